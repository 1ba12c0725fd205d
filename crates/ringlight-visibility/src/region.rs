//! Triangles in a convex region.

use crate::build::{Node, STACK, Target, WIDTH};
use crate::{Hierarchy, Triangle};

/// Keeps the points p with normal · p ≤ offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfSpace {
    /// Of any length.
    pub normal: [f64; 3],
    /// Metres times the normal's length.
    pub offset: f64,
}

/// A half-space for boxes in `f32`, grown by more than the arithmetic can round.
struct Side {
    normal: [f32; 3],
    offset: f32,
}

impl Hierarchy {
    /// Calls `visit` with every triangle that may reach into all of the half-spaces: those whose box, and the boxes around it
    /// in the hierarchy, lie wholly outside none of them. It never leaves out a triangle that has a point in all of them.
    pub fn visit(&self, region: &[HalfSpace], mut visit: impl FnMut(&Triangle)) {
        if self.nodes.is_empty() {
            return;
        }
        let reach = (0..3).map(|i| self.bounds.low[i].abs().max(self.bounds.high[i].abs())).fold(0.0, f32::max);
        let sides: Vec<Side> = region
            .iter()
            .map(|half| {
                // Rounding to f32 and four operations in it, each by at most 2⁻²⁴ of the amounts.
                let amounts: f64 = half.normal.iter().map(|n| n.abs()).sum::<f64>() * f64::from(reach);
                let slack = (amounts + half.offset.abs()) / f64::from(1 << 20);
                Side { normal: half.normal.map(|n| n as f32), offset: (half.offset + slack) as f32 }
            })
            .collect();
        let mut stack = [0u32; STACK];
        let mut height = 1;
        while height > 0 {
            height -= 1;
            let node = &self.nodes[stack[height] as usize];
            let mut children = children(&sides, node);
            while children != 0 {
                let i = children.trailing_zeros() as usize;
                children &= children - 1;
                match node.child[i].target() {
                    Target::Node(number) => {
                        stack[height] = number as u32;
                        height += 1;
                    }
                    Target::Triangles(range) => self.triangles[range].iter().for_each(&mut visit),
                }
            }
        }
    }
}

/// The children of `node` that are outside of no side, as bits.
fn children(sides: &[Side], node: &Node) -> u32 {
    let mut inside: [bool; WIDTH] = std::array::from_fn(|i| node.low[0][i] <= node.high[0][i]);
    for side in sides {
        // The corner that lies deepest in the half-space.
        let [x, y, z] =
            std::array::from_fn(|axis| if side.normal[axis] > 0.0 { &node.low[axis] } else { &node.high[axis] });
        for i in 0..WIDTH {
            let least = side.normal[0] * x[i] + side.normal[1] * y[i] + side.normal[2] * z[i];
            inside[i] &= least <= side.offset;
        }
    }
    (0..WIDTH).fold(0, |bits, i| bits | u32::from(inside[i]) << i)
}
