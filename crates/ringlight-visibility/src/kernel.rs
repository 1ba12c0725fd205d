//! One triangle against a packet of receivers: lanes are receivers, cells are the inner loop.
//!
//! Over a grid the predicate's four functions are affine in (u, v), and rounding is monotone, so the computed values at
//! the extreme parameters bound the computed values at all cells exactly. A function whose upper bound is negative
//! rejects the receiver, one whose lower bound is not negative drops out; only the others are evaluated cell by cell:
//! the triangle is rasterised into the mask.

use crate::instruction_set::Machine;

use crate::lanes::{LaneVector, Lanes, abs, any, cross, dot, dot_lanes, flip, from_point, norm, splat};
use crate::plan::{Kind, Plan};
use crate::predicate::{self, Prepared};
use crate::{NO_PLANE, Triangle};

/// Receivers in a packet.
pub(crate) const PACKET: usize = 16;

/// Receivers tested together, and the cells that each of them still sees.
#[repr(C, align(64))]
pub(crate) struct Packet {
    pub x: [f32; PACKET],
    pub y: [f32; PACKET],
    pub z: [f32; PACKET],
    /// [`Plan::reach`] of each point.
    pub reach: [f32; PACKET],
    pub plane: [u32; PACKET],
    /// Mask bits 0 to 31, and 32 to 63.
    pub words: [[u32; PACKET]; 2],
}

/// A triangle with what the shooter and the filters say of it.
pub(crate) struct Candidate<'a> {
    pub triangle: &'a Triangle,
    pub prepared: Prepared,
    /// Cells it may block.
    pub cells: u64,
    /// The texels to ask about each blocked cell.
    pub cutout: Option<&'a crate::Filter>,
}

impl Packet {
    #[inline(always)]
    fn lanes<S: Machine>(simd: S, all: &[f32; PACKET], chunk: usize) -> Lanes<S> {
        Lanes::new(simd, S::as_simd_f32s(all).0[chunk])
    }

    pub fn point(&self, lane: usize) -> [f32; 3] {
        [self.x[lane], self.y[lane], self.z[lane]]
    }

    pub fn mask(&self, lane: usize) -> u64 {
        u64::from(self.words[0][lane]) | u64::from(self.words[1][lane]) << 32
    }

    pub fn set_mask(&mut self, lane: usize, mask: u64) {
        (self.words[0][lane], self.words[1][lane]) = (mask as u32, (mask >> 32) as u32);
    }

    /// The cells that any receiver still sees.
    #[inline(always)]
    pub fn union(&self) -> u64 {
        let [low, high] = [&self.words[0], &self.words[1]].map(|words| words.iter().fold(0, |all, word| all | word));
        u64::from(low) | u64::from(high) << 32
    }

    /// The lanes that still see something, as bits.
    #[inline(always)]
    pub fn unfinished<S: Machine>(&self, simd: S) -> u32 {
        let mut bits = 0;
        for chunk in 0..PACKET / S::F32_LANES {
            let [low, high] = [0, 1].map(|w| S::as_simd_u32s(&self.words[w]).0[chunk]);
            bits |= simd.bits(nonzero(simd, simd.or_u32s(low, high))) << (chunk * S::F32_LANES);
        }
        bits
    }

    /// Clears the bits that the candidate blocks; whether it blocked any.
    #[inline(always)]
    pub fn clear<S: Machine>(&mut self, simd: S, plan: &Plan, candidate: &Candidate) -> bool {
        let mut blocked = false;
        for chunk in 0..PACKET / S::F32_LANES {
            blocked |= match (plan.kind, plan.side) {
                (Kind::Grid, 1) => self.clear_chunk::<S, GRID, 1>(simd, plan, candidate, chunk),
                (Kind::Grid, 2) => self.clear_chunk::<S, GRID, 2>(simd, plan, candidate, chunk),
                (Kind::Grid, 4) => self.clear_chunk::<S, GRID, 4>(simd, plan, candidate, chunk),
                (Kind::Grid, 8) => self.clear_chunk::<S, GRID, 8>(simd, plan, candidate, chunk),
                (Kind::Grid, _) => self.clear_chunk::<S, GRID, 0>(simd, plan, candidate, chunk),
                (Kind::TwistedGrid, _) => self.clear_chunk::<S, TWISTED, 0>(simd, plan, candidate, chunk),
                (Kind::Points, _) => self.clear_chunk::<S, POINTS, 0>(simd, plan, candidate, chunk),
                (Kind::Directions, _) => self.clear_chunk::<S, DIRECTIONS, 0>(simd, plan, candidate, chunk),
            };
        }
        blocked
    }

