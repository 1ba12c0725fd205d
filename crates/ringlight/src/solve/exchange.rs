//! Visibility over a ring: the pipeline of `ring`, driven over the communicator, for several jobs at a time.

use super::asking;
use crate::mesh::Mesh;
use crate::ring::{Action, Answers, Content, Outlines, Packet, Parcel, Pipeline, Rings, Routing, Sight, Visits};
use crate::transport::{Communicator, Failure, Message};
use rayon::prelude::*;
use ringlight_visibility::{Hierarchy, PreparedShooter, Shooter, Tally};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Tag of packets between members of a ring.
const PARCEL: u32 = 2;

/// Tag of a member's word to the first of its ring that its own packets of a job are home.
const HOME: u32 = 3;

/// Tag of the first member's word that those of all are.
const ALL_HOME: u32 = 4;

/// Parcels gather to messages of about so many bytes, unless there is nothing else to do: the cost of a message, some
/// microseconds, is that of a few kilobytes.
const MESSAGE: usize = 16 << 10;

/// Packets that are tested together, for each thread: looking at the clock costs as much as some rays.
const TOGETHER: usize = 8;

/// This rank's place among those that hold the geometry with it.
pub struct RingExchange {
    pipeline: Pipeline,
    /// First rank of the ring, which consists of consecutive ranks.
    first: usize,
    /// Jobs under way, by number.
    jobs: BTreeMap<u64, Job>,
    /// Jobs that are over for members which have begun them before this one: known only to the first.
    early: BTreeMap<u64, usize>,
    /// Parcels that wait for company, by member.
    outbox: Vec<Vec<u8>>,
    effort: Effort,
}

/// What has been done here, for whomever.
#[derive(Clone, Copy, Debug, Default)]
pub struct Effort {
    /// Counts of visibility tests.
    pub tally: Tally,
    /// Nodes and triangles looked at in search of nearest hits.
    pub searched: u64,
    /// CPU time that tests took, seconds.
    pub testing: f64,
    /// Sample points of own clusters that were asked for.
    pub points: u64,
}

/// A job: what all members of the ring ask about one shooter.
struct Job {
    shooter: Arc<PreparedShooter>,
    /// What this rank holds for it.
    hierarchy: Arc<Hierarchy>,
    /// Own packets under way.
    in_flight: usize,
    /// Members whose packets are home; counted by the first.
    done: usize,
    /// Whether this rank's packets are home, all of them.
    here: bool,
    /// Whether those of all members are.
    everywhere: bool,
}

/// What a rank asks its ring for in a job.
pub trait Part {
    /// The next packet of this rank, if there is another now; a finished one may make room for more. The job is done when
    /// there is none and none is under way.
    fn next(&mut self) -> Option<Packet>;
    /// Takes the final answers to a packet that [`Part::next`] gave.
    fn finish(&mut self, ticket: u32, answers: Answers);
}

/// Own parts of the jobs under way, by number, in their order.
pub type Parts<'p> = [(u64, &'p mut dyn Part)];

impl RingExchange {
    /// Of rank `rank`. At most `window` own packets are under way at a time.
    pub fn new(rings: Rings, rank: usize, routing: Routing, window: usize) -> RingExchange {
        let members = rings.members(rings.ring_of(rank));
        RingExchange {
            pipeline: Pipeline::new(rank - members.start, routing, window),
            first: members.start,
            jobs: BTreeMap::new(),
            early: BTreeMap::new(),
            outbox: vec![Vec::new(); members.len()],
            effort: Effort::default(),
        }
    }

    /// Whether packets are compact, because their way depends on where they are: then a packet holds points of one cluster
    /// only, of which many travel in one message.
    pub fn wants_compact_packets(&self) -> bool {
        self.pipeline.routing() == Routing::Boxes
    }

    /// Counts so far.
    pub fn visits(&self) -> Visits {
        self.pipeline.visits()
    }

