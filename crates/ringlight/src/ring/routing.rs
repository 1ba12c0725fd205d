//! Which members a packet visits.

use super::{Aimed, Bounds, Content, Packet, Rays, ShardBox};
use ringlight_visibility::{NO_PLANE, PreparedShooter, Region};
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
    /// Boxes around the shard of each member of the ring.
    outlines: Arc<Vec<Vec<ShardBox>>>,
    /// Around all.
    bounds: Bounds,
}

impl Sight {
    /// Of these cells, none where only rays are followed; with boxes around the shard of each member of the ring.
    pub fn new(shooter: Arc<PreparedShooter>, outlines: Arc<Vec<Vec<ShardBox>>>) -> Sight {
        let bounds = outlines.iter().flatten().fold(Bounds::EMPTY, |sum, part| sum.join(part.bounds));
        Sight { shooter, outlines, bounds }
    }

    /// Number of members of the ring.
    pub fn members(&self) -> usize {
        self.outlines.len()
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
        let outline = |place: usize| &sight.outlines[(packet.home as usize + place) % members];
        let (samples, shooter) = match &packet.content {
            Content::Samples(samples) => (samples, &*sight.shooter),
            Content::Aimed(aimed) => (&aimed.samples, aimed.shooter()),
            Content::Rays(rays) => {
                return (from..members).find(|&place| outline(place).iter().any(|part| may_hit(rays, &part.bounds)));
            }
        };
        let Bounds { low, high } = sight.bounds;
        let region = Region::new(shooter, samples.points(), samples.masks(), [low, high]);
        let own = [samples.plane().unwrap_or(NO_PLANE), shooter.plane()];
        let may_hide = |part: &ShardBox| {
            let beside = part.plane == NO_PLANE || !own.contains(&part.plane);
            beside && region.meets(part.bounds.low, part.bounds.high)
        };
        (from..members).find(|&place| outline(place).iter().any(may_hide))
    }
}

/// Whether a ray may hit something in the box that is as near as its nearest hit so far.
fn may_hit(rays: &Rays, bounds: &Bounds) -> bool {
    rays.rays.iter().zip(&rays.hits).any(|(ray, hit)| {
        let far = hit.map_or(ray.far, |hit| hit.distance);
        ray.may_hit(bounds.low, bounds.high, far)
    })
}
