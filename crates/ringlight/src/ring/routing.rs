//! Which members a packet visits.

use super::{Aimed, Bounds, Content, Packet, ShardBox};
use ringlight_visibility::{Boxes, NO_PLANE, PreparedShooter, Region};
use std::sync::Arc;

/// How packets find their way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Routing {
    /// Only to members whose boxes the shaft from the packet to the shooter crosses, or a ray of the packet before its nearest
    /// hit so far.
    #[default]
    Boxes,
    /// To all members (the paper's way).
    All,
}

/// A shot as a ring sees it: the cells, and where the members' geometry lay when it was chosen. Geometry that moves later
/// counts for later shots only.
#[derive(Clone, Debug)]
pub struct Sight {
    /// The cells; none where only rays are followed.
    shooter: Arc<PreparedShooter>,
    outlines: Arc<Outlines>,
}

/// What all members of a ring know of each other's shards.
#[derive(Clone, Debug)]
pub struct Outlines(
    /// Boxes around the shard of each member.
    Vec<Boxes>,
    /// Around all.
    Bounds,
);

impl Outlines {
    /// From the boxes around the shard of each member.
    pub fn new(shards: &[Vec<ShardBox>]) -> Outlines {
        let plain = |part: &ShardBox| (part.bounds.low, part.bounds.high, part.plane);
        let boxes = |shard: &Vec<ShardBox>| Boxes::new(&shard.iter().map(plain).collect::<Vec<_>>());
        let all = shards.iter().flatten().fold(Bounds::EMPTY, |sum, part| sum.join(part.bounds));
        Outlines(shards.iter().map(boxes).collect(), all)
    }

    /// Number of members.
    pub fn members(&self) -> usize {
        self.0.len()
    }
}

impl Sight {
    /// Of these cells, none where only rays are followed.
    pub fn new(shooter: Arc<PreparedShooter>, outlines: Arc<Outlines>) -> Sight {
        Sight { shooter, outlines }
    }

    /// Number of members of the ring.
    pub fn members(&self) -> usize {
        self.outlines.members()
    }
}

impl Routing {
    /// The next of the places `from..` that the packet visits, counted from its home round the ring; home is 0. Masks only
    /// shrink on the way, and with them the shaft; hits only come nearer.
    pub fn next(self, packet: &Packet, sight: &Sight, from: usize) -> Option<usize> {
        let members = sight.members();
        let done = match &packet.content {
            Content::Samples(samples) | Content::Aimed(Aimed { samples, .. }) => samples.is_dark(),
            Content::Rays(rays) => rays.rays.is_empty(),
        };
        if from >= members || done {
            return None;
        }
        if self == Routing::All {
            return Some(from);
        }
        let boxes = |place: usize| &sight.outlines.0[(packet.home as usize + place) % members];
        let (samples, shooter) = match &packet.content {
            Content::Samples(samples) => (samples, &*sight.shooter),
            Content::Aimed(aimed) => (&aimed.samples, aimed.shooter()),
            Content::Rays(rays) => {
                return (from..members).find(|&place| boxes(place).may_be_hit(&rays.rays, &rays.hits));
            }
        };
        let Bounds { low, high } = sight.outlines.1;
        let region = Region::new(shooter, samples.points(), samples.masks(), [low, high]);
        let own = [samples.plane().unwrap_or(NO_PLANE), shooter.plane()];
        (from..members).find(|&place| boxes(place).may_hide(&region, own))
    }
}
