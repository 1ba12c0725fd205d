//! The factor of two polygons with occluders between them: the exact factor from a point, integrated over one polygon by
//! adaptive subdivision.
//!
//! A piece that nothing stands before, or that one blocker hides wholly, is done in closed form. Elsewhere F(x) has kinks where
//! shadows begin, so a rule's own estimate of its error leads the subdivision: the worst piece is halved until the estimates
//! add up to less than the tolerance, or until as much work is done as a pair may take. Pieces with very many blockers take
//! rays for exact clipping, with what those may err by in the estimate.

use super::clip::area_vector;
use super::hull::{Side, hull, reaches_into};
use super::sampled::{self, Rays, SHARE_ERROR};
use super::shadow::{self, Blocker, Seen};
use super::unobstructed::{self, Face};
use glam::DVec3;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Pieces below this depth are halved however smooth they look, unless all that they could receive is below the tolerance.
const LEAST_DEPTH: u32 = 2;

/// Most pieces of a pair.
const MOST_PIECES: usize = 4000;

/// Most blockers that samples are tested against, over all samples of a pair.
const MOST_TESTS: usize = 1_000_000;

/// Most blockers of a piece for exact clipping, and how many of them rays cost as much as. The fragments of what is seen grow in
/// number with the blockers, so that clipping by 40 of them takes as long as a thousand rays.
const MOST_CLIPPED: usize = 40;
const COST_OF_RAYS: usize = 60;

/// Blockers that are culled in the time of one such test.
const COST_OF_CULL: usize = 4;

/// Blockers, the largest first, that are tried as the one that hides everything.
const MOST_COVERS: usize = 32;

/// Samples of the rule.
const SAMPLES: usize = 7;

/// What a pair's integral is made of.
pub(crate) struct Scene<'a> {
    /// Polygon that is integrated over.
    pub outer: Face<'a>,
    /// Polygon that is looked at.
    pub target: Face<'a>,
    /// What may stand between.
    pub blockers: &'a [Blocker],
    /// The same by rays.
    pub rays: Rays<'a>,
    /// What counts as 0 in heights.
    pub flat: f64,
    /// A·F that does not matter.
    pub least: f64,
}

/// Room for intermediate results.
#[derive(Debug, Default)]
pub(crate) struct Scratch {
    shadow: shadow::Scratch,
    sides: Vec<Side>,
    spare: [Vec<DVec3>; 2],
}

/// A triangle of the outer polygon.
#[derive(Debug)]
struct Piece {
    corners: [DVec3; 3],
    depth: u32,
    /// Numbers of the blockers that reach into the hull of the piece and the target.
    blockers: Vec<u32>,
    value: f64,
    /// Estimate of what the rule misses, which halving makes smaller.
    error: f64,
    /// Estimate of what the samples' own values are off by, which it does not.
    floor: f64,
    number: usize,
}

