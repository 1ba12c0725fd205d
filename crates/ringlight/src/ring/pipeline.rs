//! The pipeline: packets on their way through the members of a ring, seen from one member.
//!
//! A state machine: events come in by its methods, actions go out by [`Pipeline::poll`]. It has no clock, sends nothing
//! and tests nothing itself.

use super::packet::Seeing;
use super::routing::{Routing, Sight};
use super::{Answers, Packet, Parcel};
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

/// What is to be done.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Send the parcel to the member at this place in the ring.
    Send {
        /// Place in the ring.
        to: usize,
        /// What to send.
        parcel: Parcel,
    },
    /// Clear the bits that this member's geometry blocks, or find what nearer it has in the rays' way, as it was for the
    /// packet's shot; then call [`Pipeline::tested`].
    Test(Packet),
    /// The answers to a packet of this member are final.
    Finish {
        /// The shot.
        shot: u64,
        /// Number of the packet.
        ticket: u32,
        /// What all members have answered together.
        answers: Answers,
    },
}

/// Counts for the report.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Visits {
    /// Packets of this member.
    pub own: u64,
    /// Packets tested here, its own and others'.
    pub tested: u64,
    /// Packets sent on to another member.
    pub sent: u64,
}

/// One member's part.
#[derive(Debug)]
pub struct Pipeline {
    place: usize,
    routing: Routing,
    window: usize,
    shots: BTreeMap<u64, Arc<Sight>>,
    /// Packets that came before their shot was known here.
    unknown: Vec<Packet>,
    /// Packets to be tested here: earlier shots first, others' packets before own ones, then in order of arrival.
    ready: BTreeMap<(u64, bool, u64), Packet>,
    /// Of own packets that have left, by shot and ticket, which points went with them.
    seeing: BTreeMap<(u64, u32), Seeing>,
    actions: VecDeque<Action>,
    arrivals: u64,
    in_flight: usize,
    visits: Visits,
}

impl Pipeline {
    /// Of the member at `place`, which lets at most `window` packets of its own be under way at a time.
    pub fn new(place: usize, routing: Routing, window: usize) -> Pipeline {
        assert!(window > 0, "a window of no packets lets nothing through");
        Pipeline {
            place,
            routing,
            window,
            shots: BTreeMap::new(),
            unknown: Vec::new(),
            ready: BTreeMap::new(),
            seeing: BTreeMap::new(),
            actions: VecDeque::new(),
            arrivals: 0,
            in_flight: 0,
            visits: Visits::default(),
        }
    }

    /// A shot has been chosen. Packets of other members may have come before.
    pub fn begin(&mut self, shot: u64, sight: Sight) {
        self.shots.insert(shot, Arc::new(sight));
        for packet in std::mem::take(&mut self.unknown) {
            self.accept(packet);
        }
    }

    /// A shot is over on all ranks: none of its packets is under way any more.
    pub fn end(&mut self, shot: u64) {
        self.shots.remove(&shot);
    }

    /// Whether another packet of this member may set off now; if not, one after the next [`Action::Finish`] may.
    pub fn has_room(&self) -> bool {
        self.in_flight < self.window
    }

    /// A packet of this member sets off; its shot has begun, and there is room.
    pub fn submit(&mut self, mut packet: Packet) {
        assert!(self.has_room(), "more packets than the window allows");
        packet.home = self.place as u32;
        self.in_flight += 1;
        self.visits.own += 1;
        self.route(packet, 0);
    }

    /// A parcel has come from another member.
    pub fn receive(&mut self, parcel: Parcel) {
        match parcel {
            Parcel::Onward(packet) => self.accept(packet),
            Parcel::Home { shot, ticket, answers } => self.finish(shot, ticket, answers),
        }
    }

    /// The packet of an [`Action::Test`], with what this member had to say.
    pub fn tested(&mut self, packet: Packet) {
        self.visits.tested += 1;
        let members = self.shots[&packet.shot].members();
        let visited = (self.place + members - packet.home as usize) % members;
        self.route(packet, visited + 1);
    }

    /// The next thing to do: what concerns others before tests.
    pub fn poll(&mut self) -> Option<Action> {
        self.actions.pop_front().or_else(|| self.ready.pop_first().map(|(_, packet)| Action::Test(packet)))
    }

    /// Own packets that have set off and are not finished.
    pub fn in_flight(&self) -> usize {
        self.in_flight
    }

    /// Packets held here, whosever they are.
    pub fn held(&self) -> usize {
        self.ready.len() + self.unknown.len()
    }

    /// How its packets find their way.
    pub fn routing(&self) -> Routing {
        self.routing
    }

    /// Counts so far.
    pub fn visits(&self) -> Visits {
        self.visits
    }

    fn accept(&mut self, packet: Packet) {
        if self.shots.contains_key(&packet.shot) {
            self.arrivals += 1;
            self.ready.insert((packet.shot, packet.home as usize == self.place, self.arrivals), packet);
        } else {
            self.unknown.push(packet);
        }
    }

    /// Sends a packet to the next place, counted from its home, that it visits from `from` on; or home.
    fn route(&mut self, mut packet: Packet, from: usize) {
        let sight = &self.shots[&packet.shot];
        let members = sight.members();
        let home = packet.home as usize;
        match self.routing.next(&packet, sight, from).map(|place| (home + place) % members) {
            Some(to) if to == self.place => self.accept(packet),
            Some(to) => {
                self.visits.sent += 1;
                // The paper's packets travel whole.
                if home == self.place
                    && self.routing == Routing::Boxes
                    && let Some(seeing) = packet.content.leave_dark()
                {
                    self.seeing.insert((packet.shot, packet.ticket), seeing);
                }
                self.actions.push_back(Action::Send { to, parcel: Parcel::Onward(packet) });
            }
            None => {
                let Packet { shot, ticket, content, .. } = packet;
                let answers = content.into_answers();
                if home == self.place {
                    self.finish(shot, ticket, answers);
                } else {
                    self.actions.push_back(Action::Send { to: home, parcel: Parcel::Home { shot, ticket, answers } });
                }
            }
        }
    }

    fn finish(&mut self, shot: u64, ticket: u32, answers: Answers) {
        self.in_flight -= 1;
        // Rays may have the ticket of samples.
        let seeing = match answers {
            Answers::Masks(_) => self.seeing.remove(&(shot, ticket)),
            Answers::Hits(_) => None,
        };
        let answers = match seeing {
            Some(seeing) => seeing.answers(answers),
            None => answers,
        };
        self.actions.push_back(Action::Finish { shot, ticket, answers });
    }
}
