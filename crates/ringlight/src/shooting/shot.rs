//! A shot: what travels from the shooter's owner to all receivers.

use super::cells::Sharing;
use super::light::{ClusterLight, unshot_radiosity};
use crate::mesh::{ALL_VALID, Mesh, Patch};
use glam::{DVec2, DVec3};
use ringlight_visibility::{Cells, Grid, Shooter};
use serde::{Deserialize, Serialize};

/// Which distribution of its unshot radiosity a patch shoots.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Shoot {
    /// Each cell what the elements under it hold, interpolated.
    #[default]
    Elements,
    /// The area average everywhere (the paper's way).
    Average,
}

/// What one cell shoots; radiosity for patches, see [`Source`] for the others.
pub type CellLight = [f32; 3];

/// A shooter with its light.
#[derive(Clone, Debug)]
pub struct Shot {
    /// The cells as visibility sees them.
    pub shooter: Shooter,
    /// Light of each cell.
    pub light: Vec<CellLight>,
    /// What kind of shooter it is.
    pub source: Source,
    /// Power, W or lm, summed over channels.
    pub power: f64,
}

/// Kinds of shooters.
#[derive(Clone, Debug)]
pub enum Source {
    /// A patch; the light of a cell is its unshot radiosity ΔB, W/m² or lm/m².
    Patch(Box<PatchSource>),
    /// A point or spot light; the light is its intensity, W/sr or cd.
    Point {
        /// Position, mesh coordinates, metres.
        position: DVec3,
        /// Unit axis, and cosines of the inner and outer cone; None for points.
        cone: Option<(DVec3, f64, f64)>,
        /// Where it ends, metres; infinite if nowhere.
        range: f64,
    },
    /// Parallel light or a part of the sky: cells are directions towards the light; the light of a cell is the
    /// irradiance it gives to a surface that faces it, W/m² or lux.
    Directions,
}

/// Geometry of a shooting patch.
#[derive(Clone, Copy, Debug)]
pub struct PatchSource {
    /// Number of the patch.
    pub patch: u32,
    /// Corners; `count` of them are valid.
    pub corners: [DVec3; 4],
    /// Number of corners.
    pub count: usize,
    /// Unit normal of the lit side.
    pub normal: DVec3,
    /// Area, m².
    pub area: f64,
    /// Diameter, metres.
    pub diameter: f64,
    /// Box.
    pub low: DVec3,
    /// Upper corner of the box.
    pub high: DVec3,
    /// Area of each cell relative to their mean.
    pub density: [f32; 64],
}

/// The shot of a patch with `side`² cells: its unshot light, interpolated from its elements, their power
/// exact (DESIGN section 3; with equal weights it is the paper's).
pub fn patch_shot(mesh: &Mesh, patch: &Patch, light: &ClusterLight, first: usize, side: u32, shoot: Shoot) -> Shot {
    let cluster_patch = &light.patches[first];
    let elements = patch_elements(mesh, patch, light);
    let radiosity: Vec<[f64; 3]> = elements
        .iter()
        .enumerate()
        .map(|(k, e)| unshot_radiosity(mesh, patch, patch.first_element + k as u32, e, cluster_patch.emission_waits))
        .collect();
    let free_area = |k: usize| patch.element_area(k as u32) * mesh.valid_share(patch.first_element + k as u32);
    let mut mean = [0.0; 3];
    for (k, b) in radiosity.iter().enumerate() {
        (0..3).for_each(|c| mean[c] += free_area(k) / patch.area * b[c]);
    }
    let frame = &patch.frame;
    let cells = (side * side) as usize;
    let mut density = [0.0f32; 64];
    for (k, d) in density.iter_mut().enumerate().take(cells) {
        let [u, v] = frame.layout.centre(side, k).map(f64::from);
        *d = frame.relative_density(DVec2::new(u, v)) as f32;
    }
    let mut weights = vec![mean; cells];
    let valid = &mesh.valid[patch.first_element as usize..][..radiosity.len()];
    if shoot == Shoot::Elements && (radiosity.len() > 1 || valid[0] != ALL_VALID) {
        let areas = density.map(|d| f64::from(d) * patch.area / cells as f64);
        let power: Vec<[f64; 3]> = radiosity.iter().enumerate().map(|(k, b)| b.map(|b| b * free_area(k))).collect();
        weights = Sharing { patch, valid, side, areas: &areas[..cells] }.radiosity(&power);
    }
    let (corners, count) = frame.corners();
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let mut diameter = 0.0f64;
    for &a in &corners[..count] {
        (low, high) = (low.min(a), high.max(a));
        diameter = corners[..count].iter().map(|&b| (a - b).length()).fold(diameter, f64::max);
    }
    let single = |p: DVec3| p.as_vec3().to_array();
    let grid = Grid {
        origin: single(frame.origin),
        edge_u: single(frame.edge_u),
        edge_v: single(frame.edge_v),
        twist: single(frame.twist),
        layout: frame.layout,
        side,
    };
    Shot {
        shooter: Shooter { cells: Cells::Grid(grid), plane: patch.plane, far: FAR },
        light: weights.iter().map(|w| w.map(|x| x as f32)).collect(),
        source: Source::Patch(Box::new(PatchSource {
            patch: patch.id,
            corners,
            count,
            normal: patch.normal,
            area: patch.area,
            diameter,
            low,
            high,
            density,
        })),
        power: cluster_patch.unshot_power,
    }
}

/// Hits in the last ten-thousandth of the way to a cell do not count.
pub const FAR: f32 = 0.9999;

/// The elements of a patch within its cluster's light.
fn patch_elements<'a>(mesh: &Mesh, patch: &Patch, light: &'a ClusterLight) -> &'a [super::ElementLight] {
    let cluster = mesh.cluster_of(patch.id);
    let first = (patch.first_element - mesh.clusters[cluster].elements.start) as usize;
    &light.elements[first..first + patch.element_count() as usize]
}
