//! Ways to a form factor with obstacles: the exact one, and those that other renderers took.

pub mod clip;
pub mod disc_sum;
pub mod exact;
pub mod hemicube;
