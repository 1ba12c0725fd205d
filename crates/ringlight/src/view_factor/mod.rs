//! Area-averaged form factors (view factors) between polygons, faces and objects. Knows no light.
//!
//! Geometry is held in double precision, straight from the scene: no mesh, no elements.

mod polygon;

pub use polygon::Polygon;

/// A factor with the estimate of its error, both as exchange areas A₁F₁₂ = A₂F₂₁, m²: the one number that belongs to the
/// pair. Divide by the area of the side from which it is looked at.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Exchange {
    /// A·F, m².
    pub area: f64,
    /// What it may be off by, m².
    pub error: f64,
}

/// How good a factor is to be: its error is to stay below `relative`·F or `absolute`, whichever is larger.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// Share of F.
    pub relative: f64,
    /// Of F itself, seen from the smaller of the two polygons.
    pub absolute: f64,
}
