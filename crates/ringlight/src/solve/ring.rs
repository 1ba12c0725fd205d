//! A rank in its ring: the geometry that it holds, and how its clusters come to see a shot.

use super::exchange::{Parts, RingExchange};
use super::receiving::Receiving;
use super::share::{Share, Spread};
use crate::mesh::{self, Mesh};
use crate::ring::{Bounds, Piece, Visits, deal, outline};
use crate::shooting::{self, ClusterLight, Shot, Work};
use crate::transport::{Communicator, Failure};
use rayon::prelude::*;
use ringlight_visibility::{Hierarchy, Tally};
use std::sync::Arc;

/// Boxes that describe a shard to the other members.
const OUTLINE: usize = 16;

/// Most pieces that geometry is dealt out in: every member knows the holder of each.
const PIECES: usize = 1 << 16;

/// Clusters with final masks gather to so many for each thread before they take their light, unless there is nothing else
/// to do.
const SEEN: usize = 8;

/// A rank's place in its ring.
pub struct Ring<'a> {
    mesh: &'a Mesh,
    share: Arc<Share>,
    hierarchy: Arc<Hierarchy>,
    /// None in a ring of one, which holds everything.
    spread: Option<Wider<'a>>,
    tally: Tally,
    whole: Option<Hierarchy>,
}

/// What a ring of several members needs.
struct Wider<'a> {
    exchange: RingExchange,
    outlines: Arc<Vec<Vec<Bounds>>>,
    packet_size: usize,
    parts: Parts<Receiving<'a>>,
}

impl<'a> Ring<'a> {
    /// Of a rank that is alone and holds all geometry.
    pub fn alone(mesh: &'a Mesh, hierarchy: Arc<Hierarchy>) -> Ring<'a> {
        Ring {
            mesh,
            share: Arc::new(Share::new(mesh, 0, 1)),
            hierarchy,
            spread: None,
            tally: Tally::default(),
            whole: None,
        }
    }

    /// Of rank `rank`: builds the hierarchy over its shard.
    pub fn new(mesh: &'a Mesh, spread: &Spread, rank: usize) -> Ring<'a> {
        let members = spread.rings.members(spread.rings.ring_of(rank));
        let share = Arc::new(Share::new(mesh, rank, spread.rings.ranks()));
        if members.len() == 1 {
            return Ring { share, ..Ring::alone(mesh, Arc::new(mesh::hierarchy(mesh))) };
        }
        let run = mesh.facets.len().div_ceil(PIECES);
        let pieces: Vec<Piece> = mesh.facets.chunks(run).map(piece).collect();
        let holders = deal(&pieces, members.len(), spread.shards);
        let mut held = vec![Vec::new(); members.len()];
        holders.iter().zip(0u32..).for_each(|(&member, piece)| held[member as usize].push(piece));
        let boxes =
            |held: &Vec<u32>| outline(&held.iter().map(|&piece| pieces[piece as usize]).collect::<Vec<_>>(), OUTLINE);
        let outlines = Arc::new(held.iter().map(boxes).collect::<Vec<_>>());
        let (run, facets) = (run as u32, mesh.facets.len() as u32);
        let own = held[rank - members.start].iter();
        let hierarchy = mesh::hierarchy_of(mesh, own.flat_map(|&p| p * run..facets.min((p + 1) * run)));
        let wider = Wider {
            exchange: RingExchange::new(spread.rings, rank, spread.routing, spread.window),
            outlines,
            packet_size: spread.packet_size,
            parts: Parts::new(),
        };
        Ring {
            mesh,
            share,
            hierarchy: Arc::new(hierarchy),
            spread: Some(wider),
            tally: Tally::default(),
            whole: Some(mesh::hierarchy(mesh)),
        }
    }

    /// The scene.
    pub fn mesh(&self) -> &'a Mesh {
        self.mesh
    }

    /// What this rank owns.
    pub fn share(&self) -> &Arc<Share> {
        &self.share
    }

    /// What this rank holds of the geometry.
    pub fn hierarchy(&self) -> &Arc<Hierarchy> {
        &self.hierarchy
    }

    /// TEMPORARY
    pub fn whole(&self) -> &Hierarchy {
        self.whole.as_ref().unwrap_or(&self.hierarchy)
    }

    /// Counts of visibility tests made here so far.
    pub fn tally(&self) -> Tally {
        self.spread.as_ref().map_or(self.tally, |wider| wider.exchange.tally())
    }

    /// Counts of packets so far.
    pub fn visits(&self) -> Visits {
        self.spread.as_ref().map_or(Visits::default(), |wider| wider.exchange.visits())
    }

    /// Begins to find what own clusters see of shot number `number`.
    pub fn begin(&mut self, number: u64, shot: &Arc<Shot>) {
        let Some(wider) = &mut self.spread else { return };
        wider.exchange.begin(number, &shot.shooter, wider.outlines.clone(), self.hierarchy.clone());
        let compact = wider.exchange.wants_compact_packets();
        let part = Receiving::new(self.mesh, self.share.clone(), shot.clone(), wider.packet_size, compact);
        wider.parts.insert(number, part);
    }

    /// Does what can be done now for the shots that have begun; false if there is nothing to do before a message comes.
    pub fn serve(&mut self, ranks: &mut Communicator<'_>) -> Result<bool, Failure> {
        self.spread.as_mut().map_or(Ok(false), |wider| wider.exchange.serve(ranks, &mut wider.parts))
    }

    /// Adds to `light`, the light of own clusters, what they receive from shot number `number`.
    pub fn commit(
        &mut self,
        ranks: &mut Communicator<'_>,
        number: u64,
        shot: &Shot,
        light: &mut [ClusterLight],
    ) -> Result<(), Failure> {
        let Some(Wider { exchange, parts, .. }) = &mut self.spread else {
            self.tally = self.tally.join(receive(self.mesh, &self.share, &self.hierarchy, shot, light));
            return Ok(());
        };
        let many = SEEN * rayon::current_num_threads();
        while !exchange.is_over(number) {
            let busy = exchange.serve(ranks, parts)?;
            let Some(part) = parts.get_mut(&number) else { break };
            if part.seen() >= many || !busy && part.seen() > 0 {
                part.add_seen(light);
            } else if !busy && !exchange.is_over(number) {
                exchange.wait(ranks)?;
            }
        }
        if let Some(mut part) = parts.remove(&number) {
            part.add_seen(light);
        }
        exchange.end(number);
        Ok(())
    }
}

/// What a ring of one does: every own cluster receives the shot, in parallel; each computes its light alone.
fn receive(mesh: &Mesh, share: &Share, hierarchy: &Hierarchy, shot: &Shot, light: &mut [ClusterLight]) -> Tally {
    let own = share.own.par_iter().zip(light).with_min_len(4);
    own.map_init(Work::default, |work, (&c, light)| shooting::receive(mesh, c as usize, light, shot, hierarchy, work))
        .reduce(Tally::default, Tally::join)
}

fn piece(facets: &[mesh::Facet]) -> Piece {
    let triangles = facets.iter().map(|f| if f.corners[3] == f.corners[0] { 1 } else { 2 }).sum();
    Piece { bounds: Bounds::around(facets.iter().flat_map(|f| f.corners).map(|c| c.to_array())), triangles }
}