    #[inline(always)]
    fn clear_chunk<S: Machine, const KIND: u8, const SIDE: usize>(
        &mut self,
        simd: S,
        plan: &Plan,
        candidate: &Candidate,
        chunk: usize,
    ) -> bool {
        let t = &candidate.prepared;
        let x =
            [Self::lanes(simd, &self.x, chunk), Self::lanes(simd, &self.y, chunk), Self::lanes(simd, &self.z, chunk)];
        let low = S::as_simd_u32s(&self.words[0]).0[chunk];
        let high = S::as_simd_u32s(&self.words[1]).0[chunk];
        let reach = Self::lanes(simd, &self.reach, chunk);

        let to_first = from_point(t.corners[0], x);
        let height = dot(to_first, t.normal);
        let (sign, distance) = (height.sign(), height.abs());
        let mut alive = nonzero(simd, simd.or_u32s(low, high));
        alive = simd.and_m32s(alive, Lanes::splat(simd, 0.0).below(distance));
        if candidate.triangle.plane != NO_PLANE {
            let plane = simd.splat_u32s(candidate.triangle.plane);
            let same = simd.equal_u32s(S::as_simd_u32s(&self.plane).0[chunk], plane);
            alive = simd.and_m32s(alive, simd.not_m32s(same));
        }
        let near = norm(to_first) + t.longest;
        let grazing = distance.below(t.grazing * (near + reach));
        let view = View { x, to_first, sign, distance, reach, allowance: (near * reach) * t.rounding, grazing };
        let wanted = [
            simd.and_u32s(low, simd.splat_u32s(candidate.cells as u32)),
            simd.and_u32s(high, simd.splat_u32s((candidate.cells >> 32) as u32)),
        ];
        let found = if KIND == GRID || KIND == TWISTED {
            view.over_grid::<KIND, SIDE>(simd, plan, candidate, alive, wanted)
        } else {
            view.over_cells::<KIND>(simd, plan, candidate, alive, wanted)
        };
        let Some(Found { mut seen, sure, grazing }) = found else {
            return false;
        };

        let all_doubtful = if candidate.cutout.is_some() { simd.splat_u32s(u32::MAX) } else { simd.splat_u32s(0) };
        let grazing = simd.select_u32s(grazing, simd.splat_u32s(u32::MAX), all_doubtful);
        let mut doubt = seen;
        for w in 0..2 {
            doubt[w] = simd.and_u32s(seen[w], simd.or_u32s(grazing, simd.not_u32s(sure[w])));
        }
        let mut some = true;
        if any(simd, nonzero(simd, simd.or_u32s(doubt[0], doubt[1]))) {
            let mut refuted = [[0; PACKET]; 2];
            let mut certain = [[0; PACKET]; 2];
            for w in 0..2 {
                S::as_mut_simd_u32s(&mut refuted[w]).0[chunk] = doubt[w];
                S::as_mut_simd_u32s(&mut certain[w]).0[chunk] = sure[w];
            }
            self.keep_refuted(plan, candidate, &certain, &mut refuted);
            for w in 0..2 {
                seen[w] = simd.xor_u32s(seen[w], S::as_simd_u32s(&refuted[w]).0[chunk]);
            }
            some = any(simd, nonzero(simd, simd.or_u32s(seen[0], seen[1])));
        }
        S::as_mut_simd_u32s(&mut self.words[0]).0[chunk] = simd.xor_u32s(low, seen[0]);
        S::as_mut_simd_u32s(&mut self.words[1]).0[chunk] = simd.xor_u32s(high, seen[1]);
        some
    }

