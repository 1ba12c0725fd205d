//! The nearest hits of parallel rays that start near each other: they go through the hierarchy together, as a beam. At a node
//! lanes are its children, as for one ray; at a child, and at a triangle, they are the rays.
//!
//! What is looked at by lanes only rules out: whatever may be hit is given to the predicate of one ray.

#![allow(clippy::needless_range_loop, reason = "what iterators do to lanes is not inlined, and loses the vectors")]

use arrayvec::ArrayVec;

use crate::build::{Child, Node, STACK, Target};
use crate::instruction_set::{Machine, Task};
use crate::lanes::{LaneVector, Lanes, dot, from_point, norm};
use crate::nearest::{count_looks, inverse, passed, through};
use crate::packet::PACKET;
use crate::predicate::{self, Prepared, Vector, ray_hit};
use crate::{Hierarchy, Hit, NO_PLANE, Ray};

/// How many times what rounding may take from an edge function a ray may lie outside of it here and inside of it for the
/// predicate: each of the two ways to compute it errs by that much at most, and the predicate allows for as much again.
const DOUBT: f32 = 4.0;

/// Of the share by which a hit may lie beyond what has been found and still be rounded to before it.
const BEYOND: f32 = 1.0 + 1.0 / 262_144.0;

/// The work of [`Hierarchy::nearest_hits`]: up to [`PACKET`] rays of one direction, and their hits.
pub(crate) struct Beam<'a> {
    pub hierarchy: &'a Hierarchy,
    pub rays: &'a [Ray],
    pub hits: &'a mut [Option<Hit>],
}

/// The rays of a beam, and where they end so far; those that are none end before they begin.
#[repr(C, align(64))]
struct Bundle {
    x: [f32; PACKET],
    y: [f32; PACKET],
    z: [f32; PACKET],
    far: [f32; PACKET],
}

/// A triangle as it is met along the direction of a beam.
struct Along {
    prepared: Prepared,
    /// The edges × the direction, so turned that inside is positive for what is met from the side that it is met from.
    edges: [Vector; 3],
    /// What the height is multiplied with to be positive on that side.
    side: f32,
    /// Height that is passed along the direction.
    rise: f32,
    /// Whether the way to it is more than height over rise, see [`predicate::GRAZING`].
    grazing: bool,
    reach: f32,
}

