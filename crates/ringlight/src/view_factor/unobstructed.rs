//! The factor of two polygons with nothing between them, to about the last digits.
//!
//! Three ways, whichever is cheapest for the pair's shape: far from each other, a product of Gauss–Legendre rules; where one of them
//! is small for its distance, its rule over the closed point-to-polygon form; near each other, the contour form
//! A₁F₁₂ = 1/2π ∮∮ ln r dr₁·dr₂.

use super::edges;
use super::quadrature::{MOST, points_needed, rule};
use crate::form_factor;
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// Flat convex polygon of a pair: each lies wholly in front of the other. Lengths in a unit near the pair's size.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Face<'a> {
    /// Corners, counter-clockwise.
    pub corners: &'a [DVec3],
    /// Unit normal.
    pub normal: DVec3,
}

/// Room for intermediate results.
#[derive(Debug, Default)]
pub(crate) struct Scratch {
    points: [Vec<Sample>; 2],
    relative: Vec<DVec3>,
}

/// A point of a rule over a polygon.
#[derive(Clone, Copy, Debug)]
struct Sample {
    place: DVec3,
    /// Area that it stands for.
    area: f64,
}

/// Costs in units of one evaluation of cosθ cosθ′/r⁴, measured: a corner of the point-to-polygon form, a pair of edges.
const COST_CORNER: usize = 25;
const COST_EDGES: usize = 200;

/// Largest order of a rule over a polygon; above, the contour form is both faster and exact.
const LARGEST_ORDER: usize = 8;

/// A·F of the pair and its rounding error, in the pair's unit squared. `a` and `b` in the order that the caller wants the
/// arithmetic to have.
pub(crate) fn exchange(a: Face, b: Face, scratch: &mut Scratch) -> (f64, f64) {
    let (count_a, count_b) = (samples(a, b, &mut scratch.points[0]), samples(b, a, &mut scratch.points[1]));
    let contour = COST_EDGES * a.corners.len() * b.corners.len();
    let cost = |count: Option<usize>, each: usize| count.map_or(usize::MAX, |n| n.saturating_mul(each));
    let both = cost(count_a.zip(count_b).map(|(n, m)| n * m), 1);
    let from_a = cost(count_a, COST_CORNER * b.corners.len());
    let from_b = cost(count_b, COST_CORNER * a.corners.len());
    let [points_a, points_b] = &scratch.points;
    let mut least = contour.min(both).min(from_a).min(from_b);
    if least == contour {
        // Its terms are as large as the pair and cancel; where little is left, a rule is better.
        let area = double_contour(a, b);
        let rounding = CONTOUR_ROUNDING * (a.corners.len() * b.corners.len()) as f64;
        least = both.min(from_a).min(from_b);
        if least == usize::MAX || rounding <= PRECISE * area {
            return with_error(area, rounding);
        }
    }
    if least == both {
        with_error(product(a, points_a, b, points_b), 0.0)
    } else if least == from_a {
        with_error(from_points(a, points_a, b, &mut scratch.relative), POINT_ROUNDING * total(points_a))
    } else {
        with_error(from_points(b, points_b, a, &mut scratch.relative), POINT_ROUNDING * total(points_b))
    }
}

/// What the rules are good to, as a share of the result.
const PRECISE: f64 = 1e-10;

/// What a pair of edges rounds in the contour form, in the unit squared.
const CONTOUR_ROUNDING: f64 = 4.0 * f64::EPSILON;

fn with_error(area: f64, rounding: f64) -> (f64, f64) {
    let area = area.max(0.0);
    (area, PRECISE * area + rounding)
}

/// What the point-to-polygon form rounds, absolutely: its angles are added with both signs.
const POINT_ROUNDING: f64 = 4.0 * f64::EPSILON;

fn total(samples: &[Sample]) -> f64 {
    samples.iter().map(|s| s.area).sum()
}

/// Fills `samples` with a rule over `a` that suits the distance of `b`; None if that would be too large.
fn samples(a: Face, b: Face, samples: &mut Vec<Sample>) -> Option<usize> {
    samples.clear();
    let last = a.corners.len() - 1;
    for k in (1..last).step_by(2) {
        // Two triangles of the fan, or the last one as a quadrilateral with a corner twice.
        let quad = [a.corners[0], a.corners[k], a.corners[k + 1], a.corners[(k + 2).min(last)]];
        let centre = (quad[0] + quad[1] + quad[2] + quad[3]) / 4.0;
        let half = |p: DVec3, q: DVec3| 0.5 * p.distance(q);
        let u = half(quad[0], quad[1]).max(half(quad[3], quad[2]));
        let v = half(quad[0], quad[3]).max(half(quad[1], quad[2]));
        let distance = distance(centre, b.corners, b.normal);
        let order = |half: f64, other: f64| {
            let n = points_needed(2.0 * ((distance - other) / half).max(1.0));
            (n <= LARGEST_ORDER.min(MOST)).then_some(n)
        };
        let (n, m) = (order(u, v)?, order(v, u)?);
        for &(x, weight_x) in rule(n) {
            for &(y, weight_y) in rule(m) {
                let (s, t) = (0.5 * (1.0 + x), 0.5 * (1.0 + y));
                let (low, high) = (quad[0].lerp(quad[1], s), quad[3].lerp(quad[2], s));
                let along_s = (quad[1] - quad[0]).lerp(quad[2] - quad[3], t);
                let area = 0.25 * weight_x * weight_y * along_s.cross(high - low).dot(a.normal);
                samples.push(Sample { place: low.lerp(high, t), area });
            }
        }
    }
    Some(samples.len())
}

/// Distance of a point from a convex polygon.
fn distance(point: DVec3, corners: &[DVec3], normal: DVec3) -> f64 {
    let mut inside = true;
    let mut nearest = f64::INFINITY;
    for (k, &p) in corners.iter().enumerate() {
        let edge = corners[if k + 1 == corners.len() { 0 } else { k + 1 }] - p;
        let r = point - p;
        inside &= normal.cross(edge).dot(r) >= 0.0;
        let t = (r.dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
        nearest = nearest.min((r - t * edge).length_squared());
    }
    if inside { (point - corners[0]).dot(normal).abs() } else { nearest.sqrt() }
}

/// ∫∫ cosθ cosθ′ / πr² by the two rules.
fn product(a: Face, points_a: &[Sample], b: Face, points_b: &[Sample]) -> f64 {
    let mut sum = 0.0;
    for p in points_a {
        let mut row = 0.0;
        for q in points_b {
            let r = q.place - p.place;
            let r2 = r.length_squared();
            row += q.area * r.dot(a.normal) * -r.dot(b.normal) / (r2 * r2);
        }
        sum += p.area * row;
    }
    sum / PI
}

/// ∫ F(x) over `a` by its rule.
fn from_points(a: Face, points: &[Sample], b: Face, relative: &mut Vec<DVec3>) -> f64 {
    let mut sum = 0.0;
    for p in points {
        relative.clear();
        relative.extend(b.corners.iter().map(|&c| c - p.place));
        sum += p.area * form_factor::polygon(relative, a.normal);
    }
    sum
}

/// The contour form.
fn double_contour(a: Face, b: Face) -> f64 {
    let edge = |f: Face, k: usize| [f.corners[k], f.corners[if k + 1 == f.corners.len() { 0 } else { k + 1 }]];
    let pairs = (0..a.corners.len()).flat_map(|i| (0..b.corners.len()).map(move |j| (i, j)));
    pairs.map(|(i, j)| edges::pair(edge(a, i), edge(b, j))).sum::<f64>() / TAU
}
