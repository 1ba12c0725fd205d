//! Shadows of triangles on a grid of cells: lanes are triangles.
//!
//! Most triangles between a receiver and a shooter are small, and their shadows fall between the cells. In coordinates
//! along the grid's edges and its normal, the shadow of a triangle's box takes two divisions per receiver; where no
//! cell lies in any receiver's shadow, the packet needs no look at the triangle at all.
//!
//! Accepted segments pass within [`SHAFT_MARGIN`] of the reach of the triangle's box, so the shadows of boxes grown by
//! that hold them all. Where a box is hardly in front of the receiver its shadow has no bounds; there the planes through
//! the receiver and the outermost cells decide.

use crate::Triangle;
use crate::build::WIDTH;
use crate::instruction_set::Machine;
use crate::lanes::{LaneVector, Lanes, dot, minus, norm, splat};
use crate::packet::{PACKET, Packet};
use crate::plan::{Kind, Plan};
use crate::predicate::{SHAFT_MARGIN, Vector, cross, dot as product, norm as length, sub};

/// Share of the lengths involved that rounding may take, with plenty to spare.
const ROUNDING: f32 = 1.0 / 65536.0;

/// What rounding may take from a place on the lattice.
const LATTICE_ROUNDING: f32 = 1.0 / 512.0;

/// Adding it leaves no room for a fraction.
const WHOLE: f32 = 12_582_912.0;

/// Boxes of triangles waiting to be tested, structure of arrays.
#[repr(C, align(64))]
pub(crate) struct Block {
    low: [[f32; WIDTH]; 3],
    high: [[f32; WIDTH]; 3],
    pub index: [u32; WIDTH],
    pub count: usize,
}

impl Block {
    pub fn new() -> Block {
        Block { low: [[0.0; WIDTH]; 3], high: [[0.0; WIDTH]; 3], index: [0; WIDTH], count: 0 }
    }

    #[inline(always)]
    pub fn push(&mut self, index: usize, triangle: &Triangle) {
        let lane = self.count % WIDTH;
        let [a, b, c] = &triangle.corners;
        let less = |a: f32, b: f32| if a < b { a } else { b };
        let more = |a: f32, b: f32| if a > b { a } else { b };
        for axis in 0..3 {
            self.low[axis][lane] = less(less(a[axis], b[axis]), c[axis]);
            self.high[axis][lane] = more(more(a[axis], b[axis]), c[axis]);
        }
        self.index[lane] = index as u32;
        self.count += 1;
    }
}

/// The receivers in the grid's coordinates: cells lie at whole numbers along the first two; the third grows from the
/// receivers to the grid.
pub(crate) struct Shadows {
    centre: Vector,
    /// Dual to the edges, and the normal.
    axes: [Vector; 3],
    /// Norms of the axes.
    sizes: Vector,
    receivers: [Receiver; PACKET],
    /// The greatest whole number in use.
    last: f32,
}

#[derive(Clone, Copy, Default)]
struct Receiver {
    /// The receiver along the three axes, less and more the margin.
    low: Vector,
    high: Vector,
    /// Where it lies over the lattice.
    over: [f32; 2],
    /// Distance from the grid's plane.
    height: f32,
    /// The margin along the normal.
    thick: f32,
}

impl Shadows {
    /// `None` where the cells are no grid, or one too thin.
    pub fn new(plan: &Plan, packet: &Packet) -> Option<Shadows> {
        let normal = cross(plan.edge_u, plan.edge_v);
        let squared = product(normal, normal);
        let edges = product(plan.edge_u, plan.edge_u) * product(plan.edge_v, plan.edge_v);
        if plan.kind != Kind::Grid || !(squared > edges * 0.01 && squared > 1e-20 && squared < 1e20) {
            return None;
        }
        let (count, part) = plan.lattice;
        let scale = count / squared;
        let unit = 1.0 / squared.sqrt();
        let centre = packet.point(0);
        let unit = if product(normal, sub(plan.anchor, centre)) < 0.0 { -unit } else { unit };
        let axes = [
            cross(plan.edge_v, normal).map(|c| c * scale),
            cross(normal, plan.edge_u).map(|c| c * scale),
            normal.map(|c| c * unit),
        ];
        let sizes = axes.map(length);
        let mut receivers = [Receiver::default(); PACKET];
        for (lane, receiver) in receivers.iter_mut().enumerate() {
            let x = packet.point(lane);
            let (from, to, reach) = (sub(x, centre), sub(plan.anchor, x), packet.reach[lane]);
            let height = product(axes[2], to);
            // A receiver that sees the grid edge-on, or from the other side, is not spared anything: its margin has no
            // bounds, and the rest must not matter.
            let seen = height > reach * (1.0 / 64.0);
            let margin = if seen { reach * SHAFT_MARGIN + length(from) * ROUNDING } else { f32::INFINITY };
            for i in 0..3 {
                let at = product(axes[i], from);
                (receiver.low[i], receiver.high[i]) = (at - margin * sizes[i], at + margin * sizes[i]);
            }
            receiver.thick = margin * sizes[2];
            receiver.height = if seen { height } else { 1.0 };
            receiver.over = [0, 1].map(|i| if seen { -product(axes[i], to) - 1.0 / part } else { 0.0 });
        }
        Some(Shadows { centre, axes, sizes, receivers, last: count - 1.0 })
    }