    /// What has been done so far.
    pub fn effort(&self) -> Effort {
        self.effort
    }

    /// Begins job `number`, which every rank of the ring does. `outlines` are the boxes around the shards of the ring's
    /// members, of which `hierarchy` is this rank's.
    pub fn begin(&mut self, number: u64, shooter: &Shooter, outlines: Arc<Outlines>, hierarchy: Arc<Hierarchy>) {
        assert_eq!(self.outbox.len(), outlines.members(), "every member of the ring has its boxes");
        let shooter = Arc::new(PreparedShooter::new(shooter));
        self.pipeline.begin(number, Sight::new(shooter.clone(), outlines));
        let done = self.early.remove(&number).unwrap_or(0);
        self.jobs.insert(number, Job { shooter, hierarchy, in_flight: 0, done, here: false, everywhere: false });
    }

    /// Whether the packets of all members in a job are home. Then it is to be ended.
    pub fn is_over(&self, number: u64) -> bool {
        self.jobs.get(&number).is_none_or(|job| job.everywhere)
    }

    /// Forgets a job that is over.
    pub fn end(&mut self, number: u64) {
        self.pipeline.end(number);
        self.jobs.remove(&number);
    }

    /// Does what can be done now; false if there is nothing to do before a message comes.
    pub fn serve(
        &mut self,
        ranks: &mut Communicator<'_>,
        mesh: &Mesh,
        parts: &mut Parts<'_>,
        clock: &dyn Fn() -> f64,
    ) -> Result<bool, Failure> {
        let mut busy = false;
        while let Some(message) = ranks.receive_where(is_ours)? {
            self.take(ranks, message)?;
            busy = true;
        }
        busy |= self.submit(parts);
        let mut packets = Vec::new();
        while packets.len() < TOGETHER * rayon::current_num_threads()
            && let Some(action) = self.pipeline.poll()
        {
            busy = true;
            match action {
                Action::Send { to, parcel } => {
                    let outbox = &mut self.outbox[to];
                    if outbox.capacity() == 0 {
                        outbox.reserve(MESSAGE + MESSAGE / 4);
                    }
                    parcel.write(outbox);
                    if self.outbox[to].len() >= MESSAGE {
                        self.post(ranks, to);
                    }
                }
                Action::Test(packet) => packets.push(packet),
                Action::Finish { shot, ticket, answers } => {
                    self.job(shot).in_flight -= 1;
                    let part = parts.iter_mut().find(|(number, _)| *number == shot);
                    part.expect("own packets belong to own parts").1.finish(ticket, answers);
                }
            }
        }
        if !packets.is_empty() {
            let start = clock();
            self.test(mesh, packets);
            self.effort.testing += clock() - start;
        }
        if !busy {
            // Nobody waits for a parcel that waits for company.
            (0..self.outbox.len()).for_each(|to| self.post(ranks, to));
            busy = self.conclude(ranks);
        }
        Ok(busy)
    }

    /// Waits for a message when there is nothing to do.
    pub fn wait(&mut self, ranks: &mut Communicator<'_>) -> Result<(), Failure> {
        let message = ranks.wait_where(is_ours)?;
        self.take(ranks, message)
    }

    /// Lets own packets set off, those of earlier jobs first.
    fn submit(&mut self, parts: &mut Parts<'_>) -> bool {
        let mut busy = false;
        for (number, part) in parts {
            let number = *number;
            while self.pipeline.has_room()
                && self.jobs.get(&number).is_some_and(|job| !job.here)
                && let Some(packet) = part.next()
            {
                self.job(number).in_flight += 1;
                if let Content::Samples(samples) = &packet.content {
                    self.effort.points += samples.len() as u64;
                }
                self.pipeline.submit(Packet { shot: number, ..packet });
                busy = true;
            }
        }
        busy
    }

