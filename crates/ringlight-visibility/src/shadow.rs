//! Shadows of boxes on a grid of cells: lanes are receivers.
//!
//! Most of what lies between a receiver and a shooter is small, or hides cells that are hidden already. In coordinates
//! along the grid's edges and its normal, the shadow of a box takes two divisions for sixteen receivers; where no cell
//! that is still seen lies in any receiver's shadow, nothing in the box needs a look.
//!
//! Accepted segments pass within [`SHAFT_MARGIN`] of the reach of a triangle's box, so the shadows of boxes grown by
//! that hold them all. What of a box is behind the receiver hides nothing: the box is cut there, and its shadow goes on for
//! ever on the sides where the box does.

#![allow(clippy::needless_range_loop, reason = "what iterators do to lanes is not inlined, and loses the vectors")]

use crate::Triangle;
use crate::build::WIDTH;
use crate::instruction_set::Machine;
use crate::lanes::{Lanes, any, dot, from_point, minus, nonzero, norm, splat};
use crate::packet::{PACKET, Packet};
use crate::plan::Plan;
use crate::predicate::{SHAFT_MARGIN, Vector, cross, dot as product, norm as length, sub};
use crate::spans::span;

/// Share of the lengths involved that rounding may take, with plenty to spare.
const ROUNDING: f32 = 1.0 / 65536.0;

/// Height of a receiver that sees the grid edge-on, as a share of the margin: any box is nearer and farther.
const EDGEWISE: f32 = 1.0 / 1024.0;

/// Share of a receiver's height where boxes are cut.
const NEAREST: f32 = 1e-9;

/// What rounding may take from a place on the lattice.
const LATTICE_ROUNDING: f32 = 1.0 / 512.0;

/// Boxes, structure of arrays: in space, or in the grid's coordinates.
#[repr(C, align(64))]
#[derive(Clone, Copy)]
pub(crate) struct Block {
    pub low: [[f32; WIDTH]; 3],
    pub high: [[f32; WIDTH]; 3],
}

/// The axes of a grid's coordinates: dual to the edges, so that cells lie at whole numbers, and its normal. None for a grid
/// too thin.
pub(crate) fn axes(edge_u: Vector, edge_v: Vector, (count, _): (f32, f32)) -> Option<[Vector; 3]> {
    let normal = cross(edge_u, edge_v);
    let squared = product(normal, normal);
    let edges = product(edge_u, edge_u) * product(edge_v, edge_v);
    if !(squared > edges * 0.01 && squared > 1e-20 && squared < 1e20) {
        return None;
    }
    let scale = count / squared;
    let unit = 1.0 / squared.sqrt();
    Some([cross(edge_v, normal).map(|c| c * scale), cross(normal, edge_u).map(|c| c * scale), normal.map(|c| c * unit)])
}

/// Boxes in space in the grid's coordinates, grown by what rounding may take.
#[inline(always)]
pub(crate) fn turned<S: Machine>(
    simd: S,
    plan: &Plan,
    axes: &[Vector; 3],
    low: &[[f32; WIDTH]; 3],
    high: &[[f32; WIDTH]; 3],
    to: &mut Block,
) {
    let centre = splat(simd, plan.anchor);
    for chunk in 0..WIDTH / S::F32_LANES {
        let (mut least, mut most) = (centre, centre);
        for i in 0..3 {
            least[i] = Lanes::load(simd, &low[i], chunk);
            most[i] = Lanes::load(simd, &high[i], chunk);
        }
        let (low, high) = (minus(least, centre), minus(most, centre));
        let rounding = (norm(low) + norm(high)) * ROUNDING;
        for i in 0..3 {
            let axis = axes[i];
            let (mut near, mut far) = (rounding * -length(axis), rounding * length(axis));
            for j in 0..3 {
                let (p, q) = if axis[j] < 0.0 { (high[j], low[j]) } else { (low[j], high[j]) };
                near = near + p * axis[j];
                far = far + q * axis[j];
            }
            near.store(&mut to.low[i], chunk);
            far.store(&mut to.high[i], chunk);
        }
    }
}

impl Block {
    pub const EMPTY: Block = Block { low: [[0.0; WIDTH]; 3], high: [[0.0; WIDTH]; 3] };

