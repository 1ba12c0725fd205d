//! Lit models, pictures, tables, reports.

mod camera;
mod exposure;
mod picture;
#[cfg(test)]
mod scenes;
mod seen;
mod smooth;
mod table;
mod vtu;

pub use camera::{CameraError, Projection, View};
pub use exposure::Exposure;
pub use picture::{FalseColour, Picture, PictureOptions, Scale, Tone, Unit, render, write_exr, write_png};
pub use smooth::Smooth;
pub use table::write_table;
pub use vtu::write_vtu;