    /// Says what this rank's geometry has to say: clears the bits that it blocks, finds what it has in the rays' way; with
    /// all threads if there are several packets.
    fn test(&mut self, mesh: &Mesh, mut packets: Vec<Packet>) {
        let test = |packet: &mut Packet| {
            let Job { shooter, hierarchy, .. } = &self.jobs[&packet.shot];
            match &mut packet.content {
                Content::Samples(samples) => {
                    let test = |(points, masks)| hierarchy.clear_blocked_of(shooter, points, masks);
                    (samples.neighbours_mut().map(test).fold(Tally::default(), Tally::join), 0)
                }
                Content::Aimed(aimed) => {
                    let (shooter, points, masks) = aimed.split_mut();
                    (hierarchy.clear_blocked_of(shooter, points, masks), 0)
                }
                Content::Rays(rays) => (Tally::default(), asking::test(mesh, hierarchy, rays)),
            }
        };
        let join = |a: (Tally, u64), b: (Tally, u64)| (a.0.join(b.0), a.1 + b.1);
        let (tally, searched) = match packets.as_mut_slice() {
            [] => return,
            [packet] => test(packet),
            packets => packets.par_iter_mut().map(test).reduce(Default::default, join),
        };
        self.effort.tally = self.effort.tally.join(tally);
        self.effort.searched += searched;
        packets.into_iter().for_each(|packet| self.pipeline.tested(packet));
    }

    /// Tells the first member of jobs that are done here.
    fn conclude(&mut self, ranks: &mut Communicator<'_>) -> bool {
        // With nothing to do and none of its packets under way, a job's part has nothing more to ask: there was room.
        let has_room = self.pipeline.has_room();
        let done = |job: &Job| !job.here && job.in_flight == 0 && has_room;
        let done: BTreeSet<u64> = self.jobs.iter().filter(|(_, job)| done(job)).map(|(&number, _)| number).collect();
        for &number in &done {
            self.job(number).here = true;
            if ranks.rank() == self.first {
                self.is_done_at_one(ranks, number);
            } else {
                ranks.send(self.first, HOME, number.to_ne_bytes().to_vec());
            }
        }
        !done.is_empty()
    }

    /// The packets of one more member are home.
    fn is_done_at_one(&mut self, ranks: &mut Communicator<'_>, number: u64) {
        let members = self.outbox.len();
        let Some(job) = self.jobs.get_mut(&number) else {
            *self.early.entry(number).or_default() += 1;
            return;
        };
        job.done += 1;
        if job.done == members {
            job.everywhere = true;
            let tell = |place| ranks.send(self.first + place, ALL_HOME, number.to_ne_bytes().to_vec());
            (1..members).for_each(tell);
        }
    }

    /// Sends what has gathered for a member.
    fn post(&mut self, ranks: &mut Communicator<'_>, to: usize) {
        if !self.outbox[to].is_empty() {
            ranks.send(self.first + to, PARCEL, std::mem::take(&mut self.outbox[to]));
        }
    }

    fn take(&mut self, ranks: &mut Communicator<'_>, message: Message) -> Result<(), Failure> {
        let rank = ranks.rank();
        let failure = |error: String| Failure { rank, message: format!("from rank {}: {error}", message.from) };
        if message.tag == PARCEL {
            let mut bytes = message.bytes.as_slice();
            while let Some(parcel) = Parcel::read(&mut bytes).map_err(|error| failure(error.to_string()))? {
                self.pipeline.receive(parcel);
            }
            return Ok(());
        }
        let number = message.bytes.as_slice().try_into().map(u64::from_ne_bytes);
        let number = number.map_err(|_| failure("a word about a job without its number".into()))?;
        if message.tag == HOME {
            self.is_done_at_one(ranks, number);
        } else {
            self.job(number).everywhere = true;
        }
        Ok(())
    }

    fn job(&mut self, number: u64) -> &mut Job {
        self.jobs.get_mut(&number).expect("a job lasts until it is over everywhere")
    }
}

fn is_ours(message: &Message) -> bool {
    [PARCEL, HOME, ALL_HOME].contains(&message.tag)
}
