//! How boxes and facets are looked at for cells wherever they are: a group's, a lamp's, the sky's.
//!
//! A box hides a cell only where it meets the shaft from the receivers' box to the cell, and only from a receiver whose shaft
//! to the cells it meets. For a facet with corner v, edges e and g and N = e × g, see `sieve.rs`, the predicate's functions
//! are, in exact arithmetic,
//!
//!   f = ((v−x)×e)·(c−x),  h = (g×(v−x))·(c−x),  D = N·(c−x);  D − f − h, or for a parallelogram D − f and D − h.
//!
//! They are affine in the cell c: with c−x split at the shooter's anchor they take nine products for each cell. What lies near a
//! border is left to the predicate, and all else is certain: the bits are the predicate's.

#![allow(clippy::needless_range_loop, reason = "what iterators do to lanes is not inlined, and loses the vectors")]

use crate::build::Bounds;
use crate::descent::{Borders, Look};
use crate::instruction_set::Machine;
use crate::lanes::{LaneVector, Lanes, any, dot, dot_lanes, dot_plus, flip, from_point, minus, nonzero, norm, splat};
use crate::packet::{PACKET, Packet};
use crate::plan::{Kind, Plan};
use crate::predicate::{Vector, sub};
use crate::shadow::Block;
use crate::shaft::{along, around, extend, leave};
use crate::shafts::Shafts;
use crate::sieve::{Facet, OURS, Sifted, THEIRS};
use crate::{MAX_CELLS, NO_PLANE};

/// At scattered cells.
pub(crate) struct AtCells {
    /// From the box around the receivers to each cell.
    to_cells: Shafts<MAX_CELLS>,
    /// From each receiver to the box around the cells.
    from_receivers: Shafts<PACKET>,
    /// Cells that any receiver still saw when these were made.
    seen: u64,
}

impl Look for AtCells {
    type Of<'a> = ();

    #[inline(always)]
    fn new<M: Machine>(_: M, _: &Plan, (): (), packet: &Packet) -> Self {
        let centre = packet.point(0);
        AtCells { to_cells: Shafts::new(centre), from_receivers: Shafts::new(centre), seen: 0 }
    }

    #[inline(always)]
    fn narrow<M: Machine>(&mut self, _: M, plan: &Plan, packet: &Packet, unfinished: u32, scene: &Bounds) {
        let mut points = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        let mut reach = 0f32;
        for lane in (0..PACKET).filter(|lane| unfinished >> lane & 1 == 1) {
            extend(&mut points, packet.point(lane));
            reach = reach.max(packet.reach[lane]);
        }
        self.seen = packet.union();
        let cells = around(plan, self.seen);
        let mut way = None;
        if plan.kind == Kind::Directions {
            let (distance, times) = leave(plan, points, scene);
            (reach, way) = (distance, Some(times));
        }
        let end = |from, cells| way.map_or(cells, |way| along(from, cells, way));
        for k in (0..plan.count).filter(|k| self.seen >> k & 1 == 1) {
            let cell = plan.cells[k];
            self.to_cells.put(k, points, end(points, (cell, cell)), reach);
        }
        for lane in (0..PACKET).filter(|lane| unfinished >> lane & 1 == 1) {
            let x = (packet.point(lane), packet.point(lane));
            let reach = if way.is_some() { reach } else { packet.reach[lane] };
            self.from_receivers.put(lane, x, end(x, cells), reach);
        }
    }

    #[inline(always)]
    fn turn<M: Machine>(_: M, _: &Plan, (): (), (low, high): Borders, to: &mut Block) {
        (to.low, to.high) = (*low, *high);
    }

    #[inline(always)]
    fn hidden<M: Machine>(&self, machine: M, plan: &Plan, packet: &Packet, around: (Vector, Vector)) -> u64 {
        let cells = self.to_cells.met(machine, plan.count, around) & self.seen;
        if cells == 0 {
            return 0;
        }
        let receivers = self.from_receivers.met(machine, PACKET, around) as u32;
        if receivers & packet.seeing(machine, cells) != 0 { cells } else { 0 }
    }

    #[inline(always)]
    fn sift<M: Machine>(&self, machine: M, plan: &Plan, packet: &mut Packet, facet: &Facet, cells: u64) -> Sifted {
        let mut sifted = Sifted { cleared: false, doubtful: 0 };
        for chunk in 0..PACKET / M::F32_LANES {
            match (plan.kind, facet.is_quad) {
                (Kind::Points, true) => {
                    sift_chunk::<M, true, false>(machine, plan, packet, facet, cells, chunk, &mut sifted)
                }
                (Kind::Points, false) => {
                    sift_chunk::<M, false, false>(machine, plan, packet, facet, cells, chunk, &mut sifted)
                }
                (Kind::Directions, true) => {
                    sift_chunk::<M, true, true>(machine, plan, packet, facet, cells, chunk, &mut sifted)
                }
                (Kind::Directions, false) => {
                    sift_chunk::<M, false, true>(machine, plan, packet, facet, cells, chunk, &mut sifted);
                }
                // A grid has axes, and a way of its own.
                (Kind::Grid, _) => sifted.doubtful = cells,
            }
        }
        sifted
    }
}

