//! `resume`: goes on from a solution, as if it had never stopped.

use crate::arguments::Resume;
use crate::bake;
use crate::failure::{End, Failure};
use crate::input;
use crate::outputs::{self, Content, Others};
use crate::progress::Stage;
use crate::run::{self, Run};
use ringlight::solution::Solution;
use ringlight::solve::{State, World};
use ringlight::transport::Communicator;

/// Resumes.
pub fn resume(arguments: &Resume, ranks: &mut Communicator<'_>) -> Result<End, Failure> {
    let mut run = Run::begin(&arguments.running, &arguments.spread, ranks)?;
    let (path, scene) = (arguments.solution.as_path(), arguments.scene.as_deref());
    let others = Others { scene, resumed: Some(path), ..run.others() };
    run.on_first_rank(|| outputs::check(&arguments.targets, &others))?;
    let solution = run.stage(Stage::Load, |_| input::solution(path, scene))?;
    outputs::check_camera(&arguments.display, &solution.description.cameras)?;
    // These were said when the scene was read.
    run.remember(&solution.description.warnings);
    run.remember(&bake::skipped(&solution.mesh));
    run.warn(&outputs::missing_images(&solution, &arguments.targets));
    run.choose_rings(&solution.mesh)?;
    let Solution { description, mesh, settings, state, images, .. } = solution;
    let mut ring = run.stage(Stage::Build, |run| run.ring(&mesh, None));
    let world = run.stage(Stage::Build, |run| World::new(&mut ring, &description.lights, settings, run.ranks))?;
    let mut clusters: Vec<_> = state.clusters.into_iter().map(Some).collect();
    let own = world.share.own.iter().filter_map(|&cluster| clusters[cluster as usize].take()).collect();
    let state = State { clusters: own, ..state };
    if state.emitters_shot as usize > world.emitters.len() {
        return Err(anyhow::anyhow!("{}: more lights have shot than there are", path.display()).into());
    }
    let solved = run.solve(&description, &world, &mut ring, state, &arguments.stop)?;
    let hierarchy = run.whole_hierarchy(&ring);
    drop((world, ring));
    let end = (solved.progress, solved.reason);
    let solution = Solution { description, mesh, settings, state: solved.state, energy: solved.energy, images };
    let outcome = run.write(&Content::new(&solution, &arguments.display, hierarchy), &arguments.targets);
    let reported = run::settings(&settings, &solution.mesh, &arguments.stop);
    run.end(&solution, end, reported, outcome)
}
