//! What one point receives from one shooter, with visibility by testing every triangle.

use glam::DVec3;
use ringlight::form_factor::contour;
use ringlight::mesh::{Frame, Mesh, NONE, Patch, Tile};
use ringlight_visibility::{Cells, Filter, Grid, OPAQUE, Points, Shooter, Triangle, reference};
use std::f64::consts::PI;

/// Hits in the last ten-thousandth of the way to a cell do not count.
const FAR: f32 = 0.9999;

/// All triangles of a mesh whose surfaces are opaque.
pub fn triangles(mesh: &Mesh) -> Vec<Triangle> {
    let mut triangles = Vec::new();
    for (number, facet) in mesh.facets.iter().enumerate() {
        assert!(mesh.occluder.coverage(number as u32, facet) >= 1.0 && facet.base_uv == NONE, "an opaque surface");
        let [a, b, c, d] = facet.corners.map(|c| c.to_array());
        let mut add = |corners, half| {
            let id = 2 * number as u32 + half;
            triangles.push(Triangle { corners, plane: facet.plane, id, filter: OPAQUE });
        };
        add([a, b, c], 0);
        if d != a {
            add([a, c, d], 1);
        }
    }
    triangles
}

/// A point that receives light.
#[derive(Clone, Copy, Debug)]
pub struct Receiver {
    /// Position, metres.
    pub point: DVec3,
    /// Unit normal.
    pub normal: DVec3,
    /// Plane id of its surface.
    pub plane: u32,
}

impl Receiver {
    /// Its position as visibility sees it.
    fn single(&self) -> [f32; 3] {
        self.point.as_vec3().to_array()
    }

    /// Which cells it sees: above its horizon, and hidden by no triangle.
    pub fn sees(&self, triangles: &[Triangle], shooter: &Shooter) -> Vec<bool> {
        let towards = |k: usize| -> DVec3 {
            let at = |p: [f32; 3]| DVec3::from(p.map(f64::from));
            match &shooter.cells {
                Cells::Grid(grid) => at(grid.point(k)) - self.point,
                Cells::Points(points) => at(points[k]) - self.point,
                Cells::Directions(directions) => at(directions[k]),
            }
        };
        let cells = shooter.cells.len();
        let above = (0..cells).filter(|&k| self.normal.dot(towards(k)) > 0.0).fold(0u64, |mask, k| mask | 1 << k);
        let ([x, y, z], mut mask) = (self.single(), [above]);
        let points = Points { x: &[x], y: &[y], z: &[z], plane: &[self.plane] };
        const NO_FILTERS: &[Filter] = &[];
        reference::clear_blocked(triangles, NO_FILTERS, shooter, points, &mut mask);
        (0..cells).map(|k| mask[0] >> k & 1 == 1).collect()
    }
}

/// A patch as a shooter.
pub struct PatchShooter {
    /// As visibility sees it.
    pub shooter: Shooter,
    corners: Vec<DVec3>,
    normal: DVec3,
    /// Positions of the cells, as visibility sees them.
    cells: Vec<DVec3>,
    /// Each cell in parts, which stand for it near the shooter: 16 of them along the patch's side.
    parts: Vec<Vec<DVec3>>,
    /// Area of each cell, m², its parameters' density times their share.
    areas: Vec<f64>,
    /// Area of an average cell, m².
    mean_area: f64,
}

impl PatchShooter {
    /// The patch with `side`² cells at the middles of a regular grid.
    pub fn new(patch: &Patch, side: u32) -> PatchShooter {
        let frame = &patch.frame;
        let single = |p: DVec3| p.as_vec3().to_array();
        let grid = Grid {
            origin: single(frame.origin),
            edge_u: single(frame.edge_u),
            edge_v: single(frame.edge_v),
            twist: single(frame.twist),
            layout: frame.layout,
            side,
        };
        let (corners, count) = frame.corners();
        let mean_area = patch.area / grid.len() as f64;
        let (fine, centre) = (16 / side, Frame::middle(frame.layout));
        let parts = (0..grid.len() as u32).map(|k| {
            let cell = Tile::of(frame.layout, [side; 2], k);
            let part = |p: u32| frame.at(cell.compose(Tile::of(frame.layout, [fine; 2], p)).at(centre));
            (0..fine * fine).map(|p| part(p).as_vec3().as_dvec3()).collect()
        });
        let middle = |k: usize| grid.layout.centre(side, k).map(f64::from).into();
        PatchShooter {
            corners: corners[..count].to_vec(),
            normal: patch.normal,
            cells: (0..grid.len()).map(|k| DVec3::from(grid.point(k).map(f64::from))).collect(),
            parts: parts.collect(),
            areas: (0..grid.len()).map(|k| mean_area * frame.relative_density(middle(k))).collect(),
            mean_area,
            shooter: Shooter { cells: Cells::Grid(grid), plane: patch.plane, far: FAR },
        }
    }

