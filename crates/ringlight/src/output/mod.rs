//! Lit models, pictures, tables, reports.

mod ambient;
mod camera;
mod exposure;
mod factors;
#[cfg(test)]
pub(crate) mod fixture;
mod gltf;
mod picture;
pub mod report;
#[cfg(test)]
mod scenes;
mod seen;
mod table;
mod vtu;

pub use ambient::{AmbientSums, ambient};
pub use camera::{CameraError, Projection, View};
pub use exposure::Exposure;
pub use factors::{FactorForm, FactorValue, FactorWriter};
pub use gltf::{LitOptions, LitReport, check_glb, write_glb, write_gltf};
pub use picture::{
    Drawn, FalseColour, Picture, PictureLoad, PictureOptions, Scale, Split, Tone, Unit, grid_picture, render,
    write_exr, write_png,
};
pub use table::write_table;
pub use vtu::write_vtu;
