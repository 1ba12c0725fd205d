//! Foretells what a solve needs.

mod memory;

pub use memory::{Counts, MeshPlace};
