//! The nearest hit of one ray: lanes are the children of a node.

use arrayvec::ArrayVec;
use std::cell::Cell;

use crate::build::{Child, Node, STACK, Target, WIDTH};
use crate::instruction_set::{Machine, Task};
use crate::lanes::{LaneVector, Lanes, splat};
use crate::predicate::{Prepared, SHAFT_MARGIN, Vector, ray_hit};
use crate::{Hierarchy, Hit, NO_PLANE, Ray, Triangle};

thread_local! {
    /// Nodes and triangles that this thread has looked at within the innermost [`searched`].
    static LOOKED_AT: Cell<u64> = const { Cell::new(0) };
}

/// Does some work, and counts the nodes and triangles that this thread looks at meanwhile in search of nearest hits: what the
/// work costs, whoever it asks. Within each other, the inner counts are no part of the outer.
pub fn searched<T>(work: impl FnOnce() -> T) -> (T, u64) {
    let before = LOOKED_AT.replace(0);
    let done = work();
    (done, LOOKED_AT.replace(before))
}

/// The work of [`Hierarchy::nearest_hit_where`].
pub(crate) struct Nearest<'a, F> {
    pub hierarchy: &'a Hierarchy,
    pub ray: &'a Ray,
    pub accept: F,
}

impl<F: Fn(&Triangle) -> bool> Task for Nearest<'_, F> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn run<M: Machine>(self, machine: M) -> Option<Hit> {
        let Nearest { hierarchy, ray, accept } = self;
        let mut best: Option<Hit> = None;
        if hierarchy.nodes.is_empty() {
            return None;
        }
        let inverse = inverse(ray);
        let mut stack = ArrayVec::<(f32, Child), STACK>::new();
        stack.push((0.0, Child::ROOT));
        let mut looked_at = 0;
        while let Some((enter, child)) = stack.pop() {
            if best.is_some_and(|b| enter > b.distance) {
                continue;
            }
            match child.target() {
                Target::Triangles(range) => {
                    looked_at += range.len() as u64;
                    for triangle in &hierarchy.triangles[range] {
                        if triangle.plane == ray.plane && ray.plane != NO_PLANE {
                            continue;
                        }
                        if let Some(hit) = ray_hit(triangle, &Prepared::new(triangle), &hierarchy.filters, ray)
                            && hit.is_nearer(&best)
                            && accept(triangle)
                        {
                            best = Some(hit);
                        }
                    }
                }
                Target::Node(number) => {
                    looked_at += 1;
                    let node = &hierarchy.nodes[number];
                    let far = best.map_or(ray.far, |b| b.distance);
                    let (mut hits, enters) = passed(machine, node, (ray.origin, ray.origin), inverse, far);
                    let above = stack.len();
                    while hits != 0 {
                        let i = hits.trailing_zeros() as usize;
                        hits &= hits - 1;
                        // Insertion keeps the nearest on top.
                        stack.push((enters[i], node.child[i]));
                        let mut place = stack.len() - 1;
                        while place > above && stack[place - 1].0 < enters[i] {
                            stack.swap(place - 1, place);
                            place -= 1;
                        }
                    }
                }
            }
        }
        count_looks(looked_at);
        best
    }
}

/// Reciprocals of the direction, finite for those that do not count.
#[inline(always)]
pub(crate) fn inverse(ray: &Ray) -> [f32; 3] {
    ray.direction.map(|d| if d.abs() > 1e-30 { 1.0 / d } else { 1e30f32.copysign(d) })
}

/// Counts nodes and triangles that have been looked at, see [`searched`].
pub(crate) fn count_looks(looked_at: u64) {
    LOOKED_AT.set(LOOKED_AT.get() + looked_at);
}

/// The children whose boxes some ray of this direction may pass before `far`, as bits, and where it may enter them, for rays that
/// start within the box of `origins`.
#[inline(always)]
pub(crate) fn passed<M: Machine>(
    machine: M,
    node: &Node,
    origins: (Vector, Vector),
    inverse: [f32; 3],
    far: f32,
) -> (u32, [f32; WIDTH]) {
    let (mut bits, mut enters) = (0, [0.0; WIDTH]);
    for chunk in 0..WIDTH / M::F32_LANES {
        let mut low = splat(machine, [0.0; 3]);
        let mut high = low;
        for i in 0..3 {
            low[i] = Lanes::new(machine, M::as_simd_f32s(&node.low[i]).0[chunk]) - origins.1[i];
            high[i] = Lanes::new(machine, M::as_simd_f32s(&node.high[i]).0[chunk]) - origins.0[i];
        }
        let (through, enter) = through(machine, (low, high), inverse, Lanes::splat(machine, far));
        let filled = high[0].at_least(low[0]);
        bits |= machine.bits(machine.and_m32s(filled, through)) << (chunk * M::F32_LANES);
        M::as_mut_simd_f32s(&mut enters).0[chunk] = enter.value;
    }
    (bits, enters)
}

/// Whether boxes, as seen from the rays' starts, are passed before `far`, and where they are entered. Boxes grow with their
/// distance, see [`SHAFT_MARGIN`].
#[inline(always)]
pub(crate) fn through<M: Machine>(
    machine: M,
    (low, high): (LaneVector<M>, LaneVector<M>),
    inverse: [f32; 3],
    far: Lanes<M>,
) -> (M::m32s, Lanes<M>) {
    let farthest = [low[0].abs().max(high[0].abs()), low[1].abs().max(high[1].abs()), low[2].abs().max(high[2].abs())];
    let margin = ((farthest[0] + farthest[1]) + farthest[2]) * SHAFT_MARGIN;
    let mut enter = Lanes::splat(machine, 0.0);
    let mut leave = far;
    for i in 0..3 {
        let (s, t) = ((low[i] - margin) * inverse[i], (high[i] + margin) * inverse[i]);
        enter = enter.max(s.min(t));
        leave = leave.min(s.max(t));
    }
    (leave.at_least(enter), enter)
}
