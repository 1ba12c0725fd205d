//! What a solver works on.

use super::{Energy, SolveSettings};
use crate::mesh::Mesh;
use crate::quantity::ExactSum;
use crate::scene::Light;
use crate::shooting::{self, Audit, ClusterLight, Emitter, Fate, unshot_power};
use glam::DVec3;
use rayon::prelude::*;
use ringlight_visibility::{Cells, Hierarchy};
use std::convert::Infallible;

/// The scene as a solver needs it.
pub struct World<'a> {
    /// Discretised surfaces.
    pub mesh: &'a Mesh,
    /// Occluders.
    pub hierarchy: &'a Hierarchy,
    /// Lights that are not surfaces, in the order in which they shoot.
    pub emitters: Vec<Emitter>,
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
    /// Puts a world together where all occluders are held.
    pub fn new(mesh: &'a Mesh, hierarchy: &'a Hierarchy, lights: &[Light], settings: SolveSettings) -> World<'a> {
        let follow = |audits: &[Audit<'_>]| Ok(audits.par_iter().map(|audit| audit.follow(hierarchy)).collect());
        let Ok::<_, Infallible>(world) = World::with_entry(mesh, hierarchy, lights, settings, follow);
        world
    }

    /// Puts a world together. `follow` tells the fates of the rays of some audits: of light from infinity only what meets the
    /// scene counts as emitted.
    pub fn with_entry<E>(
        mesh: &'a Mesh,
        hierarchy: &'a Hierarchy,
        lights: &[Light],
        settings: SolveSettings,
        follow: impl FnOnce(&[Audit<'_>]) -> Result<Vec<Fate>, E>,
    ) -> Result<World<'a>, E> {
        let low = mesh.clusters.iter().fold(DVec3::INFINITY, |a, c| a.min(c.low.as_dvec3()));
        let high = mesh.clusters.iter().fold(DVec3::NEG_INFINITY, |a, c| a.max(c.high.as_dvec3()));
        let (centre, radius) = ((low + high) / 2.0, (high - low).length() / 2.0);
        let mut emitters = shooting::emitters(lights, mesh.origin, radius);
        if let Some(radiance) = settings.sky {
            emitters.extend(shooting::skies(radiance, f64::from(settings.cells).sqrt() as u32, radius));
        }
        let comes_from_infinity = |e: &&Emitter| matches!(e.shooter.cells, Cells::Directions(_));
        let entering = emitters.iter().filter(comes_from_infinity);
        let audits: Vec<Audit<'_>> = entering.map(|e| Audit::new(mesh, e, ENTRY_RAYS, centre, radius)).collect();
        let fates = follow(&audits)?;
        let entering = emitters.iter_mut().filter(|e| comes_from_infinity(&&**e));
        entering.zip(fates).for_each(|(emitter, fate)| emitter.power *= 1.0 - fate.shares().escaped_at_once);
        Ok(World { mesh, hierarchy, emitters, centre, radius, settings })
    }
}

/// The light, and how far the solver has come. Saved in solutions.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// Light of each cluster.
    pub clusters: Vec<ClusterLight>,
    /// Shots done.
    pub shots: u64,
    /// How many of the world's emitters have shot.
    pub emitters_shot: u64,
    /// Power sent out by all emitters, W or lm.
    pub emitted: f64,
    /// Power that left the scene.
    pub escaped: f64,
    /// Power that met unlit backs.
    pub absorbed_by_backs: f64,
}

impl State {
    /// Dark; all emission is unshot.
    pub fn new(world: &World<'_>) -> State {
        let clusters: Vec<ClusterLight> =
            (0..world.mesh.clusters.len()).into_par_iter().map(|c| ClusterLight::new(world.mesh, c)).collect();
        let mut state = State { clusters, ..State::default() };
        state.emitted = state.unshot(world);
        state
    }

    /// Renews what is derived from the elements' light, after loading.
    pub fn renew(&mut self, mesh: &Mesh) {
        self.clusters.par_iter_mut().enumerate().for_each(|(c, light)| {
            let cluster = &mesh.clusters[c];
            for (index, id) in cluster.patches.clone().enumerate() {
                let patch = mesh.patch(id);
                let start = (patch.first_element - cluster.elements.start) as usize;
                let elements = &light.elements[start..start + patch.element_count() as usize];
                let waits = light.patches[index].emission_waits;
                light.patches[index].unshot_power = unshot_power(mesh, &patch, elements, waits);
            }
        });
    }

    /// Unshot power, W or lm: an order-free sum.
    pub fn unshot(&self, world: &World<'_>) -> f64 {
        let mut sum = self
            .clusters
            .par_iter()
            .map(|c| {
                let mut sum = ExactSum::default();
                c.patches.iter().for_each(|p| sum.add(p.unshot_power));
                sum
            })
            .reduce(ExactSum::default, ExactSum::join);
        world.emitters[self.emitters_shot as usize..].iter().for_each(|e| sum.add(e.power));
        sum.value()
    }

    /// The audit so far.
    pub fn energy(&self, world: &World<'_>) -> Energy {
        let mesh = world.mesh;
        let absorbed = self
            .clusters
            .par_iter()
            .enumerate()
            .map(|(c, light)| {
                let mut sum = ExactSum::default();
                for id in mesh.clusters[c].patches.clone() {
                    let patch = mesh.patch(id);
                    for (k, e) in patch.elements().enumerate() {
                        let colour = mesh.colour(&patch, e);
                        let light = light.elements[(e - mesh.clusters[c].elements.start) as usize].mean();
                        let area = patch.element_area(k as u32) * mesh.valid_share(e) * f64::from(colour.coverage);
                        let kept: f64 =
                            (0..3).map(|i| (1.0 - f64::from(colour.reflectance[i])) * f64::from(light[i])).sum();
                        sum.add(area * kept);
                    }
                }
                sum
            })
            .reduce(ExactSum::default, ExactSum::join)
            .value();
        let unshot = self.unshot(world);
        let accounted = absorbed + self.absorbed_by_backs + self.escaped + unshot;
        Energy {
            emitted: self.emitted,
            absorbed,
            absorbed_by_backs: self.absorbed_by_backs,
            escaped: self.escaped,
            unshot,
            closure_error: if self.emitted > 0.0 { (self.emitted - accounted) / self.emitted } else { 0.0 },
        }
    }
}