    /// The box of both triangles as number `k`.
    #[inline(always)]
    pub fn put(&mut self, k: usize, a: &Triangle, b: &Triangle) {
        let less = |a: f32, b: f32| if a < b { a } else { b };
        let more = |a: f32, b: f32| if a > b { a } else { b };
        for axis in 0..3 {
            let (mut low, mut high) = (a.corners[0][axis], a.corners[0][axis]);
            for corner in [a.corners[1], a.corners[2], b.corners[0], b.corners[1], b.corners[2]] {
                (low, high) = (less(low, corner[axis]), more(high, corner[axis]));
            }
            (self.low[axis][k % WIDTH], self.high[axis][k % WIDTH]) = (low, high);
        }
    }

    /// Box `k`.
    #[inline(always)]
    pub fn at(&self, k: usize) -> (Vector, Vector) {
        ([self.low[0][k], self.low[1][k], self.low[2][k]], [self.high[0][k], self.high[1][k], self.high[2][k]])
    }
}

/// The receivers in the grid's coordinates: cells lie at whole numbers along the first two; the third grows from the
/// receivers to the grid.
#[repr(C, align(64))]
pub(crate) struct Shadows {
    /// The receivers along the three axes, less and more the margin.
    low: [[f32; PACKET]; 3],
    high: [[f32; PACKET]; 3],
    /// Where they lie over the lattice.
    over: [[f32; PACKET]; 2],
    /// Distance from the grid's plane.
    height: [f32; PACKET],
    /// The margin along the normal.
    thick: [f32; PACKET],
    /// Whether the receivers are on the other side of the grid than the third axis tells.
    behind: bool,
}

impl Shadows {
    /// The packet's receivers.
    #[inline(always)]
    pub fn new<S: Machine>(simd: S, plan: &Plan, axes: &[Vector; 3], packet: &Packet) -> Shadows {
        let sizes = [length(axes[0]), length(axes[1]), length(axes[2])];
        let behind = product(axes[2], sub(plan.anchor, packet.point(0))) < 0.0;
        let (_, part) = plan.lattice;
        let centre = plan.anchor;
        let none = [0.0; PACKET];
        let mut shadows =
            Shadows { low: [none; 3], high: [none; 3], over: [none; 2], height: none, thick: none, behind };
        let zero = Lanes::splat(simd, 0.0);
        for chunk in 0..PACKET / S::F32_LANES {
            let x = packet.points(simd, chunk);
            let reach = packet.reach(simd, chunk);
            let (from, to) = (minus(x, splat(simd, centre)), from_point(plan.anchor, x));
            let height = if behind { zero - dot(to, axes[2]) } else { dot(to, axes[2]) };
            // Of a receiver that sees the grid edge-on, or from the other side, nothing is known of how far along the way
            // a box lies.
            let seen = (reach * (1.0 / 64.0)).below(height);
            let margin = reach * SHAFT_MARGIN + norm(from) * ROUNDING;
            for i in 0..2 {
                let (at, margin) = (dot(from, axes[i]), margin * sizes[i]);
                (at - margin).store(&mut shadows.low[i], chunk);
                (at + margin).store(&mut shadows.high[i], chunk);
            }
            // Edge-on, what reaches between the receiver and the grid may lie anywhere along the way.
            let thick = margin * sizes[2];
            let at = zero - height;
            (at.or(seen, at.min(zero)) - thick).store(&mut shadows.low[2], chunk);
            (at.or(seen, at.max(zero)) + thick).store(&mut shadows.high[2], chunk);
            thick.or(seen, zero).store(&mut shadows.thick, chunk);
            height.or(seen, thick * EDGEWISE).store(&mut shadows.height, chunk);
            for i in 0..2 {
                let over = (zero - dot(to, axes[i])) - Lanes::splat(simd, 1.0 / part);
                over.store(&mut shadows.over[i], chunk);
            }
        }
        shadows
    }

    /// Whether the shadow of a box, in the grid's coordinates, may hold a cell that a receiver still sees.
    #[inline(always)]
    pub fn matters<S: Machine, const SIDE: usize>(
        &self,
        simd: S,
        plan: &Plan,
        packet: &Packet,
        (mut low, mut high): (Vector, Vector),
    ) -> bool {
        if self.behind {
            (low[2], high[2]) = (-high[2], -low[2]);
        }
        let mut matters = false;
        for chunk in 0..PACKET / S::F32_LANES {
            matters |= self.chunk_matters::<S, SIDE>(simd, plan, packet, low, high, chunk);
        }
        matters
    }