impl PartialEq for Piece {
    fn eq(&self, other: &Piece) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Piece {}

impl PartialOrd for Piece {
    fn partial_cmp(&self, other: &Piece) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Piece {
    /// The largest error first, then the oldest.
    fn cmp(&self, other: &Piece) -> Ordering {
        self.error.total_cmp(&other.error).then(other.number.cmp(&self.number))
    }
}

/// A·F and the estimate of its error; stops once that is below `tolerance` of the value found so far.
pub(crate) fn exchange(
    scene: &Scene,
    tolerance: impl Fn(f64) -> f64,
    scratch: &mut Scratch,
    open: &mut unobstructed::Scratch,
) -> (f64, f64) {
    let mut tests = 0;
    let mut heap = BinaryHeap::new();
    let mut done = Sum::default();
    let corners = scene.outer.corners;
    let all: Vec<u32> = (0..scene.blockers.len() as u32).collect();
    let mut waiting: Vec<([DVec3; 3], u32, Vec<u32>)> =
        (1..corners.len() - 1).rev().map(|k| ([corners[0], corners[k], corners[k + 1]], 0, all.clone())).collect();
    let mut number = 0;
    let (mut value, mut error) = (0.0, 0.0);
    loop {
        while let Some((corners, depth, blockers)) = waiting.pop() {
            let mut piece = Piece { corners, depth, blockers, value: 0.0, error: 0.0, floor: 0.0, number };
            number += 1;
            let halve = evaluate(&mut piece, scene, &mut tests, scratch, open);
            if halve && number < MOST_PIECES {
                waiting.extend(halves(piece));
            } else {
                value += piece.value;
                error += piece.error;
                if piece.blockers.is_empty() {
                    done = done.with(&piece);
                } else {
                    heap.push(piece);
                }
            }
        }
        if error <= tolerance(value) || number >= MOST_PIECES || tests >= MOST_TESTS {
            break;
        }
        let Some(worst) = heap.pop() else { break };
        value -= worst.value;
        error -= worst.error;
        waiting.extend(halves(worst));
    }
    // Summed anew, in the order of their numbers, free of what the running sums have rounded.
    let mut pieces = heap.into_vec();
    pieces.sort_unstable_by_key(|piece| piece.number);
    let sum = pieces.iter().fold(done, Sum::with);
    (sum.value, sum.error)
}

/// Of pieces.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    value: f64,
    error: f64,
}

impl Sum {
    fn with(self, piece: &Piece) -> Sum {
        Sum { value: self.value + piece.value, error: self.error + piece.error + piece.floor }
    }
}

/// Two halves, cut at the longest edge (Rivara 1984).
fn halves(piece: Piece) -> [([DVec3; 3], u32, Vec<u32>); 2] {
    let length = |k: usize| piece.corners[k].distance_squared(piece.corners[(k + 1) % 3]);
    let longest = (1..3).fold(0, |best, k| if length(k) > length(best) { k } else { best });
    let [p, q, r] = [0, 1, 2].map(|k| piece.corners[(longest + k) % 3]);
    let middle = p.midpoint(q);
    let depth = piece.depth + 1;
    [([middle, q, r], depth, piece.blockers.clone()), ([p, middle, r], depth, piece.blockers)]
}

/// Fills in a piece's blockers, value and error; whether it is to be halved in any case.
fn evaluate(
    piece: &mut Piece,
    scene: &Scene,
    tests: &mut usize,
    scratch: &mut Scratch,
    open: &mut unobstructed::Scratch,
) -> bool {
    let (target, flat) = (scene.target, scene.flat);
    let face = Face { corners: &piece.corners, normal: scene.outer.normal };
    hull(face, target, flat, &mut scratch.sides);
    let blocker = |&i: &u32| &scene.blockers[i as usize];
    piece.blockers.retain(|i| reaches_into(blocker(i).corners(), &scratch.sides, flat, &mut scratch.spare));
    *tests += piece.blockers.len() / COST_OF_CULL;
    let whole = unobstructed::exchange(face, target, open);
    if piece.blockers.is_empty() {
        (piece.value, piece.error) = whole;
        return false;
    }
    if piece.blockers.iter().take(MOST_COVERS).any(|i| blocker(i).covers(&piece.corners, target.corners, flat)) {
        piece.blockers.clear();
        return false;
    }
    if piece.depth < LEAST_DEPTH && whole.0 > scene.least {
        // Where no piece more may be made, all that it could receive is in doubt.
        piece.error = whole.0 + whole.1;
        return true;
    }
    let area = 0.5 * (piece.corners[1] - piece.corners[0]).cross(piece.corners[2] - piece.corners[0]).length();
    let points = RULE.map(|(weights, _)| (0..3).map(|i| weights[i] * piece.corners[i]).sum());
    let clipped = piece.blockers.len() <= MOST_CLIPPED;
    let samples: [Seen; SAMPLES] = look(points, piece, scene, &mut scratch.shadow);
    *tests += SAMPLES * if clipped { piece.blockers.len() } else { COST_OF_RAYS };
    // Either what is seen is integrated, or what is hidden, and taken from the closed form: whichever is smoother.
    let (seen, seen_error) = integrate(samples.map(|s| s.visible));
    let (hidden, hidden_error) = integrate(samples.map(|s| s.whole - s.visible));
    (piece.value, piece.error) = if seen_error <= hidden_error {
        (area * seen, area * seen_error)
    } else {
        ((whole.0 - area * hidden).max(0.0), area * hidden_error + whole.1)
    };
    if !clipped {
        // By so much the rules differ even where F is smooth; and the samples' errors have either sign.
        let noise = area * SHARE_ERROR * seen.min(hidden).max(0.0);
        piece.error = (piece.error - noise).max(0.0);
        piece.floor = noise / (SAMPLES as f64).sqrt();
    }
    if seen == 0.0 || hidden == 0.0 {
        // Light or shadow may yet reach in from a corner,
        let corners = look(piece.corners, piece, scene, &mut scratch.shadow);
        let mean = |of: fn(&Seen) -> f64| corners.iter().map(of).sum::<f64>() / 3.0;
        piece.error += area * if seen == 0.0 { mean(|s| s.visible) } else { mean(|s| s.whole - s.visible) };
        *tests += 3 * piece.blockers.len();
    }
    if hidden == 0.0 {
        // and blockers that no sample's view meets may hide something between the samples: at most what they receive.
        let most: f64 = piece.blockers.iter().map(|i| area_vector(blocker(i).corners()).length()).sum();
        piece.error += UNSEEN * most.min(whole.0);
    }
    false
}

/// What points of a piece see of the target.
fn look<const N: usize>(points: [DVec3; N], piece: &Piece, scene: &Scene, scratch: &mut shadow::Scratch) -> [Seen; N] {
    let normal = scene.outer.normal;
    if piece.blockers.len() > MOST_CLIPPED {
        return sampled::seen(points, normal, scene.target, scene.rays);
    }
    points.map(|point| {
        let blockers = piece.blockers.iter().map(|&i| &scene.blockers[i as usize]);
        shadow::seen(point, normal, scene.target.corners, blockers, scene.flat, scratch)
    })
}

/// Share of what unseen blockers could hide at most that is taken as the error.
const UNSEEN: f64 = 0.1;

/// Radon's rule of degree 5 on a triangle (Abramowitz & Stegun 25.4.63): barycentric weights of the samples, and their share of the area.
const RULE: [([f64; 3], f64); SAMPLES] = [
    ([1.0 / 3.0; 3], 0.225),
    ([1.0 - 2.0 * NEAR_CORNER, NEAR_CORNER, NEAR_CORNER], NEAR_CORNER_SHARE),
    ([NEAR_CORNER, 1.0 - 2.0 * NEAR_CORNER, NEAR_CORNER], NEAR_CORNER_SHARE),
    ([NEAR_CORNER, NEAR_CORNER, 1.0 - 2.0 * NEAR_CORNER], NEAR_CORNER_SHARE),
    ([1.0 - 2.0 * NEAR_EDGE, NEAR_EDGE, NEAR_EDGE], NEAR_EDGE_SHARE),
    ([NEAR_EDGE, 1.0 - 2.0 * NEAR_EDGE, NEAR_EDGE], NEAR_EDGE_SHARE),
    ([NEAR_EDGE, NEAR_EDGE, 1.0 - 2.0 * NEAR_EDGE], NEAR_EDGE_SHARE),
];

/// (6 − √15)/21, (155 − √15)/1200; (6 + √15)/21, (155 + √15)/1200.
const NEAR_CORNER: f64 = 0.101_286_507_323_456_34;
const NEAR_CORNER_SHARE: f64 = 0.125_939_180_544_827_15;
const NEAR_EDGE: f64 = 0.470_142_064_105_115_1;
const NEAR_EDGE_SHARE: f64 = 0.132_394_152_788_506_2;

/// Mean over the triangle, and by how much the rules of degree 2 that lie in the rule differ from it: the centroid with the
/// samples near the corners, and with those near the edges.
fn integrate(values: [f64; SAMPLES]) -> (f64, f64) {
    let mean: f64 = RULE.iter().zip(values).map(|((_, share), value)| share * value).sum();
    let lower = |near: f64, sum: f64| {
        // Exact for second moments, 1/6 over the triangle and 6(1/3 − near)² at these samples.
        let share = 1.0 / (36.0 * (1.0 / 3.0 - near) * (1.0 / 3.0 - near));
        (1.0 - share) * values[0] + share * sum / 3.0
    };
    let corners = lower(NEAR_CORNER, values[1] + values[2] + values[3]);
    let edges = lower(NEAR_EDGE, values[4] + values[5] + values[6]);
    (mean, (mean - corners).abs().max((mean - edges).abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rule_is_exact_to_degree_five_and_its_estimate_to_degree_two() {
        let moment = |i: i32, j: i32, k: i32| {
            let factorial = |n: i32| (1..=n).map(f64::from).product::<f64>();
            let exact = 2.0 * factorial(i) * factorial(j) * factorial(k) / factorial(i + j + k + 2);
            let values = RULE.map(|(w, _)| w[0].powi(i) * w[1].powi(j) * w[2].powi(k));
            (integrate(values), exact)
        };
        for (i, j, k) in [(0, 0, 0), (1, 0, 0), (2, 0, 0), (1, 1, 0), (3, 1, 0), (5, 0, 0), (2, 2, 1), (0, 3, 2)] {
            let ((mean, estimate), exact) = moment(i, j, k);
            assert!((mean - exact).abs() < 1e-15, "{i} {j} {k}: {mean}, exact {exact}");
            assert_eq!(estimate < 1e-15, i + j + k <= 2, "{i} {j} {k}: estimate {estimate}");
        }
    }
}
