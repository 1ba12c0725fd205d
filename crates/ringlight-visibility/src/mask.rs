//! Masks of many points against one shooter: packets of neighbours descend the hierarchy together.

use crate::descent::Over;
use crate::grid::AtGrid;
use crate::instruction_set::{Machine, Task};
use crate::packet::{Candidate, PACKET, Packet};
use crate::plan::Plan;
use crate::predicate::Prepared;
use crate::scattered::AtCells;
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
            (Some(axes), 4) => machine.call(Over::<AtGrid<4>>(self, axes)),
            (Some(axes), 8) => machine.call(Over::<AtGrid<8>>(self, axes)),
            (Some(axes), _) => machine.call(Over::<AtGrid<0>>(self, axes)),
            (None, _) => machine.call(Over::<AtCells>(self, ())),
        }
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

/// The predicate for the triangles of a facet, all receivers and these cells; whether it blocked anything.
pub(crate) struct Test<'a> {
    pub hierarchy: &'a Hierarchy,
    pub plan: &'a Plan,
    pub packet: &'a mut Packet,
    pub index: usize,
    pub cells: u64,
    /// Set where a triangle was tested.
    pub tested: &'a mut bool,
}

impl Task for Test<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<M: Machine>(self, machine: M) -> bool {
        let Test { hierarchy, plan, packet, index, cells: asked, tested } = self;
        let (first, other) = hierarchy.facet(index);
        let mut blocked = false;
        for triangle in [Some(first), other].into_iter().flatten() {
            let cells = hierarchy.blocked_cells(plan, triangle.filter) & asked;
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
