//! Receiving points that are lit together: the shot's light through the masks of what they see.
//!
//! Visibility clears bits and knows no light; form factors turn masks into light and need no occluder.

use super::emitter::range_window;
use super::shot::{PatchSource, Shot, Source};
use crate::form_factor;
use glam::DVec3;
use ringlight_visibility::{Cells, Hierarchy, Points, Tally};

/// Lanes of the cell loop.
const LANES: usize = 16;

/// Points with normals that receive one shot after another; the buffers are reused.
#[derive(Debug, Default)]
pub struct Packet {
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    plane: Vec<u32>,
    masks: Vec<u64>,
    receivers: Vec<Receiver>,
    received: Vec<[f64; 3]>,
}

/// A receiving point, metres.
#[derive(Clone, Copy, Debug)]
struct Receiver {
    point: DVec3,
    normal: DVec3,
}

impl Packet {
    /// Removes all points.
    pub fn clear(&mut self) {
        self.x.clear();
        self.y.clear();
        self.z.clear();
        self.plane.clear();
        self.masks.clear();
        self.receivers.clear();
        self.received.clear();
    }

    /// Adds a point on a surface of plane id `plane` that sees no more of the shot's cells than `mask`, which
    /// [`Shot::above_horizon`] gives.
    pub fn push(&mut self, point: DVec3, normal: DVec3, plane: u32, mask: u64) {
        let single = point.as_vec3();
        self.x.push(single.x);
        self.y.push(single.y);
        self.z.push(single.z);
        self.plane.push(plane);
        self.masks.push(mask);
        self.receivers.push(Receiver { point, normal });
    }

    /// Finds what each point sees of the shot, and what it receives.
    pub fn receive(&mut self, shot: &Shot, hierarchy: &Hierarchy) -> Tally {
        let points = Points { x: &self.x, y: &self.y, z: &self.z, plane: &self.plane };
        let tally = hierarchy.clear_blocked(&shot.shooter, points, &mut self.masks);
        irradiances(shot, self);
        tally
    }

    /// The cells that each point sees, in the order in which they were pushed.
    pub fn masks(&self) -> &[u64] {
        &self.masks
    }

    /// Irradiance of each point, W/m² or lux.
    pub fn received(&self) -> &[[f64; 3]] {
        &self.received
    }
}

impl Shot {
    /// The cells that lie above the horizon of a point with this normal, and face it.
    pub fn above_horizon(&self, point: DVec3, normal: DVec3) -> u64 {
        let above = |cells: &mut dyn Iterator<Item = DVec3>| {
            cells.enumerate().fold(0u64, |mask, (k, to)| mask | u64::from(normal.dot(to) > 0.0) << k)
        };
        match (&self.source, &self.shooter.cells) {
            (Source::Patch(source), Cells::Grid(grid)) => {
                if source.normal.dot(point - source.corners[0]) <= 0.0 {
                    return 0;
                }
                if source.corners[..source.count].iter().all(|&c| normal.dot(c - point) > 0.0) {
                    return self.shooter.cells.all();
                }
                above(&mut (0..grid.len()).map(|k| DVec3::from(grid.point(k).map(f64::from)) - point))
            }
            (_, Cells::Directions(d)) => above(&mut d.iter().map(|d| DVec3::from(d.map(f64::from)))),
            (_, Cells::Points(p)) => above(&mut p.iter().map(|p| DVec3::from(p.map(f64::from)) - point)),
            (_, Cells::Grid(_)) => 0,
        }
    }
}

/// The cells of a patch shooter, structure of arrays, padded with cells of no weight.
struct CellTable {
    x: [f32; 64],
    y: [f32; 64],
    z: [f32; 64],
    density: [f32; 64],
    light: [[f32; 64]; 3],
    count: usize,
    /// Area of a cell, m².
    area: f32,
}

