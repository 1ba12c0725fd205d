//! The digest: one line that says whether two solutions hold the same bits.

use super::Solution;
use rayon::prelude::*;

/// A hash of per-cluster hashes of the light, hexadecimal.
pub fn digest(solution: &Solution) -> String {
    let clusters = &solution.mesh.clusters;
    let hash = |c: usize| blake3::hash(&solution.light.bytes(&clusters[c..=c]));
    let hashes: Vec<blake3::Hash> = (0..clusters.len()).into_par_iter().map(hash).collect();
    let mut all = blake3::Hasher::new();
    hashes.iter().for_each(|hash| _ = all.update(hash.as_bytes()));
    finish(all, solution.ledger.shots)
}

/// The digest, once all hashes of clusters have been fed.
pub(super) fn finish(mut all: blake3::Hasher, shots: u64) -> String {
    all.update(&shots.to_le_bytes());
    all.finalize().to_hex().to_string()
}
