//! Masks over the cells of a planar grid, the usual shooter.
//!
//! A packet descends the hierarchy where its shaft to the cells leads. What is in a box is looked at only where the box's
//! shadow may fall on a cell that some receiver still sees (`shadow.rs`), facets are sifted (`sieve.rs`), and the
//! predicate is asked where that leaves a doubt.

use std::cell::Cell;

use arrayvec::ArrayVec;

use crate::build::{STACK, Target, WIDTH};
use crate::instruction_set::{Machine, Task};
use crate::items::SINGLE;
use crate::mask::{Clear, Test, in_packets, pack};
use crate::packet::{PACKET, Packet};
use crate::plan::Plan;
use crate::predicate::Vector;
use crate::shadow::{Block, Shadows, turned};
use crate::shaft::Shaft;
use crate::sieve::{Facet, Frame, Sifted, sift};
use crate::{Hierarchy, NO_PLANE, OPAQUE, Tally};

/// Facets that are looked at first.
const REMEMBERED: usize = 12;

const NONE: u32 = u32::MAX;

/// Facets that hid something lately, by their first triangles, and the number of the hierarchy they are of. They probably
/// hide it from the neighbours, and the next shooter, too.
#[derive(Clone, Copy)]
struct Blockers {
    hierarchy: u64,
    index: [u32; REMEMBERED],
}

thread_local! {
    static BLOCKERS: Cell<Blockers> =
        const { Cell::new(Blockers { hierarchy: u64::MAX, index: [NONE; REMEMBERED] }) };
}

impl Blockers {
    /// Puts it first.
    fn note(&mut self, index: u32) {
        let place = self.index.iter().position(|&known| known == index).unwrap_or(REMEMBERED - 1);
        self.index.copy_within(0..place, 1);
        self.index[0] = index;
    }
}

/// For a grid with so many rows and columns, or 0 where they are not evaluated apart; with its axes, see `shadow.rs`.
pub(crate) struct OverGrid<'a, const SIDE: usize>(pub Clear<'a>, pub &'a [Vector; 3]);

impl<const SIDE: usize> Task for OverGrid<'_, SIDE> {
    type Output = Tally;

    #[inline(always)]
    fn run<M: Machine>(self, machine: M) -> Tally {
        let OverGrid(Clear { hierarchy, plan, points, masks }, axes) = self;
        let mut tally = Tally::default();
        let mut blockers = BLOCKERS.get();
        if blockers.hierarchy != hierarchy.number {
            (blockers.hierarchy, blockers.index) = (hierarchy.number, [NONE; REMEMBERED]);
        }
        let mut search = Search { hierarchy, plan, axes, blockers, tested: false };
        for numbers in in_packets(points).chunks(PACKET) {
            let mut packet = pack(machine, plan, points, numbers, masks);
            search.tested = false;
            machine.call(Descent::<SIDE> { search: &mut search, packet: &mut packet });
            tally = tally.join(packet.unpack(plan, numbers, masks, search.tested));
        }
        BLOCKERS.set(search.blockers);
        tally
    }
}

struct Search<'a> {
    hierarchy: &'a Hierarchy,
    plan: &'a Plan,
    axes: &'a [Vector; 3],
    blockers: Blockers,
    tested: bool,
}

/// One packet's way through the hierarchy.
struct Descent<'a, 'b, const SIDE: usize> {
    search: &'a mut Search<'b>,
    packet: &'a mut Packet,
}

impl<const SIDE: usize> Task for Descent<'_, '_, SIDE> {
    type Output = ();

