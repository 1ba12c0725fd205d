//! What ranks did for a picture.

use crate::transport::{Communicator, Failure};
use bytemuck::{Pod, Zeroable};
use serde::Serialize;

/// Tag of loads on their way to rank 0.
const LOADS: u32 = 63;

/// What a rank did for a picture, the rough one that decides exposure included.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Pod, Zeroable)]
#[repr(C)]
pub struct PictureLoad {
    /// Pixels of its part.
    pub pixels: u64,
    /// Rays of sight that it followed for them: one for each surface met, and one for the sky behind.
    pub rays: u64,
    /// Nodes and triangles that it looked at in search of what rays meet: its own rays where it holds all geometry, those of its
    /// ring where it holds a shard.
    pub searched: u64,
    /// Elements for whose light at the corners it asked, counted anew for each run of pixels.
    pub elements_asked: u64,
    /// Memory of its part of the light between sample points, bytes.
    pub light_bytes: u64,
    /// Memory of the light at sample points while that was found, bytes.
    pub light_bytes_while_found: u64,
}

impl PictureLoad {
    /// The loads of all ranks, on rank 0. Every rank calls it.
    pub(super) fn gather(self, ranks: &mut Communicator<'_>) -> Result<Option<Vec<PictureLoad>>, Failure> {
        let all = ranks.gather(0, LOADS, bytemuck::bytes_of(&self).to_vec())?;
        let read = |bytes: Vec<u8>| -> Vec<PictureLoad> { bytemuck::pod_collect_to_vec(&bytes) };
        Ok(all.map(|all| all.into_iter().flat_map(read).collect()))
    }
}

/// By how much the rank that has most exceeds the mean of all; 1 if all have as much.
pub fn max_over_mean(loads: &[PictureLoad], load: impl Fn(&PictureLoad) -> u64) -> f64 {
    let most = loads.iter().map(&load).max().unwrap_or(0);
    let sum: u64 = loads.iter().map(&load).sum();
    if sum == 0 { 1.0 } else { most as f64 * loads.len() as f64 / sum as f64 }
}
