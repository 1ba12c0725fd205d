//! Adaptive numerical integration of the point form factor's definition, ∫ cosθᵣ cosθₛ/(πr²) dA.

use crate::method::clip::split;
use glam::DVec3;
use std::f64::consts::PI;

/// Form factor from `point` with unit `normal` to the part of a convex polygon above its horizon, within about
/// `tolerance` (absolute). The point must not lie in the polygon's plane.
pub fn form_factor(point: DVec3, normal: DVec3, corners: &[DVec3], tolerance: f64) -> f64 {
    // Only what lies above the horizon: there the integrand is smooth.
    let relative: Vec<DVec3> = corners.iter().map(|corner| corner - point).collect();
    let [corners, _] = split(&relative, normal, 0.0);
    let triangles = corners.len().saturating_sub(2);
    (0..triangles)
        .map(|k| {
            let triangle = [corners[0], corners[k + 1], corners[k + 2]];
            let whole = rule(normal, triangle);
            refine(normal, triangle, whole, tolerance / triangles as f64, 0)
        })
        .sum()
}

/// Halves all edges, three times at least, until the four parts agree with the whole.
fn refine(normal: DVec3, triangle: [DVec3; 3], whole: f64, tolerance: f64, depth: u32) -> f64 {
    let [a, b, c] = triangle;
    let (ab, bc, ca) = ((a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0);
    let parts = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]];
    let values = parts.map(|part| rule(normal, part));
    let sum: f64 = values.iter().sum();
    if depth >= 3 && (sum - whole).abs() <= tolerance {
        return sum;
    }
    // Errors of the parts do not all have the same sign: half of the tolerance each is on the safe side.
    parts.iter().zip(values).map(|(part, value)| refine(normal, *part, value, tolerance / 2.0, depth + 1)).sum()
}

/// Radon's rule of seven points, exact for polynomials of degree 5 (Abramowitz & Stegun 25.4.63).
fn rule(normal: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let vector = (b - a).cross(c - a) / 2.0;
    let kernel = |way: DVec3| way.dot(normal) * way.dot(vector).abs() / (PI * way.length_squared().powi(2));
    let root = 15.0f64.sqrt();
    let mut sum = 9.0 / 40.0 * kernel((a + b + c) / 3.0);
    for sign in [-1.0, 1.0] {
        let (weight, near) = ((155.0 + sign * root) / 1200.0, (6.0 + sign * root) / 21.0);
        for (p, q, r) in [(a, b, c), (b, c, a), (c, a, b)] {
            sum += weight * kernel((1.0 - 2.0 * near) * p + near * (q + r));
        }
    }
    sum
}
