//! What points see of a polygon behind very many blockers, by rays: the polygon is cut into cells, and the masks of the
//! visibility crate say which of them are seen. Exact clipping would take time that grows with the square of the silhouettes' length.

use super::shadow::Seen;
use super::unobstructed::Face;
use crate::form_factor;
use glam::DVec3;
use ringlight_visibility::{Cells, Grid, Hierarchy, Layout, Points, Shooter};

/// Shooters along a side of the polygon's parts, and cells along a side of a shooter.
const SHOOTERS: u32 = 4;
const CELLS: u32 = 8;

/// Error of the seen share, of what is partly seen: 0.27 · M^(−3/4) for M cells across a straight shadow edge, root mean square.
pub(crate) const SHARE_ERROR: f64 = 0.0015;

/// Rays beyond this share of the way do not count: they have arrived.
const FAR: f32 = 0.9999;

/// The occluders, and where the pair lies among them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rays<'a> {
    pub hierarchy: &'a Hierarchy,
    /// Metres.
    pub unit: f64,
    /// The pair's origin relative to the hierarchy's, metres.
    pub shift: DVec3,
    /// Plane ids of the surface with the points and of the polygon.
    pub planes: [u32; 2],
}

/// What each of `points`, on a surface with this unit normal, sees of `target`.
pub(crate) fn seen<const N: usize>(points: [DVec3; N], normal: DVec3, target: Face, rays: Rays) -> [Seen; N] {
    let placed = |p: DVec3| (p * rays.unit + rays.shift).as_vec3();
    let [x, y, z] = [0, 1, 2].map(|axis| points.map(|p| placed(p)[axis]));
    let plane = [rays.planes[0]; N];
    let mut seen = [Seen { whole: 0.0, visible: 0.0 }; N];
    let last = target.corners.len() - 1;
    for k in (1..last).step_by(2) {
        let quad = [target.corners[0], target.corners[k], target.corners[k + 1], target.corners[(k + 2).min(last)]];
        // Sums over all cells and over the seen ones, for each point.
        let (mut all, mut open) = ([0.0; N], [0.0; N]);
        for part in 0..SHOOTERS * SHOOTERS {
            let patch = part_of(quad, part);
            let [o, p, q, r] = patch.map(placed);
            let grid = Grid {
                origin: o.to_array(),
                edge_u: (p - o).to_array(),
                edge_v: (r - o).to_array(),
                twist: (q - p - r + o).to_array(),
                layout: Layout::Quad,
                side: CELLS,
            };
            let mut masks = [u64::MAX; N];
            let shooter = Shooter { cells: Cells::Grid(grid), plane: rays.planes[1], far: FAR };
            rays.hierarchy.clear_blocked(&shooter, Points { x: &x, y: &y, z: &z, plane: &plane }, &mut masks);
            for cell in 0..CELLS * CELLS {
                let [u, v] = Layout::Quad.centre(CELLS, cell as usize).map(f64::from);
                let place = bilinear(patch, u, v);
                let along = (patch[1] - patch[0]).lerp(patch[2] - patch[3], v);
                let across = (patch[3] - patch[0]).lerp(patch[2] - patch[1], u);
                let area = along.cross(across).length();
                for i in 0..N {
                    let r = place - points[i];
                    let weight =
                        area * r.dot(normal).max(0.0) * (-r.dot(target.normal)).max(0.0) / r.length_squared().powi(2);
                    all[i] += weight;
                    open[i] += if masks[i] >> cell & 1 == 1 { weight } else { 0.0 };
                }
            }
        }
        for i in 0..N {
            let factor = form_factor::polygon(&quad.map(|c| c - points[i]), normal);
            seen[i].whole += factor;
            seen[i].visible += if all[i] > 0.0 { factor * (open[i] / all[i]) } else { 0.0 };
        }
    }
    seen
}

/// Part of a quadrilateral, one of a regular grid.
fn part_of(quad: [DVec3; 4], part: u32) -> [DVec3; 4] {
    let at = |i: u32, j: u32| {
        let t = |n: u32| f64::from(n) / f64::from(SHOOTERS);
        bilinear(quad, t(part % SHOOTERS + i), t(part / SHOOTERS + j))
    };
    [at(0, 0), at(1, 0), at(1, 1), at(0, 1)]
}

fn bilinear([o, p, q, r]: [DVec3; 4], u: f64, v: f64) -> DVec3 {
    o.lerp(p, u).lerp(r.lerp(q, u), v)
}
