//! `resume`: goes on from a solution, as if it had never stopped.

use crate::arguments::Resume;
use crate::bake;
use crate::failure::{End, Failure};
use crate::host::Host;
use crate::input;
use crate::launch;
use crate::method;
use crate::outputs::{self, Others};
use crate::progress::Stage;
use crate::run::{Baked, Made, Run};
use crate::showing::Subject;
use anyhow::Context;
use ringlight::column::Store;
use ringlight::solution::{LightFile, SolutionFile};
use ringlight::solve::{Ledger, SolveSettings, World};
use ringlight::transport::Communicator;

/// Resumes.
pub fn resume(arguments: &Resume, ranks: &mut Communicator<'_>) -> Result<End, Failure> {
    let mut run = Run::begin(&arguments.running, &arguments.spread, ranks)?;
    let (path, scene) = (arguments.solution.as_path(), arguments.scene.as_deref());
    let others = Others { scene, resumed: Some(path), ..run.others() };
    launch::on_first_rank(run.ranks, || outputs::check(&arguments.targets, &others))?;
    let frugal = arguments.spread.is_bounded();
    let host = Host::find(run.ranks, None, frugal)?;
    let located = || path.display().to_string();
    let bytes = input::bytes(path)?;
    let made = if host.leads() { Some(make(&mut run, arguments, &bytes, host.store())?) } else { None };
    let (made, decided) = made.unzip();
    let (settings, ledger): (SolveSettings, Ledger) = run.tell(decided)?;
    method::check_resumed(&settings, &arguments.stop, path)?;
    let Made { mesh, description, images } = run.share(&host, made)?;
    run.choose_rings(&host, &mesh, &settings).map_err(anyhow::Error::msg)?;
    let mut ring = run.stage(Stage::Build, |run| run.ring(&mesh, None));
    let world = run.stage(Stage::Build, |run| World::new(&mut ring, &description.lights, settings, run.ranks))?;
    let light = || LightFile::open(&bytes)?.light_of(&mesh, &world.share.own);
    let state = ledger.with(run.stage(Stage::Load, |_| light()).with_context(located)?);
    if state.emitters_shot as usize > world.emitters.len() {
        return Err(anyhow::anyhow!("{}: more lights have shot than there are", path.display()).into());
    }
    let subject = Subject { description: &description, mesh: &mesh, settings, images: &images };
    let solved = run.solve(subject, &world, &mut ring, state, &arguments.stop)?;
    let hierarchy = run.whole_hierarchy(&ring);
    drop(ring);
    drop(world);
    let reported = method::reported(&settings, &mesh, &arguments.stop);
    let baked = Baked { made: Made { mesh, description, images }, settings, solved };
    run.finish(baked, (&arguments.targets, &arguments.display), &host, hierarchy, reported)
}

/// Takes from a solution what is not light, and what decides how it goes on.
fn make(
    run: &mut Run<'_, '_>,
    arguments: &Resume,
    bytes: &[u8],
    store: Store<'_>,
) -> Result<(Made, (SolveSettings, Ledger)), Failure> {
    let (path, scene) = (arguments.solution.as_path(), arguments.scene.as_deref());
    let located = || path.display().to_string();
    let file = run.stage(Stage::Load, |_| SolutionFile::open(bytes)).with_context(located)?;
    let mesh = run.stage(Stage::Load, |_| file.mesh(store)).with_context(located)?;
    let decided = (file.settings(), file.ledger());
    let description = file.description().clone();
    let images = input::images(path, scene, &description, store)?;
    outputs::check_camera(&arguments.display, &description.cameras)?;
    outputs::check_sizes(&arguments.targets, &mesh)?;
    // These were said when the scene was read.
    run.remember(&description.warnings);
    run.remember(&bake::skipped(&mesh));
    run.warn(&outputs::missing_images(&description, &images, &arguments.targets));
    Ok((Made { mesh, description, images }, decided))
}
