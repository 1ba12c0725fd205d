//! Lit models, pictures, tables, reports.

mod exposure;
pub mod report;
mod smooth;

pub use exposure::Exposure;
pub use smooth::Smooth;
