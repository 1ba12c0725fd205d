//! View factors: shapes, cases and reference values that they are measured with.

pub mod cases;
pub mod references;
pub mod shapes;
pub mod view3d;
