//! Masks of many points against one shooter: packets of neighbours descend the hierarchy together.

use crate::build::{STACK, Target, WIDTH};
use crate::instruction_set::{Machine, Task};
use crate::packet::{Candidate, PACKET, Packet};
use crate::plan::Plan;
use crate::predicate::Prepared;
use crate::shadow::{Block, Shadows};
use crate::shaft::Shaft;
use crate::{Filter, Hierarchy, NO_PLANE, OPAQUE, Points, Tally};

/// The work of [`Hierarchy::clear_blocked`].
pub(crate) struct Clear<'a> {
    pub hierarchy: &'a Hierarchy,
    pub plan: &'a Plan,
    pub points: Points<'a>,
    pub masks: &'a mut [u64],
}

impl Task for Clear<'_> {
    type Output = Tally;

    #[inline(always)]
    fn run<M: Machine>(self, machine: M) -> Tally {
        let Clear { hierarchy, plan, points, masks } = self;
        let mut tally = Tally::default();
        let mut search = Search { hierarchy, plan, last_blocker: None, tested: false };
        for numbers in in_packets(points).chunks(PACKET) {
            let mut packet = pack(plan, points, numbers, masks);
            let mut idle = 0;
            for &number in numbers {
                let mask = masks[number as u32 as usize];
                tally.rays += u64::from(mask.count_ones());
                idle += u64::from(mask & plan.all == 0);
            }
            search.tested = false;
            search.descend(machine, &mut packet);
            tally.masks += numbers.len() as u64;
            tally.masks_without_rays += if search.tested { idle } else { numbers.len() as u64 };
            for (lane, &number) in numbers.iter().enumerate() {
                let mask = &mut masks[number as u32 as usize];
                *mask = (*mask & !plan.all) | packet.mask(lane);
            }
        }
        tally
    }
}

/// The numbers of the points (in the lower halves) along a Morton curve through their box: neighbours share a packet.
fn in_packets(points: Points) -> Vec<u64> {
    let mut numbers: Vec<u64> = (0..points.len() as u64).collect();
    if numbers.len() > PACKET {
        let mut scale = 0f32;
        let low = [points.x, points.y, points.z].map(|axis| {
            let low = axis.iter().copied().fold(f32::INFINITY, f32::min);
            scale = scale.max(axis.iter().copied().fold(f32::NEG_INFINITY, f32::max) - low);
            low
        });
        let scale = 1023.0 / scale;
        for (i, number) in numbers.iter_mut().enumerate() {
            // The cast saturates, and takes NaN to 0.
            let [x, y, z] = std::array::from_fn(|a| spread(((points.at(i)[a] - low[a]) * scale) as u32));
            *number |= u64::from(x | y << 1 | z << 2) << 32;
        }
        numbers.sort_unstable();
    }
    numbers
}

/// Ten bits, two apart.
fn spread(t: u32) -> u32 {
    let t = (t | t << 16) & 0x0300_00ff;
    let t = (t | t << 8) & 0x0300_f00f;
    let t = (t | t << 4) & 0x030c_30c3;
    (t | t << 2) & 0x0924_9249
}

/// The points with these numbers; lanes beyond the last one repeat it and have nothing left to see.
#[inline(always)]
fn pack(plan: &Plan, points: Points, numbers: &[u64], masks: &[u64]) -> Packet {
    let mut packet = Packet {
        x: [0.0; PACKET],
        y: [0.0; PACKET],
        z: [0.0; PACKET],
        reach: [0.0; PACKET],
        plane: [NO_PLANE; PACKET],
        words: [[0; PACKET]; 2],
    };
    for lane in 0..PACKET {
        let i = numbers[lane.min(numbers.len() - 1)] as u32 as usize;
        let x = points.at(i);
        [packet.x[lane], packet.y[lane], packet.z[lane]] = x;
        packet.reach[lane] = plan.reach(x);
        packet.plane[lane] = points.plane[i];
        packet.set_mask(lane, if lane < numbers.len() { masks[i] & plan.all } else { 0 });
    }
    packet
}

