//! What receivers get from cells that are small seen from where they are: each cell is a disc (Wallace, Elmquist & Haines
//! 1989), all of them for sixteen receivers at a time.

use super::shot::FAR;
use glam::{DVec3, Vec3};
use ringlight_visibility::{Cells, NO_PLANE, Points, Shooter};
use std::f32::consts::PI;

/// Receivers that are tested together.
const LANES: usize = 16;

/// Most cells.
const CELLS: usize = 64;

/// Sample points with their normals, in columns.
#[derive(Clone, Debug, Default)]
pub struct FarReceivers {
    position: [Vec<f32>; 3],
    normal: [Vec<f32>; 3],
    plane: Vec<u32>,
    /// What each is called.
    pub names: Vec<u32>,
}

/// Cells of a node: where they are, the way they face, and the share of the node's radiosity times area over π that each
/// sends.
#[derive(Clone, Debug)]
pub struct FarCells {
    /// As visibility sees them.
    pub shooter: Shooter,
    /// Positions, metres; normals; intensities; squares of their radii as discs that may be near, m².
    columns: [[f32; CELLS]; 8],
    count: usize,
}

impl FarReceivers {
    /// Adds a point.
    pub fn push(&mut self, point: DVec3, normal: DVec3, plane: u32, name: u32) {
        let (point, normal) = (point.as_vec3().to_array(), normal.as_vec3().to_array());
        for i in 0..3 {
            self.position[i].push(point[i]);
            self.normal[i].push(normal[i]);
        }
        self.plane.push(plane);
        self.names.push(name);
    }

    /// As visibility takes them.
    pub fn points(&self) -> Points<'_> {
        let [x, y, z] = &self.position;
        Points { x, y, z, plane: &self.plane }
    }
}

impl FarCells {
    /// None yet, of a shooter in this plane.
    pub fn new(cells: Cells, plane: u32) -> FarCells {
        FarCells { shooter: Shooter { cells, plane, far: FAR }, columns: [[0.0; CELLS]; 8], count: 0 }
    }

    /// Adds a cell, a disc of this area, m², if it may be near: it is a point else.
    pub fn push(&mut self, point: Vec3, normal: Vec3, intensity: f32, area: f32) {
        let values = [point.x, point.y, point.z, normal.x, normal.y, normal.z, intensity, area / PI];
        for (column, value) in self.columns.iter_mut().zip(values) {
            column[self.count] = value;
        }
        self.count += 1;
    }
}

/// What receivers get, all together.
#[derive(Clone, Copy, Debug)]
pub struct Share {
    /// Of cells that are seen.
    pub seen: f32,
    /// Of all cells above their horizons.
    pub open: f32,
}

impl Share {
    /// Whether all is seen, but for rounding.
    pub fn is_full(&self) -> bool {
        self.seen >= 0.9999 * self.open
    }
}

/// Buffers that are used again.
#[derive(Debug, Default)]
pub struct FarWork {
    /// For each chunk of receivers and each cell, what it sends to each.
    factors: Vec<[f32; LANES]>,
    /// Cells that each receiver sees.
    pub masks: Vec<u64>,
    /// What each receiver gets.
    pub received: Vec<f32>,
}

impl FarWork {
    /// Finds which cells may light which receivers, as masks, and by how much. False if none lights any.
    pub fn face(&mut self, receivers: &FarReceivers, cells: &FarCells) -> bool {
        self.masks.clear();
        self.masks.resize(receivers.names.len(), 0);
        self.factors.clear();
        self.factors.resize(receivers.names.len().div_ceil(LANES) * cells.count, [0.0; LANES]);
        pulp::Arch::new().dispatch(|| self.open(receivers, cells));
        self.masks.iter().any(|&mask| mask != 0)
    }

    /// What the receivers get from the cells that the masks have left.
    pub fn gather(&mut self, cells: &FarCells) -> Share {
        self.received.clear();
        self.received.resize(self.masks.len(), 0.0);
        let mut share = Share { seen: 0.0, open: 0.0 };
        for (chunk, (masks, received)) in self.masks.chunks(LANES).zip(self.received.chunks_mut(LANES)).enumerate() {
            let factors = &self.factors[chunk * cells.count..][..cells.count];
            for (lane, (mask, received)) in masks.iter().zip(received).enumerate() {
                let mut mask = *mask;
                share.open += factors.iter().map(|f| f[lane]).sum::<f32>();
                while mask != 0 {
                    *received += factors[mask.trailing_zeros() as usize][lane];
                    mask &= mask - 1;
                }
                share.seen += *received;
            }
        }
        share
    }

    /// Factors of all cells above the horizon, and their bits.
    #[inline(always)]
    fn open(&mut self, receivers: &FarReceivers, cells: &FarCells) {
        let FarReceivers { position, normal, plane, .. } = receivers;
        for (chunk, masks) in self.masks.chunks_mut(LANES).enumerate() {
            let first = chunk * LANES;
            let lanes = |column: &[f32]| {
                let mut values = [0.0f32; LANES];
                values[..masks.len()].copy_from_slice(&column[first..first + masks.len()]);
                values
            };
            let [x, y, z] = [0, 1, 2].map(|i| lanes(&position[i]));
            let [nx, ny, nz] = [0, 1, 2].map(|i| lanes(&normal[i]));
            let mut bits = [0u64; LANES];
            for k in 0..cells.count {
                let [cx, cy, cz, mx, my, mz, intensity, disc] = cells.columns.each_ref().map(|column| column[k]);
                let factors = &mut self.factors[chunk * cells.count + k];
                for l in 0..LANES {
                    let (dx, dy, dz) = (cx - x[l], cy - y[l], cz - z[l]);
                    let r2 = dx * dx + dy * dy + dz * dz;
                    let arriving = (dx * nx[l] + dy * ny[l] + dz * nz[l]).max(0.0);
                    let leaving = (-(dx * mx + dy * my + dz * mz)).max(0.0);
                    let factor = intensity * arriving * leaving / (r2 * (r2 + disc)).max(f32::MIN_POSITIVE);
                    factors[l] = factor;
                    bits[l] |= u64::from(factor > 0.0) << k;
                }
            }
            for (l, mask) in masks.iter_mut().enumerate() {
                let coplanar = plane[first + l] == cells.shooter.plane && cells.shooter.plane != NO_PLANE;
                *mask = if coplanar { 0 } else { bits[l] };
            }
        }
    }
}

/// Intensity of a cell of this area and radiosity.
pub fn intensity(area: f32, radiosity: f32) -> f32 {
    area * radiosity / PI
}
