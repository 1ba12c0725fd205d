//! `resume`: goes on from a solution, as if it had never stopped.

use crate::arguments::Resume;
use crate::bake;
use crate::failure::{End, Failure};
use crate::input;
use crate::outputs::{self, Content, Others};
use crate::progress::Stage;
use crate::run::{self, Run};
use anyhow::Context;
use ringlight::column::Store;
use ringlight::mesh;
use ringlight::solution::{Solution, SolutionFile, SolvedLight};
use ringlight::solve::{Ledger, Ring, World};
use ringlight::transport::Communicator;
use std::sync::Arc;

/// Resumes.
pub fn resume(arguments: &Resume) -> Result<End, Failure> {
    let mut run = Run::begin(&arguments.running)?;
    let (path, scene) = (arguments.solution.as_path(), arguments.scene.as_deref());
    outputs::check(&arguments.targets, &Others { scene, resumed: Some(path), ..run.others() })?;
    let store = Store::Heap;
    let (mesh, state, description, settings, images) = run.stage(Stage::Load, |_| {
        let bytes = input::bytes(path)?;
        let file = SolutionFile::open(&bytes).with_context(|| path.display().to_string())?;
        let mesh = file.mesh(store).with_context(|| path.display().to_string())?;
        let own: Vec<u32> = (0..mesh.clusters.len() as u32).collect();
        let light = file.light_of(&mesh, &own).with_context(|| path.display().to_string())?;
        let description = file.description().clone();
        let images = input::images(path, scene, &description)?;
        Ok::<_, Failure>((mesh, file.ledger().with(light), description, file.settings(), images))
    })?;
    outputs::check_camera(&arguments.display, &description.cameras)?;
    outputs::check_sizes(&arguments.targets, &mesh)?;
    // These were said when the scene was read.
    run.remember(&description.warnings);
    run.remember(&bake::skipped(&mesh));
    run.warn(&outputs::missing_images(&description, &images, &arguments.targets));
    let hierarchy = run.stage(Stage::Build, |_| mesh::hierarchy(&mesh));
    let hierarchy = Arc::new(hierarchy);
    let ranks = &mut Communicator::alone();
    let mut ring = Ring::alone(&mesh, hierarchy.clone());
    let world = run.stage(Stage::Build, |_| World::new(&mut ring, &description.lights, settings, ranks))?;
    if state.emitters_shot as usize > world.emitters.len() {
        return Err(anyhow::anyhow!("{}: more lights have shot than there are", path.display()).into());
    }
    let solved = run.solve(&description, &world, &mut ring, state, &arguments.stop, ranks)?;
    drop((world, ring));
    let end = (solved.progress, solved.reason);
    let (energy, ledger) = (solved.energy, Ledger::of(&solved.state));
    let light = SolvedLight::of(solved.state.clusters, store).context("the light cannot be kept")?;
    let solution = Solution { description, mesh, settings, ledger, light, energy, images };
    let outcome = run.write(&Content::new(&solution, &arguments.display, Some(hierarchy)), &arguments.targets);
    let reported = run::settings(&settings, &solution.mesh, &arguments.stop);
    run.end(&solution, end, reported.into(), outcome)
}
