//! A rank in its ring: the geometry that it holds, and how its clusters come to see a shot.

use super::exchange::{Part, Parts, RingExchange};
use super::receiving::Receiving;
use super::share::{Share, Spread};
use super::walking::{self, Walking};
use crate::mesh::{self, LookAbout, Mesh, View, walk};
use crate::ring::{Bounds, Piece, Visits, deal, outline};
use crate::shooting::{self, Audit, ClusterLight, Fate, Following, Shot, Work};
use crate::transport::{Communicator, Failure};
use rayon::prelude::*;
use ringlight_visibility::{Cells, Hierarchy, NO_PLANE, Shooter, Tally};
use std::collections::BTreeMap;
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
}

/// What a ring of several members needs.
struct Wider<'a> {
    exchange: RingExchange<'a>,
    outlines: Arc<Vec<Vec<Bounds>>>,
    packet_size: usize,
    /// Own parts of the shots under way, by job.
    parts: BTreeMap<u64, Receiving<'a>>,
}

impl<'a> Ring<'a> {
    /// Of a rank that is alone and holds all geometry.
    pub fn alone(mesh: &'a Mesh, hierarchy: Arc<Hierarchy>) -> Ring<'a> {
        Ring { mesh, share: Arc::new(Share::new(mesh, 0, 1)), hierarchy, spread: None, tally: Tally::default() }
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
            exchange: RingExchange::new(mesh, spread.rings, rank, spread.routing, spread.window),
            outlines,
            packet_size: spread.packet_size,
            parts: BTreeMap::new(),
        };
        Ring { mesh, share, hierarchy: Arc::new(hierarchy), spread: Some(wider), tally: Tally::default() }
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

    /// Begins to find what own clusters see of shot number `number`.
    pub fn begin(&mut self, number: u64, shot: &Arc<Shot>) {
        let Some(wider) = &mut self.spread else { return };
        wider.begin(seeing(number), &shot.shooter, &self.hierarchy);
        let compact = wider.exchange.wants_compact_packets();
        let part = Receiving::new(self.mesh, self.share.clone(), shot.clone(), wider.packet_size, compact);
        wider.parts.insert(seeing(number), part);
    }

    /// Does what can be done now for the shots that have begun; false if there is nothing to do before a message comes.
    pub fn serve(&mut self, ranks: &mut Communicator<'_>) -> Result<bool, Failure> {
        self.spread.as_mut().map_or(Ok(false), |wider| wider.serve(ranks, None))
    }

    /// Adds to `light`, the light of own clusters, what they receive from shot number `number`, and follows this rank's share of
    /// its audit's rays: the fates of all ranks are to be joined.
    pub fn commit(
        &mut self,
        ranks: &mut Communicator<'_>,
        number: u64,
        shot: &Shot,
        audit: &Audit<'_>,
        light: &mut [ClusterLight],
    ) -> Result<Fate, Failure> {
        let (first, step) = self.blocks(ranks, number);
        let Some(wider) = &mut self.spread else {
            self.tally = self.tally.join(receive(self.mesh, &self.share, &self.hierarchy, shot, light));
            return Ok(audit.follow_some(&self.hierarchy, first, step));
        };
        let mut fate = Fate::default();
        let end = |_, rays: Vec<Following<'_>>| fate = rays.iter().map(Following::fate).fold(fate, Fate::join);
        let mut walking = Walking::new(walking::rays(std::slice::from_ref(audit), first, step), end);
        let (seeing, following) = (seeing(number), following(number));
        wider.begin(following, &nothing(), &self.hierarchy);
        let many = SEEN * rayon::current_num_threads();
        while !wider.exchange.is_over(seeing) || !wider.exchange.is_over(following) {
            let busy = wider.serve(ranks, Some((following, &mut walking)))?;
            let over = wider.exchange.is_over(seeing) && wider.exchange.is_over(following);
            match wider.parts.get_mut(&seeing) {
                Some(part) if part.seen() >= many || !busy && part.seen() > 0 => part.add_seen(light),
                _ if !busy && !over => wider.exchange.wait(ranks)?,
                _ => {}
            }
        }
        if let Some(mut part) = wider.parts.remove(&seeing) {
            part.add_seen(light);
        }
        wider.exchange.end(seeing);
        wider.exchange.end(following);
        Ok(fate)
    }

    /// Where the rays of some audits end. Every rank calls it, before the first shot.
    pub fn follow(&mut self, ranks: &mut Communicator<'_>, audits: &[Audit<'_>]) -> Result<Vec<Fate>, Failure> {
        if audits.is_empty() {
            return Ok(Vec::new());
        }
        let (first, step) = self.blocks(ranks, 0);
        let mut fates = vec![Fate::default(); audits.len()];
        if let Some(wider) = &mut self.spread {
            let end = |i: usize, rays: Vec<Following<'_>>| {
                fates[i] = rays.iter().map(Following::fate).fold(fates[i], Fate::join);
            };
            let walking = Walking::new(walking::rays(audits, first, step), end);
            wider.walk(ranks, ENTERING, walking, &self.hierarchy)?;
        } else {
            fates = audits.par_iter().map(|audit| audit.follow_some(&self.hierarchy, first, step)).collect();
        }
        let join = |a, b| Fate::from_bytes(a).join(Fate::from_bytes(b)).to_bytes();
        fates.iter().map(|fate| Ok(Fate::from_bytes(ranks.all_reduce(FATE, fate.to_bytes(), join)?))).collect()
    }

    /// The valid samples of the elements of own clusters, one cluster after the other: what [`mesh::find_valid_samples`] finds
    /// where all geometry is held. Every rank calls it, once.
    pub fn find_valid_samples(&mut self, ranks: &mut Communicator<'_>) -> Result<Vec<u16>, Failure> {
        let (mesh, share) = (self.mesh, self.share.clone());
        let clusters = share.own.iter().map(|&c| &mesh.clusters[c as usize]);
        let mut valid = vec![0; clusters.clone().map(|c| c.elements.len()).sum()];
        let mut end = |(id, first): (u32, usize), looks: Vec<LookAbout<'_>>| {
            let views: Vec<View> = looks.iter().map(LookAbout::view).collect();
            let patch = mesh.patch(id);
            let found = mesh::valid_samples(mesh, &patch, &views);
            valid[first..].iter_mut().zip(found).for_each(|(bits, found)| *bits = found);
        };
        let patches = clusters.flat_map(|c| c.patches.clone());
        if let Some(wider) = &mut self.spread {
            let walking = Walking::new(walking::looks(mesh, patches, wider.packet_size), end);
            wider.walk(ranks, LOOKING, walking, &self.hierarchy)?;
        } else {
            let run = |look| walk::run(mesh, &self.hierarchy, look);
            let groups: Vec<_> = walking::looks(mesh, patches, usize::MAX).collect();
            let run_all = |(purpose, looks): (_, Vec<_>)| (purpose, looks.into_iter().map(run).collect());
            let seen: Vec<_> = groups.into_par_iter().map(run_all).collect();
            seen.into_iter().for_each(|(purpose, looks)| end(purpose, looks));
        }
        Ok(valid)
    }

    /// The blocks of an audit's rays that this rank follows, as the first and the step: begun with another rank for each
    /// shot, because audits of one block are frequent.
    fn blocks(&self, ranks: &Communicator<'_>, number: u64) -> (u32, usize) {
        let size = ranks.size();
        ((self.share.rank + size - (number % size as u64) as usize) as u32 % size as u32, size)
    }
}

