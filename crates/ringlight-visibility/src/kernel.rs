//! One triangle against a packet of receivers: lanes are receivers, cells are the inner loop.
//!
//! Over a grid the predicate's four functions are affine in (u, v), and rounding is monotone, so the computed values at
//! the extreme parameters bound the computed values at all cells exactly. A function whose upper bound is negative
//! rejects the receiver; the rest is evaluated cell by cell: the triangle is rasterised into the mask.

#![allow(clippy::needless_range_loop, reason = "what iterators do to lanes is not inlined, and loses the vectors")]

use crate::instruction_set::Machine;
use crate::lanes::{LaneVector, Lanes, abs, any, cross, dot, dot_lanes, flip, from_point, nonzero, norm, splat};
use crate::packet::Candidate;
use crate::plan::Plan;
use crate::predicate::{self, Prepared};

pub(crate) const GRID: u8 = 0;
pub(crate) const POINTS: u8 = 1;
pub(crate) const DIRECTIONS: u8 = 2;

/// A triangle as the receivers see it.
pub(crate) struct View<S: Machine> {
    pub x: LaneVector<S>,
    /// v₀ − x.
    pub to_first: LaneVector<S>,
    /// The sign bit of T, and |T|.
    pub sign: Lanes<S>,
    pub distance: Lanes<S>,
    pub reach: Lanes<S>,
    /// [`Prepared::allowance`].
    pub allowance: Lanes<S>,
    /// |v₀−x|₁ + longest.
    pub near: Lanes<S>,
}

/// The wanted cells (two words) that the predicate's four functions accept with the allowance for rounding, and `sure`
/// those accepted without.
pub(crate) struct Found<S: Machine> {
    pub seen: [S::u32s; 2],
    pub sure: [S::u32s; 2],
    pub grazing: S::m32s,
}

impl<S: Machine> View<S> {
    /// The edge planes' normals, turned so that inside is positive.
    #[inline(always)]
    fn normals(&self, simd: S, t: &Prepared) -> [LaneVector<S>; 3] {
        let opposite = self.sign.flip(Lanes::splat(simd, -0.0));
        [
            flip(cross(self.to_first, t.edges[0]), self.sign),
            flip(cross(from_point(t.corners[1], self.x), t.edges[1]), self.sign),
            flip(cross(self.to_first, t.edges[2]), opposite),
        ]
    }

    /// The function n·(c−x) of the cell.
    #[inline(always)]
    fn affine(plan: &Plan, n: LaneVector<S>, anchor: LaneVector<S>) -> Affine<S> {
        Affine { base: dot_lanes(n, anchor), u: dot(n, plan.edge_u), v: dot(n, plan.edge_v) }
    }

    /// The receivers that graze the triangle, see [`predicate::GRAZING`].
    #[inline(always)]
    fn grazing(&self, t: &Prepared) -> S::m32s {
        self.distance.below(t.grazing() * (self.near + self.reach))
    }

    /// What the lanes `alive` want of `seen`; `None` if nothing.
    #[inline(always)]
    fn among(simd: S, mut seen: [S::u32s; 2], wanted: [S::u32s; 2], alive: S::m32s) -> Option<[S::u32s; 2]> {
        for w in 0..2 {
            seen[w] = simd.select_u32s(alive, simd.and_u32s(seen[w], wanted[w]), simd.splat_u32s(0));
        }
        any(simd, nonzero(simd, simd.or_u32s(seen[0], seen[1]))).then_some(seen)
    }

