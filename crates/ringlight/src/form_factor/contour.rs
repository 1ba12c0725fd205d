//! The closed contour form of a polygon's form factor from a point.

use super::atan2;
use glam::DVec3;

/// Form factor from a point at the origin with unit normal `normal` to a polygon whose corners are given relative to the
/// point: F = |Σ θₖ (cₖ/|cₖ|)·n| / 2π with cₖ = rₖ × rₖ₊₁, θₖ = atan2(|cₖ|, rₖ·rₖ₊₁) (Lambert 1760; Baum, Rushmeier &
/// Winget 1989, equation 8). All corners must lie on or above the horizon; see [`contour`] otherwise.
pub fn polygon(corners: &[DVec3], normal: DVec3) -> f64 {
    let mut sum = 0.0;
    for (k, &r) in corners.iter().enumerate() {
        let next = corners[if k + 1 == corners.len() { 0 } else { k + 1 }];
        // r × next, from the edge: well-conditioned for short far edges.
        let cross = r.cross(next - r);
        let length = cross.length();
        if length > 0.0 {
            sum += atan2(length, r.dot(next)) / length * cross.dot(normal);
        }
    }
    sum.abs() / std::f64::consts::TAU
}

/// Form factor from `point` with unit normal `normal` to a convex polygon of three or four `corners`, metres, the part
/// below the point's horizon cut off. 0 when the point lies in the polygon's plane.
pub fn contour(point: DVec3, normal: DVec3, corners: &[DVec3]) -> f64 {
    let mut relative = [DVec3::ZERO; 4];
    let mut height = [0.0; 4];
    let count = corners.len();
    let (mut lowest, mut highest) = (f64::INFINITY, f64::NEG_INFINITY);
    for k in 0..count {
        relative[k] = corners[k] - point;
        height[k] = relative[k].dot(normal);
        (lowest, highest) = (lowest.min(height[k]), highest.max(height[k]));
    }
    if highest <= 0.0 {
        return 0.0;
    }
    if lowest >= 0.0 {
        return polygon(&relative[..count], normal);
    }
    // Clip by the horizon (Sutherland & Hodgman 1974): a convex quadrilateral gains at most one corner.
    let mut clipped = [DVec3::ZERO; 6];
    let mut n = 0;
    for k in 0..count {
        let j = if k + 1 == count { 0 } else { k + 1 };
        if height[k] >= 0.0 {
            clipped[n] = relative[k];
            n += 1;
        }
        if (height[k] >= 0.0) != (height[j] >= 0.0) {
            let t = height[k] / (height[k] - height[j]);
            clipped[n] = relative[k] + t * (relative[j] - relative[k]);
            n += 1;
        }
    }
    polygon(&clipped[..n], normal)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Howell C-factor: from a differential element to a parallel rectangle with one corner on its normal.
    fn parallel_rectangle(a: f64, b: f64, c: f64) -> f64 {
        let (x, y) = (a / c, b / c);
        let (p, q) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
        (x / p * (y / p).atan() + y / q * (x / q).atan()) / std::f64::consts::TAU
    }

    #[test]
    fn equals_the_closed_form_for_a_parallel_rectangle() {
        for (a, b, c) in [(1.0, 1.0, 1.0), (2.0, 0.5, 3.0), (10.0, 7.0, 0.1), (0.01, 0.02, 5.0)] {
            let corners = [(0., 0.), (a, 0.), (a, b), (0., b)].map(|(x, y)| DVec3::new(x, y, c));
            let f = contour(DVec3::ZERO, DVec3::Z, &corners);
            // Rounding of a cancelling sum: a few units in the last place times distance over size.
            assert!((f / parallel_rectangle(a, b, c) - 1.0).abs() < 1e-11, "{a} {b} {c}: {f}");
        }
    }

    #[test]
    fn horizon_cuts_a_perpendicular_rectangle_in_half() {
        let at = |low: f64| [(-1., low), (1., low), (1., 1.), (-1., 1.)].map(|(x, z)| DVec3::new(x, 0.7, z));
        let whole = contour(DVec3::ZERO, DVec3::Z, &at(-1.0));
        let upper = contour(DVec3::ZERO, DVec3::Z, &at(0.0));
        assert!((whole - upper).abs() < 1e-14 && whole > 0.1);
    }

    #[test]
    fn five_faces_of_a_cube_fill_the_hemisphere() {
        let n = DVec3::new(0.0, 0.0, 1.0);
        let mut sum = 0.0;
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                let corners = [(-1., -1.), (1., -1.), (1., 1.), (-1., 1.)].map(|(a, b)| {
                    let mut p = [0.0; 3];
                    (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (side, a, b);
                    DVec3::from(p)
                });
                sum += contour(DVec3::new(0.3, -0.2, 0.1), n, &corners);
            }
        }
        assert!((sum - 1.0).abs() < 1e-14, "{sum}");
    }
}
