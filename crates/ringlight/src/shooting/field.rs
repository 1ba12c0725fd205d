//! The light that leaves a patch, place by place, and the shots made of it: of the whole patch or of a part.

use super::cells::{Interpolation, Sharing};
use super::shot::{CellLight, FAR, PatchSource, Shoot, Shot, Source};
use crate::mesh::{ALL_VALID, Frame, Mesh, Patch, Tile, free_share};
use glam::{DVec2, DVec3};
use ringlight_visibility::{Cells, Grid, Shooter};
use std::sync::OnceLock;

/// Radiosity over a patch, interpolated between its elements.
#[derive(Clone, Debug)]
pub struct Field<'a> {
    patch: &'a Patch,
    /// Of each element's free part.
    radiosity: &'a [[f64; 3]],
    /// Free samples of each element.
    valid: &'a [u32],
    /// Area average; covered parts are dark.
    mean: [f64; 3],
}

impl<'a> Field<'a> {
    /// From the radiosity of the free part of each element of `patch`, in order.
    pub fn new(mesh: &'a Mesh, patch: &'a Patch, radiosity: &'a [[f64; 3]]) -> Field<'a> {
        let mut mean = [0.0; 3];
        for (k, b) in radiosity.iter().enumerate() {
            let share = patch.element_area(k as u32) / patch.area * mesh.valid_share(patch.first_element + k as u32);
            (0..3).for_each(|c| mean[c] += share * b[c]);
        }
        let valid = &mesh.valid[patch.first_element as usize..][..radiosity.len()];
        Field { patch, radiosity, valid, mean }
    }

    /// The shot of the whole patch with `side`² cells, the power of each element exact (DESIGN section 3; with equal
    /// weights it is the paper's).
    pub fn shot(&self, side: u32, shoot: Shoot, power: f64) -> Shot {
        let frame = &self.patch.frame;
        let density = densities(frame, side);
        let weights = if shoot == Shoot::Elements && !self.is_constant() {
            let cell = self.patch.area / f64::from(side * side);
            let areas = density.map(|d| f64::from(d) * cell);
            let power: Vec<[f64; 3]> = self
                .radiosity
                .iter()
                .enumerate()
                .map(|(k, b)| {
                    let free = free_share(self.valid[k]);
                    b.map(|b| b * self.patch.element_area(k as u32) * free)
                })
                .collect();
            let areas = &areas[..(side * side) as usize];
            Sharing { interpolation: self.interpolation(), side, areas }.radiosity(&power)
        } else {
            vec![self.mean; (side * side) as usize]
        };
        shot_of(self.patch, frame, &weights, density, power)
    }

    /// The shot of the part of the patch over `tile`, its light as in the whole patch; `scale` is [`Field::scale`].
    pub fn part(&self, tile: Tile, side: u32, scale: [f64; 3]) -> Shot {
        let frame = self.patch.frame.tile(tile);
        let density = densities(&frame, side);
        let mut weights = vec![self.mean; (side * side) as usize];
        if !self.is_constant() {
            let averages = self.cell_averages(tile, side);
            let mean = mean_of(&averages, &density);
            let mean = std::array::from_fn(|c| scale[c] * mean[c]);
            weights = self.scaled(tile, averages, side, &density, mean);
        }
        shot_of(self.patch, &frame, &weights, density, 0.0)
    }

    /// What the interpolated light is multiplied by to give the patch's exact power.
    pub fn scale(&self) -> [f64; 3] {
        if self.is_constant() {
            return [1.0; 3];
        }
        let side = self.patch.grid[0].max(self.patch.grid[1]).next_power_of_two().min(8);
        let mean = mean_of(&self.cell_averages(WHOLE, side), &densities(&self.patch.frame, side));
        std::array::from_fn(|c| if mean[c] > 0.0 { self.mean[c] / mean[c] } else { 1.0 })
    }

    fn interpolation(&self) -> Interpolation<'a> {
        Interpolation { patch: self.patch, valid: self.valid }
    }

    fn is_constant(&self) -> bool {
        self.radiosity.len() == 1 && self.valid[0] == ALL_VALID
    }

    /// Averages over the cells of a part; parts covered by other geometry are dark.
    fn cell_averages(&self, tile: Tile, side: u32) -> Vec<[f64; 3]> {
        (0..side * side).map(|k| self.cell_average(tile, side, k)).collect()
    }

    /// Average over cell `k` of the light interpolated between element middles; parts covered by other geometry are dark.
    fn cell_average(&self, part: Tile, side: u32, k: u32) -> [f64; 3] {
        let layout = self.patch.frame.layout;
        let grid = self.patch.grid;
        let tile = part.compose(Tile::of(layout, [side; 2], k));
        let interpolation = self.interpolation();
        // As fine as the elements, or as their samples where some are covered.
        let finest = grid[0].max(grid[1]) * if interpolation.is_partly_covered() { 4 } else { 1 };
        let fine = (f64::from(finest) * part.size.abs().max_element() / f64::from(side)).ceil().max(1.0) as u32;
        let mut sum = [0.0; 3];
        for s in 0..fine * fine {
            let at = tile.compose(Tile::of(layout, [fine; 2], s)).at(Frame::middle(layout));
            if interpolation.is_covered(at) {
                continue;
            }
            interpolation.shares(at, |element, share| {
                (0..3).for_each(|c| sum[c] += share * self.radiosity[element][c] / f64::from(fine * fine));
            });
        }
        sum
    }

