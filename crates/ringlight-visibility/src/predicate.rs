//! The one ray–triangle predicate; everything faster must give the same bits.
//!
//! For a receiver x and a triangle whose corners are put in the order of their coordinates, v₀ ≤ v₁ ≤ v₂, the planes
//! through x and the edges have normals n₀ = (v₀−x)×(v₁−v₀), n₁ = (v₁−x)×(v₂−v₁), n₂ = (v₂−v₀)×(v₀−x). A cell c lies
//! inside all three when every nᵢ·(c−x) has the sign of T = N·(v₀−x), with N = (v₁−v₀)×(v₂−v₀); the hit lies before the
//! cell when far · N·(c−x) exceeds T. These are four functions of the cell, of which none may be negative; over a grid
//! of cells they are affine, which is what makes masks cheap.
//!
//! *Watertight.* A shared edge is the same pair of numbers in both triangles, even when its corners are stored twice, so
//! both compute the same bits up to a sign (compare Woop, Benthin & Wald 2013, who reach this with a shear per ray). The
//! edge enters as v₁−v₀, not as the difference of two vectors from x: that is far better conditioned for small distant
//! triangles. A value of 0 counts as inside for both. At a corner many edges meet, and rounding could put the ray outside
//! of each triangle in turn; so where two functions are 0 as far as rounding can tell (see [`ROUNDING`]), they count as 0.
//!
//! *Rounding.* Each function errs by at most ROUNDING · |v−x| · |edge| · |c−x|. Where the receiver is high above the
//! triangle's plane this moves a hit by a small share of the way only. Where it grazes the plane, or the triangle is a
//! needle, it could claim hits far from the triangle; there (see [`GRAZING`]) the segment must also pass the triangle's
//! box, grown by [`BOX_MARGIN`] of the reach. Hence every accepted segment passes within [`SHAFT_MARGIN`] of the reach
//! of its triangle, and culls with that margin are strictly conservative whatever hierarchy they run on.
//!
//! Arithmetic is plain `f32` in a fixed order, without fused multiply-add.

use crate::plan::{Plan, distance};
use crate::{Filter, Hit, OPAQUE, Ray, Triangle};

/// Bound on the error of an edge function, relative to |v−x| · |edge| · |c−x|: some fourteen roundings of 2⁻²⁴.
pub(crate) const ROUNDING: f32 = 1.0 / 1048576.0;

/// A receiver is grazing when |T| < GRAZING · longest² · (|v₀−x|₁ + longest + reach).
///
/// Otherwise a barycentric weight, an edge function over N·(c−x), is wrong by at most 2 · ROUNDING · |v−x| · reach /
/// (GRAZING · longest · (|v−x| + reach)), so that the hit lies within 6 · ROUNDING / GRAZING of the reach of the
/// triangle; along the way it is wrong by at most ROUNDING / GRAZING.
pub(crate) const GRAZING: f32 = 1.0 / 64.0;

/// Growth of the triangle's box in the check of grazing hits, as a share of the reach.
pub(crate) const BOX_MARGIN: f32 = 1.0 / 2048.0;

/// Growth of shafts and of the hierarchy's boxes, as a share of the reach: what both rules above allow, and as much again
/// for the rounding of the cull itself.
pub(crate) const SHAFT_MARGIN: f32 = 1.0 / 1024.0;

/// Triangles whose doubled area is below this share of their longest edge squared are slivers and never block.
pub(crate) const SLIVER: f32 = 1.0 / 131072.0;

pub(crate) type Vector = [f32; 3];

#[inline(always)]
pub(crate) fn sub(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(crate) fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline(always)]
pub(crate) fn dot(a: Vector, b: Vector) -> f32 {
    (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2]
}

/// Sum of the absolute coordinates.
#[inline(always)]
pub(crate) fn norm(a: Vector) -> f32 {
    (a[0].abs() + a[1].abs()) + a[2].abs()
}

/// What the predicate needs of a triangle alone.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Prepared {
    /// Corners in the order of their coordinates.
    pub corners: [Vector; 3],
    /// v₁−v₀, v₂−v₁, v₂−v₀.
    pub edges: [Vector; 3],
    /// N.
    pub normal: Vector,
    /// Bound on the length of the longest edge, metres.
    pub longest: f32,
    /// ROUNDING · longest.
    pub rounding: f32,
}