    /// Leaves in `doubt`, bits that seem blocked, those that the scalar predicate or the cutout lets through.
    #[inline(never)]
    fn keep_refuted(
        &self,
        plan: &Plan,
        candidate: &Candidate,
        sure: &[[u32; PACKET]; 2],
        doubt: &mut [[u32; PACKET]; 2],
    ) {
        for (w, words) in doubt.iter_mut().enumerate() {
            for (lane, word) in words.iter_mut().enumerate() {
                let mut bits = *word;
                while bits != 0 {
                    let bit = bits & bits.wrapping_neg();
                    bits ^= bit;
                    let k = 32 * w + bit.trailing_zeros() as usize;
                    if candidate.confirms(plan, self.point(lane), k, sure[w][lane] & bit != 0) {
                        *word ^= bit;
                    }
                }
            }
        }
    }
}

impl Candidate<'_> {
    /// Whether it hides cell `k` from `x`, given that the four functions say so: for `sure`, or nearly.
    fn confirms(&self, plan: &Plan, x: [f32; 3], k: usize, sure: bool) -> bool {
        if self.cutout.is_some() || !sure {
            return self.blocks(plan, x, k);
        }
        let height = predicate::dot(self.prepared.normal, predicate::sub(self.prepared.corners[0], x));
        !plan.is_grazing(&self.prepared, x, k, height) || plan.passes_box(&self.prepared, x, k)
    }

    /// Whether it hides cell `k` from `x`, plane ids apart.
    pub fn blocks(&self, plan: &Plan, x: [f32; 3], k: usize) -> bool {
        self.cells >> k & 1 == 1
            && predicate::hit(plan, &self.prepared, x, k).is_some_and(|weights| {
                self.cutout.is_none_or(|filter| {
                    let share = predicate::barycentric(self.triangle, &self.prepared, weights);
                    filter.blocks_at(share)
                })
            })
    }
}

#[inline(always)]
fn nonzero<S: Machine>(simd: S, word: S::u32s) -> S::m32s {
    simd.not_m32s(simd.equal_u32s(word, simd.splat_u32s(0)))
}

const GRID: u8 = 0;
const TWISTED: u8 = 1;
const POINTS: u8 = 2;
const DIRECTIONS: u8 = 3;

/// A triangle as the receivers see it.
struct View<S: Machine> {
    x: LaneVector<S>,
    /// v₀ − x.
    to_first: LaneVector<S>,
    /// The sign bit of T, and |T|.
    sign: Lanes<S>,
    distance: Lanes<S>,
    reach: Lanes<S>,
    /// [`Prepared::allowance`].
    allowance: Lanes<S>,
    grazing: S::m32s,
}

