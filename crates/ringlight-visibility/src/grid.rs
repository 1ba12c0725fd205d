//! How boxes and facets are looked at for the cells of a planar grid, the usual shooter.

use crate::build::Bounds;
use crate::descent::{Borders, Look};
use crate::instruction_set::Machine;
use crate::packet::Packet;
use crate::plan::Plan;
use crate::predicate::Vector;
use crate::shadow::{Block, Shadows, turned};
use crate::sieve::{Facet, Frame, Sifted, sift};

/// At a grid with so many rows and columns, or 0 where they are not evaluated apart; with its axes, see `shadow.rs`.
pub(crate) struct AtGrid<const SIDE: usize> {
    frame: Frame,
    shadows: Shadows,
}

impl<const SIDE: usize> Look for AtGrid<SIDE> {
    type Of<'a> = &'a [Vector; 3];

    #[inline(always)]
    fn new<M: Machine>(machine: M, plan: &Plan, axes: &[Vector; 3], packet: &Packet) -> Self {
        AtGrid { frame: Frame::new(machine, plan, packet), shadows: Shadows::new(machine, plan, axes, packet) }
    }

    #[inline(always)]
    fn narrow<M: Machine>(&mut self, _: M, _: &Plan, _: &Packet, _: u32, _: &Bounds) {}

    #[inline(always)]
    fn turn<M: Machine>(machine: M, plan: &Plan, axes: &[Vector; 3], (low, high): Borders, to: &mut Block) {
        turned(machine, plan, axes, low, high, to);
    }

    #[inline(always)]
    fn hidden<M: Machine>(&self, machine: M, plan: &Plan, packet: &Packet, around: (Vector, Vector)) -> u64 {
        if self.shadows.matters::<M, SIDE>(machine, plan, packet, around) { u64::MAX } else { 0 }
    }

    #[inline(always)]
    fn sift<M: Machine>(&self, machine: M, plan: &Plan, packet: &mut Packet, facet: &Facet, _: u64) -> Sifted {
        if facet.is_quad {
            sift::<M, SIDE, true>(machine, plan, &self.frame, packet, facet)
        } else {
            sift::<M, SIDE, false>(machine, plan, &self.frame, packet, facet)
        }
    }
}