    /// The triangles of the block in whose shadow for any receiver of the lanes `unfinished` a cell may lie, as bits.
    #[inline(always)]
    pub fn on_cells<S: Machine>(&self, simd: S, block: &Block, unfinished: u32) -> u32 {
        let mut bits = 0;
        let centre = splat(simd, self.centre);
        for chunk in 0..WIDTH / S::F32_LANES {
            if chunk * S::F32_LANES >= block.count {
                break;
            }
            let mut low = centre;
            let mut high = centre;
            for i in 0..3 {
                low[i] = Lanes::new(simd, S::as_simd_f32s(&block.low[i]).0[chunk]);
                high[i] = Lanes::new(simd, S::as_simd_f32s(&block.high[i]).0[chunk]);
            }
            let (low, high) = (minus(low, centre), minus(high, centre));
            let rounding = (norm(low) + norm(high)) * ROUNDING;
            let extent = minus(high, low);
            let (mut least, mut most) = (low, high);
            for i in 0..3 {
                let axis = self.axes[i];
                let (near, far) = (dot(low, axis), dot(extent, axis.map(|c| if c < 0.0 { c } else { 0.0 })));
                let further = dot(extent, axis.map(|c| if c > 0.0 { c } else { 0.0 }));
                least[i] = (near + far) - rounding * self.sizes[i];
                most[i] = (near + further) + rounding * self.sizes[i];
            }
            let mut lanes = unfinished;
            let all = if block.count < WIDTH { (1 << block.count) - 1 } else { u32::MAX };
            let wanted = (all >> (chunk * S::F32_LANES)) & ((1 << S::F32_LANES) - 1);
            let mut found = 0;
            while lanes != 0 && found & wanted != wanted {
                let lane = lanes.trailing_zeros() as usize % PACKET;
                lanes &= lanes - 1;
                found |= self.shadow_holds(simd, &self.receivers[lane], least, most);
            }
            bits |= (found & wanted) << (chunk * S::F32_LANES);
        }
        bits
    }

    /// For boxes in the grid's coordinates, as bits.
    #[inline(always)]
    fn shadow_holds<S: Machine>(&self, simd: S, x: &Receiver, low: LaneVector<S>, high: LaneVector<S>) -> u32 {
        let (near, far) = (low[2] - x.high[2], high[2] - x.low[2]);
        // Neither behind the receiver nor behind the shooter.
        let height = Lanes::splat(simd, x.height);
        let inside = simd.and_m32s(far.not_negative(), (height + x.thick).at_least(near));
        // Farther than rounding, so that the division is good.
        let bounded = near.at_least(Lanes::splat(simd, x.thick));
        let (by_near, by_far) = (height / near, height / far);
        let mut holds = inside;
        let mut around = inside;
        for i in 0..2 {
            let (below, above) = (low[i] - x.high[i], high[i] - x.low[i]);
            let from = (below * by_near).min(below * by_far) + (x.over[i] - LATTICE_ROUNDING);
            let to = (above * by_near).max(above * by_far) + (x.over[i] + LATTICE_ROUNDING);
            // A quarter more than the cells need, so that no end of the interval is exactly at a cell.
            let from = from.max(Lanes::splat(simd, -0.25));
            let to = to.min(Lanes::splat(simd, self.last + 0.25));
            // If a whole number lies between, then the one nearest to the middle does.
            let middle = (from + to) * 0.5;
            let off = (middle - ((middle + WHOLE) - WHOLE)).abs();
            holds = simd.and_m32s(holds, (to - from).at_least(off + off));
            let (first, last) = (x.over[i] + LATTICE_ROUNDING, (x.over[i] - self.last) - LATTICE_ROUNDING);
            around = simd.and_m32s(around, (above * height + (near * first).max(far * first)).not_negative());
            let least = below * height + (near * last).min(far * last);
            around = simd.and_m32s(around, Lanes::splat(simd, 0.0).at_least(least));
        }
        let around = simd.bits(around);
        let bounded = simd.bits(bounded);
        (simd.bits(holds) & bounded) | (around & !bounded)
    }
}
