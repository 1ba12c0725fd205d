//! View factors: the cases that they are measured on.

pub mod cases;
pub mod references;