impl Prepared {
    #[inline(always)]
    pub fn new(triangle: &Triangle) -> Prepared {
        // Sorted without branches, which would be mispredicted: the three comparisons name the permutation.
        let [a, b, c] = triangle.corners;
        let order = usize::from(before(a, b)) | usize::from(before(b, c)) << 1 | usize::from(before(a, c)) << 2;
        let [i, j, k] = ORDERS[order];
        let (a, b, c) = (triangle.corners[i as usize], triangle.corners[j as usize], triangle.corners[k as usize]);
        let edges = [sub(b, a), sub(c, b), sub(c, a)];
        let longest = greatest([norm(edges[0]), norm(edges[1]), norm(edges[2])]);
        Prepared { corners: [a, b, c], edges, normal: cross(edges[0], edges[2]), longest, rounding: ROUNDING * longest }
    }

    /// The edge planes' normals seen from `x`, and T.
    #[inline(always)]
    pub fn planes(&self, x: Vector) -> ([Vector; 3], f32) {
        let (to_first, to_second) = (sub(self.corners[0], x), sub(self.corners[1], x));
        let normals = [cross(to_first, self.edges[0]), cross(to_second, self.edges[1]), cross(self.edges[2], to_first)];
        (normals, dot(self.normal, to_first))
    }

    /// GRAZING · longest².
    #[inline(always)]
    pub fn grazing(&self) -> f32 {
        let [a, b, c] = self.edges;
        GRAZING * greatest([dot(a, a), dot(b, b), dot(c, c)])
    }

    /// What rounding may take from an edge function, see [`ROUNDING`]; `reach` bounds the way to the cells.
    #[inline(always)]
    pub fn allowance(&self, x: Vector, reach: f32) -> f32 {
        ((norm(sub(self.corners[0], x)) + self.longest) * reach) * self.rounding
    }

    /// Least and greatest coordinates.
    pub fn bounds(&self) -> (Vector, Vector) {
        let [a, b, c] = self.corners;
        (std::array::from_fn(|i| a[i].min(b[i]).min(c[i])), std::array::from_fn(|i| a[i].max(b[i]).max(c[i])))
    }

    /// Where the ray from `x` along `d` is within `margin` of the triangle's box, as distances in units of `d` between
    /// 0 and `far`.
    pub fn pass_box(&self, x: Vector, d: Vector, margin: f32, far: f32) -> Option<(f32, f32)> {
        pass(self.box_around(x, margin), d, far)
    }

    /// The triangle's box seen from `x`, grown by `margin`.
    #[inline(always)]
    pub fn box_around(&self, x: Vector, margin: f32) -> (Vector, Vector) {
        let (low, high) = self.bounds();
        (std::array::from_fn(|i| (low[i] - x[i]) - margin), std::array::from_fn(|i| (high[i] - x[i]) + margin))
    }
}

/// Where the ray from the origin along `d` is within the box, as distances in units of `d` between 0 and `far`.
#[inline(always)]
pub(crate) fn pass((low, high): (Vector, Vector), d: Vector, far: f32) -> Option<(f32, f32)> {
    let (mut enter, mut leave) = (0.0f32, far);
    for i in 0..3 {
        if d[i] == 0.0 {
            if low[i] > 0.0 || high[i] < 0.0 {
                return None;
            }
        } else {
            let (s, t) = (low[i] / d[i], high[i] / d[i]);
            enter = enter.max(s.min(t));
            leave = leave.min(s.max(t));
        }
    }
    (enter <= leave).then_some((enter, leave))
}

/// The greatest of three. (`f32::max` would also look for NaN.)
#[inline(always)]
fn greatest([a, b, c]: [f32; 3]) -> f32 {
    let most = if a > b { a } else { b };
    if c > most { c } else { most }
}

/// The corners' order for the answers a < b, b < c, a < c (bits 0 to 2). The answers of 3 and 4 contradict each other
/// but for equal points, which make slivers.
const ORDERS: [[u8; 3]; 8] = [[2, 1, 0], [2, 0, 1], [1, 2, 0], [0, 1, 2], [0, 1, 2], [0, 2, 1], [1, 0, 2], [0, 1, 2]];

/// The order of coordinates, x first; equal points are not before each other.
#[inline(always)]
fn before(p: Vector, q: Vector) -> bool {
    (p[0] < q[0]) | ((p[0] == q[0]) & ((p[1] < q[1]) | ((p[1] == q[1]) & (p[2] < q[2]))))
}

/// Whether the triangle is too thin or not finite, so that it blocks nothing. A rule of the triangle alone.
pub(crate) fn is_sliver(triangle: &Triangle) -> bool {
    let t = Prepared::new(triangle);
    let squared = t.edges.iter().map(|&e| dot(e, e)).fold(0.0, f32::max);
    let area = dot(t.normal, t.normal).sqrt();
    let finite = triangle.corners.iter().flatten().all(|c| c.is_finite()) && area.is_finite() && squared.is_finite();
    !finite || squared == 0.0 || area < SLIVER * squared
}

