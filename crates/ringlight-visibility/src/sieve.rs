//! A quick look at a triangle, or at two that make a parallelogram, for a packet of receivers and a grid of cells.
//!
//! Seen from the grid's corner, with x the receiver, v a corner of the facet, e and g its edges there, N = e × g, and a
//! cell c = u·U + v·W, the predicate's functions are, in exact arithmetic,
//!
//!   f = ((v−x)×e)·(c−x),  h = (g×(v−x))·(c−x),  and with D = N·(c−x) the third one D − f − h.
//!
//! A parallelogram has D − f and D − h instead. As V = v×e does not depend on the receiver, nor x×U and x×W on the facet,
//! each is had for nine products. They round otherwise than the predicate does; so what lies near a border
//! is left to it, and all else is certain: the bits are the predicate's.

#![allow(clippy::needless_range_loop, reason = "what iterators do to lanes is not inlined, and loses the vectors")]

use crate::instruction_set::Machine;
use crate::kernel::{Affine, words};
use crate::lanes::{self, LaneVector, Lanes, any, dot, dot_plus, from_point, minus, nonzero, norm, splat};
use crate::packet::{PACKET, Packet, words_of};
use crate::plan::Plan;
use crate::predicate::{GRAZING, ROUNDING, Vector, cross, dot as product, norm as length, sub};
use crate::spans::Spans;
use crate::{NO_PLANE, Triangle};

/// Bound on the error of the functions here, relative to longest · (|v|+|x|+longest) · reach: the third is the sum of three
/// with some twelve roundings of 2⁻²⁴ each.
pub(crate) const OURS: f32 = 3.0 * ROUNDING;

/// Bound on the predicate's, relative to longest · (|v−x|+longest) · reach. It may err by [`ROUNDING`] and forgives as
/// much; where two triangles make a parallelogram, a border of one is the sum of two functions of the other.
pub(crate) const THEIRS: f32 = 4.0 * ROUNDING;

/// How far two triangles may be from a parallelogram, relative to the longest edge.
pub(crate) const FLAT: f32 = 2.0 * ROUNDING;

/// A facet.
pub(crate) struct Facet {
    pub corner: Vector,
    pub e: Vector,
    pub g: Vector,
    pub normal: Vector,
    pub longest: f32,
    /// What the predicate may be off, for each metre from the corner and of reach.
    pub strip: f32,
    /// Least |T| for each metre from the corner that tells the side.
    pub flat: f32,
    /// Least |T| for each metre from the corner where rounding cannot confuse the two triangles; 0 where that does not matter.
    pub grazing: f32,
    pub plane: u32,
    /// Whether it is a parallelogram.
    pub is_quad: bool,
}

/// A facet as seen from a grid.
struct Seen<'a> {
    facet: &'a Facet,
    /// v × e and g × v.
    moments: [Vector; 2],
    /// Their products with U and W.
    slopes: [[f32; 2]; 2],
    /// N·U, N·W.
    rise: [f32; 2],
    /// |v| + longest.
    size: f32,
}

impl Seen<'_> {
    #[inline(always)]
    fn new<'a>(plan: &Plan, facet: &'a Facet) -> Seen<'a> {
        let seen = sub(facet.corner, plan.anchor);
        let moments = [cross(seen, facet.e), cross(facet.g, seen)];
        Seen {
            facet,
            moments,
            slopes: [
                [product(moments[0], plan.edge_u), product(moments[0], plan.edge_v)],
                [product(moments[1], plan.edge_u), product(moments[1], plan.edge_v)],
            ],
            rise: [product(facet.normal, plan.edge_u), product(facet.normal, plan.edge_v)],
            size: length(seen) + facet.longest,
        }
    }
}