/// Turns masks into irradiance.
fn irradiances(shot: &Shot, packet: &mut Packet) {
    let Packet { masks, receivers, received, .. } = packet;
    match &shot.source {
        Source::Patch(source) => {
            let table = CellTable::new(shot, source);
            pulp::Arch::new().dispatch(|| {
                for (receiver, &mask) in receivers.iter().zip(masks.iter()) {
                    received.push(if mask == 0 { [0.0; 3] } else { from_patch(source, &table, receiver, mask) });
                }
            });
        }
        Source::Point { position, cone, range } => {
            for (receiver, &mask) in receivers.iter().zip(masks.iter()) {
                let factor = if mask == 0 { 0.0 } else { from_point(receiver, *position, *cone, *range) };
                received.push(shot.light[0].map(|i| f64::from(i) * factor));
            }
        }
        Source::Directions => {
            let Cells::Directions(directions) = &shot.shooter.cells else { return };
            for (receiver, &mask) in receivers.iter().zip(masks.iter()) {
                let mut sum = [0.0; 3];
                for (k, d) in directions.iter().enumerate().filter(|(k, _)| mask >> k & 1 == 1) {
                    let cosine = receiver.normal.dot(DVec3::from(d.map(f64::from)));
                    (0..3).for_each(|c| sum[c] += cosine * f64::from(shot.light[k][c]));
                }
                received.push(sum);
            }
        }
    }
}

/// Irradiance from the visible part of a patch: the contour of the whole shooter, weighted by the visible share of the
/// light of its cells, Σ cosθᵣ cosθₛ ΔB / (πr² + A) (DESIGN section 3; Wallace, Elmquist & Haines 1989 for the disc form).
#[inline(always)]
fn from_patch(source: &PatchSource, table: &CellTable, at: &Receiver, mask: u64) -> [f64; 3] {
    let factor = form_factor::contour(at.point, at.normal, &source.corners[..source.count]);
    let (x, n) = (at.point.as_vec3(), at.normal.as_vec3());
    let s = source.normal.as_vec3();
    let mut total = [0.0f32; LANES];
    let mut light = [[0.0f32; LANES]; 3];
    for chunk in 0..table.count.div_ceil(LANES) {
        let first = chunk * LANES;
        let bits = (mask >> first) as u32;
        for l in 0..LANES {
            let k = first + l;
            let (dx, dy, dz) = (table.x[k] - x.x, table.y[k] - x.y, table.z[k] - x.z);
            let r2 = dx * dx + dy * dy + dz * dz;
            let receiver = (dx * n.x + dy * n.y + dz * n.z).max(0.0);
            let shooter = (-(dx * s.x + dy * s.y + dz * s.z)).max(0.0);
            let disc = receiver * shooter / (r2 * (std::f32::consts::PI * r2 + table.area)) * table.density[k];
            let seen = (bits >> l & 1) as f32 * disc;
            total[l] += disc;
            light[0][l] += seen * table.light[0][k];
            light[1][l] += seen * table.light[1][k];
            light[2][l] += seen * table.light[2][k];
        }
    }
    let sum = |lanes: &[f32; LANES]| lanes.iter().map(|&x| f64::from(x)).sum::<f64>();
    let total = sum(&total);
    if total > 0.0 { [0, 1, 2].map(|c| factor * sum(&light[c]) / total) } else { [0.0; 3] }
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

impl CellTable {
    fn new(shot: &Shot, source: &PatchSource) -> CellTable {
        let mut table = CellTable {
            // Lanes without a cell lie so far away that they add 0, also for a point at the origin.
            x: [1e15; 64],
            y: [0.0; 64],
            z: [0.0; 64],
            density: [0.0; 64],
            light: [[0.0; 64]; 3],
            count: shot.light.len(),
            area: (source.area / shot.light.len() as f64) as f32,
        };
        let Cells::Grid(grid) = &shot.shooter.cells else { return table };
        for (k, light) in shot.light.iter().enumerate() {
            [table.x[k], table.y[k], table.z[k]] = grid.point(k);
            table.density[k] = source.density[k];
            (0..3).for_each(|c| table.light[c][k] = light[c]);
        }
        table
    }
}
