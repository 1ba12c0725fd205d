//! How a patch's light is shared among its cells: linearly, so that light shot at different times adds up to what all of it
//! shot at once would give, whatever the order.

use crate::mesh::{ALL_VALID, Frame, Patch, Tile};
use glam::DVec2;
use ringlight_visibility::Layout;

/// How light between the elements of a patch follows from theirs.
#[derive(Clone, Copy, Debug)]
pub struct Interpolation<'a> {
    /// The patch.
    pub patch: &'a Patch,
    /// Free samples of each element.
    pub valid: &'a [u32],
}

impl Interpolation<'_> {
    /// Whether the patch is covered at parameters `at`.
    pub fn is_covered(&self, at: DVec2) -> bool {
        let layout = self.patch.frame.layout;
        let (element, within) = Tile::find(layout, self.patch.grid, at);
        self.valid[element as usize] >> Tile::find(layout, [4, 4], within).0 & 1 == 0
    }

    /// Whether some part of the patch is covered.
    pub fn is_partly_covered(&self) -> bool {
        self.valid.iter().any(|&v| v != ALL_VALID)
    }

    /// Calls with the elements that light at `at` comes from and their shares, which sum to 1: between the middles of the
    /// elements of a quadrilateral that have a free part, constant beyond the outermost middles; in triangles the element
    /// there.
    pub fn shares(&self, at: DVec2, mut add: impl FnMut(usize, f64)) {
        let grid = self.patch.grid;
        if self.patch.frame.layout == Layout::Triangle {
            return add(Tile::find(Layout::Triangle, grid, at).0 as usize, 1.0);
        }
        let axis = |t: f64, n: u32| {
            let x = (t * f64::from(n) - 0.5).clamp(0.0, f64::from(n - 1));
            let low = (x as u32).min(n.saturating_sub(2));
            let share = x - f64::from(low);
            [(low, 1.0 - share), ((low + 1).min(n - 1), share)]
        };
        let (columns, rows) = (axis(at.x, grid[0]), axis(at.y, grid[1]));
        let mut free = [(0, 0.0); 4];
        let mut total = 0.0;
        for (i, corner) in free.iter_mut().enumerate() {
            let ((column, wide), (row, high)) = (columns[i % 2], rows[i / 2]);
            let element = (row * grid[0] + column) as usize;
            if wide * high > 0.0 && self.valid[element] != 0 {
                *corner = (element, wide * high);
                total += wide * high;
            }
        }
        free.iter().filter(|(_, weight)| *weight > 0.0).for_each(|&(element, weight)| add(element, weight / total));
    }
}

/// A patch whose light is to be shared among `side`² cells.
pub struct Sharing<'a> {
    /// How light between elements follows from theirs.
    pub interpolation: Interpolation<'a>,
    /// Cells along a side.
    pub side: u32,
    /// Area of each cell, m².
    pub areas: &'a [f64],
}

impl Sharing<'_> {
    /// Radiosity of each cell for the power of each element: averages over the cells of the light interpolated between the
    /// elements' middles, scaled for each element so that its power is exact. Covered cells are seen by nobody: open
    /// ones shoot their share.
    pub fn radiosity(&self, power: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let layout = self.interpolation.patch.frame.layout;
        let mut usable: Vec<bool> = (0..self.areas.len())
            .map(|k| !self.interpolation.is_covered(layout.centre(self.side, k).map(f64::from).into()))
            .collect();
        if !usable.contains(&true) {
            usable.fill(true);
        }
        let mut carried = vec![0.0; power.len()];
        self.visit(&usable, |k, element, share| carried[element] += self.areas[k] * share);
        let mut radiosity = vec![[0.0; 3]; self.areas.len()];
        self.visit(&usable, |k, element, share| {
            (0..3).for_each(|c| radiosity[k][c] += share * power[element][c] / carried[element]);
        });
        // What no usable cell carries is shot by all of them.
        let area: f64 = self.areas.iter().zip(&usable).filter(|(_, usable)| **usable).map(|(area, _)| area).sum();
        for (power, _) in power.iter().zip(&carried).filter(|(_, carried)| **carried == 0.0) {
            for (cell, _) in radiosity.iter_mut().zip(&usable).filter(|(_, usable)| **usable) {
                (0..3).for_each(|c| cell[c] += power[c] / area);
            }
        }
        radiosity
    }

    /// Calls with cell, element and the share of the cell's light that is the element's, for regular samples of the cells
    /// that fit both cells and elements: then interpolation keeps the mean, unless something is covered.
    fn visit(&self, usable: &[bool], mut add: impl FnMut(usize, usize, f64)) {
        let Interpolation { patch, .. } = self.interpolation;
        let layout = patch.frame.layout;
        // As fine as the elements, or as their samples where some are covered.
        let finer = if self.interpolation.is_partly_covered() { 4 } else { 1 };
        let fine = patch.grid.map(|n| finer * n / greatest_common_divisor(finer * n, self.side));
        let samples = fine[0] * fine[1];
        for k in (0..usable.len()).filter(|&k| usable[k]) {
            let cell = Tile::of(layout, [self.side; 2], k as u32);
            for s in 0..samples {
                let at = cell.compose(Tile::of(layout, fine, s)).at(Frame::middle(layout));
                if !self.interpolation.is_covered(at) {
                    self.interpolation.shares(at, |element, share| add(k, element, share / f64::from(samples)));
                }
            }
        }
    }
}