struct Search<'a> {
    hierarchy: &'a Hierarchy,
    plan: &'a Plan,
    /// What hid something last probably hides it from the neighbours too.
    last_blocker: Option<usize>,
    tested: bool,
}

impl Search<'_> {
    #[inline(always)]
    fn descend<M: Machine>(&mut self, machine: M, packet: &mut Packet) {
        let mut unfinished = packet.unfinished(machine);
        if unfinished == 0 || self.hierarchy.nodes.is_empty() {
            return;
        }
        let mut shaft = Shaft::new(self.plan, packet, unfinished, &self.hierarchy.bounds);
        let shadows = Shadows::new(self.plan, packet);
        let mut block = Block::new();
        if let Some(last) = self.last_blocker {
            block.push(last, &self.hierarchy.triangles[last]);
        }
        let mut in_shaft = (unfinished.count_ones(), packet.union().count_ones());
        let mut stack = [0u32; STACK];
        let mut height = 1;
        // The child of a visited node whose triangles are gathered next.
        let mut leaves = 0u32;
        let mut node = &self.hierarchy.nodes[0];
        let mut rest = 0..0;
        loop {
            // Gathers triangles until a register is full of them, or no node is left.
            while block.count < WIDTH {
                if let Some(index) = rest.next() {
                    block.push(index, &self.hierarchy.triangles[index]);
                } else if leaves != 0 {
                    let i = leaves.trailing_zeros() as usize;
                    leaves &= leaves - 1;
                    if let Target::Triangles(range) = node.child[i].target() {
                        rest = range;
                    }
                } else if height > 0 {
                    height -= 1;
                    node = &self.hierarchy.nodes[stack[height] as usize];
                    let above = height;
                    let mut children = shaft.children(machine, node);
                    while children != 0 {
                        let i = children.trailing_zeros() as usize;
                        children &= children - 1;
                        match node.child[i].target() {
                            Target::Node(number) => {
                                stack[height] = number as u32;
                                height += 1;
                            }
                            Target::Triangles(_) => leaves |= 1 << i,
                        }
                    }
                    // The largest child was found first and is to be visited first.
                    stack[above..height].reverse();
                } else {
                    break;
                }
            }
            if block.count == 0 {
                return;
            }
            let all = ((1u64 << block.count) - 1) as u32;
            let mut left = match &shadows {
                Some(shadows) => shadows.on_cells(machine, &block, unfinished),
                None => all,
            };
            block.count = 0;
            let mut cleared = false;
            while left != 0 {
                let i = left.trailing_zeros() as usize % WIDTH;
                left &= left - 1;
                cleared |= self.test(machine, packet, block.index[i] as usize);
            }
            if cleared {
                unfinished = packet.unfinished(machine);
                if unfinished == 0 {
                    return;
                }
                // A narrower shaft, once it is for much fewer receivers or cells.
                let size = (unfinished.count_ones(), packet.union().count_ones());
                if 2 * size.0 <= in_shaft.0 || 4 * size.1 <= 3 * in_shaft.1 {
                    shaft = Shaft::new(self.plan, packet, unfinished, &self.hierarchy.bounds);
                    in_shaft = size;
                }
            }
        }
    }

    /// Tests one triangle; whether it blocked anything.
    #[inline(always)]
    fn test<M: Machine>(&mut self, machine: M, packet: &mut Packet, index: usize) -> bool {
        let (hierarchy, plan) = (self.hierarchy, self.plan);
        let triangle = &hierarchy.triangles[index];
        let cells = hierarchy.blocked_cells(plan, triangle.filter);
        if cells == 0 || triangle.plane == plan.plane && plan.plane != NO_PLANE {
            return false;
        }
        self.tested = true;
        let cutout = if triangle.filter == OPAQUE {
            None
        } else {
            Some(&hierarchy.filters[triangle.filter as usize]).filter(|f| matches!(f, Filter::Cutout { .. }))
        };
        let candidate = Candidate { triangle, prepared: Prepared::new(triangle), cells, cutout };
        let blocked = packet.clear(machine, plan, &candidate);
        if blocked {
            self.last_blocker = Some(index);
        }
        blocked
    }
}
