//! Masks of many points against one shooter: packets of neighbours descend the hierarchy together.

use crate::build::{STACK, Target};
use crate::instruction_set::{Machine, Task};
use crate::kernel::{Candidate, PACKET, Packet};
use crate::plan::Plan;
use crate::predicate::Prepared;
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
        for first in (0..masks.len()).step_by(PACKET) {
            let masks = &mut masks[first..(first + PACKET).min(points.len())];
            let mut packet = pack(plan, points, first, masks);
            let idle = masks.iter().filter(|&&mask| mask & plan.all == 0).count() as u64;
            tally.masks += masks.len() as u64;
            tally.rays += masks.iter().map(|mask| u64::from(mask.count_ones())).sum::<u64>();
            search.tested = false;
            search.descend(machine, &mut packet);
            tally.masks_without_rays += if search.tested { idle } else { masks.len() as u64 };
            for (lane, mask) in masks.iter_mut().enumerate() {
                *mask = (*mask & !plan.all) | packet.mask(lane);
            }
        }
        tally
    }
}

/// The points from `first` on; lanes beyond the last one repeat it and have nothing left to see.
#[inline(always)]
fn pack(plan: &Plan, points: Points, first: usize, masks: &[u64]) -> Packet {
    let mut packet = Packet {
        x: [0.0; PACKET],
        y: [0.0; PACKET],
        z: [0.0; PACKET],
        reach: [0.0; PACKET],
        plane: [NO_PLANE; PACKET],
        words: [[0; PACKET]; 2],
    };
    for lane in 0..PACKET {
        let i = first + lane.min(masks.len() - 1);
        let x = points.at(i);
        [packet.x[lane], packet.y[lane], packet.z[lane]] = x;
        packet.reach[lane] = plan.reach(x);
        packet.plane[lane] = points.plane[i];
        packet.set_mask(lane, masks.get(lane).map_or(0, |mask| mask & plan.all));
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
        if let Some(last) = self.last_blocker {
            let triangle = &self.hierarchy.triangles[last];
            if shaft.touches(Prepared::new(triangle).bounds()) && self.test(machine, packet, last) {
                unfinished = packet.unfinished(machine);
            }
        }
        let mut in_shaft = unfinished.count_ones();
        let mut stack = [0u32; STACK];
        let mut height = 1;
        while height > 0 && unfinished != 0 {
            height -= 1;
            let node = &self.hierarchy.nodes[stack[height] as usize];
            let mut children = shaft.children(machine, node);
            let above = height;
            while children != 0 {
                let i = children.trailing_zeros() as usize;
                children &= children - 1;
                match node.child[i].target() {
                    Target::Node(number) => {
                        stack[height] = number as u32;
                        height += 1;
                    }
                    Target::Triangles(range) => {
                        for index in range {
                            if self.test(machine, packet, index) {
                                unfinished = packet.unfinished(machine);
                                if unfinished == 0 {
                                    return;
                                }
                            }
                        }
                    }
                }
            }
            // The largest child was found first and is to be visited first.
            stack[above..height].reverse();
            if 2 * unfinished.count_ones() <= in_shaft {
                shaft = Shaft::new(self.plan, packet, unfinished, &self.hierarchy.bounds);
                in_shaft = unfinished.count_ones();
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
