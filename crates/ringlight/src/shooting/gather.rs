//! From masks to light: what sample points get from the visible cells of a shot.

use super::emitter::range_window;
use super::shot::{PatchSource, Shot, Source};
use crate::form_factor;
use crate::mesh::{Frame, Tile};
use glam::{DVec3, Vec3};
use ringlight_visibility::{Cells, Grid};

/// Lanes of the cell loop.
const LANES: usize = 16;

/// A receiving point.
#[derive(Clone, Copy, Debug)]
pub struct Receiver {
    /// Where, mesh coordinates, metres.
    pub point: DVec3,
    /// Unit normal.
    pub normal: DVec3,
    /// What it stands for.
    pub role: Role,
}

/// What a receiving point stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Itself.
    Point,
    /// Itself, near the shooter.
    Near,
    /// Alone for an area about it, whose [`Spread`] has this number.
    Alone(u32),
}

/// How far an area about its middle extends: two vectors u, v in its plane with (uuᵀ + vvᵀ)/12 the covariance of a
/// point anywhere on it, metres. For a parallelogram they are its edges.
#[derive(Clone, Copy, Debug)]
pub struct Spread(pub [Vec3; 2]);

/// Irradiance, W/m² or lux.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Received {
    /// At the point.
    pub point: [f64; 3],
    /// Mean over the area for which the point stands alone; else the same.
    pub mean: [f64; 3],
}

impl Received {
    fn even(light: [f64; 3]) -> Received {
        Received { point: light, mean: light }
    }
}

/// The cells of a patch shooter, or `N` equal parts of them, structure of arrays, padded with cells of no weight.
#[derive(Clone, Debug)]
pub struct CellTable<const N: usize> {
    x: [f32; N],
    y: [f32; N],
    z: [f32; N],
    density: [f32; N],
    light: [[f32; N]; 3],
    /// Entries in use, all parts of one cell as far apart as there are cells.
    count: usize,
    /// Area of an entry, m².
    area: f32,
    /// Times this, a mask of the cells is a mask of the entries, 64 of them in turn.
    repeat: u64,
}

/// As many parts of all cells as receivers near the shooter see of it: there a cell is no point.
pub type Parts = CellTable<256>;

/// Turns the masks of what the receivers see into irradiance.
pub fn gather(shot: &Shot, receivers: &[Receiver], spreads: &[Spread], masks: &[u64], received: &mut Vec<Received>) {
    let lit = receivers.iter().zip(masks.iter().copied());
    match &shot.source {
        Source::Patch(source) => {
            let Cells::Grid(grid) = &shot.shooter.cells else { return };
            let cells = source.cells(shot, grid);
            pulp::Arch::new().dispatch(|| {
                received.extend(lit.map(|(at, mask)| match at.role {
                    _ if mask == 0 => Received::default(),
                    Role::Near => {
                        let parts =
                            source.parts.get_or_init(|| Box::new(CellTable::new(shot, source, grid, 16 / grid.side)));
                        from_patch::<256, false>(source, parts, at, None, mask)
                    }
                    Role::Alone(k) => from_patch::<64, true>(source, cells, at, Some(&spreads[k as usize]), mask),
                    Role::Point => from_patch::<64, false>(source, cells, at, None, mask),
                }));
            });
        }
        Source::Group(normals) => {
            let Cells::Points(points) = &shot.shooter.cells else { return };
            received.extend(lit.map(|(at, mask)| Received::even(from_group(shot, normals, points, at, mask))));
        }
        Source::Point { position, cone, range } => {
            received.extend(lit.map(|(at, mask)| {
                let factor = if mask == 0 { 0.0 } else { from_point(at, *position, *cone, *range) };
                Received::even(shot.light[0].map(|i| f64::from(i) * factor))
            }));
        }
        Source::Directions => {
            let Cells::Directions(directions) = &shot.shooter.cells else { return };
            received.extend(lit.map(|(at, mask)| {
                let mut sum = [0.0; 3];
                for (k, d) in directions.iter().enumerate().filter(|(k, _)| mask >> k & 1 == 1) {
                    let cosine = at.normal.dot(DVec3::from(d.map(f64::from)));
                    (0..3).for_each(|c| sum[c] += cosine * f64::from(shot.light[k][c]));
                }
                Received::even(sum)
            }));
        }
    }
}

