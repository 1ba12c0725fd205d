//! A shot: what travels from the shooter's owner to all receivers.

use super::field::{Field, announced};
use super::gather::{CellTable, Parts};
use super::light::{ClusterLight, unshot_radiosity};
use crate::mesh::{Frame, Mesh, Patch};
use glam::{DVec3, Vec3};
use ringlight_visibility::Shooter;
use serde::{Deserialize, Serialize};
use std::sync::OnceLock;

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
    /// Some places of several surfaces; the light of a cell is its power over π in each direction that it faces, W/sr or cd.
    Group(Vec<CellNormal>),
    /// Parallel light or a part of the sky: cells are directions towards the light; the light of a cell is the
    /// irradiance it gives to a surface that faces it, W/m² or lux.
    Directions,
}

/// Unit normal of a cell.
pub type CellNormal = Vec3;

/// Geometry of a shooting patch.
#[derive(Clone, Debug)]
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
    /// Its cells as receivers see them, when one has asked, and what those near it see.
    pub(super) cells: OnceLock<Box<CellTable<64>>>,
    pub(super) parts: OnceLock<Box<Parts>>,
}

/// The shot of a patch with `side`² cells: its unshot light.
pub fn patch_shot(mesh: &Mesh, patch: &Patch, light: &ClusterLight, first: usize, side: u32, shoot: Shoot) -> Shot {
    let cluster_patch = &light.patches[first];
    let radiosity: Vec<[f64; 3]> = light
        .patch(mesh, patch)
        .iter()
        .enumerate()
        .map(|(k, e)| unshot_radiosity(mesh, patch, patch.first_element + k as u32, e, cluster_patch.emission_waits))
        .collect();
    Field::new(mesh, patch, &radiosity).shot(side, shoot, cluster_patch.unshot_power)
}

impl Shot {
    /// What tells others of a patch's shot, see [`Shot::from_bytes`]: its number, its power, the light of its cells.
    pub fn to_bytes(&self) -> Vec<u8> {
        let Source::Patch(source) = &self.source else { return Vec::new() };
        let mut bytes = source.patch.to_le_bytes().to_vec();
        bytes.extend_from_slice(&self.power.to_le_bytes());
        bytes.extend_from_slice(bytemuck::cast_slice(&self.light));
        bytes
    }

    /// Length of [`Shot::to_bytes`] of so many cells.
    pub fn bytes_from(cells: u32) -> usize {
        size_of::<u32>() + size_of::<f64>() + cells as usize * size_of::<CellLight>()
    }

    /// The shot of a patch of `mesh` that another rank tells of; none if the bytes are no such thing.
    pub fn from_bytes(mesh: &Mesh, bytes: &[u8]) -> Option<Shot> {
        let (patch, rest) = bytes.split_first_chunk()?;
        let (power, light) = rest.split_first_chunk()?;
        let patch = u32::from_le_bytes(*patch);
        let light: Vec<CellLight> =
            light.len().is_multiple_of(size_of::<CellLight>()).then(|| bytemuck::pod_collect_to_vec(light))?;
        let cells = [1, 4, 16, 64].contains(&light.len());
        let known = cells && (patch as usize) < mesh.patch_count();
        known.then(|| announced(&mesh.patch(patch), &light, f64::from_le_bytes(*power)))
    }
}

/// Hits in the last ten-thousandth of the way to a cell do not count.
pub const FAR: f32 = 0.9999;
