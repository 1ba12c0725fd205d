//! What group shooting keeps in memory besides what any solve keeps.

use super::{Counts, MeshPlace};
use crate::mesh::Mesh;
use crate::quantity::Rgb;
use crate::ring::Demand;
use crate::shooting::{Faces, Node, Radiosity};
use crate::solve::{SolveSettings, Solver, usual_rays};
use glam::Vec3;
use rayon::prelude::*;

/// Numbers of elements that decide how much group shooting does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GroupCounts {
    /// All.
    pub elements: u64,
    /// Those for which light of their own is looked for: all but those of face clusters, which have one together.
    pub own: u64,
    /// Those of patches that emit: the leaves of the tree.
    pub emitting: u64,
}

/// Colours of every element that every rank has while light settles: what is received before a pass and after it, as it arrives from
/// the ranks, what is emitted, what is returned of what is received, and what is reflected, now and in the first round.
const COLOURS: u64 = 7;

/// Bytes of a node of the tree for each of its leaves, which has twice as many nodes: itself, its light and where that is.
const NODES: u64 = 2 * (size_of::<Node>() + size_of::<Radiosity>() + size_of::<f32>() + size_of::<Vec3>()) as u64;

/// Light of own elements besides that which is the result: of lamps without surface, of surfaces that emit, of all, and as
/// it is joined.
const LIGHTS: u64 = 4;

/// Bytes of an entry of a row, an element and its share; and of a row: its element and length, what comes from lamps, and what all
/// of it comes to.
const ENTRY: u64 = 8;
const ROW: u64 = 8 + 2 * 28;

/// Entries of a row as a share of the usual rays of the last round, so that most scenes need no more: an office has about 110 of
/// 288, a gallery with dark corners, where contrast asks for more rays, twice as many.
const ENTRIES: f64 = 0.75;

impl GroupCounts {
    /// Those of a mesh.
    pub fn of(mesh: &Mesh) -> GroupCounts {
        let faces = Faces::new(mesh);
        let elements = mesh.element_count() as u64;
        let own = (0..elements as u32).into_par_iter().filter(|&element| faces.is_own(element)).count() as u64;
        let emits = |id: u32| {
            let patch = mesh.patch(id);
            let any = patch.elements().any(|element| mesh.colour(&patch, element).emits());
            if any { u64::from(patch.element_count()) } else { 0 }
        };
        let emitting = (0..mesh.patch_count() as u32).into_par_iter().map(emits).sum();
        GroupCounts { elements, own, emitting }
    }

    /// Rays over the hemispheres that are usual to an error of `error`.
    pub fn rays(&self, error: f64) -> f64 {
        self.own as f64 * usual_rays(error).iter().sum::<f64>()
    }

    /// What group shooting to an error of `error` keeps besides what `demand` says.
    fn add_to(&self, demand: Demand, error: f64, light: u64) -> Demand {
        let [.., rays] = usual_rays(error);
        let of_all = self.elements * (COLOURS * size_of::<Rgb>() as u64 + size_of::<u32>() as u64);
        let rows = self.own * (ROW + ENTRY * (ENTRIES * rays).ceil() as u64);
        Demand {
            everywhere: demand.everywhere + of_all + self.emitting * NODES,
            owned: demand.owned + LIGHTS * light + rows,
            ..demand
        }
    }
}

/// What a solve with these settings keeps in memory.
pub fn demand(mesh: &Mesh, place: MeshPlace, settings: &SolveSettings) -> Demand {
    let counts = Counts::of(mesh);
    let demand = counts.demand(place, settings.shooters_in_flight);
    match settings.solver {
        Solver::Plain | Solver::PlainTo(_) => demand,
        Solver::Group(error) => GroupCounts::of(mesh).add_to(demand, error, counts.light_bytes()),
    }
}
