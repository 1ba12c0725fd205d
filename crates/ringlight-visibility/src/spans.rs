//! Where a facet's borders cross the rows of a square grid of cells: lanes are receivers.
//!
//! A function of the cells that is affine changes its sign at one place of each row, so a convex facet covers one span of
//! cells in each: two shifts make the bits of a row, instead of a comparison of each cell with each border.

#![allow(clippy::needless_range_loop, reason = "what iterators do to lanes is not inlined, and loses the vectors")]

use crate::instruction_set::Machine;
use crate::kernel::Affine;
use crate::lanes::Lanes;
use crate::plan::Plan;

/// What rounding may take from a place in a row, in cells: numbers up to 8 are rounded by 2⁻²¹ or less, a few times.
const PLACE_ROUNDING: f32 = 1.0 / 65536.0;

/// 2²³ · 1.5: added to numbers from 0 to 8, leaves them rounded in the lowest bits.
const INTEGER: f32 = 12_582_912.0;

/// The borders of a facet as places in rows, counted from the end of the row at which the cells outside are.
pub(crate) struct Spans<S: Machine, const SIDE: usize, const N: usize> {
    /// Places in the first row.
    at: [Lanes<S>; N],
    /// How much they advance with each row.
    step: [Lanes<S>; N],
    /// Half the widths of the error bands.
    half: [Lanes<S>; N],
    /// Whether cells outside come first.
    rising: [S::m32s; N],
}

impl<S: Machine, const SIDE: usize, const N: usize> Spans<S, SIDE, N> {
    /// Of functions that are not negative inside, each with what it may be off. An untwisted grid's.
    #[inline(always)]
    pub fn new(simd: S, plan: &Plan, functions: [Affine<S>; N], bands: [Lanes<S>; N]) -> Self {
        let zero = Lanes::splat(simd, 0.0);
        let mut spans = Spans { at: [zero; N], step: [zero; N], half: [zero; N], rising: [zero.at_least(zero); N] };
        for f in 0..N {
            let Affine { base, u, v, .. } = functions[f];
            let slope = u * (1.0 / SIDE as f32);
            // The bands are taken half as wide again: a ninth of one goes for the slopes that this raises, the rest is for rounding.
            let least = bands[f] * (1.0 / 64.0) + Lanes::splat(simd, f32::MIN_POSITIVE);
            let inverse = Lanes::splat(simd, 1.0) / slope.abs().max(least);
            let first = (base + plan.v[0] * v) + plan.u[0] * u;
            spans.rising[f] = slope.not_negative();
            let last = zero.or(spans.rising[f], Lanes::splat(simd, (SIDE - 1) as f32));
            spans.at[f] = last - first * inverse;
            spans.step[f] = (zero - v * (1.0 / SIDE as f32)) * inverse;
            spans.half[f] = bands[f] * 1.5 * inverse + Lanes::splat(simd, PLACE_ROUNDING);
        }
        spans
    }

    /// The cells inside, in two words: those that are for certain, or those that may be.
    #[inline(always)]
    pub fn words(&self, simd: S, certain: bool) -> [S::u32s; 2] {
        let zero = Lanes::splat(simd, 0.0);
        let mut at = self.at;
        for f in 0..N {
            at[f] = if certain { at[f] + self.half[f] } else { at[f] - self.half[f] };
        }
        let mut words = [simd.splat_u32s(0); 2];
        for j in 0..SIDE {
            let j_times = Lanes::splat(simd, j as f32);
            let (mut before, mut after) = (zero, zero);
            for f in 0..N {
                let place = self.step[f].times_plus(j_times, at[f]);
                before = before.max(place).or(self.rising[f], before);
                after = after.or(self.rising[f], after.max(place));
            }
            let cells = span::<S, SIDE>(simd, before, after);
            let cells = simd.wrapping_dyn_shl_u32s(cells, simd.splat_u32s((j * SIDE % 32) as u32));
            words[j * SIDE / 32] = simd.or_u32s(words[j * SIDE / 32], cells);
        }
        words
    }
}

/// A row's cells from this place on, up to the one as far from the last. Places are not negative; whole numbers must be off by
/// [`PLACE_ROUNDING`] to be sure.
#[inline(always)]
pub(crate) fn span<S: Machine, const SIDE: usize>(simd: S, before: Lanes<S>, after: Lanes<S>) -> S::u32s {
    let row = simd.splat_u32s((1 << SIDE) - 1);
    let first = simd.wrapping_dyn_shl_u32s(row, whole::<S, SIDE>(simd, before));
    simd.and_u32s(first, simd.wrapping_dyn_shr_u32s(row, whole::<S, SIDE>(simd, after)))
}

/// The next whole number, at most SIDE, in the lowest five bits.
#[inline(always)]
fn whole<S: Machine, const SIDE: usize>(simd: S, place: Lanes<S>) -> S::u32s {
    let nearest = (place + 0.5).min(Lanes::splat(simd, SIDE as f32)) + INTEGER;
    simd.transmute_u32s_f32s(nearest.value)
}
