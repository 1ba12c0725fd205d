//! Which members a packet visits.

use super::{Bounds, Packet};
use ringlight_visibility::{Region, Shooter};
use std::sync::Arc;

/// How packets find their way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Routing {
    /// Only to members whose boxes the shaft from the packet to the shooter crosses.
    #[default]
    Boxes,
    /// To all members (the paper's way).
    All,
}

/// A shot as a ring sees it: the cells, and where the members' geometry lay when it was chosen. Geometry that moves later
/// counts for later shots only.
#[derive(Clone, Debug)]
pub struct Sight {
    /// The cells.
    pub shooter: Shooter,
    /// Boxes around the shard of each member of the ring.
    pub outlines: Arc<Vec<Vec<Bounds>>>,
}

impl Routing {
    /// The next of the places `from..` that the packet visits, counted from its home round the ring; home is 0. Masks only
    /// shrink on the way, and with them the shaft.
    pub fn next(self, packet: &Packet, sight: &Sight, from: usize) -> Option<usize> {
        let members = sight.outlines.len();
        if from >= members || packet.is_dark() {
            return None;
        }
        if self == Routing::All {
            return Some(from);
        }
        let all = sight.outlines.iter().flatten().fold(Bounds::EMPTY, |sum, &bounds| sum.join(bounds));
        let region = Region::new(&sight.shooter, packet.points(), &packet.masks, [all.low, all.high]);
        (from..members).find(|place| {
            let outline = &sight.outlines[(packet.home as usize + place) % members];
            outline.iter().any(|bounds| region.meets(bounds.low, bounds.high))
        })
    }
}
