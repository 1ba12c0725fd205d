//! What a rank owns, and how the work is spread over ranks.

use crate::mesh::Mesh;
use crate::ring::{Moves, Rings, Routing, Shards, owners};

/// The clusters whose light a rank holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Share {
    /// This rank.
    pub rank: usize,
    /// The owner of each cluster.
    pub owners: Vec<u32>,
    /// Own clusters, ascending.
    pub own: Vec<u32>,
}

impl Share {
    /// Of rank `rank` of `ranks`, all of which own as much.
    pub fn new(mesh: &Mesh, rank: usize, ranks: usize) -> Share {
        Share::within(mesh, rank, &vec![u64::MAX; ranks])
    }

    /// Of rank `rank`, where each has room for so many elements: all own as much, but for those that have less room.
    pub fn within(mesh: &Mesh, rank: usize, rooms: &[u64]) -> Share {
        let elements: Vec<u64> = mesh.clusters.iter().map(|c| c.elements.len() as u64).collect();
        let owners = owners(&elements, rooms);
        let own = (0..owners.len() as u32).filter(|&c| owners[c as usize] as usize == rank).collect();
        Share { rank, owners, own }
    }

    /// The place of a cluster among the own ones.
    pub fn place(&self, cluster: usize) -> Option<usize> {
        self.own.binary_search(&(cluster as u32)).ok()
    }
}

/// How the work is spread over ranks. It changes no result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Spread {
    /// Ranks and rings.
    pub rings: Rings,
    /// Who of a ring's members holds which geometry.
    pub shards: Shards,
    /// Which members a packet visits.
    pub routing: Routing,
    /// Most points of a packet.
    pub packet_size: usize,
    /// Most own packets of a rank under way at a time.
    pub window: usize,
    /// When geometry moves between the members of a ring.
    pub moves: Moves,
}

impl Spread {
    /// Over the ranks of these rings; all else as it is best.
    pub fn new(rings: Rings) -> Spread {
        Spread {
            rings,
            shards: Shards::default(),
            routing: Routing::default(),
            packet_size: 256,
            window: 64,
            moves: Moves::default(),
        }
    }
}
