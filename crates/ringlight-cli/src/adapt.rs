//! Adaptive elements: the mesh of the next solve, from the light of the one before.

use crate::arguments::Bake;
use crate::failure::Failure;
use crate::host::Host;
use crate::input;
use crate::progress::Stage;
use crate::run::{Made, Run, Solved};
use anyhow::Context;
use ringlight::adapt::{self, Fineness};
use ringlight::column::Column;
use ringlight::mesh::Mesh;
use ringlight::scene::Scene;
use ringlight::solution::{Solution, SolvedLight};
use ringlight::solve::{Ledger, SolveSettings, Solver};
use ringlight_visibility::Hierarchy;
use std::sync::Arc;

/// What differs by more than so many times the error asked for is cut finer: the light in the middle of an element differs from
/// that of its corners by a quarter of the step at the edge of a shadow.
const TOLERANCE: f64 = 8.0;

/// Errors that do not hide where light changes.
const ROUGH: f64 = 2.0;

/// Error asked for, where the solver asks for none.
const USUAL_ERROR: f64 = 0.01;

/// How fine elements become, and how the rough solves that tell are made.
pub fn plan(arguments: &Bake, settings: SolveSettings) -> (Fineness, SolveSettings) {
    let error = match settings.solver {
        Solver::Group(error) | Solver::PlainTo(error) => error,
        Solver::Plain => USUAL_ERROR,
    };
    let fineness = Fineness { levels: arguments.method.adapt, tolerance: TOLERANCE * error };
    (fineness, SolveSettings { solver: Solver::Group(ROUGH * error), ..settings })
}

impl Run<'_, '_> {
    /// Cuts patches finer where the light of a rough solve asks for it; the scene is there on those who lead a machine, its
    /// hierarchy where it has been built for the whole of it. Every rank calls it. Gives the mesh as it was too.
    pub fn adapt(
        &mut self,
        (host, arguments): (&Host, &Bake),
        (made, (scene, hierarchy)): (Made, (Option<&Scene>, Option<Arc<Hierarchy>>)),
        (settings, solved): (SolveSettings, Solved),
        fineness: &Fineness,
    ) -> Result<(Mesh, Made), Failure> {
        let (coarser, made) = self.stage(Stage::Mesh, |run| {
            let Made { mesh, description, images } = made;
            let (ledger, energy) = (Ledger::of(&solved.state), solved.energy);
            let light = match run.ranks.size() {
                1 => Some(SolvedLight::of(solved.state.clusters, host.store()).context("the light cannot be kept")?),
                _ => solved.light().gather(&mesh, host.store(), run.ranks)?,
            };
            let light = light.unwrap_or_default();
            let solution = Solution { description, mesh, settings, ledger, light, energy, images };
            let mut ring = run.ring(&solution.mesh, hierarchy);
            let mut subdivisions: Column<u8> = adapt::subdivisions(&solution, fineness, &mut ring, run.ranks)?.into();
            drop(ring);
            host.hand_on(run.ranks, &mut subdivisions)?;
            let Solution { description, mesh, images, .. } = solution;
            let finer = scene.map(|scene| mesh.refined(scene, &subdivisions, host.store())).transpose();
            let finer = finer.map_err(|error| input::locate(error, &arguments.scene))?;
            Ok::<_, Failure>((mesh, finer.map(|mesh| Made { mesh, description, images })))
        })?;
        let made = self.share(host, made)?;
        self.detail(&format!("{} elements where light changes much are smaller", made.mesh.element_count()));
        Ok((coarser, made))
    }
}
