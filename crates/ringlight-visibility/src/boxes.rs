//! What is known of triangles held elsewhere: boxes, tested sixteen at a time.

use crate::build::{Bounds, Node, WIDTH};
use crate::instruction_set::{Machine, Task};
use crate::nearest::{inverse, passed};
use crate::shaft::extend;
use crate::{Hit, InstructionSet, NO_PLANE, Ray, Region};

/// Boxes that hold triangles, each with the plane id of all of them, or [`NO_PLANE`].
#[derive(Clone, Debug)]
pub struct Boxes {
    /// Around the boxes of sixteen nodes each: most regions and rays come near to few of them.
    around: Vec<Node>,
    nodes: Vec<Node>,
    /// Of each box; those that fill the last node up included.
    planes: Vec<u32>,
    instruction_set: InstructionSet,
}

impl Boxes {
    /// Boxes from their least to their greatest coordinates, with the planes of what is in them.
    pub fn new(boxes: &[([f32; 3], [f32; 3], u32)]) -> Boxes {
        let mut planes: Vec<u32> = boxes.iter().map(|b| b.2).collect();
        planes.resize(planes.len().next_multiple_of(WIDTH), NO_PLANE);
        let plain: Vec<Bounds> = boxes.iter().map(|&(low, high, _)| Bounds { low, high }).collect();
        let joint = |boxes: &[Bounds]| {
            let mut joint = (Bounds::EMPTY.low, Bounds::EMPTY.high);
            boxes.iter().flat_map(|b| [b.low, b.high]).for_each(|corner| extend(&mut joint, corner));
            Bounds { low: joint.0, high: joint.1 }
        };
        let joints: Vec<Bounds> = plain.chunks(WIDTH).map(joint).collect();
        let nodes = |boxes: &[Bounds]| boxes.chunks(WIDTH).map(node).collect();
        let (around, nodes) = (nodes(&joints), nodes(&plain));
        Boxes { around, nodes, planes, instruction_set: InstructionSet::best() }
    }

    /// Whether triangles in some box may hide anything in the region; those in the planes `exempt` hide nothing.
    pub fn may_hide(&self, region: &Region, exempt: [u32; 2]) -> bool {
        self.instruction_set.run(Hiding { boxes: self, region, exempt })
    }

    /// Whether some ray may hit a triangle in some box, before the nearest hit that is known of it; triangles in the ray's own
    /// plane do not count. Never false where [`crate::Hierarchy::nearest_hit`] over these triangles finds such a hit.
    pub fn may_be_hit(&self, rays: &[Ray], hits: &[Option<Hit>]) -> bool {
        self.instruction_set.run(Hitting { boxes: self, rays, hits })
    }

    /// Whether a box is `met` (as bits of its node) of which the triangles are not all in one of the planes `exempt`.
    #[inline(always)]
    fn any(&self, exempt: [u32; 2], met: impl Fn(&Node) -> u32) -> bool {
        for (group, around) in self.around.iter().enumerate() {
            let mut near = met(around);
            while near != 0 {
                let number = group * WIDTH + near.trailing_zeros() as usize;
                near &= near - 1;
                let mut boxes = met(&self.nodes[number]);
                while boxes != 0 {
                    let plane = self.planes[number * WIDTH + boxes.trailing_zeros() as usize];
                    if plane == NO_PLANE || !exempt.contains(&plane) {
                        return true;
                    }
                    boxes &= boxes - 1;
                }
            }
        }
        false
    }
}

/// At most as many boxes as a node has lanes.
fn node(boxes: &[Bounds]) -> Node {
    let Bounds { low, high } = Bounds::EMPTY;
    let (low, high) = (low.map(|c| [c; WIDTH]), high.map(|c| [c; WIDTH]));
    let mut node = Node { low, high, child: Default::default() };
    for (lane, bounds) in boxes.iter().enumerate() {
        for i in 0..3 {
            (node.low[i][lane], node.high[i][lane]) = (bounds.low[i], bounds.high[i]);
        }
    }
    node
}

struct Hiding<'a> {
    boxes: &'a Boxes,
    region: &'a Region,
    exempt: [u32; 2],
}

impl Task for Hiding<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<M: Machine>(self, machine: M) -> bool {
        let Some(shaft) = self.region.shaft() else { return false };
        self.boxes.any(
            self.exempt,
            #[inline(always)]
            |node| shaft.children(machine, node),
        )
    }
}

struct Hitting<'a> {
    boxes: &'a Boxes,
    rays: &'a [Ray],
    hits: &'a [Option<Hit>],
}

impl Task for Hitting<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<M: Machine>(self, machine: M) -> bool {
        let mut hits = self.hits;
        for parallel in self.rays.chunk_by(|a, b| a.direction == b.direction) {
            let known;
            (known, hits) = hits.split_at(parallel.len());
            // All of them at once: a little more is met, in a fraction of the time.
            let (mut starts, mut far, mut plane) = ((Bounds::EMPTY.low, Bounds::EMPTY.high), 0.0f32, parallel[0].plane);
            for (ray, hit) in parallel.iter().zip(known) {
                extend(&mut starts, ray.origin);
                far = far.max(hit.map_or(ray.far, |hit| hit.distance));
                plane = if ray.plane == plane { plane } else { NO_PLANE };
            }
            let inverse = inverse(&parallel[0]);
            let any = self.boxes.any(
                [plane; 2],
                #[inline(always)]
                |node| passed(machine, node, starts, inverse, far).0,
            );
            if any {
                return true;
            }
        }
        false
    }
}
