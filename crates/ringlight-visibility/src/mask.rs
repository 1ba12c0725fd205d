//! Masks of many points against one shooter: packets of neighbours descend the hierarchy together.

use arrayvec::ArrayVec;

use crate::build::{STACK, Target, WIDTH};
use crate::grid::OverGrid;
use crate::instruction_set::{Machine, Task};
use crate::items::SINGLE;
use crate::packet::{Candidate, PACKET, Packet};
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
        let plan = self.plan;
        match (&plan.axes, plan.side) {
            (Some(axes), 4) => machine.call(OverGrid::<4>(self, axes)),
            (Some(axes), 8) => machine.call(OverGrid::<8>(self, axes)),
            (Some(axes), _) => machine.call(OverGrid::<0>(self, axes)),
            (None, _) => machine.call(OverCells(self)),
        }
    }
}

/// For cells wherever they are: every triangle in a packet's shaft is tested.
struct OverCells<'a>(Clear<'a>);

impl Task for OverCells<'_> {
    type Output = Tally;

    #[inline(always)]
    fn run<M: Machine>(self, machine: M) -> Tally {
        let Clear { hierarchy, plan, points, masks } = self.0;
        let mut tally = Tally::default();
        let mut search = Search { hierarchy, plan, last_blocker: None, tested: false };
        for numbers in in_packets(points).chunks(PACKET) {
            let mut packet = pack(machine, plan, points, numbers, masks);
            search.tested = false;
            search.descend(machine, &mut packet);
            tally = tally.join(packet.unpack(plan, numbers, masks, search.tested));
        }
        tally
    }
}

/// The numbers of the points (in the lower halves), so that neighbours share a packet: as they come, if they come so, or else
/// along a Morton curve through their box.
pub(crate) fn in_packets(points: Points) -> Vec<u64> {
    let mut numbers: Vec<u64> = (0..points.len() as u64).collect();
    if numbers.len() <= PACKET {
        return numbers;
    }
    let mut extent = 0f32;
    let low = [points.x, points.y, points.z].map(|axis| {
        let low = axis.iter().copied().fold(f32::INFINITY, f32::min);
        extent = extent.max(axis.iter().copied().fold(f32::NEG_INFINITY, f32::max) - low);
        low
    });
    // Elements of a surface come row by row, and are better left so: a curve through space would mix surfaces.
    let leaps = |axis: &[f32]| axis.windows(2).filter(|pair| (pair[1] - pair[0]).abs() > LEAP * extent).count();
    if [points.x, points.y, points.z].map(leaps).iter().sum::<usize>() <= points.len() / FEW_LEAPS {
        return numbers;
    }
    let scale = 1023.0 / extent;
    for (i, number) in numbers.iter_mut().enumerate() {
        // The cast saturates, and takes NaN to 0.
        let [x, y, z] = std::array::from_fn(|a| spread(((points.at(i)[a] - low[a]) * scale) as u32));
        *number |= u64::from(x | y << 1 | z << 2) << 32;
    }
    numbers.sort_unstable();
    numbers
}

/// Points farther apart than this share of all points' extent do not belong to one packet.
const LEAP: f32 = 0.125;

/// Points that come in order leap less than once in so many.
const FEW_LEAPS: usize = 8;

/// Ten bits, two apart.
fn spread(t: u32) -> u32 {
    let t = (t | t << 16) & 0x0300_00ff;
    let t = (t | t << 8) & 0x0300_f00f;
    let t = (t | t << 4) & 0x030c_30c3;
    (t | t << 2) & 0x0924_9249
}

/// The points with these numbers; lanes beyond the last one repeat it and have nothing left to see.
#[inline(always)]
pub(crate) fn pack<M: Machine>(machine: M, plan: &Plan, points: Points, numbers: &[u64], masks: &[u64]) -> Packet {
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
        packet.plane[lane] = points.plane[i];
        packet.set_mask(lane, if lane < numbers.len() { masks[i] & plan.all } else { 0 });
    }
    packet.find_reach(machine, plan);
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
        let hierarchy = self.hierarchy;
        let mut unfinished = packet.unfinished(machine);
        if unfinished == 0 || hierarchy.nodes.is_empty() {
            return;
        }
        if let Some(last) = self.last_blocker {
            self.test(machine, packet, last);
        }
        let mut in_shaft = (0, 0);
        let mut shaft = None;
        let mut stack = ArrayVec::<u32, STACK>::new();
        stack.push(0);
        while !stack.is_empty() {
            unfinished = packet.unfinished(machine);
            if unfinished == 0 {
                return;
            }
            // A narrower shaft, once it is for much fewer receivers or cells.
            let size = (unfinished.count_ones(), packet.union().count_ones());
            if shaft.is_none() || 2 * size.0 <= in_shaft.0 || 4 * size.1 <= 3 * in_shaft.1 {
                shaft = Some(Shaft::new(self.plan, packet, unfinished, &hierarchy.bounds));
                in_shaft = size;
            }
            let Some(shaft) = &shaft else { return };
            let Some(number) = stack.pop() else { return };
            let node = &hierarchy.nodes[number as usize];
            let above = stack.len();
            let mut children = shaft.children(machine, node);
            while children != 0 {
                let i = children.trailing_zeros() as usize % WIDTH;
                children &= children - 1;
                match node.child[i].target() {
                    Target::Node(number) => {
                        stack.push(number as u32);
                    }
                    Target::Triangles(range) => {
                        let (mut index, end) = (range.start, range.end);
                        while index < end {
                            self.test(machine, packet, index);
                            index += if hierarchy.facets[index] == SINGLE { 1 } else { 2 };
                        }
                    }
                }
            }
            // The largest child was found first and is to be visited first.
            stack[above..].reverse();
        }
    }

    /// Tests the triangles of a facet.
    #[inline(always)]
    fn test<M: Machine>(&mut self, machine: M, packet: &mut Packet, index: usize) {
        let (hierarchy, plan, tested) = (self.hierarchy, self.plan, &mut self.tested);
        if machine.call(Test { hierarchy, plan, packet, index, tested }) {
            self.last_blocker = Some(index);
        }
    }
}

/// The predicate for the triangles of a facet and all receivers; whether it blocked anything.
pub(crate) struct Test<'a> {
    pub hierarchy: &'a Hierarchy,
    pub plan: &'a Plan,
    pub packet: &'a mut Packet,
    pub index: usize,
    /// Set where a triangle was tested.
    pub tested: &'a mut bool,
}

impl Task for Test<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<M: Machine>(self, machine: M) -> bool {
        let Test { hierarchy, plan, packet, index, tested } = self;
        let (first, other) = hierarchy.facet(index);
        let mut blocked = false;
        for triangle in [Some(first), other].into_iter().flatten() {
            let cells = hierarchy.blocked_cells(plan, triangle.filter);
            if cells == 0 || triangle.plane == plan.plane && plan.plane != NO_PLANE {
                continue;
            }
            *tested = true;
            let cutout = if triangle.filter == OPAQUE {
                None
            } else {
                Some(&hierarchy.filters[triangle.filter as usize]).filter(|f| matches!(f, Filter::Cutout { .. }))
            };
            let candidate = Candidate { triangle, prepared: Prepared::new(triangle), cells, cutout };
            blocked |= packet.clear(machine, plan, &candidate);
        }
        blocked
    }
}