impl Task for Beam<'_> {
    type Output = ();

    #[inline(always)]
    fn run<M: Machine>(self, machine: M) {
        let Beam { hierarchy, rays, hits } = self;
        if hierarchy.nodes.is_empty() {
            return;
        }
        let mut bundle = Bundle::new(rays);
        let (direction, inverse) = (rays[0].direction, inverse(&rays[0]));
        let origins = bundle.origins(rays.len());
        let mut farthest = bundle.farthest();
        let mut stack = ArrayVec::<(f32, Child, u32), STACK>::new();
        stack.push((0.0, Child::ROOT, (1 << rays.len()) - 1));
        let mut looked_at = 0;
        while let Some((enter, child, lanes)) = stack.pop() {
            let lanes = lanes & bundle.reaching(machine, enter);
            if lanes == 0 {
                continue;
            }
            match child.target() {
                Target::Triangles(range) => {
                    looked_at += range.len() as u64;
                    for triangle in &hierarchy.triangles[range] {
                        let Some(along) = Along::new(Prepared::new(triangle), direction) else { continue };
                        let mut meeting = lanes & bundle.meeting(machine, &along);
                        while meeting != 0 {
                            let lane = meeting.trailing_zeros() as usize;
                            meeting &= meeting - 1;
                            let ray = &rays[lane];
                            if triangle.plane == ray.plane && ray.plane != NO_PLANE {
                                continue;
                            }
                            if let Some(hit) = ray_hit(triangle, &along.prepared, &hierarchy.filters, ray)
                                && hit.is_nearer(&hits[lane])
                            {
                                hits[lane] = Some(hit);
                                bundle.far[lane] = hit.distance;
                            }
                        }
                    }
                    farthest = bundle.farthest();
                }
                Target::Node(number) => {
                    looked_at += 1;
                    let node = &hierarchy.nodes[number];
                    let (mut met, enters) = passed(machine, node, origins, inverse, farthest);
                    let above = stack.len();
                    while met != 0 {
                        let i = met.trailing_zeros() as usize;
                        met &= met - 1;
                        let lanes = lanes & bundle.passing(machine, node, i, inverse);
                        if lanes == 0 {
                            continue;
                        }
                        // Insertion keeps the nearest on top.
                        stack.push((enters[i], node.child[i], lanes));
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
    }
}

impl Bundle {
    fn new(rays: &[Ray]) -> Bundle {
        let mut bundle = Bundle { x: [0.0; PACKET], y: [0.0; PACKET], z: [0.0; PACKET], far: [-1.0; PACKET] };
        for lane in 0..PACKET {
            [bundle.x[lane], bundle.y[lane], bundle.z[lane]] = rays[lane.min(rays.len() - 1)].origin;
            if lane < rays.len() {
                bundle.far[lane] = rays[lane].far;
            }
        }
        bundle
    }

    /// Least and greatest coordinates of the first `count` rays' origins.
    fn origins(&self, count: usize) -> (Vector, Vector) {
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for lane in 0..count {
            let at = [self.x[lane], self.y[lane], self.z[lane]];
            low = std::array::from_fn(|i| low[i].min(at[i]));
            high = std::array::from_fn(|i| high[i].max(at[i]));
        }
        (low, high)
    }

    /// Where the last ray ends.
    #[inline(always)]
    fn farthest(&self) -> f32 {
        let mut farthest = self.far[0];
        for lane in 1..PACKET {
            farthest = if self.far[lane] > farthest { self.far[lane] } else { farthest };
        }
        farthest
    }

    #[inline(always)]
    fn points<M: Machine>(&self, machine: M, chunk: usize) -> LaneVector<M> {
        [
            Lanes::load(machine, &self.x, chunk),
            Lanes::load(machine, &self.y, chunk),
            Lanes::load(machine, &self.z, chunk),
        ]
    }

    /// The rays that do not end before this distance, as bits.
    #[inline(always)]
    fn reaching<M: Machine>(&self, machine: M, distance: f32) -> u32 {
        let mut bits = 0;
        for chunk in 0..PACKET / M::F32_LANES {
            let far = Lanes::load(machine, &self.far, chunk);
            bits |= machine.bits(far.at_least(Lanes::splat(machine, distance))) << (chunk * M::F32_LANES);
        }
        bits
    }

    /// The rays that pass the box of a node's child before they end, as bits.
    #[inline(always)]
    fn passing<M: Machine>(&self, machine: M, node: &Node, child: usize, inverse: [f32; 3]) -> u32 {
        let low = [node.low[0][child], node.low[1][child], node.low[2][child]];
        let high = [node.high[0][child], node.high[1][child], node.high[2][child]];
        let mut bits = 0;
        for chunk in 0..PACKET / M::F32_LANES {
            let x = self.points(machine, chunk);
            let far = Lanes::load(machine, &self.far, chunk);
            let (passing, _) = through(machine, (from_point(low, x), from_point(high, x)), inverse, far);
            bits |= machine.bits(passing) << (chunk * M::F32_LANES);
        }
        bits
    }

    /// The rays that may hit a triangle before they end, as bits.
    #[inline(always)]
    fn meeting<M: Machine>(&self, machine: M, along: &Along) -> u32 {
        let t = &along.prepared;
        let mut bits = 0;
        for chunk in 0..PACKET / M::F32_LANES {
            let x = self.points(machine, chunk);
            let (to_first, to_second) = (from_point(t.corners[0], x), from_point(t.corners[1], x));
            // The predicate's own height, in the order in which it adds.
            let height = dot(to_first, t.normal) * along.side;
            let mut meeting = Lanes::splat(machine, 0.0).below(height);
            if !along.grazing {
                let far = Lanes::load(machine, &self.far, chunk);
                meeting = machine.and_m32s(meeting, (far * (along.rise * BEYOND)).at_least(height));
            }
            let doubt = (norm(to_first) + t.longest) * (along.reach * t.rounding * -DOUBT);
            for (to, edge) in [(to_first, along.edges[0]), (to_second, along.edges[1]), (to_first, along.edges[2])] {
                meeting = machine.and_m32s(meeting, dot(to, edge).at_least(doubt));
            }
            bits |= machine.bits(meeting) << (chunk * M::F32_LANES);
        }
        bits
    }
}

impl Along {
    /// None if nothing along the direction can hit it.
    #[inline(always)]
    fn new(prepared: Prepared, direction: Vector) -> Option<Along> {
        let rise = predicate::dot(prepared.normal, direction);
        if rise == 0.0 || rise.is_nan() {
            return None;
        }
        let side = 1f32.copysign(rise);
        let edge = |i: usize, turned: f32| predicate::cross(prepared.edges[i], direction).map(|c| turned * c);
        let edges = [edge(0, side), edge(1, side), edge(2, -side)];
        let (rise, reach) = (rise.abs(), predicate::norm(direction));
        let grazing = rise < prepared.grazing() * reach;
        Some(Along { prepared, edges, side, rise, grazing, reach })
    }
}
