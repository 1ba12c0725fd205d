//! Flat convex polygons, seen from one side.

use glam::DVec3;

/// A flat convex polygon; its front, from which the corners run counter-clockwise, sees and is seen.
#[derive(Clone, Debug, PartialEq)]
pub struct Polygon {
    /// Corners, metres.
    pub corners: Vec<DVec3>,
    /// Unit normal of the front.
    pub normal: DVec3,
    /// Area, m².
    pub area: f64,
    /// Plane id: polygons and occluders of one plane share it and never block each other's view.
    pub plane: u32,
}

impl Polygon {
    /// From corners in order; None if they enclose no area.
    pub fn new(corners: Vec<DVec3>, plane: u32) -> Option<Polygon> {
        let first = *corners.first()?;
        let vector = corners.windows(2).fold(DVec3::ZERO, |sum, w| sum + (w[0] - first).cross(w[1] - first)) / 2.0;
        let area = vector.length();
        (area > 0.0 && area.is_finite()).then(|| Polygon { corners, normal: vector / area, area, plane })
    }
}
