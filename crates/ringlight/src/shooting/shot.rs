//! A shot: what travels from the shooter's owner to all receivers.

use super::light::{ClusterLight, unshot_radiosity};
use crate::mesh::{ALL_VALID, Frame, Mesh, Patch, Tile};
use glam::{DVec2, DVec3};
use ringlight_visibility::{Cells, Grid, Layout, Shooter};
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
    /// Geometry.
    pub frame: Frame,
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

/// The shot of a patch with `side`² cells: its unshot light, interpolated from its elements, scaled so that the patch's
/// power is exact (DESIGN section 3; with equal weights it is the paper's).
pub fn patch_shot(mesh: &Mesh, patch: &Patch, light: &ClusterLight, first: usize, side: u32, shoot: Shoot) -> Shot {
    let cluster_patch = &light.patches[first];
    let elements = patch_elements(mesh, patch, light);
    let radiosity: Vec<[f64; 3]> = elements
        .iter()
        .enumerate()
        .map(|(k, e)| unshot_radiosity(mesh, patch, patch.first_element + k as u32, e, cluster_patch.emission_waits))
        .collect();
    let mut mean = [0.0; 3];
    for (k, b) in radiosity.iter().enumerate() {
        let share = patch.element_area(k as u32) / patch.area * mesh.valid_share(patch.first_element + k as u32);
        (0..3).for_each(|c| mean[c] += share * b[c]);
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
        let field = Field { patch, radiosity: &radiosity, valid };
        for (k, weight) in weights.iter_mut().enumerate() {
            *weight = field.cell_average(side, k as u32);
        }
        // A covered cell is seen by nobody: those that are seen shoot its share.
        let open = |k: usize| !field.is_covered(frame.layout.centre(side, k).map(f64::from).into());
        if (0..cells).any(|k| open(k) && weights[k] != [0.0; 3]) {
            (0..cells).filter(|&k| !open(k)).for_each(|k| weights[k] = [0.0; 3]);
        }
        scale_to(&mut weights, &density, mean);
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
            frame: *frame,
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

/// The unshot radiosity over a patch.
struct Field<'a> {
    patch: &'a Patch,
    /// Of each element's free part.
    radiosity: &'a [[f64; 3]],
    /// Free samples of each element.
    valid: &'a [u16],
}

impl Field<'_> {
    /// Average over cell `k` of the light interpolated between element middles; parts covered by other geometry are dark.
    fn cell_average(&self, side: u32, k: u32) -> [f64; 3] {
        let layout = self.patch.frame.layout;
        let grid = self.patch.grid;
        let tile = Tile::of(layout, [side; 2], k);
        let covered = self.valid.iter().any(|&v| v != ALL_VALID);
        // As fine as the elements, or as their samples where some are covered.
        let fine = (grid[0].max(grid[1]) * if covered { 4 } else { 1 }).div_ceil(side);
        let mut sum = [0.0; 3];
        for s in 0..fine * fine {
            let at = tile.compose(Tile::of(layout, [fine; 2], s)).at(Frame::middle(layout));
            if self.is_covered(at) {
                continue;
            }
            let value = match layout {
                Layout::Quad => self.bilinear(at),
                Layout::Triangle => self.radiosity[Tile::find(layout, grid, at).0 as usize],
            };
            (0..3).for_each(|c| sum[c] += value[c] / f64::from(fine * fine));
        }
        sum
    }

    /// Whether the patch is covered at parameters `at`.
    fn is_covered(&self, at: DVec2) -> bool {
        let layout = self.patch.frame.layout;
        let (element, within) = Tile::find(layout, self.patch.grid, at);
        self.valid[element as usize] >> Tile::find(layout, [4, 4], within).0 & 1 == 0
    }

    /// Interpolation between the middles of the elements that have a free part; constant beyond the outermost middles.
    fn bilinear(&self, at: DVec2) -> [f64; 3] {
        let grid = self.patch.grid;
        let axis = |t: f64, n: u32| {
            let x = (t * f64::from(n) - 0.5).clamp(0.0, f64::from(n - 1));
            let low = (x as u32).min(n.saturating_sub(2));
            ([low, (low + 1).min(n - 1)], x - f64::from(low))
        };
        let ((column, s), (row, t)) = (axis(at.x, grid[0]), axis(at.y, grid[1]));
        let (mut sum, mut total) = ([0.0; 3], 0.0);
        for (j, wj) in row.into_iter().zip([1.0 - t, t]) {
            for (i, wi) in column.into_iter().zip([1.0 - s, s]) {
                let element = (j * grid[0] + i) as usize;
                if self.valid[element] != 0 {
                    total += wi * wj;
                    (0..3).for_each(|c| sum[c] += wi * wj * self.radiosity[element][c]);
                }
            }
        }
        if total > 0.0 { sum.map(|x| x / total) } else { sum }
    }
}

/// Scales weights so that their average over the cells' areas is `mean`; where all are 0 the mean itself is shot.
fn scale_to(weights: &mut [[f64; 3]], density: &[f32; 64], mean: [f64; 3]) {
    let total: f64 = density[..weights.len()].iter().map(|&d| f64::from(d)).sum();
    for c in 0..3 {
        let sum: f64 = weights.iter().zip(density).map(|(w, &d)| w[c] * f64::from(d)).sum::<f64>() / total;
        for w in weights.iter_mut() {
            w[c] = if sum > 0.0 { w[c] * (mean[c] / sum) } else { mean[c] };
        }
    }
}
