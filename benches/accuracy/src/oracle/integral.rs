//! Adaptive numerical integration of the point form factor's definition, ∫ cosθᵣ cosθₛ/(πr²) dA.

use glam::DVec3;
use std::f64::consts::PI;

/// Form factor from `point` with unit `normal` to a convex polygon that faces it, within about `tolerance` (absolute).
pub fn form_factor(point: DVec3, normal: DVec3, corners: &[DVec3], tolerance: f64) -> f64 {
    let triangles = corners.len() - 2;
    (0..triangles)
        .map(|k| {
            let triangle = [corners[0], corners[k + 1], corners[k + 2]];
            let whole = rule(point, normal, triangle);
            refine(point, normal, triangle, whole, tolerance / triangles as f64, 0)
        })
        .sum()
}

/// Halves all edges until the four parts agree with the whole. Where the horizon cuts, that takes long: the depth ends it
/// when a triangle is a billionth of the first in width.
fn refine(point: DVec3, normal: DVec3, triangle: [DVec3; 3], whole: f64, tolerance: f64, depth: u32) -> f64 {
    let [a, b, c] = triangle;
    let (ab, bc, ca) = ((a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0);
    let parts = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]];
    let values = parts.map(|part| rule(point, normal, part));
    let sum: f64 = values.iter().sum();
    if depth > 0 && (sum - whole).abs() <= tolerance || depth == 30 {
        return sum;
    }
    // Errors of the parts do not all have the same sign: half of the tolerance each is on the safe side.
    parts.iter().zip(values).map(|(part, value)| refine(point, normal, *part, value, tolerance / 2.0, depth + 1)).sum()
}

/// Radon's rule of seven points, exact for polynomials of degree 5 (Abramowitz & Stegun 25.4.63).
fn rule(point: DVec3, normal: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let vector = (b - a).cross(c - a) / 2.0;
    let kernel = |p: DVec3| {
        let way = p - point;
        let r2 = way.length_squared();
        if r2 == 0.0 { 0.0 } else { way.dot(normal).max(0.0) * way.dot(vector).abs() / (PI * r2 * r2) }
    };
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