    #[inline(always)]
    fn run<M: Machine>(self, machine: M) {
        let Descent { search, packet } = self;
        let (hierarchy, plan, axes) = (search.hierarchy, search.plan, search.axes);
        let mut unfinished = packet.unfinished(machine);
        if unfinished == 0 || hierarchy.nodes.is_empty() {
            return;
        }
        let frame = Frame::new(machine, plan, packet);
        let shadows = Shadows::new(machine, plan, axes, packet);
        let (mut boxes, mut within) = (Block::EMPTY, Block::EMPTY);
        let mut facets = [0u32; WIDTH];
        let remembered = search.blockers.index;
        let mut remembered = remembered.iter();
        let (mut shaft, mut in_shaft) = (None, (0, 0));
        let mut stack = ArrayVec::<u32, STACK>::new();
        stack.push(0);
        let mut above = 0;
        let mut node = &hierarchy.nodes[0];
        // Children of the node, and facets of one of them, that are to be looked at.
        let (mut children, mut waiting) = (0u32, 0u32);
        'search: loop {
            let mut met = true;
            let index = 'next: {
                for &index in remembered.by_ref() {
                    if index != NONE {
                        met = false;
                        break 'next index;
                    }
                }
                while waiting != 0 {
                    let k = waiting.trailing_zeros() as usize % WIDTH;
                    waiting &= waiting - 1;
                    if shadows.matters::<M, SIDE>(machine, plan, packet, within.at(k)) {
                        break 'next facets[k];
                    }
                }
                while children != 0 {
                    let i = children.trailing_zeros() as usize % WIDTH;
                    children &= children - 1;
                    if !shadows.matters::<M, SIDE>(machine, plan, packet, boxes.at(i)) {
                        continue;
                    }
                    match node.child[i].target() {
                        Target::Node(number) => {
                            stack.push(number as u32);
                        }
                        Target::Triangles(range) => {
                            let first = range.start as u32;
                            let count = hierarchy.gather(range, &mut facets, &mut within);
                            if count == 1 {
                                break 'next first;
                            }
                            let Block { low, high } = within;
                            turned(machine, plan, axes, &low, &high, &mut within);
                            waiting = (1 << count) - 1;
                            continue 'search;
                        }
                    }
                }
                // The largest child was found first and is to be visited first.
                stack[above..].reverse();
                unfinished = packet.unfinished(machine);
                if unfinished == 0 {
                    return;
                }
                // A narrower shaft, once it is for much fewer receivers or cells.
                let size = (unfinished.count_ones(), packet.union().count_ones());
                if shaft.is_none() || 2 * size.0 <= in_shaft.0 || 4 * size.1 <= 3 * in_shaft.1 {
                    shaft = Some(Shaft::new(plan, packet, unfinished, &hierarchy.bounds));
                    in_shaft = size;
                }
                let Some(shaft) = &shaft else { return };
                while children == 0 {
                    let Some(number) = stack.pop() else { return };
                    node = &hierarchy.nodes[number as usize];
                    children = shaft.children(machine, node);
                }
                above = stack.len();
                turned(machine, plan, axes, &node.low, &node.high, &mut boxes);
                continue 'search;
            };
            let looked = search.look::<M, SIDE>(machine, packet, &frame, index);
            // What is remembered depends on what the thread did before; counts must not.
            search.tested |= looked.cleared || met && looked.tested;
            if looked.cleared && packet.unfinished(machine) == 0 {
                return;
            }
        }
    }
}

impl Search<'_> {
    /// Clears what the facet that begins with this triangle hides.
    #[inline(always)]
    fn look<M: Machine, const SIDE: usize>(
        &mut self,
        machine: M,
        packet: &mut Packet,
        frame: &Frame,
        index: u32,
    ) -> Looked {
        let (hierarchy, plan) = (self.hierarchy, self.plan);
        let (triangle, other) = hierarchy.facet(index as usize);
        if triangle.plane == plan.plane && plan.plane != NO_PLANE {
            return Looked { tested: false, cleared: false };
        }
        let mut sifted = Sifted { cleared: false, doubtful: true };
        let mut tested = triangle.filter == OPAQUE;
        if tested {
            let corners = hierarchy.facets[index as usize];
            let facet = Facet::new(plan, triangle, corners, other);
            sifted = if other.is_some() {
                sift::<M, SIDE, true>(machine, plan, frame, packet, &facet)
            } else {
                sift::<M, SIDE, false>(machine, plan, frame, packet, &facet)
            };
        }
        let mut cleared = sifted.cleared;
        if sifted.doubtful {
            let tested = &mut tested;
            cleared |= machine.call(Test { hierarchy, plan, packet, index: index as usize, tested });
        }
        if cleared {
            self.blockers.note(index);
        }
        Looked { tested, cleared }
    }
}

/// Whether a triangle was tested, and whether bits were cleared.
struct Looked {
    tested: bool,
    cleared: bool,
}

impl Hierarchy {
    /// The facets of a leaf: their first triangles, and boxes; how many.
    #[inline(always)]
    fn gather(&self, range: std::ops::Range<usize>, facets: &mut [u32; WIDTH], boxes: &mut Block) -> usize {
        let mut count = 0;
        let mut index = range.start;
        while index < range.end {
            facets[count % WIDTH] = index as u32;
            let (triangle, other) = self.facet(index);
            boxes.put(count, triangle, other.unwrap_or(triangle));
            index += if self.facets[index] == SINGLE { 1 } else { 2 };
            count += 1;
        }
        count
    }
}
