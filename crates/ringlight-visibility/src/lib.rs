//! Visibility for radiosity: which of a shooter's cells each sample point sees.
//!
//! A shooter is M weighted cells. What a receiver sees of it is an M-bit mask. Occluders, wherever they live, only
//! *clear* bits; masks are joined by AND. The one primitive for light is [`Hierarchy::clear_blocked`], the one for
//! pictures, probes and buried points is [`Hierarchy::nearest_hit`].
//!
//! This crate knows no light and no ranks. Coordinates are `f32`, in metres, near the origin (the caller subtracts the
//! scene's centre).

#![forbid(unsafe_code)]

mod beam;
mod boxes;
mod build;
mod descent;
mod grid;
mod hierarchy;
mod instruction_set;
mod items;
mod kernel;
mod lanes;
mod mask;
mod nearest;
mod packet;
mod plan;
mod predicate;
pub mod reference;
mod region;
mod scattered;
mod shadow;
mod shaft;
mod shaft_region;
mod shafts;
mod shooter;
mod sieve;
mod spans;
mod triangle;

pub use boxes::Boxes;
pub use hierarchy::{Hierarchy, Hit, Ray, Tally};
pub use instruction_set::InstructionSet;
pub use nearest::searched;
pub use plan::PreparedShooter;
pub use region::HalfSpace;
pub use shaft_region::Region;
pub use shooter::{Cells, Grid, Layout, Shooter};
pub use triangle::{Bitmap, Filter, Triangle};

/// Plane id that exempts nothing.
pub const NO_PLANE: u32 = u32::MAX;

/// Filter index of an opaque triangle.
pub const OPAQUE: u32 = u32::MAX;

/// The largest number of cells of a shooter, and of bits in a mask.
pub const MAX_CELLS: usize = 64;

/// Sample points tested together, structure of arrays; all slices have the same length.
#[derive(Clone, Copy, Debug)]
pub struct Points<'a> {
    /// Coordinates x, metres.
    pub x: &'a [f32],
    /// Coordinates y, metres.
    pub y: &'a [f32],
    /// Coordinates z, metres.
    pub z: &'a [f32],
    /// Plane of the surface each point lies on: triangles with this plane id never block it; [`NO_PLANE`] if none.
    pub plane: &'a [u32],
}

impl Points<'_> {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.x.is_empty()
    }

    /// Point `i`.
    pub fn at(&self, i: usize) -> [f32; 3] {
        [self.x[i], self.y[i], self.z[i]]
    }
}