    #[inline(always)]
    pub fn over_grid<const SIDE: usize>(
        &self,
        simd: S,
        plan: &Plan,
        candidate: &Candidate,
        mut alive: S::m32s,
        wanted: [S::u32s; 2],
    ) -> Option<Found<S>> {
        let t = &candidate.prepared;
        let anchor = from_point(plan.anchor, self.x);
        let depth = Affine {
            base: (plan.far * dot(anchor, t.normal)).flip(self.sign) - self.distance,
            u: Lanes::splat(simd, plan.far * predicate::dot(t.normal, plan.edge_u)).flip(self.sign),
            v: Lanes::splat(simd, plan.far * predicate::dot(t.normal, plan.edge_v)).flip(self.sign),
        };
        let [depth_bottom, top] = depth.bounds(plan);
        alive = simd.and_m32s(alive, top.not_negative());
        if !any(simd, alive) {
            return None;
        }
        let [a, b, c] = self.normals(simd, t);
        let strict = [Self::affine(plan, a, anchor), Self::affine(plan, b, anchor), Self::affine(plan, c, anchor)];
        let a = Affine { base: strict[0].base + self.allowance, ..strict[0] };
        let b = Affine { base: strict[1].base + self.allowance, ..strict[1] };
        let c = Affine { base: strict[2].base + self.allowance, ..strict[2] };
        // For few cells the bounds cost more than they save.
        if plan.count > 16 {
            for function in [a, b, c] {
                let [_, top] = function.bounds(plan);
                alive = simd.and_m32s(alive, top.not_negative());
            }
            if !any(simd, alive) {
                return None;
            }
        }
        let undecided = any(simd, simd.and_m32s(alive, simd.not_m32s(depth_bottom.not_negative())));
        let seen = if undecided {
            words::<S, SIDE, 4>(simd, plan, [a, b, c, depth])
        } else {
            words::<S, SIDE, 3>(simd, plan, [a, b, c])
        };
        let seen = Self::among(simd, seen, wanted, alive)?;
        let [a, b, c] = strict;
        let sure = words::<S, SIDE, 3>(simd, plan, [a, b, c]);
        Some(Found { seen, sure, grazing: self.grazing(t) })
    }

    #[inline(always)]
    pub fn over_cells<const KIND: u8>(
        &self,
        simd: S,
        plan: &Plan,
        candidate: &Candidate,
        mut alive: S::m32s,
        wanted: [S::u32s; 2],
    ) -> Option<Found<S>> {
        let t = &candidate.prepared;
        let normals = self.normals(simd, t);
        // Upper bounds over the cells' box; 2⁻¹⁶ of the reach is far more than rounding.
        let middle = if KIND == POINTS { from_point(plan.anchor, self.x) } else { splat(simd, plan.anchor) };
        for n in normals {
            let slack = norm(n) * self.reach * (1.0 / 65536.0);
            let top = ((dot_lanes(n, middle) + dot(abs(n), plan.half)) + slack) + self.allowance;
            alive = simd.and_m32s(alive, top.not_negative());
        }
        if !any(simd, alive) {
            return None;
        }
        let zero = Lanes::splat(simd, 0.0);
        let mut grazing = if KIND == POINTS { self.grazing(t) } else { zero.below(zero) };
        let least_rise = t.grazing() * self.reach;
        let mut seen = [simd.splat_u32s(0); 2];
        let mut sure = seen;
        for k in 0..plan.count {
            if candidate.cells >> k & 1 == 0 {
                continue;
            }
            let cell = plan.cells[k];
            let mut pass;
            let mut certain;
            if KIND == POINTS {
                let d = from_point(cell, self.x);
                pass = ((plan.far * dot(d, t.normal)).flip(self.sign) - self.distance).not_negative();
                certain = pass;
                for n in normals {
                    let e = dot_lanes(n, d);
                    certain = simd.and_m32s(certain, e.not_negative());
                    pass = simd.and_m32s(pass, (e + self.allowance).not_negative());
                }
            } else {
                let rise = Lanes::splat(simd, plan.far * predicate::dot(t.normal, cell)).flip(self.sign);
                grazing = simd.or_m32s(grazing, rise.below(least_rise));
                pass = (rise - f32::MIN_POSITIVE).not_negative();
                certain = pass;
                for n in normals {
                    let e = dot(n, cell);
                    certain = simd.and_m32s(certain, e.not_negative());
                    pass = simd.and_m32s(pass, (e + self.allowance).not_negative());
                }
            }
            seen[k >> 5] = simd.or_u32s(seen[k >> 5], bit_where(simd, pass, k));
            sure[k >> 5] = simd.or_u32s(sure[k >> 5], bit_where(simd, certain, k));
        }
        let seen = Self::among(simd, seen, wanted, alive)?;
        Some(Found { seen, sure, grazing })
    }
}

