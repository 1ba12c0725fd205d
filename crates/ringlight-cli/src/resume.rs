//! `resume`: goes on from a solution, as if it had never stopped.

use crate::arguments::Resume;
use crate::bake;
use crate::failure::{End, Failure};
use crate::input;
use crate::outputs::{self, Content, Others};
use crate::progress::Stage;
use crate::run::{self, Run};
use ringlight::mesh;
use ringlight::solution::Solution;
use ringlight::solve::{Ring, World};
use ringlight::transport::Communicator;
use std::sync::Arc;

/// Resumes.
pub fn resume(arguments: &Resume) -> Result<End, Failure> {
    let mut run = Run::begin(&arguments.running)?;
    let (path, scene) = (arguments.solution.as_path(), arguments.scene.as_deref());
    outputs::check(&arguments.targets, &Others { scene, resumed: Some(path), ..run.others() })?;
    let solution = run.stage(Stage::Load, |_| input::solution(path, scene))?;
    outputs::check_camera(&arguments.display, &solution.description.cameras)?;
    // These were said when the scene was read.
    run.remember(&solution.description.warnings);
    run.remember(&bake::skipped(&solution.mesh));
    run.warn(&outputs::missing_images(&solution, &arguments.targets));
    let Solution { description, mesh, settings, state, images, .. } = solution;
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
    let solution = Solution { description, mesh, settings, state: solved.state, energy: solved.energy, images };
    let outcome = run.write(&Content::new(&solution, &arguments.display, Some(hierarchy)), &arguments.targets);
    let reported = run::settings(&settings, &solution.mesh, &arguments.stop);
    run.end(&solution, end, reported.into(), outcome)
}