impl Facet {
    /// The triangle; with `other`, the parallelogram that both make. See [`crate::items::parallelogram`] for `corners`.
    #[inline(always)]
    pub fn new(triangle: &Triangle, corners: u8, other: Option<&Triangle>) -> Facet {
        let [corner, b, c] = match corners & 3 {
            1 => [triangle.corners[1], triangle.corners[2], triangle.corners[0]],
            2 => [triangle.corners[2], triangle.corners[0], triangle.corners[1]],
            _ => triangle.corners,
        };
        let fourth = other.map(|t| t.corners[(corners >> 2) as usize % 3]);
        let (e, g) = (sub(b, corner), sub(c, corner));
        let normal = cross(e, g);
        let edge = sub(e, g);
        let more = |a: f32, b: f32| if a > b { a } else { b };
        let longest = more(more(length(e), length(g)), length(edge));
        let squared = more(more(product(e, e), product(g, g)), product(edge, edge));
        // How far apart the planes of the two triangles may be.
        let bent = match fourth {
            Some(fourth) => length(sub(sub(fourth, corner), [e[0] + g[0], e[1] + g[1], e[2] + g[2]])),
            None => 0.0,
        };
        Facet {
            corner,
            e,
            g,
            normal,
            longest,
            strip: THEIRS * longest + 2.0 * bent,
            flat: 0.5 * ROUNDING * length(normal) + 2.0 * bent * longest,
            // Where both triangles fill the same box, the predicate's check of grazing hits passes for both.
            grazing: if (0..3).all(|i| e[i] * g[i] <= 0.0) { 0.0 } else { 0.5 * GRAZING * squared },
            plane: triangle.plane,
            is_quad: other.is_some(),
        }
    }
}

/// What depends on receivers and grid alone: x, x×U and x×W seen from the grid's corner.
#[repr(C, align(64))]
pub(crate) struct Frame {
    x: [[f32; PACKET]; 3],
    by_u: [[f32; PACKET]; 3],
    by_v: [[f32; PACKET]; 3],
    /// |x|.
    length: [f32; PACKET],
}

impl Frame {
    #[inline(always)]
    pub fn new<S: Machine>(simd: S, plan: &Plan, packet: &Packet) -> Frame {
        let none = [[0.0; PACKET]; 3];
        let mut frame = Frame { x: none, by_u: none, by_v: none, length: [0.0; PACKET] };
        let anchor = splat(simd, plan.anchor);
        for chunk in 0..PACKET / S::F32_LANES {
            let x = minus(packet.points(simd, chunk), anchor);
            let (by_u, by_v) = (lanes::cross(x, plan.edge_u), lanes::cross(x, plan.edge_v));
            for i in 0..3 {
                x[i].store(&mut frame.x[i], chunk);
                by_u[i].store(&mut frame.by_u[i], chunk);
                by_v[i].store(&mut frame.by_v[i], chunk);
            }
            norm(x).store(&mut frame.length, chunk);
        }
        frame
    }

    #[inline(always)]
    fn vector<S: Machine>(simd: S, of: &[[f32; PACKET]; 3], chunk: usize) -> LaneVector<S> {
        [Lanes::load(simd, &of[0], chunk), Lanes::load(simd, &of[1], chunk), Lanes::load(simd, &of[2], chunk)]
    }
}

/// What a facet does to a packet.
pub(crate) struct Sifted {
    /// Whether bits were cleared.
    pub cleared: bool,
    /// The cells that the predicate is to be asked about.
    pub doubtful: u64,
}

/// Clears what the facet hides for certain.
#[inline(always)]
pub(crate) fn sift<S: Machine, const SIDE: usize, const QUAD: bool>(
    simd: S,
    plan: &Plan,
    frame: &Frame,
    packet: &mut Packet,
    facet: &Facet,
) -> Sifted {
    let mut sifted = Sifted { cleared: false, doubtful: 0 };
    let seen = Seen::new(plan, facet);
    for chunk in 0..PACKET / S::F32_LANES {
        sift_chunk::<S, SIDE, QUAD>(simd, plan, frame, packet, &seen, chunk, &mut sifted);
    }
    sifted
}

