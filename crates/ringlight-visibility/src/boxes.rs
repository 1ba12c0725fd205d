//! What is known of triangles held elsewhere: boxes, tested sixteen at a time.

use crate::build::{Bounds, Child, Node, WIDTH};
use crate::instruction_set::{Machine, Task};
use crate::nearest::{inverse, passed};
use crate::{Hit, InstructionSet, NO_PLANE, Ray, Region};

/// Boxes that hold triangles, each with the plane id of all of them, or [`NO_PLANE`].
#[derive(Clone, Debug)]
pub struct Boxes {
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
        let node = |boxes: &[([f32; 3], [f32; 3], u32)]| {
            let Bounds { low, high } = Bounds::EMPTY;
            let mut node =
                Node { low: low.map(|c| [c; WIDTH]), high: high.map(|c| [c; WIDTH]), child: Default::default() };
            for (lane, (low, high, _)) in boxes.iter().enumerate() {
                for i in 0..3 {
                    (node.low[i][lane], node.high[i][lane]) = (low[i], high[i]);
                }
                node.child[lane] = Child::default();
            }
            node
        };
        let nodes = boxes.chunks(WIDTH).map(node).collect();
        Boxes { nodes, planes, instruction_set: InstructionSet::best() }
    }

    /// Whether triangles in some box may hide anything in the region; those in the planes `exempt` hide nothing.
    pub fn may_hide(&self, region: &Region, exempt: [u32; 2]) -> bool {
        self.instruction_set.run(Hiding { boxes: self, region, exempt })
    }

    /// Whether some ray may hit a triangle in some box, before the nearest hit that is known of it: never false where
    /// [`crate::Hierarchy::nearest_hit`] over these triangles finds such a hit.
    pub fn may_be_hit(&self, rays: &[Ray], hits: &[Option<Hit>]) -> bool {
        self.instruction_set.run(Hitting { boxes: self, rays, hits })
    }
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
        let Hiding { boxes: Boxes { nodes, planes, .. }, region, exempt } = self;
        let Some(shaft) = region.shaft() else { return false };
        for (node, planes) in nodes.iter().zip(planes.chunks(WIDTH)) {
            let mut met = shaft.children(machine, node);
            while met != 0 {
                let plane = planes[met.trailing_zeros() as usize];
                if plane == NO_PLANE || !exempt.contains(&plane) {
                    return true;
                }
                met &= met - 1;
            }
        }
        false
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
        for (ray, hit) in self.rays.iter().zip(self.hits) {
            let (inverse, far) = (inverse(ray), hit.map_or(ray.far, |hit| hit.distance));
            for node in &self.boxes.nodes {
                if passed(machine, node, ray.origin, inverse, far).0 != 0 {
                    return true;
                }
            }
        }
        false
    }
}
