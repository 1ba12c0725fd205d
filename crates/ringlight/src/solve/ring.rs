//! A rank in its ring: the geometry that it holds, and how its clusters come to see a shot.

use super::among::Among;
use super::asking;
use super::exchange::{Effort, Part, RingExchange};
use super::holding::Holding;
use super::receiving::Receiving;
use super::share::{Share, Spread};
use crate::mesh::{self, Mesh};
use crate::ring::{Load, Visits, Window};
use crate::shooting::{self, ClusterLight, Shot, Work};
use crate::transport::{Communicator, Failure};
use rayon::prelude::*;
use ringlight_visibility::{Hierarchy, PreparedShooter, Shooter, Tally};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Clusters with final masks gather to so many for each thread before they take their light, unless there is nothing else
/// to do.
const SEEN: usize = 8;

/// A rank's place in its ring.
pub struct Ring<'a> {
    mesh: &'a Mesh,
    share: Arc<Share>,
    geometry: Geometry<'a>,
    tally: Tally,
    searched: u64,
}

/// Where the geometry is.
enum Geometry<'a> {
    /// All of it here: a ring of one.
    Here(Arc<Hierarchy>),
    /// Spread over the members.
    Spread(Box<Wider<'a>>),
}

/// What a ring of several members needs.
struct Wider<'a> {
    exchange: RingExchange,
    holding: Holding<'a>,
    packet_size: usize,
    /// Shots under way, by the number of their job.
    receiving: BTreeMap<u64, Receiving<'a>>,
    /// Buffers of shots that are over.
    spare: Vec<Work>,
    /// Jobs so far.
    jobs: u64,
    /// Tells the CPU time of this rank so far, seconds.
    clock: Clock,
    /// The last job that saw the geometry held otherwise.
    settled: u64,
    /// Shots since the members told each other their loads.
    shots: u64,
    /// The clock, and what the exchange had done, at that time.
    since: (f64, Effort),
}

/// Tells CPU time of this rank so far, seconds.
pub type Clock = Box<dyn Fn() -> f64 + Send>;

/// A job under way: what the ring is asked for one shooter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Job(u64);

impl<'a> Ring<'a> {
    /// Of a rank that is alone and holds all geometry.
    pub fn alone(mesh: &'a Mesh, hierarchy: Arc<Hierarchy>) -> Ring<'a> {
        let share = Arc::new(Share::new(mesh, 0, 1));
        Ring { mesh, share, geometry: Geometry::Here(hierarchy), tally: Tally::default(), searched: 0 }
    }

    /// Of rank `rank`: builds the hierarchy over its shard.
    pub fn new(mesh: &'a Mesh, spread: &Spread, rank: usize) -> Ring<'a> {
        Ring::with(mesh, spread, Share::new(mesh, rank, spread.rings.ranks()), None, Box::new(|| 0.0))
    }

    /// Of the rank that has this share, with the hierarchy over its shard if that has been built before, see [`Ring::hierarchy`].
    /// The load is balanced by a clock; it changes no result.
    pub fn with(
        mesh: &'a Mesh,
        spread: &Spread,
        share: Share,
        hierarchy: Option<Arc<Hierarchy>>,
        clock: Clock,
    ) -> Ring<'a> {
        let (rank, share) = (share.rank, Arc::new(share));
        let members = spread.rings.members(spread.rings.ring_of(rank));
        let geometry = if members.len() == 1 {
            Geometry::Here(hierarchy.unwrap_or_else(|| Arc::new(mesh::hierarchy(mesh))))
        } else {
            let since = (clock(), Effort::default());
            Geometry::Spread(Box::new(Wider {
                exchange: RingExchange::new(spread.rings, rank, spread.routing, spread.window),
                holding: Holding::new(mesh, spread, rank, hierarchy),
                packet_size: spread.packet_size,
                receiving: BTreeMap::new(),
                spare: Vec::new(),
                jobs: 0,
                clock,
                settled: 0,
                shots: 0,
                since,
            }))
        };
        Ring { mesh, share, geometry, tally: Tally::default(), searched: 0 }
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
        match &self.geometry {
            Geometry::Here(hierarchy) => hierarchy,
            Geometry::Spread(wider) => &wider.holding.hierarchy,
        }
    }

    /// The rank that holds the geometry of a facet for this rank's ring.
    pub fn holder(&self, facet: u32) -> usize {
        self.wider().map_or(self.share.rank, |wider| wider.holding.holder(facet))
    }

    /// How the load of the ring's members was balanced; none in a ring of one.
    pub fn windows(&self) -> &[Window] {
        self.wider().map_or(&[], |wider| wider.holding.balance().windows())
    }

    fn wider(&self) -> Option<&Wider<'a>> {
        match &self.geometry {
            Geometry::Here(_) => None,
            Geometry::Spread(wider) => Some(wider),
        }
    }

    /// Counts of visibility tests made here so far.
    pub fn tally(&self) -> Tally {
        self.wider().map_or(self.tally, |wider| wider.exchange.effort().tally)
    }