/// `QUAD`: a parallelogram. `FAR`: cells are directions.
#[inline(always)]
fn sift_chunk<S: Machine, const QUAD: bool, const FAR: bool>(
    simd: S,
    plan: &Plan,
    packet: &mut Packet,
    facet: &Facet,
    cells: u64,
    chunk: usize,
    sifted: &mut Sifted,
) {
    let none = simd.splat_u32s(0);
    let mut masks = packet.masks(simd, chunk);
    for w in 0..2 {
        masks[w] = simd.and_u32s(masks[w], simd.splat_u32s((cells >> (32 * w)) as u32));
    }
    let mut alive = nonzero(simd, simd.or_u32s(masks[0], masks[1]));
    if facet.plane != NO_PLANE {
        let same = simd.equal_u32s(S::as_simd_u32s(&packet.plane).0[chunk], simd.splat_u32s(facet.plane));
        alive = simd.and_m32s(alive, simd.not_m32s(same));
    }
    if !any(simd, alive) {
        return;
    }
    let x = packet.points(simd, chunk);
    let to_corner = from_point(facet.corner, x);
    let height = dot(to_corner, facet.normal);
    let (sign, distance) = (height.sign(), height.abs());
    let near = norm(to_corner) + facet.longest;
    let unsure = simd.and_m32s(alive, distance.below(near * facet.flat));
    let reach = packet.reach(simd, chunk);
    let band = (near * (OURS * facet.longest + facet.strip)) * reach;
    // D must be positive, or for cells at places exceed |T| on the way that counts; it may be off by the other one.
    let depth_band = (near + reach) * (2.0 * THEIRS * facet.longest * facet.longest);
    let (zero, per_way) = (Lanes::splat(simd, 0.0), 1.0 / plan.far);
    let (least, most) = if FAR {
        (zero - depth_band, depth_band + f32::MIN_POSITIVE)
    } else {
        ((distance - depth_band) * per_way, (distance + depth_band) * per_way)
    };

    // What the functions are at the anchor, and from there on.
    let from_anchor = minus(x, splat(simd, plan.anchor));
    let functions = [
        flip(product(to_corner, splat(simd, facet.e)), sign),
        flip(product(splat(simd, facet.g), to_corner), sign),
        flip(splat(simd, facet.normal), sign),
    ];
    let mut bases = [zero; 3];
    for i in 0..3 {
        bases[i] = if FAR { zero } else { zero - dot_lanes(functions[i], from_anchor) };
    }
    let mut asked = [[0u32; PACKET]; 2];
    for w in 0..2 {
        masks[w] = simd.select_u32s(alive, masks[w], none);
        S::as_mut_simd_u32s(&mut asked[w]).0[chunk] = masks[w];
    }
    // Of a grazed parallelogram it must be certain, too, which of its triangles is hit. What directions graze is not asked.
    let height = if FAR { zero } else { distance };
    let grazing = simd.and_m32s(alive, height.below(near * facet.grazing));
    let may_graze = QUAD && any(simd, grazing);
    let (mut hidden, mut left) = (false, none);
    for w in 0..2 {
        let mut bits =
            asked[w][chunk * S::F32_LANES..(chunk + 1) * S::F32_LANES].iter().fold(0, |all, word| all | word);
        let (mut maybe, mut sure) = (none, none);
        while bits != 0 {
            let bit = bits & bits.wrapping_neg();
            let k = 32 * w + bits.trailing_zeros() as usize;
            bits ^= bit;
            let cell = if FAR { plan.cells[k % MAX_CELLS] } else { sub(plan.cells[k % MAX_CELLS], plan.anchor) };
            let first = dot_plus(simd, functions[0], cell, bases[0]);
            let second = dot_plus(simd, functions[1], cell, bases[1]);
            let rise = dot_plus(simd, functions[2], cell, bases[2]);
            let inside = if QUAD {
                first.min(second).min((rise - first).min(rise - second))
            } else {
                first.min(second).min((rise - first) - second)
            };
            let here = simd.and_m32s((inside + band).not_negative(), rise.at_least(least));
            let mut certain = simd.and_m32s(inside.at_least(band), rise.at_least(most));
            if may_graze {
                let apart = ((rise - first) - second).abs().at_least(band);
                certain = simd.and_m32s(certain, simd.or_m32s(apart, simd.not_m32s(grazing)));
            }
            maybe = simd.or_u32s(maybe, simd.select_u32s(here, simd.splat_u32s(bit), none));
            sure = simd.or_u32s(sure, simd.select_u32s(certain, simd.splat_u32s(bit), none));
        }
        let doubted = simd.select_u32s(unsure, masks[w], none);
        sure = simd.and_u32s(simd.select_u32s(unsure, none, sure), masks[w]);
        let seen = simd.or_u32s(simd.and_u32s(maybe, masks[w]), doubted);
        let rest = simd.and_u32s(seen, simd.not_u32s(sure));
        hidden |= any(simd, nonzero(simd, sure));
        left = simd.or_u32s(left, rest);
        if any(simd, nonzero(simd, rest)) {
            S::as_mut_simd_u32s(&mut asked[w]).0[chunk] = rest;
            let cells =
                asked[w][chunk * S::F32_LANES..(chunk + 1) * S::F32_LANES].iter().fold(0, |all, word| all | word);
            sifted.doubtful |= u64::from(cells) << (32 * w);
        }
        let words = S::as_mut_simd_u32s(&mut packet.words[w]).0;
        words[chunk] = simd.and_u32s(words[chunk], simd.not_u32s(sure));
    }
    sifted.cleared |= hidden;
}

/// a × b.
#[inline(always)]
fn product<S: Machine>(a: LaneVector<S>, b: LaneVector<S>) -> LaneVector<S> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
