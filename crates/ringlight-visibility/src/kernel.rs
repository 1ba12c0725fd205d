//! One triangle against a packet of receivers: lanes are receivers, cells are the inner loop.
//!
//! Over a grid the predicate's four functions are affine in (u, v), and rounding is monotone, so the computed values at
//! the extreme parameters bound the computed values at all cells exactly. A function whose upper bound is negative
//! rejects the receiver, one whose lower bound is not negative drops out; only the others are evaluated cell by cell:
//! the triangle is rasterised into the mask.

use crate::instruction_set::Machine;

use crate::lanes::{LaneVector, Lanes, any, cross, dot, dot_lanes, from_point};
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
        let x = [&self.x, &self.y, &self.z].map(|c| Self::lanes(simd, c, chunk));
        let [low, high] = [0, 1].map(|w| S::as_simd_u32s(&self.words[w]).0[chunk]);
        let unfinished = nonzero(simd, simd.or_u32s(low, high));

        let to_first = from_point(t.corners[0], x);
        let height = dot(to_first, t.normal);
        let (sign, distance) = (height.sign(), height.abs());
        let mut alive = simd.and_m32s(unfinished, Lanes::splat(simd, 0.0).below(distance));
        if candidate.triangle.plane != NO_PLANE {
            let same = simd.equal_u32s(
                S::as_simd_u32s(&self.plane).0[chunk],
                simd.splat_u32s(candidate.triangle.plane),
            );
            alive = simd.and_m32s(alive, simd.not_m32s(same));
        }

        let function = |n: LaneVector<S>, anchor: LaneVector<S>| {
            let n = n.map(|c| c.flip(sign));
            Affine { base: dot_lanes(n, anchor), u: dot(n, plan.edge_u), v: dot(n, plan.edge_v), w: dot(n, plan.twist) }
        };
        let anchor = from_point(plan.anchor, x);
        let reach = Self::lanes(simd, &self.reach, chunk);
        let zero = Lanes::splat(simd, 0.0);
        let mut seen;
        let mut grazing;
        if KIND == GRID || KIND == TWISTED {
            let slope = |edge| Lanes::splat(simd, plan.far * predicate::dot(t.normal, edge)).flip(sign);
            let depth = Affine {
                base: (plan.far * dot(anchor, t.normal)).flip(sign) - distance,
                u: slope(plan.edge_u),
                v: slope(plan.edge_v),
                w: slope(plan.twist),
            };
            let [_, top] = depth.bounds::<KIND>(simd, plan);
            alive = simd.and_m32s(alive, top.not_negative());
            if !any(simd, alive) {
                return false;
            }
            let functions = [
                depth,
                function(cross(to_first, t.edges[0]), anchor),
                function(cross(from_point(t.corners[1], x), t.edges[1]), anchor),
                function(cross(to_first, t.edges[2]).map(|c| c.flip(Lanes::splat(simd, -0.0))), anchor),
            ];
            let bounds = functions.map(|f| f.bounds::<KIND>(simd, plan));
            for [_, top] in bounds {
                alive = simd.and_m32s(alive, top.not_negative());
            }
            if !any(simd, alive) {
                return false;
            }
            seen = [simd.splat_u32s(plan.all as u32), simd.splat_u32s((plan.all >> 32) as u32)];
            for (f, [bottom, _]) in functions.iter().zip(bounds) {
                if any(simd, simd.and_m32s(alive, simd.not_m32s(bottom.not_negative()))) {
                    let words = f.words::<KIND, SIDE>(simd, plan);
                    seen = [simd.and_u32s(seen[0], words[0]), simd.and_u32s(seen[1], words[1])];
                }
            }
            let span = (((to_first[0].abs() + to_first[1].abs()) + to_first[2].abs()) + t.longest) + reach;
            grazing = distance.below(t.grazing * span);
        } else {
            let normals = [
                cross(to_first, t.edges[0]),
                cross(from_point(t.corners[1], x), t.edges[1]),
                cross(to_first, t.edges[2]).map(|c| c.flip(Lanes::splat(simd, -0.0))),
            ]
            .map(|n| n.map(|c| c.flip(sign)));
            // Upper bounds over the cells' box; 2⁻¹⁶ of the reach is far more than rounding.
            let middle = if KIND == POINTS { anchor } else { plan.anchor.map(|c| Lanes::splat(simd, c)) };
            for n in normals {
                let size = n.map(Lanes::abs);
                let slack = ((size[0] + size[1]) + size[2]) * reach * (1.0 / 65536.0);
                let top = (dot_lanes(n, middle) + dot(size, plan.half)) + slack;
                alive = simd.and_m32s(alive, top.not_negative());
            }
            if !any(simd, alive) {
                return false;
            }
            let span = (((to_first[0].abs() + to_first[1].abs()) + to_first[2].abs()) + t.longest) + reach;
            grazing = distance.below(t.grazing * span);
            if KIND == DIRECTIONS {
                grazing = zero.below(zero);
            }
            seen = [simd.splat_u32s(0); 2];
            for (k, &cell) in plan.cells[..plan.count].iter().enumerate() {
                if candidate.cells >> k & 1 == 0 {
                    continue;
                }
                let (inside, rise);
                if KIND == POINTS {
                    let d = from_point(cell, x);
                    rise = (plan.far * dot(d, t.normal)).flip(sign) - distance;
                    inside = normals.map(|n| dot_lanes(n, d));
                } else {
                    let along = Lanes::splat(simd, plan.far * predicate::dot(t.normal, cell)).flip(sign);
                    rise = along - f32::MIN_POSITIVE;
                    inside = normals.map(|n| dot(n, cell));
                    grazing = simd.or_m32s(grazing, along.below(t.grazing * reach));
                }
                let mut pass = rise.not_negative();
                for e in inside {
                    pass = simd.and_m32s(pass, e.not_negative());
                }
                let bit = simd.select_u32s(pass, simd.splat_u32s(1 << (k & 31)), simd.splat_u32s(0));
                seen[k >> 5] = simd.or_u32s(seen[k >> 5], bit);
            }
        }

        for (w, word) in [low, high].into_iter().enumerate() {
            let cells = simd.splat_u32s((candidate.cells >> (32 * w)) as u32);
            let blocked = simd.and_u32s(simd.and_u32s(seen[w], cells), word);
            seen[w] = simd.select_u32s(alive, blocked, simd.splat_u32s(0));
        }
        let blocked = nonzero(simd, simd.or_u32s(seen[0], seen[1]));
        if !any(simd, blocked) {
            return false;
        }
        let doubtful = if candidate.cutout.is_some() { blocked } else { simd.and_m32s(grazing, blocked) };
        let mut some = true;
        if any(simd, doubtful) {
            let doubt = seen.map(|word| simd.select_u32s(doubtful, word, simd.splat_u32s(0)));
            let refuted = self.refuted::<S>(plan, candidate, doubt, chunk);
            seen = [0, 1].map(|w| simd.xor_u32s(seen[w], S::as_simd_u32s(&refuted[w]).0[0]));
            some = any(simd, nonzero(simd, simd.or_u32s(seen[0], seen[1])));
        }
        S::as_mut_simd_u32s(&mut self.words[0]).0[chunk] = simd.xor_u32s(low, seen[0]);
        S::as_mut_simd_u32s(&mut self.words[1]).0[chunk] = simd.xor_u32s(high, seen[1]);
        some
    }

    /// Those of the blocked bits `doubt` that the check of grazing hits or the cutout lets through.
    #[inline(never)]
    fn refuted<S: Machine>(
        &self,
        plan: &Plan,
        candidate: &Candidate,
        doubt: [S::u32s; 2],
        chunk: usize,
    ) -> [[u32; PACKET]; 2] {
        let mut words = [[0; PACKET]; 2];
        for (word, doubt) in words.iter_mut().zip(doubt) {
            S::as_mut_simd_u32s(word).0[0] = doubt;
        }
        for i in 0..S::F32_LANES {
            let x = self.point(chunk * S::F32_LANES + i);
            for w in 0..2 {
                let mut bits = words[w][i];
                while bits != 0 {
                    let bit = bits & bits.wrapping_neg();
                    bits ^= bit;
                    let k = 32 * w + bit.trailing_zeros() as usize;
                    if candidate.confirms(plan, x, k) {
                        words[w][i] ^= bit;
                    }
                }
            }
        }
        words
    }
}