/// Irradiance from the visible part of a patch: the contour of the whole shooter, weighted by the visible share of the
/// light of its cells, Σ cosθᵣ cosθₛ ΔB / (πr² + A) (DESIGN section 3; Wallace, Elmquist & Haines 1989 for the disc form).
/// Near the shooter the discs of whole cells would favour the farther cells, so their parts are summed there.
///
/// The mean over an area of spread u, v differs from the value at its middle by ∂²/24 along u and v to third order. For a
/// cell's kernel K = cosθᵣ cosθₛ/πr², with d from the point to the cell, g = d·d, b = −s·d and s the shooter's normal,
/// K_uu/K = (8 (s·u)(d·u)/b + 24 (d·u)²/g − 4 u·u)/g: n·d does not change along the receiver's own plane. All visible cells
/// count by their form factors, whatever their light: what arrives is linear in what is shot.
#[inline(always)]
fn from_patch<const N: usize, const SPREAD: bool>(
    source: &PatchSource,
    table: &CellTable<N>,
    at: &Receiver,
    spread: Option<&Spread>,
    mask: u64,
) -> Received {
    let factor = form_factor::contour(at.point, at.normal, &source.corners[..source.count]);
    let (x, n) = (at.point.as_vec3(), at.normal.as_vec3());
    let s = source.normal.as_vec3();
    let [u, v] = spread.map_or([Vec3::ZERO; 2], |spread| spread.0);
    let (su, sv, square) = (8.0 * s.dot(u), 8.0 * s.dot(v), 4.0 * (u.dot(u) + v.dot(v)));
    let mut total = [0.0f32; LANES];
    let mut light = [[0.0f32; LANES]; 3];
    let mut visible = [0.0f32; LANES];
    let mut curved = [0.0f32; LANES];
    let mask = mask.wrapping_mul(table.repeat);
    for chunk in 0..table.count.div_ceil(LANES) {
        let first = chunk * LANES;
        let bits = (mask >> (first % 64)) as u32;
        for l in 0..LANES {
            let k = first + l;
            let (dx, dy, dz) = (table.x[k] - x.x, table.y[k] - x.y, table.z[k] - x.z);
            let r2 = dx * dx + dy * dy + dz * dz;
            let receiver = (dx * n.x + dy * n.y + dz * n.z).max(0.0);
            let shooter = (-(dx * s.x + dy * s.y + dz * s.z)).max(0.0);
            let open = receiver / (r2 * (std::f32::consts::PI * r2 + table.area)) * table.density[k];
            let disc = open * shooter;
            let seen = (bits >> l & 1) as f32 * disc;
            total[l] += disc;
            for (light, shot) in light.iter_mut().zip(&table.light) {
                light[l] += seen * shot[k];
            }
            if SPREAD {
                let (du, dv) = (dx * u.x + dy * u.y + dz * u.z, dx * v.x + dy * v.y + dz * v.z);
                let inverse = 1.0 / r2;
                let second = su * du + sv * dv + shooter * (24.0 * (du * du + dv * dv) * inverse - square);
                visible[l] += seen;
                curved[l] += (bits >> l & 1) as f32 * open * second * inverse;
            }
        }
    }
    let sum = |lanes: &[f32; LANES]| lanes.iter().map(|&x| f64::from(x)).sum::<f64>();
    let total = sum(&total);
    if total <= 0.0 {
        return Received::default();
    }
    let light = light.map(|lanes| sum(&lanes));
    let point = light.map(|x| factor * x / total);
    let visible = sum(&visible);
    if !SPREAD || visible <= 0.0 {
        return Received::even(point);
    }
    // Where the point is almost in the shooter's plane, both sums are small, and their quotient says nothing.
    let mean_to_point = (1.0 + sum(&curved) / (24.0 * visible)).clamp(0.0, 2.0);
    Received { point, mean: point.map(|x| x * mean_to_point) }
}

/// Irradiance from the visible cells of a group: Σ cosθᵣ cosθₛ/r² of their intensities.
fn from_group(shot: &Shot, normals: &[Vec3], points: &[[f32; 3]], at: &Receiver, mut mask: u64) -> [f64; 3] {
    let (x, n) = (at.point.as_vec3(), at.normal.as_vec3());
    let mut sum = [0.0; 3];
    while mask != 0 {
        let k = mask.trailing_zeros() as usize;
        mask &= mask - 1;
        let to = Vec3::from(points[k]) - x;
        let r2 = to.length_squared();
        let factor = f64::from(n.dot(to) * -normals[k].dot(to) / (r2 * r2));
        (0..3).for_each(|c| sum[c] += factor * f64::from(shot.light[k][c]));
    }
    sum
}

/// Irradiance per intensity from a point or spot light (KHR_lights_punctual for cone and range).
fn from_point(at: &Receiver, position: DVec3, cone: Option<(DVec3, f64, f64)>, range: f64) -> f64 {
    let to = position - at.point;
    let r2 = to.length_squared();
    let r = r2.sqrt();
    if !(r > 0.0 && r < range) {
        return 0.0;
    }
    let mut factor = to.dot(at.normal).max(0.0) / (r * r2);
    factor *= range_window(r, range);
    if let Some((axis, inner, outer)) = cone {
        let cosine = -to.dot(axis) / r;
        let ramp = ((cosine - outer) / (inner - outer).max(1e-4)).clamp(0.0, 1.0);
        factor *= ramp * ramp;
    }
    factor
}

impl PatchSource {
    /// Its cells, those of `grid`.
    pub(super) fn cells(&self, shot: &Shot, grid: &Grid) -> &CellTable<64> {
        self.cells.get_or_init(|| Box::new(CellTable::new(shot, self, grid, 1)))
    }
}

impl<const N: usize> CellTable<N> {
    /// Where the entries in use are, metres.
    pub(super) fn points(&self) -> impl Iterator<Item = DVec3> {
        (0..self.count).map(|k| DVec3::from([self.x[k], self.y[k], self.z[k]].map(f64::from)))
    }

