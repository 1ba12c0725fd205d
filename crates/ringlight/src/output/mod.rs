//! Lit models, pictures, tables, reports.

mod exposure;
mod smooth;

pub use exposure::Exposure;
pub use smooth::Smooth;