#[inline(always)]
fn sift_chunk<S: Machine, const SIDE: usize, const QUAD: bool>(
    simd: S,
    plan: &Plan,
    frame: &Frame,
    packet: &mut Packet,
    seen: &Seen,
    chunk: usize,
    sifted: &mut Sifted,
) {
    let facet = seen.facet;
    let masks = packet.masks_of::<S, SIDE>(simd, chunk);
    let mut alive = nonzero(simd, simd.or_u32s(masks[0], masks[1]));
    if facet.plane != NO_PLANE {
        let same = simd.equal_u32s(S::as_simd_u32s(&packet.plane).0[chunk], simd.splat_u32s(facet.plane));
        alive = simd.and_m32s(alive, simd.not_m32s(same));
    }
    let zero = Lanes::splat(simd, 0.0);
    let to_corner = from_point(facet.corner, packet.points(simd, chunk));
    let height = dot(to_corner, facet.normal);
    let (sign, distance) = (height.sign(), height.abs());
    let near = norm(to_corner) + facet.longest;
    let unsure = simd.and_m32s(alive, distance.below(near * facet.flat));
    let reach = packet.reach(simd, chunk);
    let across = seen.size + Lanes::load(simd, &frame.length, chunk);
    let band = (across * (OURS * facet.longest) + near * facet.strip) * reach;

    let x = Frame::vector(simd, &frame.x, chunk);
    let (by_u, by_v) = (Frame::vector(simd, &frame.by_u, chunk), Frame::vector(simd, &frame.by_v, chunk));
    let rise = Affine {
        base: dot_plus(simd, x, opposite(facet.normal), zero).flip(sign),
        u: Lanes::splat(simd, seen.rise[0]).flip(sign),
        v: Lanes::splat(simd, seen.rise[1]).flip(sign),
    };
    let depth_band = (across + reach) * (THEIRS * facet.longest * facet.longest);
    let depth = Affine { base: rise.base * plan.far - distance, u: rise.u * plan.far, v: rise.v * plan.far };
    let [bottom, top] = depth.plus(depth_band).bounds(plan);
    let mut open = simd.and_m32s(alive, simd.or_m32s(unsure, top.not_negative()));
    if !any(simd, open) {
        return;
    }
    let first = Affine {
        base: dot_plus(simd, x, opposite(seen.moments[0]), zero).flip(sign),
        u: dot_plus(simd, by_u, facet.e, Lanes::splat(simd, seen.slopes[0][0])).flip(sign),
        v: dot_plus(simd, by_v, facet.e, Lanes::splat(simd, seen.slopes[0][1])).flip(sign),
    };
    let second = Affine {
        base: dot_plus(simd, x, opposite(seen.moments[1]), zero).flip(sign),
        u: dot_plus(simd, by_u, opposite(facet.g), Lanes::splat(simd, seen.slopes[1][0])).flip(sign),
        v: dot_plus(simd, by_v, opposite(facet.g), Lanes::splat(simd, seen.slopes[1][1])).flip(sign),
    };
    let (third, fourth) =
        if QUAD { (rise.less(first), rise.less(second)) } else { (rise.less(first).less(second), rise) };
    let functions = [first, second, third, fourth];
    let mut possible = simd.and_m32s(open, top.not_negative());
    let count = if QUAD { 4 } else { 3 };
    for f in 0..count {
        let [_, top] = functions[f].plus(band).bounds(plan);
        possible = simd.and_m32s(possible, top.not_negative());
    }
    open = simd.or_m32s(possible, unsure);
    if !any(simd, open) {
        return;
    }
    let none = simd.splat_u32s(0);
    let [a, b, c, d] = functions;
    let wanted = Wanted {
        possible: [simd.select_u32s(possible, masks[0], none), simd.select_u32s(possible, masks[1], none)],
        unsure: [simd.select_u32s(unsure, masks[0], none), simd.select_u32s(unsure, masks[1], none)],
    };
    // Where a cell may lie before the facet, depth is one function more.
    let found = match (QUAD, any(simd, simd.and_m32s(possible, (bottom - (depth_band + depth_band)).below(zero)))) {
        (true, true) => {
            let bands = [band, band, band, band, depth_band];
            cells::<S, SIDE, 5>(simd, plan, [a, b, c, d, depth], bands, wanted)
        }
        (true, false) => cells::<S, SIDE, 4>(simd, plan, functions, [band; 4], wanted),
        (false, true) => cells::<S, SIDE, 4>(simd, plan, [a, b, c, depth], [band, band, band, depth_band], wanted),
        (false, false) => cells::<S, SIDE, 3>(simd, plan, [a, b, c], [band; 3], wanted),
    };
    let Some([maybe, mut sure]) = found else { return };
    let certain = simd.not_m32s(unsure);
    // Where the receiver grazes the facet, which of a parallelogram's triangles is hit must be certain, too.
    if QUAD {
        let grazing = simd.and_m32s(possible, distance.below(near * facet.grazing));
        if any(simd, grazing) {
            let apart = rise.less(first).less(second);
            let one = words::<S, SIDE, 1>(simd, plan, [apart.minus(band)]);
            let both = words::<S, SIDE, 1>(simd, plan, [apart.plus(band)]);
            for w in 0..words_of(SIDE) {
                let clear = simd.or_u32s(one[w], simd.not_u32s(both[w]));
                sure[w] = simd.select_u32s(grazing, simd.and_u32s(sure[w], clear), sure[w]);
            }
        }
    }
    let mut left = none;
    let mut hidden = none;
    for w in 0..words_of(SIDE) {
        sure[w] = simd.and_u32s(maybe[w], simd.select_u32s(certain, sure[w], none));
        left = simd.or_u32s(left, simd.xor_u32s(maybe[w], sure[w]));
        hidden = simd.or_u32s(hidden, sure[w]);
        S::as_mut_simd_u32s(&mut packet.words[w]).0[chunk] = simd.xor_u32s(masks[w], sure[w]);
    }
    sifted.cleared |= any(simd, nonzero(simd, hidden));
    sifted.doubtful |= if any(simd, nonzero(simd, left)) { u64::MAX } else { 0 };
}