/// Bit `k` of its word, in the lanes of the mask.
#[inline(always)]
fn bit_where<S: Machine>(simd: S, mask: S::m32s, k: usize) -> S::u32s {
    simd.select_u32s(mask, simd.splat_u32s(1 << (k & 31)), simd.splat_u32s(0))
}

/// base + v·b + u·a + u·v·w for each receiver.
#[derive(Clone, Copy)]
pub(crate) struct Affine<S: Machine> {
    pub base: Lanes<S>,
    pub u: Lanes<S>,
    pub v: Lanes<S>,
}

impl<S: Machine> Affine<S> {
    /// The difference from another one, of an untwisted grid.
    #[inline(always)]
    pub fn less(self, other: Self) -> Self {
        Affine { base: self.base - other.base, u: self.u - other.u, v: self.v - other.v }
    }

    #[inline(always)]
    pub fn plus(self, amount: Lanes<S>) -> Self {
        Affine { base: self.base + amount, ..self }
    }

    #[inline(always)]
    pub fn minus(self, amount: Lanes<S>) -> Self {
        Affine { base: self.base - amount, ..self }
    }

    /// Minus the value at u = 0.
    #[inline(always)]
    fn negative_row(&self, simd: S, v: f32) -> Lanes<S> {
        (self.base + v * self.v).flip(Lanes::splat(simd, -0.0))
    }

    /// The value at cell `k`.
    #[inline(always)]
    fn at(&self, plan: &Plan, k: usize) -> Lanes<S> {
        (self.base + plan.v[k] * self.v) + plan.u[k] * self.u
    }

    /// Least and greatest computed value over the cells, or bounds on them.
    #[inline(always)]
    pub fn bounds(&self, plan: &Plan) -> [Lanes<S>; 2] {
        let (near, far) = (self.base + plan.v_range[0] * self.v, self.base + plan.v_range[1] * self.v);
        let (left, right) = (plan.u_range[0] * self.u, plan.u_range[1] * self.u);
        [near.min(far) + left.min(right), near.max(far) + left.max(right)]
    }
}

/// The cells for which none of the functions is negative, in two words.
///
/// The sum of row and column has the sign that comparing the column with the row's negative tells: rounding never
/// changes a sign.
#[inline(always)]
pub(crate) fn words<S: Machine, const SIDE: usize, const N: usize>(
    simd: S,
    plan: &Plan,
    functions: [Affine<S>; N],
) -> [S::u32s; 2] {
    let mut words = [simd.splat_u32s(0); 2];
    if SIDE > 0 {
        let mut columns = [[functions[0].u; N]; SIDE];
        for i in 0..SIDE {
            for f in 0..N {
                columns[i][f] = plan.u[i] * functions[f].u;
            }
        }
        let rows_in_word = if SIDE == 8 { 4 } else { SIDE };
        for w in 0..SIDE / rows_in_word {
            let mut bit = simd.splat_u32s(1);
            for j in w * rows_in_word..(w + 1) * rows_in_word {
                let v = plan.v[j * SIDE];
                let mut rows = [functions[0].u; N];
                for f in 0..N {
                    rows[f] = functions[f].negative_row(simd, v);
                }
                for i in 0..SIDE {
                    let mut pass = columns[i][0].at_least(rows[0]);
                    for f in 1..N {
                        pass = simd.and_m32s(pass, columns[i][f].at_least(rows[f]));
                    }
                    words[w] = simd.or_u32s(words[w], simd.select_u32s(pass, bit, simd.splat_u32s(0)));
                    bit = simd.add_u32s(bit, bit);
                }
            }
        }
    } else {
        for k in 0..plan.count {
            let mut pass = functions[0].at(plan, k).not_negative();
            for f in 1..N {
                pass = simd.and_m32s(pass, functions[f].at(plan, k).not_negative());
            }
            words[k >> 5] = simd.or_u32s(words[k >> 5], bit_where(simd, pass, k));
        }
    }
    words
}
