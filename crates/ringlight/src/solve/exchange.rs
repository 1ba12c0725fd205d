//! Visibility over a ring: the pipeline of `ring`, driven over the communicator.

use crate::ring::{Action, Answers, Bounds, Packet, Parcel, Pipeline, Rings, Routing, Sight, Visits};
use crate::transport::{Communicator, Failure, Message};
use ringlight_visibility::Shooter;
use std::sync::Arc;

/// Tag of packets between members of a ring.
const PARCEL: u32 = 2;

/// Tag of a member's word to the first of its ring that its own packets are home.
const HOME: u32 = 3;

/// Tag of the first member's word that all are.
const ALL_HOME: u32 = 4;

/// Parcels gather to messages of about so many bytes, unless there is nothing else to do: the cost of a message, some
/// microseconds, is that of a few kilobytes.
const MESSAGE: usize = 16 << 10;

/// This rank's place among those that hold the geometry with it.
pub struct RingExchange {
    pipeline: Pipeline,
    /// First rank of the ring, which consists of consecutive ranks.
    first: usize,
    outlines: Arc<Vec<Vec<Bounds>>>,
    /// Parcels that wait for company, by member.
    outbox: Vec<Vec<u8>>,
}

/// What a rank does for a shot, besides sending and waiting.
pub trait Part {
    /// The next packet of this rank, if there is another now; a finished one may make room for more.
    fn next(&mut self) -> Option<Packet>;
    /// Says what the geometry held here has to say: clears the bits that it blocks, or finds what it has in the rays' way.
    fn test(&mut self, packet: &mut Packet);
    /// Takes the final answers to a packet that [`Part::next`] gave.
    fn finish(&mut self, ticket: u32, answers: Answers);
}

impl RingExchange {
    /// Of rank `rank`; `outlines` are the boxes around the shards of its ring's members. At most `window` own packets are
    /// under way at a time.
    pub fn new(
        rings: Rings,
        rank: usize,
        outlines: Arc<Vec<Vec<Bounds>>>,
        routing: Routing,
        window: usize,
    ) -> RingExchange {
        let members = rings.members(rings.ring_of(rank));
        assert_eq!(members.len(), outlines.len(), "every member of the ring has its boxes");
        let pipeline = Pipeline::new(rank - members.start, routing, window);
        let outbox = vec![Vec::new(); members.len()];
        RingExchange { pipeline, first: members.start, outlines, outbox }
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

    /// Sees to the visibility of one shot: every rank of the ring calls it, and it returns when the packets of all are
    /// home.
    pub fn see(
        &mut self,
        ranks: &mut Communicator<'_>,
        shot: u64,
        shooter: &Shooter,
        part: &mut dyn Part,
    ) -> Result<(), Failure> {
        self.pipeline.begin(shot, Sight { shooter: shooter.clone(), outlines: self.outlines.clone() });
        let mut over = Over::new(self.first, self.outlines.len());
        while !over.everywhere {
            // Once a shot is over, the next word of the same kind is of the next shot.
            while !over.everywhere
                && let Some(message) = ranks.receive_where(is_ours)?
            {
                self.take(ranks, message, &mut over)?;
            }
            while !over.here
                && self.pipeline.has_room()
                && let Some(packet) = part.next()
            {
                self.pipeline.submit(Packet { shot, ..packet });
            }
            match self.pipeline.poll() {
                Some(Action::Send { to, parcel }) => {
                    parcel.write(&mut self.outbox[to]);
                    if self.outbox[to].len() >= MESSAGE {
                        self.post(ranks, to);
                    }
                }
                Some(Action::Test(mut packet)) => {
                    part.test(&mut packet);
                    self.pipeline.tested(packet);
                }
                Some(Action::Finish { ticket, answers, .. }) => part.finish(ticket, answers),
                _ if over.everywhere => {}
                None if self.pipeline.in_flight() == 0 && !over.here => over.is_over_here(ranks),
                None => {
                    // Nobody waits for a parcel that waits for company.
                    (0..self.outbox.len()).for_each(|to| self.post(ranks, to));
                    let message = ranks.wait_where(is_ours)?;
                    self.take(ranks, message, &mut over)?;
                }
            }
        }
        self.pipeline.end(shot);
        Ok(())
    }

    /// Sends what has gathered for a member.
    fn post(&mut self, ranks: &mut Communicator<'_>, to: usize) {
        if !self.outbox[to].is_empty() {
            ranks.send(self.first + to, PARCEL, std::mem::take(&mut self.outbox[to]));
        }
    }

    fn take(&mut self, ranks: &mut Communicator<'_>, message: Message, over: &mut Over) -> Result<(), Failure> {
        match message.tag {
            PARCEL => {
                let mut bytes = message.bytes.as_slice();
                let failure =
                    |error| Failure { rank: ranks.rank(), message: format!("from rank {}: {error}", message.from) };
                while let Some(parcel) = Parcel::read(&mut bytes).map_err(failure)? {
                    self.pipeline.receive(parcel);
                }
            }
            HOME => over.is_over_at_another(ranks),
            _ => over.everywhere = true,
        }
        Ok(())
    }
}

fn is_ours(message: &Message) -> bool {
    [PARCEL, HOME, ALL_HOME].contains(&message.tag)
}

/// When a shot is over: a member whose packets are home says so to the first, which tells all once it has heard of all.
struct Over {
    first: usize,
    members: usize,
    /// Members known to be done; counted by the first.
    done: usize,
    here: bool,
    everywhere: bool,
}

impl Over {
    fn new(first: usize, members: usize) -> Over {
        Over { first, members, done: 0, here: false, everywhere: false }
    }

    fn is_over_here(&mut self, ranks: &mut Communicator<'_>) {
        self.here = true;
        if ranks.rank() == self.first {
            self.is_over_at_another(ranks);
        } else {
            ranks.send(self.first, HOME, Vec::new());
        }
    }

    fn is_over_at_another(&mut self, ranks: &mut Communicator<'_>) {
        self.done += 1;
        if self.done == self.members {
            (1..self.members).for_each(|place| ranks.send(self.first + place, ALL_HOME, Vec::new()));
            self.everywhere = true;
        }
    }
}