/// −a.
#[inline(always)]
fn opposite(a: Vector) -> Vector {
    [-a[0], -a[1], -a[2]]
}

/// Cells that receivers still see, where the functions decide and where they do not.
struct Wanted<S: Machine> {
    possible: [S::u32s; 2],
    unsure: [S::u32s; 2],
}

/// The cells for which no function is negative: those that may be or are unsure, and those that are for certain; `None` if no
/// cell may be.
#[inline(always)]
fn cells<S: Machine, const SIDE: usize, const N: usize>(
    simd: S,
    plan: &Plan,
    functions: [Affine<S>; N],
    bands: [Lanes<S>; N],
    wanted: Wanted<S>,
) -> Option<[[S::u32s; 2]; 2]> {
    let spans = if SIDE > 0 { Some(Spans::<S, SIDE, N>::new(simd, plan, functions, bands)) } else { None };
    let mut shifted = functions;
    for f in 0..N {
        shifted[f] = functions[f].plus(bands[f]);
    }
    let mut maybe = match &spans {
        Some(spans) => spans.words(simd, false),
        None => words::<S, SIDE, N>(simd, plan, shifted),
    };
    for w in 0..2 {
        maybe[w] = simd.or_u32s(simd.and_u32s(maybe[w], wanted.possible[w]), wanted.unsure[w]);
    }
    if !any(simd, nonzero(simd, simd.or_u32s(maybe[0], maybe[1]))) {
        return None;
    }
    for f in 0..N {
        shifted[f] = functions[f].minus(bands[f]);
    }
    let sure = match &spans {
        Some(spans) => spans.words(simd, true),
        None => words::<S, SIDE, N>(simd, plan, shifted),
    };
    Some([maybe, sure])
}