/// The wanted cells (two words) that the predicate's four functions accept with the allowance for rounding, and `sure`
/// those accepted without.
struct Found<S: Machine> {
    seen: [S::u32s; 2],
    sure: [S::u32s; 2],
    grazing: S::m32s,
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
        Affine { base: dot_lanes(n, anchor), u: dot(n, plan.edge_u), v: dot(n, plan.edge_v), w: dot(n, plan.twist) }
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
    fn over_grid<const KIND: u8, const SIDE: usize>(
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
            w: Lanes::splat(simd, plan.far * predicate::dot(t.normal, plan.twist)).flip(self.sign),
        };
        let [depth_bottom, top] = depth.bounds::<KIND>(simd, plan);
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
                let [_, top] = function.bounds::<KIND>(simd, plan);
                alive = simd.and_m32s(alive, top.not_negative());
            }
            if !any(simd, alive) {
                return None;
            }
        }
        let undecided = any(simd, simd.and_m32s(alive, simd.not_m32s(depth_bottom.not_negative())));
        let seen = if undecided {
            words::<S, KIND, SIDE, true>(simd, plan, a, b, c, depth)
        } else {
            words::<S, KIND, SIDE, false>(simd, plan, a, b, c, depth)
        };
        let seen = Self::among(simd, seen, wanted, alive)?;
        let [a, b, c] = strict;
        let sure = words::<S, KIND, SIDE, false>(simd, plan, a, b, c, depth);
        Some(Found { seen, sure, grazing: self.grazing })
    }

    #[inline(always)]
    fn over_cells<const KIND: u8>(
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
        let mut grazing = if KIND == POINTS { self.grazing } else { zero.below(zero) };
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
                grazing = simd.or_m32s(grazing, rise.below(t.grazing * self.reach));
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
struct Affine<S: Machine> {
    base: Lanes<S>,
    u: Lanes<S>,
    v: Lanes<S>,
    w: Lanes<S>,
}

impl<S: Machine> Affine<S> {
    /// Minus the value at u = 0.
    #[inline(always)]
    fn negative_row(&self, simd: S, v: f32) -> Lanes<S> {
        (self.base + v * self.v).flip(Lanes::splat(simd, -0.0))
    }

    /// The value at cell `k`.
    #[inline(always)]
    fn at<const KIND: u8>(&self, plan: &Plan, k: usize) -> Lanes<S> {
        let slope = if KIND == TWISTED { self.u + plan.v[k] * self.w } else { self.u };
        (self.base + plan.v[k] * self.v) + plan.u[k] * slope
    }

    /// Least and greatest computed value over the cells, or bounds on them. A twisted grid has none: it is not monotone
    /// after rounding, and rare.
    #[inline(always)]
    fn bounds<const KIND: u8>(&self, simd: S, plan: &Plan) -> [Lanes<S>; 2] {
        if KIND == TWISTED {
            return [Lanes::splat(simd, -1.0), Lanes::splat(simd, 1.0)];
        }
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
fn words<S: Machine, const KIND: u8, const SIDE: usize, const DEPTH: bool>(
    simd: S,
    plan: &Plan,
    a: Affine<S>,
    b: Affine<S>,
    c: Affine<S>,
    depth: Affine<S>,
) -> [S::u32s; 2] {
    let mut words = [simd.splat_u32s(0); 2];
    if SIDE > 0 {
        let mut columns = [[a.u; 4]; SIDE];
        for i in 0..SIDE {
            columns[i] = [plan.u[i] * a.u, plan.u[i] * b.u, plan.u[i] * c.u, plan.u[i] * depth.u];
        }
        let rows_in_word = if SIDE == 8 { 4 } else { SIDE };
        for w in 0..SIDE / rows_in_word {
            let mut bit = simd.splat_u32s(1);
            for j in w * rows_in_word..(w + 1) * rows_in_word {
                let v = plan.v[j * SIDE];
                let (a, b, c, depth) = (
                    a.negative_row(simd, v),
                    b.negative_row(simd, v),
                    c.negative_row(simd, v),
                    depth.negative_row(simd, v),
                );
                for i in 0..SIDE {
                    let mut pass = columns[i][0].at_least(a);
                    pass = simd.and_m32s(pass, columns[i][1].at_least(b));
                    pass = simd.and_m32s(pass, columns[i][2].at_least(c));
                    if DEPTH {
                        pass = simd.and_m32s(pass, columns[i][3].at_least(depth));
                    }
                    words[w] = simd.or_u32s(words[w], simd.select_u32s(pass, bit, simd.splat_u32s(0)));
                    bit = simd.add_u32s(bit, bit);
                }
            }
        }
    } else {
        for k in 0..plan.count {
            let mut pass = a.at::<KIND>(plan, k).not_negative();
            pass = simd.and_m32s(pass, b.at::<KIND>(plan, k).not_negative());
            pass = simd.and_m32s(pass, c.at::<KIND>(plan, k).not_negative());
            if DEPTH {
                pass = simd.and_m32s(pass, depth.at::<KIND>(plan, k).not_negative());
            }
            words[k >> 5] = simd.or_u32s(words[k >> 5], bit_where(simd, pass, k));
        }
    }
    words
}
