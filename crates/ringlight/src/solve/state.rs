//! What a solver works on.

use super::{Energy, Ring, Share, SolveSettings};
use crate::mesh::Mesh;
use crate::quantity::ExactSum;
use crate::scene::Light;
use crate::shooting::{self, Audit, ClusterLight, Emitter};
use crate::transport::{Communicator, Failure};
use glam::DVec3;
use rayon::prelude::*;
use ringlight_visibility::Cells;
use std::sync::Arc;

/// The scene as a solver needs it.
pub struct World<'a> {
    /// Discretised surfaces.
    pub mesh: &'a Mesh,
    /// What this rank owns.
    pub share: Arc<Share>,
    /// Lights that are not surfaces, in the order in which they shoot.
    pub emitters: Vec<Arc<Emitter>>,
    /// Middle of the ball that holds the scene, mesh coordinates.
    pub centre: DVec3,
    /// Radius of that ball, metres.
    pub radius: f64,
    /// Settings in force.
    pub settings: SolveSettings,
}

/// Rays that find how much of the light from infinity meets the scene.
const ENTRY_RAYS: u32 = 1 << 14;

impl<'a> World<'a> {
    /// Puts a world together, of a rank in its ring. Every rank calls it.
    pub fn new(
        ring: &mut Ring<'a>,
        lights: &[Light],
        settings: SolveSettings,
        ranks: &mut Communicator<'_>,
    ) -> Result<World<'a>, Failure> {
        let mesh = ring.mesh();
        let low = mesh.clusters.iter().fold(DVec3::INFINITY, |a, c| a.min(c.low.as_dvec3()));
        let high = mesh.clusters.iter().fold(DVec3::NEG_INFINITY, |a, c| a.max(c.high.as_dvec3()));
        let (centre, radius) = ((low + high) / 2.0, (high - low).length() / 2.0);
        let mut emitters = shooting::emitters(lights, mesh.origin, radius);
        if let Some(radiance) = settings.sky {
            emitters.extend(shooting::skies(radiance, settings.cells.isqrt(), radius));
        }
        // Of light from infinity only what meets the scene counts as emitted.
        let comes_from_infinity = |e: &&Emitter| matches!(e.shooter.cells, Cells::Directions(_));
        let entering = emitters.iter().filter(comes_from_infinity);
        let audits: Vec<Audit<'_>> = entering.map(|e| Audit::new(mesh, e, ENTRY_RAYS, centre, radius)).collect();
        let fates = ring.follow(ranks, &audits)?;
        let entering = emitters.iter_mut().filter(|e| comes_from_infinity(&&**e));
        entering.zip(fates).for_each(|(emitter, fate)| emitter.power *= 1.0 - fate.shares().escaped_at_once);
        let emitters = emitters.into_iter().map(Arc::new).collect();
        Ok(World { mesh, share: ring.share().clone(), emitters, centre, radius, settings })
    }

    /// Power of the lights that are not surfaces, but for the first `shot`, W or lm.
    pub fn unshot(&self, shot: u64) -> ExactSum {
        let mut sum = ExactSum::default();
        self.emitters[shot as usize..].iter().for_each(|e| sum.add(e.power));
        sum
    }
}

/// The light of own clusters, and how far the solver has come: that of all clusters is saved in solutions.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// Light of each own cluster.
    pub clusters: Vec<ClusterLight>,
    /// Shots done.
    pub shots: u64,
    /// How many of the world's emitters have shot.
    pub emitters_shot: u64,
    /// Rounds of group shooting done.
    pub rounds: u64,
    /// Power sent out by all emitters, W or lm.
    pub emitted: f64,
    /// Power that left the scene.
    pub escaped: f64,
    /// Power that met unlit backs.
    pub absorbed_by_backs: f64,
}

impl State {
    /// Dark; all emission is unshot. Every rank calls it.
    pub fn new(world: &World<'_>, ranks: &mut Communicator<'_>) -> Result<State, Failure> {
        let clusters: Vec<ClusterLight> =
            world.share.own.par_iter().map(|&c| ClusterLight::new(world.mesh, c as usize)).collect();
        let mut state = State { clusters, ..State::default() };
        state.emitted = state.unshot(world, ranks)?;
        Ok(state)
    }

    /// Unshot power, W or lm: an order-free sum. Every rank calls it.
    pub fn unshot(&self, world: &World<'_>, ranks: &mut Communicator<'_>) -> Result<f64, Failure> {
        let here = self.clusters.par_iter().map(|c| {
            let mut sum = ExactSum::default();
            c.patches.iter().for_each(|p| sum.add(p.unshot_power));
            sum
        });
        let sum = of_all(here.reduce(ExactSum::default, ExactSum::join), ranks)?;
        Ok(sum.join(world.unshot(self.emitters_shot)).value())
    }

    /// The audit so far. Every rank calls it.
    pub fn energy(&self, world: &World<'_>, ranks: &mut Communicator<'_>) -> Result<Energy, Failure> {
        let mesh = world.mesh;
        let absorbed = world
            .share
            .own
            .par_iter()
            .zip(&self.clusters)
            .map(|(&c, light)| {
                let cluster = &mesh.clusters[c as usize];
                let mut sum = ExactSum::default();
                for id in cluster.patches.clone() {
                    let patch = mesh.patch(id);
                    for (k, e) in patch.elements().enumerate() {
                        let colour = mesh.colour(&patch, e);
                        let light = light.elements[(e - cluster.elements.start) as usize].mean();
                        let area = patch.element_area(k as u32) * mesh.valid_share(e) * f64::from(colour.coverage);
                        let kept: f64 =
                            (0..3).map(|i| (1.0 - f64::from(colour.reflectance[i])) * f64::from(light[i])).sum();
                        sum.add(area * kept);
                    }
                }
                sum
            })
            .reduce(ExactSum::default, ExactSum::join);
        let absorbed = of_all(absorbed, ranks)?.value();
        let unshot = self.unshot(world, ranks)?;
        let accounted = absorbed + self.absorbed_by_backs + self.escaped + unshot;
        Ok(Energy {
            emitted: self.emitted,
            absorbed,
            absorbed_by_backs: self.absorbed_by_backs,
            escaped: self.escaped,
            unshot,
            closure_error: if self.emitted > 0.0 { (self.emitted - accounted) / self.emitted } else { 0.0 },
        })
    }
}

/// Tag of the messages that join sums.
const SUM: u32 = 6;

/// The sum of all ranks; each calls it.
fn of_all(sum: ExactSum, ranks: &mut Communicator<'_>) -> Result<ExactSum, Failure> {
    let join = |a, b| ExactSum(i128::from_le_bytes(a)).join(ExactSum(i128::from_le_bytes(b))).0.to_le_bytes();
    Ok(ExactSum(i128::from_le_bytes(ranks.all_reduce(SUM, sum.0.to_le_bytes(), join)?)))
}