    /// Nodes and triangles looked at here so far in search of nearest hits, for own tasks and those of other members.
    pub fn searched(&self) -> u64 {
        self.wider().map_or(self.searched, |wider| wider.exchange.effort().searched)
    }

    /// Counts them for tasks that are done at once.
    pub(super) fn count_search(&mut self, looked_at: u64) {
        self.searched += looked_at;
    }

    /// Counts of packets so far.
    pub fn visits(&self) -> Visits {
        self.wider().map_or(Visits::default(), |wider| wider.exchange.visits())
    }

    /// Begins to find what patches of own clusters, those among all that are to receive it, see of a shot. Every rank calls it.
    pub fn begin(&mut self, shot: &Arc<Shot>, among: &Among) -> Job {
        let Geometry::Spread(wider) = &mut self.geometry else { return Job(0) };
        let job = wider.begin(&shot.shooter);
        let compact = wider.exchange.wants_compact_packets();
        let part = Receiving::new(
            self.mesh,
            self.share.clone(),
            (shot.clone(), among.clone()),
            wider.packet_size,
            compact,
            std::mem::take(&mut wider.spare),
        );
        wider.receiving.insert(job, part);
        Job(job)
    }

    /// Does what can be done now for what has begun; false if there is nothing to do before a message comes.
    pub fn serve(&mut self, ranks: &mut Communicator<'_>) -> Result<bool, Failure> {
        match &mut self.geometry {
            Geometry::Here(_) => Ok(false),
            Geometry::Spread(wider) => wider.serve(ranks, self.mesh, None),
        }
    }

    /// Adds to `light`, the light of own clusters, what those receive from a shot with whom it began. Every rank calls it, in the order
    /// in which the shots began.
    pub fn commit(
        &mut self,
        ranks: &mut Communicator<'_>,
        Job(job): Job,
        (shot, among): (&Shot, &Among),
        light: &mut [ClusterLight],
    ) -> Result<(), Failure> {
        let wider = match &mut self.geometry {
            Geometry::Here(hierarchy) => {
                self.tally = self.tally.join(receive(self.mesh, &self.share, hierarchy, (shot, among), light));
                return Ok(());
            }
            Geometry::Spread(wider) => wider,
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
            wider.spare.extend(part.into_buffers());
        }
        wider.exchange.end(job);
        wider.rebalance(ranks, job)
    }

    /// Serves a part of this rank until the parts of all members are done. Every rank of the ring calls it.
    pub(super) fn serve_to_the_end(
        &mut self,
        ranks: &mut Communicator<'_>,
        part: &mut dyn Part,
    ) -> Result<(), Failure> {
        let Geometry::Spread(wider) = &mut self.geometry else { return Ok(()) };
        let job = wider.begin(&asking::nothing());
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
        self.wider().is_none()
    }

    /// Most rays of a packet.
    pub fn packet_size(&self) -> usize {
        self.wider().map_or(usize::MAX, |wider| wider.packet_size)
    }
}

impl Wider<'_> {
    /// Begins a job about a shooter.
    fn begin(&mut self, shooter: &Shooter) -> u64 {
        self.jobs += 1;
        let Holding { hierarchy, outlines, .. } = &self.holding;
        self.exchange.begin(self.jobs, shooter, outlines.clone(), hierarchy.clone());
        self.jobs
    }

    /// After a shot is over: when enough has been seen, lets geometry move to members that are less busy.
    fn rebalance(&mut self, ranks: &mut Communicator<'_>, job: u64) -> Result<(), Failure> {
        if job <= self.settled {
            // It saw the geometry held otherwise.
            self.since = ((self.clock)(), self.exchange.effort());
            return Ok(());
        }
        self.shots += 1;
        if self.shots < self.holding.balance().pause() {
            return Ok(());
        }
        let now = ((self.clock)(), self.exchange.effort());
        let testing = now.1.testing - self.since.1.testing;
        let other = (now.0 - self.since.0 - testing).max(0.0);
        let load = Load { testing, other, points: now.1.points - self.since.1.points };
        if self.holding.rebalance(ranks, self.shots, load, !self.receiving.is_empty())? {
            self.settled = self.jobs;
        }
        self.shots = 0;
        self.since = ((self.clock)(), self.exchange.effort());
        Ok(())
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
        self.exchange.serve(ranks, mesh, &mut parts, &self.clock)
    }
}

/// What a ring of one does: every own cluster receives the shot, in parallel; each computes its light alone.
fn receive(
    mesh: &Mesh,
    share: &Share,
    hierarchy: &Hierarchy,
    (shot, among): (&Shot, &Among),
    light: &mut [ClusterLight],
) -> Tally {
    let shooter = PreparedShooter::new(&shot.shooter);
    let one = |work: &mut Work, (place, (&cluster, light)): (usize, (&u32, &mut ClusterLight))| {
        shooting::receive(mesh, (cluster as usize, among.at(place)), light, shot, &shooter, hierarchy, work)
    };
    let own = share.own.par_iter().zip(light).enumerate();
    own.with_min_len(4).map_init(Work::default, one).reduce(Tally::default, Tally::join)
}