    #[inline(always)]
    fn chunk_matters<S: Machine, const SIDE: usize>(
        &self,
        simd: S,
        plan: &Plan,
        packet: &Packet,
        low: Vector,
        high: Vector,
        chunk: usize,
    ) -> bool {
        let words = packet.masks_of::<S, SIDE>(simd, chunk);
        let (height, thick) = (Lanes::load(simd, &self.height, chunk), Lanes::load(simd, &self.thick, chunk));
        let (near, far) =
            (low[2] - Lanes::load(simd, &self.high[2], chunk), high[2] - Lanes::load(simd, &self.low[2], chunk));
        // Neither behind the receiver nor behind the shooter, and something left to hide.
        let mut inside = simd.and_m32s(far.not_negative(), (height + thick).at_least(near));
        inside = simd.and_m32s(inside, nonzero(simd, simd.or_u32s(words[0], words[1])));
        let below =
            [low[0] - Lanes::load(simd, &self.high[0], chunk), low[1] - Lanes::load(simd, &self.high[1], chunk)];
        let above =
            [high[0] - Lanes::load(simd, &self.low[0], chunk), high[1] - Lanes::load(simd, &self.low[1], chunk)];
        let over = [Lanes::load(simd, &self.over[0], chunk), Lanes::load(simd, &self.over[1], chunk)];
        // What is behind the receiver hides nothing: the box is cut there, and its shadow goes on for ever.
        let (by_near, by_far) = (height / near.max(height * NEAREST), height / far.min(height + thick));
        let mut hidden = words;
        for i in 0..2 {
            let from = (below[i] * by_near).min(below[i] * by_far) + (over[i] - LATTICE_ROUNDING);
            let to = (above[i] * by_near).max(above[i] * by_far) + (over[i] + LATTICE_ROUNDING);
            let mut lines = [simd.splat_u32s(0); 2];
            if SIDE == 8 {
                let zero = Lanes::splat(simd, 0.0);
                let span = span::<S, SIDE>(simd, from.max(zero), (Lanes::splat(simd, 7.0) - to).max(zero));
                lines = if i == 0 { columns(simd, span) } else { rows(simd, span) };
            } else if SIDE > 0 {
                for k in 0..SIDE {
                    let at = Lanes::splat(simd, k as f32);
                    let hides = simd.and_m32s(at.at_least(from), to.at_least(at));
                    let cells = simd.splat_u32s(cells_of_line::<SIDE>(i, k));
                    lines[0] = simd.or_u32s(lines[0], simd.select_u32s(hides, cells, simd.splat_u32s(0)));
                }
            } else {
                for line in plan.lines[i].as_slice() {
                    let at = Lanes::splat(simd, line.at);
                    let hides = simd.and_m32s(at.at_least(from), to.at_least(at));
                    for w in 0..2 {
                        let cells = simd.select_u32s(hides, simd.splat_u32s(line.cells[w]), simd.splat_u32s(0));
                        lines[w] = simd.or_u32s(lines[w], cells);
                    }
                }
            }
            for w in 0..2 {
                hidden[w] = simd.and_u32s(hidden[w], lines[w]);
            }
        }
        let left = simd.and_m32s(inside, nonzero(simd, simd.or_u32s(hidden[0], hidden[1])));
        any(simd, left)
    }
}

/// The cells of column (axis 0) or row (axis 1) `k` in a square grid that takes one word.
const fn cells_of_line<const SIDE: usize>(axis: usize, k: usize) -> u32 {
    let mut cells = 0;
    let mut i = 0;
    while i < SIDE {
        cells |= 1 << if axis == 0 { i * SIDE + k } else { k * SIDE + i };
        i += 1;
    }
    cells
}

/// The cells of some of eight columns.
#[inline(always)]
fn columns<S: Machine>(simd: S, columns: S::u32s) -> [S::u32s; 2] {
    [simd.mul_u32s(columns, simd.splat_u32s(0x0101_0101)); 2]
}

/// The cells of some of eight rows.
#[inline(always)]
fn rows<S: Machine>(simd: S, rows: S::u32s) -> [S::u32s; 2] {
    let mut words = [rows, simd.wrapping_dyn_shr_u32s(rows, simd.splat_u32s(4))];
    for w in 0..2 {
        // Each of four bits to a byte of its own, and there eight times.
        let four = simd.and_u32s(words[w], simd.splat_u32s(0xf));
        let apart = simd.and_u32s(simd.mul_u32s(four, simd.splat_u32s(0x0020_4081)), simd.splat_u32s(0x0101_0101));
        words[w] = simd.mul_u32s(apart, simd.splat_u32s(0xff));
    }
    words
}