fn greatest_common_divisor(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn patch(corners: &[(f64, f64)], grid: [u32; 2]) -> Patch {
        let corners: Vec<DVec3> = corners.iter().map(|&(x, y)| DVec3::new(x, y, 0.0)).collect();
        let frame = Frame::from_corners(&corners);
        let tile = Tile { origin: DVec2::ZERO, size: DVec2::ONE };
        let area = frame.area_vector().length();
        let normal = DVec3::Z;
        Patch { id: 0, facet: 0, back: false, tile, frame, normal, area, plane: 0, first_element: 0, grid }
    }

    #[test]
    fn light_shot_in_two_goes_adds_up_and_keeps_the_power_of_every_element() {
        let rectangle = patch(&[(0., 0.), (3., 0.), (3., 2.), (0., 2.)], [3, 5]);
        let trapezium = patch(&[(0., 0.), (4., 0.), (3., 2.), (1., 2.)], [4, 3]);
        let triangle = patch(&[(0., 0.), (4., 0.), (3., 2.)], [3, 3]);
        for (name, patch) in [("rectangle", rectangle), ("trapezium", trapezium), ("triangle", triangle)] {
            for (covered, side) in [(false, 1), (false, 4), (true, 4), (true, 8)] {
                let count = patch.element_count() as usize;
                let mut valid = vec![ALL_VALID; count];
                if covered {
                    (valid[0], valid[1], valid[count - 1]) = (0, 0x00ff, 0x8000);
                }
                let cells = (side * side) as usize;
                let density =
                    |k: usize| patch.frame.relative_density(patch.frame.layout.centre(side, k).map(f64::from).into());
                let areas: Vec<f64> = (0..cells).map(|k| density(k) * patch.area / cells as f64).collect();
                let sharing =
                    Sharing { interpolation: Interpolation { patch: &patch, valid: &valid }, side, areas: &areas };
                let power = |scale: f64| -> Vec<[f64; 3]> {
                    let light = |e: usize| if valid[e] == 0 { 0.0 } else { (scale * (e + 1) as f64).sin().abs() };
                    (0..count).map(|e| [light(e), 2.0 * light(e), 0.0]).collect()
                };
                let (first, second) = (power(0.7), power(2.3));
                let both: Vec<[f64; 3]> =
                    first.iter().zip(&second).map(|(a, b)| std::array::from_fn(|c| a[c] + b[c])).collect();
                let shot = [&first, &second, &both].map(|power| sharing.radiosity(power));
                for ((a, b), sum) in shot[0].iter().zip(&shot[1]).zip(&shot[2]) {
                    assert!((0..3).all(|c| a[c] >= 0.0 && (a[c] + b[c] - sum[c]).abs() < 1e-12), "{name} {side}");
                }
                let sent: f64 = shot[2].iter().zip(&areas).map(|(b, area)| b[0] * area).sum();
                let held: f64 = both.iter().map(|p| p[0]).sum();
                assert!((sent / held - 1.0).abs() < 1e-12, "{name} {side}: {sent} of {held}");
            }
        }
    }

    #[test]
    fn even_light_stays_even_where_nothing_is_covered() {
        for grid in [[3, 3], [4, 7], [1, 2]] {
            let patch = patch(&[(0., 0.), (3., 0.), (3., 2.), (0., 2.)], grid);
            let count = patch.element_count() as usize;
            let valid = vec![ALL_VALID; count];
            let sharing = Sharing {
                interpolation: Interpolation { patch: &patch, valid: &valid },
                side: 4,
                areas: &[6.0 / 16.0; 16],
            };
            let radiosity = sharing.radiosity(&vec![[6.0 / count as f64; 3]; count]);
            assert!(radiosity.iter().flatten().all(|b| (b - 1.0).abs() < 1e-12), "{grid:?}: {radiosity:?}");
        }
    }
}