    /// The cells of `grid`, each cut into `side`² parts.
    fn new(shot: &Shot, source: &PatchSource, grid: &Grid, side: u32) -> CellTable<N> {
        let cells = shot.light.len();
        let count = cells * (side * side) as usize;
        // Lanes without a cell lie in the first one, with no density: they add 0, and nothing overflows.
        let [x, y, z] = grid.point(0);
        let mut table = CellTable {
            x: [x; N],
            y: [y; N],
            z: [z; N],
            density: [0.0; N],
            light: [[0.0; N]; 3],
            count,
            area: (source.area / count as f64) as f32,
            // 1 for 64 cells, else a 1 for every group of as many bits as there are cells.
            repeat: if cells == 64 { 1 } else { u64::MAX / ((1 << cells) - 1) },
        };
        for i in 0..count {
            let (cell, part) = (i % cells, (i / cells) as u32);
            [table.x[i], table.y[i], table.z[i]] = if side == 1 {
                grid.point(cell)
            } else {
                let tile = Tile::of(grid.layout, [grid.side; 2], cell as u32);
                let at = tile.compose(Tile::of(grid.layout, [side; 2], part)).at(Frame::middle(grid.layout));
                source.frame.at(at).as_vec3().to_array()
            };
            let light = shot.light[cell];
            table.density[i] = source.density[cell];
            (0..3).for_each(|c| table.light[c][i] = light[c]);
        }
        table
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ringlight_visibility::{Layout, NO_PLANE, Shooter};
    use std::sync::OnceLock;

    /// A unit square in the plane z = 0, lit upwards, whose light falls from 2 to 0 along x, in 16 cells.
    fn shot() -> Shot {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y];
        let grid = Grid {
            origin: [0.0; 3],
            edge_u: [1.0, 0.0, 0.0],
            edge_v: [0.0, 1.0, 0.0],
            twist: [0.0; 3],
            layout: Layout::Quad,
            side: 4,
        };
        Shot {
            shooter: Shooter { cells: Cells::Grid(grid), plane: NO_PLANE, far: 1.0 },
            light: (0..16).map(|k| [1.75 - 0.5 * (k % 4) as f32; 3]).collect(),
            source: Source::Patch(Box::new(PatchSource {
                patch: 0,
                frame: Frame::from_corners(&corners),
                corners,
                count: 4,
                normal: DVec3::Z,
                area: 1.0,
                diameter: 2f64.sqrt(),
                low: corners[0],
                high: corners[2],
                density: [1.0; 64],
                cells: OnceLock::new(),
                parts: OnceLock::new(),
            })),
            power: 3.0,
        }
    }

    fn received(point: DVec3, normal: DVec3, role: Role, spreads: &[Spread]) -> Received {
        let mut found = Vec::new();
        gather(&shot(), &[Receiver { point, normal, role }], spreads, &[0xffff], &mut found);
        found[0]
    }

    #[test]
    fn the_mean_over_an_area_is_that_of_many_points() {
        // A tilted parallelogram two or three of its widths away.
        let (middle, u, v) = (DVec3::new(2.0, 0.2, 1.2), DVec3::new(0.4, 0.0, 0.3), DVec3::new(0.1, 0.4, -0.1));
        let normal = v.cross(u).normalize();
        let spread = Spread([u, v].map(|w| w.as_vec3()));
        let found = received(middle, normal, Role::Alone(0), &[spread]);
        let (mut sum, n) = (0.0, 40);
        for k in 0..n * n {
            let [s, t] = [k % n, k / n].map(|i| (f64::from(i) + 0.5) / f64::from(n) - 0.5);
            sum += received(middle + s * u + t * v, normal, Role::Point, &[]).point[0];
        }
        let mean = sum / f64::from(n * n);
        let (without, with) = ((found.point[0] / mean - 1.0).abs(), (found.mean[0] / mean - 1.0).abs());
        // Second order left out, fourth order left over.
        assert!(without > 2e-3 && with < without / 10.0, "{without} {with}");
    }

    #[test]
    fn near_a_shooter_its_nearest_light_counts_most() {
        // On a wall along the bright edge, a hundredth above it: the contours of 64 × 1 strips say what arrives.
        let (point, normal) = (DVec3::new(-1e-9, 0.5, 0.01), DVec3::X);
        let strips = 64;
        let exact: f64 = (0..strips)
            .map(|i| {
                let [a, b] = [i, i + 1].map(|k| f64::from(k) / f64::from(strips));
                let strip = [[a, 0.0], [b, 0.0], [b, 1.0], [a, 1.0]].map(|[x, y]| DVec3::new(x, y, 0.0));
                (1.75 - 0.5 * f64::from(i / (strips / 4))) * form_factor::contour(point, normal, &strip)
            })
            .sum();
        let off = |role: Role| (received(point, normal, role, &[]).point[0] / exact - 1.0).abs();
        assert!(
            off(Role::Near) < 0.02 && off(Role::Near) < off(Role::Point) / 5.0,
            "{} {}",
            off(Role::Near),
            off(Role::Point)
        );
    }
}