/// Whether the edge functions say inside: none is negative, or at a corner none is for certain. `nearly` are the same
/// functions with the allowance for rounding added.
#[inline(always)]
fn is_inside(inside: [f32; 3], nearly: [f32; 3], allowance: f32) -> bool {
    inside.iter().all(|&e| e >= 0.0)
        || nearly.iter().all(|&e| e >= 0.0) && inside.iter().filter(|&&e| e <= allowance).count() >= 2
}

/// Barycentric weights of the corners in the order of their coordinates, or `None`: the triangle hides cell `k` of the
/// shooter from `x`, before filters and plane ids are asked.
pub(crate) fn hit(plan: &Plan, t: &Prepared, x: Vector, k: usize) -> Option<[f32; 3]> {
    let (normals, height) = t.planes(x);
    // Only coordinates beyond 1e9 can bring about NaN.
    if height == 0.0 || height.is_nan() {
        return None;
    }
    let sign = 1f32.copysign(height);
    let before_cell = plan.before_cell(t, x, k, height);
    let allowance = t.allowance(x, plan.reach(x));
    let turned = normals.map(|n| n.map(|c| sign * c));
    let inside = turned.map(|n| plan.along(n, x, k, 0.0));
    let nearly = turned.map(|n| plan.along(n, x, k, allowance));
    if !(before_cell >= 0.0 && is_inside(inside, nearly, allowance)) {
        return None;
    }
    if plan.is_grazing(t, x, k, height) && !plan.passes_box(t, x, k) {
        return None;
    }
    Some([inside[1], inside[2], inside[0]])
}

/// Weights that sum to one, in the order of the triangle's own corners.
pub(crate) fn barycentric(triangle: &Triangle, t: &Prepared, weights: [f32; 3]) -> [f32; 3] {
    let sum = (weights[0] + weights[1]) + weights[2];
    let share = |w: f32| if sum > 0.0 { w / sum } else { 1.0 / 3.0 };
    // Corners with equal coordinates were dropped as slivers, so positions identify them.
    triangle.corners.map(|corner| {
        let i = t.corners.iter().position(|&c| c == corner).unwrap_or(0);
        share(weights[i])
    })
}

/// The hit of one ray with one triangle, prepared, plane ids apart: the same edge functions with the ray's direction for the
/// cell.
#[inline(always)]
pub(crate) fn ray_hit(triangle: &Triangle, t: &Prepared, filters: &[Filter], ray: &Ray) -> Option<Hit> {
    let (normals, height) = t.planes(ray.origin);
    let sign = 1f32.copysign(height);
    let rise = sign * dot(t.normal, ray.direction);
    if height == 0.0 || height.is_nan() || rise <= 0.0 {
        return None;
    }
    let allowance = t.allowance(ray.origin, norm(ray.direction));
    let inside = normals.map(|n| sign * dot(n, ray.direction));
    if !is_inside(inside, inside.map(|e| e + allowance), allowance) {
        return None;
    }
    met(triangle, t, filters, ray, (height, rise, inside))
}

/// The rest of [`ray_hit`], for rays that pass between the edges: height, rise and edge functions as there.
#[inline(never)]
fn met(
    triangle: &Triangle,
    t: &Prepared,
    filters: &[Filter],
    ray: &Ray,
    (height, rise, inside): (f32, f32, [f32; 3]),
) -> Option<Hit> {
    let mut way = height.abs() / rise;
    if rise < t.grazing() * norm(ray.direction) {
        let margin = BOX_MARGIN * distance(t, ray.origin);
        let (enter, leave) = t.pass_box(ray.origin, ray.direction, margin, f32::INFINITY)?;
        way = way.max(enter).min(leave);
    }
    if !(way > ray.near && way <= ray.far) {
        return None;
    }
    let share = barycentric(triangle, t, [inside[1], inside[2], inside[0]]);
    if triangle.filter != OPAQUE && !filters[triangle.filter as usize].blocks_at(share) {
        return None;
    }
    let place = |corner| t.corners.iter().position(|&c| c == corner);
    let even = matches!(
        (place(triangle.corners[0]), place(triangle.corners[1])),
        (Some(0), Some(1)) | (Some(1), Some(2)) | (Some(2), Some(0))
    );
    Some(Hit { distance: way, triangle: triangle.id, barycentric: [share[1], share[2]], front: (height < 0.0) == even })
}
