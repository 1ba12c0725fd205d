//! Lit models, pictures, tables, reports.

mod ambient;
mod exposure;
#[cfg(test)]
mod fixture;
mod gltf;
pub mod report;
mod smooth;

pub use ambient::ambient;
pub use exposure::Exposure;
pub use gltf::{LitOptions, LitReport, write_glb, write_gltf};
pub use smooth::Smooth;
