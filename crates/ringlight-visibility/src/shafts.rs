//! Shafts side by side: lanes are shafts.
//!
//! A shaft is all that lies between a box and another one. Those of a packet's receivers, each to the box around the cells,
//! and those from the receivers' box, to each of the cells, tell together what a box may hide from whom. Unlike [`Shaft`],
//! which takes many boxes at a time, these take one.
//!
//! On the way from box F to box G, at the share t between 0 and 1, a shaft is as wide as (1 − t) F + t G. It meets a box
//! where that does, along each axis: six conditions on t, affine in the box's borders.
//!
//! [`Shaft`]: crate::shaft::Shaft

#![allow(clippy::needless_range_loop, reason = "what iterators do to lanes is not inlined, and loses the vectors")]

use crate::instruction_set::Machine;
use crate::lanes::Lanes;
use crate::predicate::{ROUNDING, SHAFT_MARGIN, Vector, norm, sub};

/// Slopes below this share of the margin count as this.
const FLAT: f32 = 1.0 / 1024.0;

/// N of them.
#[repr(C, align(64))]
pub(crate) struct Shafts<const N: usize> {
    centre: Vector,
    /// For each of three axes, of t·slope ≤ offset + high and of t·slope ≤ offset − low: what to add to the border, and 1
    /// over the slope.
    offset: [[f32; N]; 6],
    inverse: [[f32; N]; 6],
}

impl<const N: usize> Shafts<N> {
    /// None yet; coordinates are taken from the centre.
    pub fn new(centre: Vector) -> Self {
        Shafts { centre, offset: [[0.0; N]; 6], inverse: [[1.0; N]; 6] }
    }

    /// Makes lane `k` the shaft from a box to another one, grown by its margin for this reach.
    #[inline(always)]
    pub fn put(&mut self, k: usize, from: (Vector, Vector), to: (Vector, Vector), reach: f32) {
        let (low, high) = (sub(from.0, self.centre), sub(from.1, self.centre));
        // What slopes are raised by goes on top, and rounding where the centre is farther than the other box. Where all is in
        // one place, anything positive will do.
        let rounding = ROUNDING * (norm(low) + norm(high));
        let margin = ((SHAFT_MARGIN * (1.0 + FLAT)) * reach + rounding) + 1e-30;
        for axis in 0..3 {
            self.offset[2 * axis][k] = margin - low[axis];
            self.offset[2 * axis + 1][k] = margin + high[axis];
            self.inverse[2 * axis][k] = to.0[axis] - from.0[axis];
            self.inverse[2 * axis + 1][k] = from.1[axis] - to.1[axis];
        }
        let least = (FLAT * SHAFT_MARGIN) * reach + 1e-33;
        for side in &mut self.inverse {
            let slope = side[k];
            side[k] = (1.0 / if slope.abs() > least { slope.abs() } else { least }).copysign(slope);
        }
    }

    /// Which of the first `count` shafts the box meets, as bits.
    #[inline(always)]
    pub fn met<S: Machine>(&self, simd: S, count: usize, (low, high): (Vector, Vector)) -> u64 {
        let (low, high) = (sub(low, self.centre), sub(high, self.centre));
        let mut bits = 0;
        let mut chunk = 0;
        while chunk * S::F32_LANES < count {
            let (mut enter, mut leave) = (Lanes::splat(simd, 0.0), Lanes::splat(simd, 1.0));
            for side in 0..6 {
                let border = if side % 2 == 0 { high[side / 2] } else { -low[side / 2] };
                let inverse = Lanes::load(simd, &self.inverse[side], chunk);
                let at = (Lanes::load(simd, &self.offset[side], chunk) + border) * inverse;
                let rising = inverse.not_negative();
                leave = leave.min(at).or(rising, leave);
                enter = enter.or(rising, enter.max(at));
            }
            bits |= u64::from(simd.bits(leave.at_least(enter))) << (chunk * S::F32_LANES);
            chunk += 1;
        }
        bits
    }
}
