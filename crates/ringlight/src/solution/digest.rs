//! The digest: one line that says whether two solutions hold the same bits.

use crate::shooting::ClusterLight;
use crate::solve::State;
use rayon::prelude::*;

/// A hash of per-cluster hashes of the light, hexadecimal.
pub fn digest(state: &State) -> String {
    let hashes: Vec<blake3::Hash> = state.clusters.par_iter().map(cluster_hash).collect();
    let mut all = blake3::Hasher::new();
    for hash in &hashes {
        all.update(hash.as_bytes());
    }
    all.update(&state.shots.to_le_bytes());
    all.finalize().to_hex().to_string()
}

fn cluster_hash(light: &ClusterLight) -> blake3::Hash {
    let mut hasher = blake3::Hasher::new();
    hasher.update(bytemuck::cast_slice(&light.elements));
    for patch in &light.patches {
        hasher.update(&[u8::from(patch.emission_waits)]);
    }
    hasher.finalize()
}