impl Candidate<'_> {
    /// Whether it hides cell `k` from `x`, given that the four functions say so.
    fn confirms(&self, plan: &Plan, x: [f32; 3], k: usize) -> bool {
        if self.cutout.is_some() {
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

/// base + v·b + u·a + u·v·w for each receiver.
#[derive(Clone, Copy)]
struct Affine<S: Machine> {
    base: Lanes<S>,
    u: Lanes<S>,
    v: Lanes<S>,
    w: Lanes<S>,
}

impl<S: Machine> Affine<S> {
    /// Least and greatest computed value over the cells, or bounds on them. A twisted grid has none: it is not monotone
    /// after rounding, and rare.
    #[inline(always)]
    fn bounds<const KIND: u8>(&self, simd: S, plan: &Plan) -> [Lanes<S>; 2] {
        if KIND == TWISTED {
            return [Lanes::splat(simd, -1.0), Lanes::splat(simd, 1.0)];
        }
        let rows = plan.v_range.map(|v| self.base + v * self.v);
        let columns = plan.u_range.map(|u| u * self.u);
        [rows[0].min(rows[1]) + columns[0].min(columns[1]), rows[0].max(rows[1]) + columns[0].max(columns[1])]
    }

    /// The cells for which the function is not negative.
    #[inline(always)]
    fn words<const KIND: u8, const SIDE: usize>(&self, simd: S, plan: &Plan) -> [S::u32s; 2] {
        let mut words = [simd.splat_u32s(0); 2];
        let mut set = |k: usize, value: Lanes<S>| {
            let bit = simd.select_u32s(value.not_negative(), simd.splat_u32s(1 << (k & 31)), simd.splat_u32s(0));
            words[k >> 5] = simd.or_u32s(words[k >> 5], bit);
        };
        if SIDE > 0 {
            let columns: [Lanes<S>; SIDE] = std::array::from_fn(|i| plan.u[i] * self.u);
            for j in 0..SIDE {
                let row = self.base + plan.v[j * SIDE] * self.v;
                for (i, &column) in columns.iter().enumerate() {
                    set(j * SIDE + i, row + column);
                }
            }
        } else {
            for k in 0..plan.count {
                let slope = if KIND == TWISTED { self.u + plan.v[k] * self.w } else { self.u };
                set(k, (self.base + plan.v[k] * self.v) + plan.u[k] * slope);
            }
        }
        words
    }
}
