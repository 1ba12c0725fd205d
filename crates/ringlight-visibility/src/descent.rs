//! A packet's way through the hierarchy.
//!
//! It descends where its shaft to the cells leads. What is in a box is looked at only where the box may hide a cell that
//! some receiver still sees, facets are sifted, and the predicate is asked where that leaves a doubt. How, depends on where the
//! cells lie: see `grid.rs` and `scattered.rs`.

use std::cell::Cell;

use arrayvec::ArrayVec;

use crate::build::{Bounds, STACK, Target, WIDTH};
use crate::instruction_set::{Machine, Task};
use crate::items::SINGLE;
use crate::mask::{Clear, Test, in_packets, pack};
use crate::packet::{PACKET, Packet};
use crate::plan::Plan;
use crate::predicate::Vector;
use crate::shadow::Block;
use crate::shaft::Shaft;
use crate::sieve::{Facet, Sifted};
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

/// How a packet's boxes and facets are looked at.
pub(crate) trait Look: Sized {
    /// What of the shooter it depends on.
    type Of<'a>: Copy;

    /// For these receivers.
    fn new<M: Machine>(machine: M, plan: &Plan, of: Self::Of<'_>, packet: &Packet) -> Self;

    /// Looks from now on for the lanes `unfinished` only, and the cells they still see; `scene` is the box of all triangles.
    /// Comes before any box.
    fn narrow<M: Machine>(&mut self, machine: M, plan: &Plan, packet: &Packet, unfinished: u32, scene: &Bounds);

    /// Boxes, in the coordinates in which they are looked at.
    fn turn<M: Machine>(machine: M, plan: &Plan, of: Self::Of<'_>, boxes: Borders, to: &mut Block);

    /// The cells still seen that a box may hide, or more.
    fn hidden<M: Machine>(&self, machine: M, plan: &Plan, packet: &Packet, around: (Vector, Vector)) -> u64;

    /// Clears what the facet hides of these cells for certain.
    fn sift<M: Machine>(&self, machine: M, plan: &Plan, packet: &mut Packet, facet: &Facet, cells: u64) -> Sifted;
}

/// Least and greatest coordinates of boxes, axis by axis.
pub(crate) type Borders<'a> = (&'a [[f32; WIDTH]; 3], &'a [[f32; WIDTH]; 3]);

/// The work of [`Clear`], looked at in one way.
pub(crate) struct Over<'a, L: Look>(pub Clear<'a>, pub L::Of<'a>);

impl<L: Look> Task for Over<'_, L> {
    type Output = Tally;

    #[inline(always)]
    fn run<M: Machine>(self, machine: M) -> Tally {
        let Over(Clear { hierarchy, plan, points, masks }, of) = self;
        let mut tally = Tally::default();
        let mut blockers = BLOCKERS.get();
        if blockers.hierarchy != hierarchy.number {
            (blockers.hierarchy, blockers.index) = (hierarchy.number, [NONE; REMEMBERED]);
        }
        let mut search = Search { hierarchy, plan, blockers, tested: false };
        for numbers in in_packets(points).chunks(PACKET) {
            let mut packet = pack(machine, plan, points, numbers, masks);
            search.tested = false;
            machine.call(Descent::<L> { search: &mut search, packet: &mut packet, of });
            tally = tally.join(packet.unpack(plan, numbers, masks, search.tested));
        }
        BLOCKERS.set(search.blockers);
        tally
    }
}

struct Search<'a> {
    hierarchy: &'a Hierarchy,
    plan: &'a Plan,
    blockers: Blockers,
    tested: bool,
}

/// One packet's way through the hierarchy.
struct Descent<'a, 'b, L: Look> {
    search: &'a mut Search<'b>,
    packet: &'a mut Packet,
    of: L::Of<'b>,
}

impl<L: Look> Task for Descent<'_, '_, L> {
    type Output = ();

    #[inline(always)]
    fn run<M: Machine>(self, machine: M) {
        let Descent { search, packet, of } = self;
        let (hierarchy, plan) = (search.hierarchy, search.plan);
        let mut unfinished = packet.unfinished(machine);
        if unfinished == 0 || hierarchy.nodes.is_empty() {
            return;
        }
        let mut look = L::new(machine, plan, of, packet);
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
            let (index, cells) = 'next: {
                for &index in remembered.by_ref() {
                    if index != NONE {
                        met = false;
                        break 'next (index, u64::MAX);
                    }
                }
                while waiting != 0 {
                    let k = waiting.trailing_zeros() as usize % WIDTH;
                    waiting &= waiting - 1;
                    let cells = look.hidden(machine, plan, packet, within.at(k));
                    if cells != 0 {
                        break 'next (facets[k], cells);
                    }
                }
                while children != 0 {
                    let i = children.trailing_zeros() as usize % WIDTH;
                    children &= children - 1;
                    let cells = look.hidden(machine, plan, packet, boxes.at(i));
                    if cells == 0 {
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
                                break 'next (first, cells);
                            }
                            let Block { low, high } = within;
                            L::turn(machine, plan, of, (&low, &high), &mut within);
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
                    look.narrow(machine, plan, packet, unfinished, &hierarchy.bounds);
                }
                let Some(shaft) = &shaft else { return };
                while children == 0 {
                    let Some(number) = stack.pop() else { return };
                    node = &hierarchy.nodes[number as usize];
                    children = shaft.children(machine, node);
                }
                above = stack.len();
                L::turn(machine, plan, of, (&node.low, &node.high), &mut boxes);
                continue 'search;
            };
            let looked = search.look(machine, packet, &look, index, cells);
            // What is remembered depends on what the thread did before; counts must not.
            search.tested |= looked.cleared || met && looked.tested;
            if looked.cleared && packet.unfinished(machine) == 0 {
                return;
            }
        }
    }
}

impl Search<'_> {
    /// Clears what the facet that begins with this triangle hides of these cells.
    #[inline(always)]
    fn look<M: Machine, L: Look>(
        &mut self,
        machine: M,
        packet: &mut Packet,
        look: &L,
        index: u32,
        cells: u64,
    ) -> Looked {
        let (hierarchy, plan) = (self.hierarchy, self.plan);
        let (triangle, other) = hierarchy.facet(index as usize);
        if triangle.plane == plan.plane && plan.plane != NO_PLANE {
            return Looked { tested: false, cleared: false };
        }
        let mut sifted = Sifted { cleared: false, doubtful: cells };
        let mut tested = triangle.filter == OPAQUE;
        if tested {
            let facet = Facet::new(triangle, hierarchy.facets[index as usize], other);
            sifted = look.sift(machine, plan, packet, &facet, cells);
        }
        let mut cleared = sifted.cleared;
        if sifted.doubtful != 0 {
            let (cells, tested) = (sifted.doubtful, &mut tested);
            cleared |= machine.call(Test { hierarchy, plan, packet, index: index as usize, cells, tested });
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
