//! Oracles: slow, obvious ways to the numbers that the library finds fast.
//!
//! None of them calls what it checks. They share with the library what defines a discretisation (where patches, elements,
//! cells and samples lie) and nothing that computes light on it.

mod dense;
pub mod integral;
mod interpolation;
pub mod kernel;
pub mod scenes;

pub use dense::{Dense, Solution};