impl Wider<'_> {
    /// Begins a job of the ring.
    fn begin(&mut self, number: u64, shooter: &Shooter, hierarchy: &Arc<Hierarchy>) {
        self.exchange.begin(number, shooter, self.outlines.clone(), hierarchy.clone());
    }

    /// Does what can be done now for the shots that have begun, and for one part more.
    fn serve(&mut self, ranks: &mut Communicator<'_>, more: Option<(u64, &mut dyn Part)>) -> Result<bool, Failure> {
        let mut parts = Parts::new();
        for (&number, part) in &mut self.parts {
            parts.insert(number, part);
        }
        if let Some((number, part)) = more {
            parts.insert(number, part);
        }
        self.exchange.serve(ranks, &mut parts)
    }

    /// Follows walks to their ends, and helps others with theirs.
    fn walk(
        &mut self,
        ranks: &mut Communicator<'_>,
        number: u64,
        mut part: impl Part,
        hierarchy: &Arc<Hierarchy>,
    ) -> Result<(), Failure> {
        self.begin(number, &nothing(), hierarchy);
        while !self.exchange.is_over(number) {
            if !self.serve(ranks, Some((number, &mut part)))? && !self.exchange.is_over(number) {
                self.exchange.wait(ranks)?;
            }
        }
        self.exchange.end(number);
        Ok(())
    }
}

/// Tag of the messages that join fates.
const FATE: u32 = 7;

/// The job in which light from infinity looks for the scene.
const ENTERING: u64 = u64::MAX;

/// The job in which samples look about.
const LOOKING: u64 = u64::MAX - 1;

/// The job in which receivers see a shot.
fn seeing(shot: u64) -> u64 {
    2 * shot
}

/// The job in which the rays of a shot's audit are followed.
fn following(shot: u64) -> u64 {
    2 * shot + 1
}

/// The shooter of jobs that only follow rays.
fn nothing() -> Shooter {
    Shooter { cells: Cells::Points(Vec::new()), plane: NO_PLANE, far: 1.0 }
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
