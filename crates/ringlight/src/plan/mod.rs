//! Foretells what a solve needs.

mod group;
mod memory;

pub use group::{GroupCounts, demand};
pub use memory::{Counts, MeshPlace};
