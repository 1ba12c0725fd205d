//! The double integral of ln r along two straight edges, of which the contour form of a factor is made.

use super::quadrature::{MOST, points_needed, rule};
use crate::form_factor::atan2;
use glam::DVec3;

/// Edges whose directions differ by less than this (radians) are taken as parallel.
const PARALLEL: f64 = 1e-11;

/// Where a corner lies on the other edge, pieces are halved towards it down to this share of the edge. The integrand goes
/// as x ln x there, of which the rule misses about 1e-5 x²: a share of 1e-13.
const SMALLEST_PIECE: f64 = 1e-4;

/// ∫∫ ln r dr·dr′ along the directed edges `a` and `b`: one pair's part of the contour form (Sparrow 1963;
/// Schröder & Hanrahan 1993, equation 5).
pub(crate) fn pair(a: [DVec3; 2], b: [DVec3; 2]) -> f64 {
    let (along_a, along_b) = (a[1] - a[0], b[1] - b[0]);
    let (length_a, length_b) = (along_a.length(), along_b.length());
    let dot = along_a.dot(along_b);
    let scale = length_a * length_b;
    // Perpendicular edges add nothing.
    if dot.abs() <= 1e-15 * scale {
        return 0.0;
    }
    if along_a.cross(along_b).length_squared() <= (PARALLEL * scale) * (PARALLEL * scale) {
        return dot.signum() * parallel(a, b, along_a / length_a, dot.signum());
    }
    // The integral along one edge in closed form, along the shorter one by quadrature.
    let (outer, inner, length) = if length_a <= length_b { (a, b, length_a) } else { (b, a, length_b) };
    dot / scale * skew(outer, inner, length, length_a.max(length_b))
}

/// ∫∫ ln r ds dt in closed form for parallel edges; `b` runs along `direction` times `sign`. Overlapping collinear edges and
/// common corners included.
fn parallel(a: [DVec3; 2], b: [DVec3; 2], direction: DVec3, sign: f64) -> f64 {
    let height = 0.5 * ((b[0] - a[0]).cross(direction).length() + (b[1] - a[1]).cross(direction).length());
    let h2 = height * height;
    // ∫∫ ln √(u² + h²) du du = ¼(u² − h²) ln(u² + h²) + u h atan(u/h) − ¾u².
    let second_integral = |u: f64, r2: f64| {
        if r2 == 0.0 {
            return 0.0;
        }
        0.25 * (u * u - h2) * libm::log(r2) + u.abs() * height * atan2(u.abs(), height) - 0.75 * u * u
    };
    let at = |i: usize, j: usize| {
        let r = b[j] - a[i];
        second_integral(r.dot(direction), r.length_squared())
    };
    sign * ((at(0, 1) - at(1, 1)) - (at(0, 0) - at(1, 0)))
}

/// ∫∫ ln r ds dt for edges that are not parallel: along `inner` in closed form, along `outer` by Gauss–Legendre rules on pieces
/// that get smaller towards the places beside which the integrand is singular in the complex plane.
fn skew(outer: [DVec3; 2], inner: [DVec3; 2], length: f64, inner_length: f64) -> f64 {
    let direction = (outer[1] - outer[0]) / length;
    let inner_direction = (inner[1] - inner[0]) / inner_length;
    // Singularities: the place along the edge, and the distance from it. Inner's corners, where the logarithms end,
    let end = |corner: DVec3| {
        let r = corner - outer[0];
        (r.dot(direction), r.cross(direction).length())
    };
    // and where inner passes by, its closest point between its corners: there the distance from its line is √(h² + s² sin²φ).
    let normal = direction.cross(inner_direction);
    let (r, sine2) = (inner[0] - outer[0], normal.length_squared());
    let passing = (r.cross(inner_direction).dot(normal) / sine2, r.dot(normal).abs() / sine2);
    let along_inner = r.cross(direction).dot(normal) / sine2;
    let passes = (0.0..=inner_length).contains(&along_inner);
    let singular = [end(inner[0]), end(inner[1]), if passes { passing } else { end(inner[0]) }];
    let mut sum = 0.0;
    // Ends of the pieces still to do, the next piece last.
    let mut ends = [0.0; 40];
    (ends[0], ends[1]) = (length, 0.0);
    let mut left = 1;
    while left > 0 {
        let (low, high) = (ends[left], ends[left - 1]);
        let half = 0.5 * (high - low);
        let distances = |(place, height): (f64, f64)| {
            let to = |end: f64| ((place - end) * (place - end) + height * height).sqrt();
            (to(low) + to(high)) / half
        };
        let needed = points_needed(singular.map(distances).into_iter().fold(f64::INFINITY, f64::min));
        if needed > MOST && high - low > SMALLEST_PIECE * length {
            ends[left] = low + half;
            left += 1;
            ends[left] = low;
            continue;
        }
        for &(x, weight) in rule(needed.min(MOST)) {
            let point = outer[0] + (low + half * (1.0 + x)) * direction;
            sum += weight * half * along(point, inner, inner_direction, inner_length);
        }
        left -= 1;
    }
    sum
}

/// ∫ ln r dt from a point along an edge.
fn along(point: DVec3, edge: [DVec3; 2], direction: DVec3, length: f64) -> f64 {
    let (r0, r1) = (edge[0] - point, edge[1] - point);
    let (u0, u1) = (r0.dot(direction), r1.dot(direction));
    let height = r0.cross(direction).length();
    let log = |u: f64, r: DVec3| {
        let r2 = r.length_squared();
        if r2 == 0.0 { 0.0 } else { 0.5 * u * libm::log(r2) }
    };
    let angle = atan2(height * length, height * height + u0 * u1);
    log(u1, r1) - log(u0, r0) - length + height * angle
}
