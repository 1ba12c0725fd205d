//! Form factors from a receiving point to a shooter, as the point sees it: no area ratio appears.

mod arctangent;
mod contour;
pub mod reference;

pub use arctangent::atan2;
pub use contour::{contour, polygon};
