//! A packet of receivers, and what a triangle clears of their masks.

use crate::instruction_set::Machine;
use crate::kernel::{DIRECTIONS, Found, GRID, POINTS, View};
use crate::lanes::{LaneVector, Lanes, any, dot, from_point, nonzero, norm};
use crate::plan::{Kind, Plan};
use crate::predicate::{self, Prepared};
use crate::{NO_PLANE, Tally, Triangle};

/// Receivers in a packet.
pub(crate) const PACKET: usize = 16;

/// Words of a mask that the cells of a grid with so many rows and columns take; 0 stands for any cells.
pub(crate) const fn words_of(side: usize) -> usize {
    if side == 0 || side > 5 { 2 } else { 1 }
}

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
    /// The points of a register.
    #[inline(always)]
    pub fn points<S: Machine>(&self, simd: S, chunk: usize) -> LaneVector<S> {
        [Lanes::load(simd, &self.x, chunk), Lanes::load(simd, &self.y, chunk), Lanes::load(simd, &self.z, chunk)]
    }

    /// [`Plan::reach`] of the points of a register.
    #[inline(always)]
    pub fn reach<S: Machine>(&self, simd: S, chunk: usize) -> Lanes<S> {
        Lanes::load(simd, &self.reach, chunk)
    }

    /// Finds [`Plan::reach`] of all points, with the same roundings.
    #[inline(always)]
    pub fn find_reach<S: Machine>(&mut self, simd: S, plan: &Plan) {
        for chunk in 0..PACKET / S::F32_LANES {
            let reach = if plan.kind == Kind::Directions {
                Lanes::splat(simd, plan.reach([0.0; 3]))
            } else {
                norm(from_point(plan.anchor, self.points(simd, chunk))) + plan.spread
            };
            reach.store(&mut self.reach, chunk);
        }
    }

    /// The masks of a register, over a grid.
    #[inline(always)]
    pub fn masks_of<S: Machine, const SIDE: usize>(&self, simd: S, chunk: usize) -> [S::u32s; 2] {
        let low = S::as_simd_u32s(&self.words[0]).0[chunk];
        if words_of(SIDE) == 1 {
            return [low, simd.splat_u32s(0)];
        }
        [low, S::as_simd_u32s(&self.words[1]).0[chunk]]
    }

    /// The masks of a register.
    #[inline(always)]
    pub fn masks<S: Machine>(&self, _: S, chunk: usize) -> [S::u32s; 2] {
        [S::as_simd_u32s(&self.words[0]).0[chunk], S::as_simd_u32s(&self.words[1]).0[chunk]]
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
        self.seeing(simd, u64::MAX)
    }

    /// The lanes that still see any of these cells, as bits.
    #[inline(always)]
    pub fn seeing<S: Machine>(&self, simd: S, cells: u64) -> u32 {
        let mut bits = 0;
        for chunk in 0..PACKET / S::F32_LANES {
            let [low, high] = self.masks(simd, chunk);
            let low = simd.and_u32s(low, simd.splat_u32s(cells as u32));
            let high = simd.and_u32s(high, simd.splat_u32s((cells >> 32) as u32));
            bits |= simd.bits(nonzero(simd, simd.or_u32s(low, high))) << (chunk * S::F32_LANES);
        }
        bits
    }

    /// Puts the masks in place of those of the points with these numbers; counts those it was packed from.
    pub fn unpack(&self, plan: &Plan, numbers: &[u64], masks: &mut [u64], tested: bool) -> Tally {
        let count = numbers.len() as u64;
        let mut tally = Tally { rays: 0, masks: count, masks_without_rays: 0 };
        for (lane, &number) in numbers.iter().enumerate() {
            let mask = &mut masks[number as u32 as usize];
            tally.rays += u64::from(mask.count_ones());
            tally.masks_without_rays += u64::from(!tested || *mask & plan.all == 0);
            *mask = (*mask & !plan.all) | self.mask(lane);
        }
        tally
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
        let x = self.points(simd, chunk);
        let [low, high] = self.masks(simd, chunk);
        let reach = self.reach(simd, chunk);

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
        let view = View { x, to_first, sign, distance, reach, allowance: (near * reach) * t.rounding, near };
        let wanted = [
            simd.and_u32s(low, simd.splat_u32s(candidate.cells as u32)),
            simd.and_u32s(high, simd.splat_u32s((candidate.cells >> 32) as u32)),
        ];
        let found = if KIND == GRID {
            view.over_grid::<SIDE>(simd, plan, candidate, alive, wanted)
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
                if bits == 0 {
                    continue;
                }
                let x = self.point(lane);
                // What is the same for all cells is asked once.
                let t = &candidate.prepared;
                let directions = plan.kind == Kind::Directions;
                let height = predicate::dot(t.normal, predicate::sub(t.corners[0], x));
                let grazing = directions || plan.is_grazing(t, x, 0, height);
                let (around, far) = plan.grown_box(t, x);
                while bits != 0 {
                    let bit = bits & bits.wrapping_neg();
                    bits ^= bit;
                    let k = 32 * w + bit.trailing_zeros() as usize;
                    let confirmed = if candidate.cutout.is_some() || sure[w][lane] & bit == 0 {
                        candidate.blocks(plan, x, k)
                    } else {
                        !grazing
                            || directions && !plan.is_grazing(t, x, k, height)
                            || predicate::pass(around, plan.towards(x, k), far).is_some()
                    };
                    if confirmed {
                        *word ^= bit;
                    }
                }
            }
        }
    }
}

impl Candidate<'_> {
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