    /// Weights with the average `mean`. A covered cell is seen by nobody: those that are seen shoot its share.
    fn scaled(
        &self,
        tile: Tile,
        mut weights: Vec<[f64; 3]>,
        side: u32,
        density: &[f32; 64],
        mean: [f64; 3],
    ) -> Vec<[f64; 3]> {
        let layout = self.patch.frame.layout;
        let cells = weights.len();
        let open = |k: usize| !self.interpolation().is_covered(tile.at(layout.centre(side, k).map(f64::from).into()));
        if (0..cells).any(|k| open(k) && weights[k] != [0.0; 3]) {
            (0..cells).filter(|&k| !open(k)).for_each(|k| weights[k] = [0.0; 3]);
        }
        scale_to(&mut weights, density, mean);
        weights
    }
}

/// Whether any of a patch's `side`² cells is free of other geometry: what shoots from none is seen by nobody.
pub fn has_free_cell(mesh: &Mesh, patch: &Patch, side: u32) -> bool {
    let valid = &mesh.valid[patch.first_element as usize..][..patch.element_count() as usize];
    let (interpolation, layout) = (Interpolation { patch, valid }, patch.frame.layout);
    let centre = |k| DVec2::from(layout.centre(side, k).map(f64::from));
    (0..(side * side) as usize).any(|k| !interpolation.is_covered(centre(k)))
}

/// The shot of a whole patch from the light of its cells, as its owner has made it with [`Field::shot`].
pub(super) fn announced(patch: &Patch, light: &[CellLight], power: f64) -> Shot {
    let weights: Vec<[f64; 3]> = light.iter().map(|w| w.map(f64::from)).collect();
    shot_of(patch, &patch.frame, &weights, densities(&patch.frame, weights.len().isqrt() as u32), power)
}

/// The shot of the part of a patch that `frame` spans; `weights` is the light of its cells.
pub(super) fn shot_of(patch: &Patch, frame: &Frame, weights: &[[f64; 3]], density: [f32; 64], power: f64) -> Shot {
    let (corners, count) = frame.corners();
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let mut diameter = 0.0f64;
    for &a in &corners[..count] {
        (low, high) = (low.min(a), high.max(a));
        diameter = corners[..count].iter().map(|&b| (a - b).length()).fold(diameter, f64::max);
    }
    let grid = grid_of(frame, weights.len().isqrt() as u32);
    Shot {
        shooter: Shooter { cells: Cells::Grid(grid), plane: patch.plane, far: FAR },
        light: weights.iter().map(|w| w.map(|x| x as f32)).collect(),
        source: Source::Patch(Box::new(PatchSource {
            patch: patch.id,
            frame: *frame,
            corners,
            count,
            normal: patch.normal,
            area: frame.area_vector().length(),
            diameter,
            low,
            high,
            density,
            cells: OnceLock::new(),
            parts: OnceLock::new(),
        })),
        power,
    }
}

/// `side`² cells on a piece of surface.
pub(super) fn grid_of(frame: &Frame, side: u32) -> Grid {
    let single = |p: DVec3| p.as_vec3().to_array();
    Grid {
        origin: single(frame.origin),
        edge_u: single(frame.edge_u),
        edge_v: single(frame.edge_v),
        twist: single(frame.twist),
        layout: frame.layout,
        side,
    }
}

/// The whole patch as a part of itself.
pub const WHOLE: Tile = Tile { origin: DVec2::ZERO, size: DVec2::ONE };

/// Area of each cell relative to their mean.
pub(super) fn densities(frame: &Frame, side: u32) -> [f32; 64] {
    let mut density = [0.0f32; 64];
    for (k, d) in density.iter_mut().enumerate().take((side * side) as usize) {
        let [u, v] = frame.layout.centre(side, k).map(f64::from);
        *d = frame.relative_density(DVec2::new(u, v)) as f32;
    }
    density
}

/// Average of weights over the cells' areas.
fn mean_of(weights: &[[f64; 3]], density: &[f32; 64]) -> [f64; 3] {
    let total: f64 = density[..weights.len()].iter().map(|&d| f64::from(d)).sum();
    std::array::from_fn(|c| weights.iter().zip(density).map(|(w, &d)| w[c] * f64::from(d)).sum::<f64>() / total)
}

/// Scales weights so that their average over the cells' areas is `mean`; where all are 0 the mean itself is shot.
fn scale_to(weights: &mut [[f64; 3]], density: &[f32; 64], mean: [f64; 3]) {
    let now = mean_of(weights, density);
    for c in 0..3 {
        for w in weights.iter_mut() {
            w[c] = if now[c] > 0.0 { w[c] * (mean[c] / now[c]) } else { mean[c] };
        }
    }
}
