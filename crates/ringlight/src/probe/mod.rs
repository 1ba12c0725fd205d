//! Light at points that are no elements: work planes, calculation grids, comparisons.
//!
//! [`gather`] computes the irradiance at any point, from what all patches, lamps and the sky send there. [`surface`] reads
//! the stored light of the nearest surface, interpolated as it is displayed. Both tell where they have no answer: points
//! inside things ([`Status::Inside`]), points far from surfaces ([`Status::Far`]).

mod dealt_out;
mod gather;
mod grid;
mod nearest;
mod place;
mod sides;
mod surface;
mod table;
#[cfg(test)]
mod tests;

pub use gather::{GatherOptions, gather};
pub use grid::{Area, Grid, GridRequest, Statistics};
pub use surface::{SurfaceOptions, surface};
pub use table::{PointsError, read_points, write_readings};

use crate::quantity::Rgb;

/// A point at which the light is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// World coordinates, metres.
    pub position: [f64; 3],
    /// Direction in which the receiving side looks; any length but 0.
    pub normal: [f64; 3],
}

/// Whether there is light to tell of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// Yes.
    Ok,
    /// The point lies inside solid geometry or behind surfaces: nearly all that it sees are unlit backs, surfaces covered
    /// by others, or surfaces that no light reaches (backs of two-sided surfaces: hardly any light).
    Inside,
    /// No surface that faces the same way is near enough.
    Far,
}

impl Status {
    /// The word in tables.
    pub fn word(self) -> &'static str {
        match self {
            Status::Ok => "ok",
            Status::Inside => "inside",
            Status::Far => "far",
        }
    }
}

/// What is found at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Irradiance, W/m² or lux; 0 unless the status is [`Status::Ok`].
    pub irradiance: Rgb,
    /// Whether it means anything.
    pub status: Status,
}

impl Reading {
    fn without_light(status: Status) -> Reading {
        Reading { irradiance: [0.0; 3], status }
    }
}
