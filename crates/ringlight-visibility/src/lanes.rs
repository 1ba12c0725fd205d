//! Vectors of receivers: `pulp`'s registers with operators, in plain (never fused) arithmetic.
//!
//! Code over lanes has neither closures nor `map`: what is not `#[inline(always)]` is compiled without the vector
//! instructions, and each operation in it becomes a call (fifty times slower).

use std::ops::{Add, Div, Mul, Sub};

use crate::instruction_set::Machine;

/// A register of numbers, one per receiver.
#[derive(Clone, Copy)]
pub(crate) struct Lanes<S: Machine> {
    simd: S,
    pub value: S::f32s,
}

/// A vector in space per receiver.
pub(crate) type LaneVector<S> = [Lanes<S>; 3];

impl<S: Machine> Lanes<S> {
    #[inline(always)]
    pub fn new(simd: S, value: S::f32s) -> Self {
        Lanes { simd, value }
    }

    /// Register `chunk` of `all`.
    #[inline(always)]
    pub fn load<const N: usize>(simd: S, all: &[f32; N], chunk: usize) -> Self {
        Lanes { simd, value: S::as_simd_f32s(all).0[chunk] }
    }

    /// Into register `chunk` of `all`.
    #[inline(always)]
    pub fn store<const N: usize>(self, all: &mut [f32; N], chunk: usize) {
        S::as_mut_simd_f32s(all).0[chunk] = self.value;
    }

    /// self · factor + sum, fused where that is fast: not for what must round everywhere alike.
    #[inline(always)]
    pub fn times_plus(self, factor: Self, sum: Self) -> Self {
        Lanes { simd: self.simd, value: self.simd.mul_add_e_f32s(self.value, factor.value, sum.value) }
    }

    /// These numbers in the lanes of `mask`, and `other` elsewhere.
    #[inline(always)]
    pub fn or(self, mask: S::m32s, other: Self) -> Self {
        Lanes { simd: self.simd, value: self.simd.select_f32s(mask, self.value, other.value) }
    }

    #[inline(always)]
    pub fn splat(simd: S, value: f32) -> Self {
        Lanes { simd, value: simd.splat_f32s(value) }
    }

    #[inline(always)]
    pub fn abs(self) -> Self {
        // `pulp` calls a function for its own `abs`, and that one three more.
        let bits = self.simd.splat_f32s(f32::from_bits(0x7fff_ffff));
        Lanes { simd: self.simd, value: self.simd.and_f32s(self.value, bits) }
    }

    #[inline(always)]
    pub fn min(self, other: Self) -> Self {
        Lanes { simd: self.simd, value: self.simd.min_f32s(self.value, other.value) }
    }

    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        Lanes { simd: self.simd, value: self.simd.max_f32s(self.value, other.value) }
    }

    /// Exclusive or of the bits, used to flip signs.
    #[inline(always)]
    pub fn flip(self, sign: Self) -> Self {
        Lanes { simd: self.simd, value: self.simd.xor_f32s(self.value, sign.value) }
    }

    /// The sign bit alone.
    #[inline(always)]
    pub fn sign(self) -> Self {
        let bit = self.simd.splat_f32s(-0.0);
        Lanes { simd: self.simd, value: self.simd.and_f32s(self.value, bit) }
    }

    #[inline(always)]
    pub fn at_least(self, other: Self) -> S::m32s {
        self.simd.greater_than_or_equal_f32s(self.value, other.value)
    }

    #[inline(always)]
    pub fn below(self, other: Self) -> S::m32s {
        self.simd.less_than_f32s(self.value, other.value)
    }

    #[inline(always)]
    pub fn not_negative(self) -> S::m32s {
        self.at_least(Self::splat(self.simd, 0.0))
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident, $call:ident) => {
        impl<S: Machine> $trait for Lanes<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Lanes { simd: self.simd, value: self.simd.$call(self.value, other.value) }
            }
        }
        impl<S: Machine> $trait<f32> for Lanes<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: f32) -> Self {
                $trait::$method(self, Self::splat(self.simd, other))
            }
        }
        impl<S: Machine> $trait<Lanes<S>> for f32 {
            type Output = Lanes<S>;
            #[inline(always)]
            fn $method(self, other: Lanes<S>) -> Lanes<S> {
                $trait::$method(Lanes::splat(other.simd, self), other)
            }
        }
    };
}

operator!(Add, add, add_f32s);
operator!(Sub, sub, sub_f32s);
operator!(Mul, mul, mul_f32s);
operator!(Div, div, div_f32s);

/// Each coordinate with its sign flipped where `sign` has its bit set.
#[inline(always)]
pub(crate) fn flip<S: Machine>(a: LaneVector<S>, sign: Lanes<S>) -> LaneVector<S> {
    [a[0].flip(sign), a[1].flip(sign), a[2].flip(sign)]
}

/// Each coordinate without its sign.
#[inline(always)]
pub(crate) fn abs<S: Machine>(a: LaneVector<S>) -> LaneVector<S> {
    [a[0].abs(), a[1].abs(), a[2].abs()]
}

/// The same vector in every lane.
#[inline(always)]
pub(crate) fn splat<S: Machine>(simd: S, a: [f32; 3]) -> LaneVector<S> {
    [Lanes::splat(simd, a[0]), Lanes::splat(simd, a[1]), Lanes::splat(simd, a[2])]
}

/// Sum of the absolute coordinates.
#[inline(always)]
pub(crate) fn norm<S: Machine>(a: LaneVector<S>) -> Lanes<S> {
    let a = abs(a);
    (a[0] + a[1]) + a[2]
}

/// a − x.
#[inline(always)]
pub(crate) fn from_point<S: Machine>(a: [f32; 3], x: LaneVector<S>) -> LaneVector<S> {
    [a[0] - x[0], a[1] - x[1], a[2] - x[2]]
}

/// a − b.
#[inline(always)]
pub(crate) fn minus<S: Machine>(a: LaneVector<S>, b: LaneVector<S>) -> LaneVector<S> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// a × b.
#[inline(always)]
pub(crate) fn cross<S: Machine>(a: LaneVector<S>, b: [f32; 3]) -> LaneVector<S> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// a · b with `b` the same for all receivers.
#[inline(always)]
pub(crate) fn dot<S: Machine>(a: LaneVector<S>, b: [f32; 3]) -> Lanes<S> {
    (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2]
}

/// a · b + c, rounded as is fast.
#[inline(always)]
pub(crate) fn dot_plus<S: Machine>(simd: S, a: LaneVector<S>, b: [f32; 3], c: Lanes<S>) -> Lanes<S> {
    let b = splat(simd, b);
    a[2].times_plus(b[2], a[1].times_plus(b[1], a[0].times_plus(b[0], c)))
}

/// a · b.
#[inline(always)]
pub(crate) fn dot_lanes<S: Machine>(a: LaneVector<S>, b: LaneVector<S>) -> Lanes<S> {
    (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2]
}

/// Whether any lane is set.
#[inline(always)]
pub(crate) fn any<S: Machine>(simd: S, mask: S::m32s) -> bool {
    simd.bits(mask) != 0
}

/// The lanes in which a bit is set.
#[inline(always)]
pub(crate) fn nonzero<S: Machine>(simd: S, word: S::u32s) -> S::m32s {
    simd.not_m32s(simd.equal_u32s(word, simd.splat_u32s(0)))
}
