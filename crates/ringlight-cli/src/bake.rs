//! `bake`: scene → solution → outputs.

use crate::adapt;
use crate::arguments::Bake;
use crate::failure::{End, Failure};
use crate::host::Host;
use crate::input;
use crate::launch;
use crate::method;
use crate::outputs::{self, Others};
use crate::progress::Stage;
use crate::run::{Baked, Made, Run, Solved};
use crate::showing::Subject;
use ringlight::column::Store;
use ringlight::mesh::{self, Mesh};
use ringlight::quantity::Rgb;
use ringlight::scene::{Place, Scene, Warnings};
use ringlight::solution::Description;
use ringlight::solve::{SolveSettings, State, StopReason, World};
use ringlight::transport::Communicator;
use ringlight_visibility::Hierarchy;
use std::sync::Arc;

/// Bakes.
pub fn bake(arguments: &Bake, ranks: &mut Communicator<'_>) -> Result<End, Failure> {
    let mut run = Run::begin(&arguments.running, &arguments.spread, ranks)?;
    let path = arguments.scene.as_path();
    let others = Others { scene: Some(path), ..run.others() };
    launch::on_first_rank(run.ranks, || outputs::check(&arguments.targets, &others))?;
    let frugal = arguments.spread.is_bounded();
    let host = Host::find(run.ranks, arguments.sizes.scratch.as_deref(), frugal)?;
    let settings = method::settings(&arguments.method, &arguments.stop, arguments.sizes.quality)?;
    let made = if host.leads() { Some(make(&mut run, arguments, host.store(), settings.sky)?) } else { None };
    let (made, scene) = made.unzip();
    let mut made = run.share(&host, made)?;
    run.choose_rings(&host, &made.mesh, &settings).map_err(anyhow::Error::msg)?;
    let (fineness, rough) = adapt::plan(arguments, settings);
    let (mut level, mut full) = (0, false);
    let (mut solved, solved_with, hierarchy) = loop {
        let last = level == fineness.levels || full;
        let now = if last { settings } else { rough };
        let (solved, hierarchy) = light(&mut run, &host, &mut made, now, arguments)?;
        if last || solved.reason != StopReason::Converged {
            break (solved, now, hierarchy);
        }
        let coarser;
        let scene = (scene.as_ref(), hierarchy);
        (coarser, made) = run.adapt((&host, arguments), (made, scene), (now, solved), &fineness)?;
        // The last solve, which nobody refines any more, needs most.
        match run.choose_rings(&host, &made.mesh, &settings) {
            Ok(()) => level += 1,
            // What is split does not depend on memory: all that light asks for, or nothing.
            Err(lacking) => {
                run.warn(&no_room(&lacking));
                (made.mesh, full) = (coarser, true);
            }
        }
    };
    if full && solved.reason == StopReason::Converged {
        solved.reason = StopReason::Memory;
    }
    let mut reported = method::reported(&solved_with, &made.mesh, &arguments.stop);
    reported.insert("adapt".into(), level.into());
    reported.insert("lines".into(), arguments.sizes.lines.into());
    let quality = arguments.sizes.quality;
    reported.insert("quality".into(), format!("{quality:?}").to_lowercase().into());
    if let Some(unit) = arguments.sizes.unit {
        reported.insert("unit".into(), format!("{unit:?}").to_lowercase().into());
    }
    let baked = Baked { made, settings: solved_with, solved };
    run.finish(baked, (&arguments.targets, &arguments.display), &host, hierarchy, reported)
}

/// That smaller elements do not fit.
fn no_room(lacking: &str) -> Warnings {
    let mut warnings = Warnings::default();
    warnings.add("no-room", format!("elements do not become smaller where light changes: {lacking}"), Place::default());
    warnings
}

/// Finds the light of a mesh; gives the hierarchy too, if it is that of the whole scene. Every rank calls it.
fn light(
    run: &mut Run<'_, '_>,
    host: &Host,
    made: &mut Made,
    settings: SolveSettings,
    arguments: &Bake,
) -> Result<(Solved, Option<Arc<Hierarchy>>), Failure> {
    let hierarchy = run.stage(Stage::Build, |run| run.find_valid_samples(host, &mut made.mesh))?;
    let Made { mesh, description, images } = made;
    let mut ring = run.ring(mesh, Some(hierarchy));
    let world = run.stage(Stage::Build, |run| World::new(&mut ring, &description.lights, settings, run.ranks))?;
    let state = State::new(&world, run.ranks)?;
    if state.emitted <= 0.0 {
        let mut dark = Warnings::default();
        let message = "no light leaves the lamps: they are covered by other geometry, or shine past the scene";
        dark.add("no-light-leaves", message, Place::new(arguments.scene.display().to_string(), ""));
        run.warn(&dark);
    }
    let subject = Subject { description, mesh, settings, images };
    let solved = run.solve(subject, &world, &mut ring, state, &arguments.stop)?;
    Ok((solved, run.whole_hierarchy(&ring)))
}

/// Reads the scene and cuts it.
fn make(run: &mut Run<'_, '_>, arguments: &Bake, store: Store<'_>, sky: Option<Rgb>) -> Result<(Made, Scene), Failure> {
    let path = arguments.scene.as_path();
    let (scene, read) = run.stage(Stage::Load, |_| input::scene(path, arguments.sizes.unit, store))?;
    outputs::check_inputs(&arguments.targets, &run.others(), &read)?;
    run.warn(&scene.warnings);
    outputs::check_camera(&arguments.display, &scene.cameras)?;
    let options = input::mesh_options(&arguments.sizes);
    let mesh = run.stage(Stage::Mesh, |_| mesh::build(&scene, &options, store)).map_err(|e| input::locate(e, path))?;
    run.warn(&skipped(&mesh));
    run.detail(&sizes(&mesh));
    outputs::check_sizes(&arguments.targets, &mesh)?;
    if !input::has_light(&scene, &mesh, sky) {
        return Err(input::no_light(path));
    }
    let images = scene.images.iter().map(|image| Some(image.bytes.clone())).collect();
    Ok((Made { mesh, description: Description::new(&scene), images }, scene))
}

/// What meshing changed or left out, as warnings.
pub fn skipped(mesh: &Mesh) -> Warnings {
    let mut warnings = mesh.warnings.clone();
    for (reason, count) in &mesh.skipped {
        let message = match reason.as_str() {
            "sliver" => "triangles with almost no area are left out".into(),
            other => format!("triangles are left out: {other}"),
        };
        warnings.add_many(reason, message, Place::default(), *count);
    }
    warnings
}

/// Sizes and counts in words.
pub fn sizes(mesh: &Mesh) -> String {
    let (patches, elements) = (mesh.patch_count(), mesh.element_count());
    let sizes = &mesh.sizes;
    format!("{patches} patches up to {:.3} m, {elements} elements up to {:.3} m", sizes.patch, sizes.element)
}
