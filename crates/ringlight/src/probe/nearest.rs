//! Closest points of facets and patches.

use crate::mesh::Facet;
use glam::DVec3;

/// The point of a convex polygon with unit normal `normal` that is nearest to `point`. Corners run counter-clockwise about
/// the normal.
pub fn closest_point(corners: &[DVec3], normal: DVec3, point: DVec3) -> DVec3 {
    let projected = point - normal.dot(point - corners[0]) * normal;
    let edges = || corners.iter().zip(corners.iter().cycle().skip(1));
    let within = edges().all(|(&a, &b)| (b - a).cross(projected - a).dot(normal) >= 0.0);
    if within {
        return projected;
    }
    let mut best = (f64::INFINITY, projected);
    for (&a, &b) in edges() {
        let edge = b - a;
        let t = ((point - a).dot(edge) / edge.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        let on = a + t * edge;
        let distance = (on - point).length_squared();
        if distance < best.0 {
            best = (distance, on);
        }
    }
    best.1
}

/// The unit normal of a facet's front, and its point nearest to `point`.
pub fn closest_on_facet(facet: &Facet, point: DVec3) -> (DVec3, DVec3) {
    let frame = facet.frame();
    let normal = frame.area_vector().normalize();
    let (corners, count) = frame.corners();
    (normal, closest_point(&corners[..count], normal, point))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_closest_point_is_the_best_of_many() {
        let corners = [(0., 0.), (4., 0.), (3., 2.), (1., 3.)].map(|(x, y)| DVec3::new(x, y, 0.5));
        let frame = crate::mesh::Frame::from_corners(&corners);
        for k in 0..60 {
            let t = f64::from(k);
            let point = DVec3::new((t * 0.7).sin() * 5.0, (t * 1.3).cos() * 4.0, (t * 0.3).sin());
            let found = (closest_point(&corners, DVec3::Z, point) - point).length();
            let mut best = f64::INFINITY;
            for i in 0..=200 {
                for j in 0..=200 {
                    let at = frame.at(glam::DVec2::new(f64::from(i), f64::from(j)) / 200.0);
                    best = best.min((at - point).length());
                }
            }
            // The grid of comparison has steps of 0.02 m.
            assert!(found <= best + 1e-12 && best - found < 0.015, "{point}: {found} for {best}");
        }
    }
}