    /// The corners, metres.
    pub fn corners(&self) -> &[DVec3] {
        &self.corners
    }

    /// Unit normal of the lit side.
    pub fn normal(&self) -> DVec3 {
        self.normal
    }

    /// Positions of the cells, metres.
    pub fn cells(&self) -> &[DVec3] {
        &self.cells
    }

    /// Area of each cell, m².
    pub fn areas(&self) -> &[f64] {
        &self.areas
    }

    /// Distance from a point to the patch's box, metres.
    pub fn distance(&self, point: DVec3) -> f64 {
        let low = self.corners.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let high = self.corners.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        (low - point).max(point - high).max(DVec3::ZERO).length()
    }

    /// Irradiance that each cell gives per radiosity of its own: the whole patch's form factor, divided among the cells by
    /// their disc forms cosθᵣ cosθₛ A/(πr² + A), of the cells that are seen (DESIGN section 3). Near the shooter the
    /// disc forms are those of the cells' parts.
    pub fn form_factors(&self, to: &Receiver, near: bool, triangles: &[Triangle]) -> Vec<f64> {
        let dark = vec![0.0; self.cells.len()];
        if to.plane == self.shooter.plane || self.normal.dot(to.point - self.corners[0]) <= 0.0 {
            return dark;
        }
        let whole = contour(to.point, to.normal, &self.corners);
        let from = DVec3::from(to.single().map(f64::from));
        let disc = |place: DVec3, share: f64| {
            let r2 = (place - from).length_squared();
            self.kernel(from, to.normal, place).max(0.0) * PI * r2 * share / (PI * r2 + self.mean_area * share)
        };
        let discs: Vec<f64> = (0..self.cells.len())
            .map(|k| {
                let parts = self.parts[k].iter().map(|&part| disc(part, (self.parts[k].len() as f64).recip()));
                self.areas[k] * if near { parts.sum() } else { disc(self.cells[k], 1.0) }
            })
            .collect();
        let total: f64 = discs.iter().sum();
        if whole == 0.0 || total == 0.0 {
            return dark;
        }
        let seen = to.sees(triangles, &self.shooter);
        discs.iter().zip(seen).map(|(disc, seen)| if seen { whole * disc / total } else { 0.0 }).collect()
    }

    /// cosθᵣ cosθₛ/(πr²) from a place of the shooter to a point, 1/m²; it goes on smoothly below the shooter's horizon.
    fn kernel(&self, point: DVec3, normal: DVec3, place: DVec3) -> f64 {
        let way = place - point;
        way.dot(normal).max(0.0) * -way.dot(self.normal) / (PI * way.length_squared().powi(2))
    }

    /// How the mean over an area about a point differs from the value there, as a share of it: the second differences of the
    /// seen cells' kernels along both edges of the area, over 24 (`factors` are the form factors of the seen).
    pub fn second_order(&self, to: &Receiver, edges: [DVec3; 2], factors: &[f64]) -> f64 {
        const STEP: f64 = 1e-3;
        let at = |k: usize, shift: DVec3| self.kernel(to.point + shift, to.normal, self.cells[k]);
        let curvature = |k: usize| -> f64 {
            let middle = at(k, DVec3::ZERO);
            edges.iter().map(|&e| (at(k, STEP * e) - 2.0 * middle + at(k, -STEP * e)) / (STEP * STEP * middle)).sum()
        };
        let seen = || (0..self.cells.len()).filter(|&k| factors[k] > 0.0);
        let sum: f64 = seen().map(|k| factors[k] * curvature(k)).sum();
        let total: f64 = seen().map(|k| factors[k]).sum();
        if total > 0.0 { sum / (24.0 * total) } else { 0.0 }
    }
}
