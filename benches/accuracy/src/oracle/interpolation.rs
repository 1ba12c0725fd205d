//! How the light of a patch's elements is shared among its cells.

use glam::DVec2;
use ringlight::mesh::{ALL_VALID, Frame, Mesh, Patch, Tile, free_share};
use ringlight::shooting::Shoot;
use ringlight_visibility::Layout;

/// For each cell, the part that each element's radiosity has in the cell's: a matrix, so that what is shot at different
/// times adds up. Power is kept for each element: Σ cells A·part = element's free area.
pub fn parts(mesh: &Mesh, patch: &Patch, side: u32, areas: &[f64], shoot: Shoot) -> Vec<Vec<f64>> {
    let count = patch.element_count() as usize;
    let valid = &mesh.valid[patch.first_element as usize..][..count];
    let free: Vec<f64> = (0..count as u32).map(|k| patch.element_area(k) * free_share(valid[k as usize])).collect();
    if shoot == Shoot::Average || count == 1 && valid[0] == ALL_VALID {
        return vec![free.iter().map(|a| a / patch.area).collect(); areas.len()];
    }
    let mut parts = vec![vec![0.0; count]; areas.len()];
    let layout = patch.frame.layout;
    let finer = if valid.iter().all(|&v| v == ALL_VALID) { 1 } else { 4 };
    let [columns, rows] = patch.grid.map(|n| finer * n / common_divisor(finer * n, side));
    let fine = [columns, rows];
    for (k, part) in parts.iter_mut().enumerate() {
        let cell = Tile::of(layout, [side; 2], k as u32);
        for s in 0..columns * rows {
            let at = cell.compose(Tile::of(layout, fine, s)).at(Frame::middle(layout));
            if is_covered(patch, valid, at) {
                continue;
            }
            let weight = areas[k] / f64::from(columns * rows);
            for (element, share) in neighbours(patch, valid, at) {
                part[element] += weight * share;
            }
        }
    }
    // Nobody sees a covered cell.
    let open: Vec<bool> =
        (0..areas.len()).map(|k| !is_covered(patch, valid, layout.centre(side, k).map(f64::from).into())).collect();
    if open.contains(&true) {
        parts.iter_mut().zip(&open).filter(|(_, open)| !**open).for_each(|(part, _)| part.fill(0.0));
    }
    for element in 0..count {
        let carried: f64 = parts.iter().map(|part| part[element]).sum();
        let usable = |k: usize| open[k] || !open.contains(&true);
        let all: f64 = (0..areas.len()).filter(|&k| usable(k)).map(|k| areas[k]).sum();
        for (k, part) in parts.iter_mut().enumerate() {
            part[element] = match carried > 0.0 {
                true => part[element] * free[element] / carried / areas[k],
                false if usable(k) => free[element] / all,
                false => 0.0,
            };
        }
    }
    parts
}

fn common_divisor(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { common_divisor(b, a % b) }
}

fn is_covered(patch: &Patch, valid: &[u32], at: DVec2) -> bool {
    let (element, within) = Tile::find(patch.frame.layout, patch.grid, at);
    let (sample, _) = Tile::find(patch.frame.layout, [4, 4], within);
    valid[element as usize] >> sample & 1 == 0
}

/// The elements whose light is interpolated at parameters `at`, with their shares: on quadrilaterals bilinearly between
/// the middles of those with a free part, on triangles the element itself.
fn neighbours(patch: &Patch, valid: &[u32], at: DVec2) -> Vec<(usize, f64)> {
    let layout = patch.frame.layout;
    if layout == Layout::Triangle {
        return vec![(Tile::find(layout, patch.grid, at).0 as usize, 1.0)];
    }
    // A hat around each middle, the outermost ones level to the edge.
    let hat = |t: f64, n: u32, i: u32| {
        let x = (t * f64::from(n) - 0.5).clamp(0.0, f64::from(n - 1));
        (1.0 - (x - f64::from(i)).abs()).max(0.0)
    };
    let [columns, rows] = patch.grid;
    let mut found: Vec<(usize, f64)> = (0..columns * rows)
        .map(|e| (e as usize, hat(at.x, columns, e % columns) * hat(at.y, rows, e / columns)))
        .filter(|&(e, share)| share > 0.0 && valid[e] != 0)
        .collect();
    let total: f64 = found.iter().map(|(_, share)| share).sum();
    found.iter_mut().for_each(|(_, share)| *share /= total);
    found
}
