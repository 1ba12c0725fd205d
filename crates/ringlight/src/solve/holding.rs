//! What the members of a ring hold of the geometry, and how it moves between them.

use super::share::Spread;
use crate::mesh::{self, Facet, Mesh};
use crate::ring::{Balance, Bounds, Load, Outlines, Piece, ShardBox, deal, outline};
use crate::transport::{Communicator, Failure};
use ringlight_visibility::{Hierarchy, NO_PLANE};
use std::ops::Range;
use std::sync::Arc;

/// Tag of the messages by which members tell each other their loads.
const LOADS: u32 = 8;

/// Boxes that describe a shard to the other members.
pub const OUTLINE: usize = 256;

/// Most pieces that geometry is dealt out in: every member knows the holder of each.
const PIECES: usize = 1 << 16;

/// A ring's geometry, seen from one member.
pub struct Holding<'a> {
    mesh: &'a Mesh,
    /// Ranks of the ring.
    members: Range<usize>,
    place: usize,
    /// Facets of a piece.
    run: usize,
    pieces: Arc<[Piece]>,
    balance: Balance,
    /// Over the shard of this member.
    pub hierarchy: Arc<Hierarchy>,
    /// Boxes around the shards of all.
    pub outlines: Arc<Outlines>,
}

impl<'a> Holding<'a> {
    /// Of rank `rank`, with the hierarchy over its shard if that has been built before.
    pub fn new(mesh: &'a Mesh, spread: &Spread, rank: usize, hierarchy: Option<Arc<Hierarchy>>) -> Holding<'a> {
        let members = spread.rings.members(spread.rings.ring_of(rank));
        let run = mesh.facets.len().div_ceil(PIECES).max(1);
        let pieces: Arc<[Piece]> = mesh.facets.chunks(run).map(piece).collect();
        let holders = deal(&pieces, members.len(), spread.shards);
        let balance = Balance::new(pieces.clone(), holders, members.len(), spread.shards, spread.moves);
        let place = rank - members.start;
        let (nothing, outlines) = (empty(), Arc::new(Outlines::new(&[])));
        let mut holding = Holding { mesh, members, place, run, pieces, balance, hierarchy: nothing, outlines };
        holding.outlines = holding.outlines();
        holding.hierarchy = hierarchy.unwrap_or_else(|| holding.hierarchy());
        holding
    }

    /// The balance so far.
    pub fn balance(&self) -> &Balance {
        &self.balance
    }

    /// The rank that holds a facet.
    pub fn holder(&self, facet: u32) -> usize {
        let piece = facet as usize / self.run;
        self.members.start + self.balance.holders().get(piece).map_or(0, |&member| member as usize)
    }

    /// Tells the others this member's load in the last shots, and takes theirs; whether geometry has moved. Every member
    /// calls it.
    pub fn rebalance(
        &mut self,
        ranks: &mut Communicator<'_>,
        shots: u64,
        load: Load,
        under_way: bool,
    ) -> Result<bool, Failure> {
        let this = ranks.rank();
        let others = self.members.clone().filter(|&rank| rank != this);
        others.for_each(|rank| ranks.send(rank, LOADS, bytemuck::bytes_of(&load).to_vec()));
        let mut loads = Vec::with_capacity(self.members.len());
        for rank in self.members.clone() {
            loads.push(match rank == this {
                true => load,
                false => {
                    let bytes = ranks.wait_for(rank, LOADS)?;
                    let malformed = |_| Failure { rank: this, message: format!("rank {rank} has told no load") };
                    bytemuck::try_pod_read_unaligned(&bytes).map_err(malformed)?
                }
            });
        }
        let moved = self.balance.add(shots, &loads);
        if moved {
            if !under_way {
                // Nobody needs the old one any more, and there may be no room for both.
                self.hierarchy = empty();
            }
            self.hierarchy = self.hierarchy();
            self.outlines = self.outlines();
        }
        Ok(moved)
    }

    fn hierarchy(&self) -> Arc<Hierarchy> {
        let (place, facets) = (self.place as u32, self.mesh.facets.len());
        let held = (0..facets).step_by(self.run).zip(self.balance.holders()).filter(|(_, holder)| **holder == place);
        let facets = held.flat_map(|(first, _)| first as u32..facets.min(first + self.run) as u32);
        Arc::new(mesh::hierarchy_of(self.mesh, facets))
    }

    fn outlines(&self) -> Arc<Outlines> {
        let of = |member: usize| {
            let held =
                self.balance.holders().iter().zip(&*self.pieces).filter(|(holder, _)| **holder as usize == member);
            outline(&held.map(|(_, &piece)| piece).collect::<Vec<_>>(), OUTLINE)
        };
        let shards: Vec<Vec<ShardBox>> = (0..self.members.len()).map(of).collect();
        Arc::new(Outlines::new(&shards))
    }
}

fn empty() -> Arc<Hierarchy> {
    Arc::new(Hierarchy::build(Vec::new(), Vec::new()))
}

fn piece(facets: &[Facet]) -> Piece {
    let plane = facets.first().map(|f| f.plane).filter(|&plane| facets.iter().all(|f| f.plane == plane));
    Piece {
        bounds: Bounds::around(facets.iter().flat_map(|f| f.corners).map(|c| c.to_array())),
        triangles: facets.iter().map(|f| f.triangle_count() as u32).sum(),
        plane: plane.unwrap_or(NO_PLANE),
    }
}
