//! A rank in its ring: the geometry that it holds, and how its clusters come to see a shot.

use super::asking;
use super::exchange::{Part, RingExchange};
use super::receiving::Receiving;
use super::share::{Share, Spread};
use crate::mesh::{self, Mesh};
use crate::ring::{Bounds, Piece, ShardBox, Visits, deal, outline};
use crate::shooting::{self, ClusterLight, Shot, Work};
use crate::transport::{Communicator, Failure};
use rayon::prelude::*;
use ringlight_visibility::{Hierarchy, NO_PLANE, Shooter, Tally};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Boxes that describe a shard to the other members.
pub const OUTLINE: usize = 64;

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
}

/// What a ring of several members needs.
struct Wider<'a> {
    exchange: RingExchange,
    outlines: Arc<Vec<Vec<ShardBox>>>,
    packet_size: usize,
    /// Shots under way, by the number of their job.
    receiving: BTreeMap<u64, Receiving<'a>>,
    /// Jobs so far.
    jobs: u64,
}

/// A job under way: what the ring is asked for one shooter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Job(u64);

impl<'a> Ring<'a> {
    /// Of a rank that is alone and holds all geometry.
    pub fn alone(mesh: &'a Mesh, hierarchy: Arc<Hierarchy>) -> Ring<'a> {
        Ring { mesh, share: Arc::new(Share::new(mesh, 0, 1)), hierarchy, spread: None, tally: Tally::default() }
    }

    /// Of rank `rank`: builds the hierarchy over its shard.
    pub fn new(mesh: &'a Mesh, spread: &Spread, rank: usize) -> Ring<'a> {
        Ring::with(mesh, spread, rank, None)
    }

    /// Of rank `rank`, with the hierarchy over its shard if that has been built before, see [`Ring::hierarchy`].
    pub fn with(mesh: &'a Mesh, spread: &Spread, rank: usize, hierarchy: Option<Arc<Hierarchy>>) -> Ring<'a> {
        let members = spread.rings.members(spread.rings.ring_of(rank));
        let share = Arc::new(Share::new(mesh, rank, spread.rings.ranks()));
        if members.len() == 1 {
            return Ring { share, ..Ring::alone(mesh, hierarchy.unwrap_or_else(|| Arc::new(mesh::hierarchy(mesh)))) };
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
        let own = own.flat_map(|&p| p * run..facets.min((p + 1) * run));
        let hierarchy = hierarchy.unwrap_or_else(|| Arc::new(mesh::hierarchy_of(mesh, own)));
        let wider = Wider {
            exchange: RingExchange::new(spread.rings, rank, spread.routing, spread.window),
            outlines,
            packet_size: spread.packet_size,
            receiving: BTreeMap::new(),
            jobs: 0,
        };
        Ring { mesh, share, hierarchy, spread: Some(wider), tally: Tally::default() }
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

    /// Counts of visibility tests made here so far.
    pub fn tally(&self) -> Tally {
        self.spread.as_ref().map_or(self.tally, |wider| wider.exchange.tally())
    }

    /// Counts of packets so far.
    pub fn visits(&self) -> Visits {
        self.spread.as_ref().map_or(Visits::default(), |wider| wider.exchange.visits())
    }

    /// Begins to find what own clusters see of a shot. Every rank calls it.
    pub fn begin(&mut self, shot: &Arc<Shot>) -> Job {
        let Some(wider) = &mut self.spread else { return Job(0) };
        let job = wider.begin(&shot.shooter, &self.hierarchy);
        let compact = wider.exchange.wants_compact_packets();
        let part = Receiving::new(self.mesh, self.share.clone(), shot.clone(), wider.packet_size, compact);
        wider.receiving.insert(job, part);
        Job(job)
    }

    /// Does what can be done now for what has begun; false if there is nothing to do before a message comes.
    pub fn serve(&mut self, ranks: &mut Communicator<'_>) -> Result<bool, Failure> {
        let mesh = self.mesh;
        self.spread.as_mut().map_or(Ok(false), |wider| wider.serve(ranks, mesh, None))
    }

    /// Adds to `light`, the light of own clusters, what they receive from a shot. Every rank calls it, in the order in which
    /// the shots began.
    pub fn commit(
        &mut self,
        ranks: &mut Communicator<'_>,
        Job(job): Job,
        shot: &Shot,
        light: &mut [ClusterLight],
    ) -> Result<(), Failure> {
        let Some(wider) = &mut self.spread else {
            self.tally = self.tally.join(receive(self.mesh, &self.share, &self.hierarchy, shot, light));
            return Ok(());
        };
        let many = SEEN * rayon::current_num_threads();
        while !wider.exchange.is_over(job) {
            let busy = wider.serve(ranks, self.mesh, None)?;
            let Some(part) = wider.receiving.get_mut(&job) else { break };
            if part.seen() >= many || !busy && part.seen() > 0 {
                part.add_seen(light);
            } else if !busy && !wider.exchange.is_over(job) {
                wider.exchange.wait(ranks)?;
            }
        }
        if let Some(mut part) = wider.receiving.remove(&job) {
            part.add_seen(light);
        }
        wider.exchange.end(job);
        Ok(())
    }

    /// Serves a part of this rank until the parts of all members are done. Every rank of the ring calls it.
    pub(super) fn serve_to_the_end(
        &mut self,
        ranks: &mut Communicator<'_>,
        part: &mut dyn Part,
    ) -> Result<(), Failure> {
        let Some(wider) = &mut self.spread else { return Ok(()) };
        let job = wider.begin(&asking::nothing(), &self.hierarchy);
        while !wider.exchange.is_over(job) {
            if !wider.serve(ranks, self.mesh, Some((job, part)))? && !wider.exchange.is_over(job) {
                wider.exchange.wait(ranks)?;
            }
        }
        wider.exchange.end(job);
        Ok(())
    }

    /// Whether this rank holds all triangles.
    pub(super) fn holds_all(&self) -> bool {
        self.spread.is_none()
    }

    /// Most rays of a packet.
    pub(super) fn packet_size(&self) -> usize {
        self.spread.as_ref().map_or(usize::MAX, |wider| wider.packet_size)
    }
}

impl Wider<'_> {
    /// Begins a job about a shooter.
    fn begin(&mut self, shooter: &Shooter, hierarchy: &Arc<Hierarchy>) -> u64 {
        self.jobs += 1;
        self.exchange.begin(self.jobs, shooter, self.outlines.clone(), hierarchy.clone());
        self.jobs
    }

    /// Serves all shots under way, and one more job.
    fn serve(
        &mut self,
        ranks: &mut Communicator<'_>,
        mesh: &Mesh,
        last: Option<(u64, &mut dyn Part)>,
    ) -> Result<bool, Failure> {
        let mut parts: Vec<(u64, &mut dyn Part)> = Vec::new();
        self.receiving.iter_mut().for_each(|(&job, part)| parts.push((job, part)));
        if let Some((job, part)) = last {
            parts.push((job, part));
        }
        self.exchange.serve(ranks, mesh, &mut parts)
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
    let plane = facets.first().map(|f| f.plane).filter(|&plane| facets.iter().all(|f| f.plane == plane));
    let bounds = Bounds::around(facets.iter().flat_map(|f| f.corners).map(|c| c.to_array()));
    Piece { bounds, triangles, plane: plane.unwrap_or(NO_PLANE) }
}
