//! A ring whose members work one after the other on one thread, so that their times do not disturb each other.

use crate::clock::thread_seconds;
use crate::office::Office;
use ringlight::mesh::Mesh;
use ringlight::ring::{Bounds, Load, Packet, Rings, Routing, Sight, outline, owners};
use ringlight::shooting::{self, ClusterLight, Shot, Work};
use ringlight_visibility::Hierarchy;
use std::sync::Arc;

/// Points in a packet (paper, section 4).
pub const PACKET_SIZE: usize = 200;

/// Boxes that describe a shard.
pub const BOXES: usize = 16;

/// One ring of many.
pub struct SerialRing<'a> {
    office: &'a Office,
    routing: Routing,
    /// The clusters of each member, with their light.
    own: Vec<Vec<(usize, ClusterLight)>>,
    shards: Vec<Hierarchy>,
    outlines: Arc<Vec<Vec<Bounds>>>,
    /// Packets that were tested, and their owners' number of packets.
    pub visits: [u64; 2],
}

/// The boxes around what each member holds.
pub fn outlines(office: &Office, holders: &[u32], members: usize) -> Arc<Vec<Vec<Bounds>>> {
    let held =
        |m: u32| office.pieces.iter().zip(holders).filter(move |(_, holder)| **holder == m).map(|(piece, _)| *piece);
    Arc::new((0..members as u32).map(|m| outline(&held(m).collect::<Vec<_>>(), BOXES)).collect())
}

impl<'a> SerialRing<'a> {
    /// Ring number `ring`, of which the members hold the office's pieces as told.
    pub fn new(office: &'a Office, rings: Rings, ranks: usize, ring: usize, holders: &[u32], routing: Routing) -> Self {
        let sizes: Vec<u64> = office.mesh.clusters.iter().map(|c| c.elements.len() as u64).collect();
        let owners = owners(&sizes, ranks);
        let own_of = |rank: usize| {
            let own = (0..sizes.len()).filter(|&c| owners[c] as usize == rank);
            own.map(|c| (c, ClusterLight::new(&office.mesh, c))).collect()
        };
        let own = rings.members(ring).map(own_of).collect();
        let mut ring =
            SerialRing { office, routing, own, shards: Vec::new(), outlines: Arc::default(), visits: [0; 2] };
        ring.hold(holders);
        ring
    }

    /// Number of members.
    pub fn members(&self) -> usize {
        self.own.len()
    }

    /// Geometry moves; gives the longest time that a member builds its hierarchy, seconds.
    pub fn hold(&mut self, holders: &[u32]) -> f64 {
        self.outlines = outlines(self.office, holders, self.members());
        let mut longest = 0f64;
        self.shards.clear();
        for member in 0..self.own.len() as u32 {
            let start = thread_seconds();
            self.shards.push(self.office.shard(holders, member));
            longest = longest.max(thread_seconds() - start);
        }
        longest
    }

    /// One shot: the times of all members.
    pub fn receive(&mut self, shot: &Shot) -> Vec<Load> {
        let members = self.members();
        let mut loads = vec![Load::default(); members];
        let sight = Sight { shooter: shot.shooter.clone(), outlines: self.outlines.clone() };
        for home in 0..members {
            let start = thread_seconds();
            let mut works: Vec<Work> = self.own[home].iter().map(|_| Work::default()).collect();
            let clusters: Vec<usize> = self.own[home].iter().map(|(c, _)| *c).collect();
            let mut packets = packets(&self.office.mesh, &clusters, shot, &mut works, self.routing, home as u32);
            loads[home].other += thread_seconds() - start;
            self.visits[1] += packets.len() as u64;
            for (packet, _) in &mut packets {
                loads[home].points += packet.masks.len() as u64;
                let (mut at, mut from) = (home, 0);
                loop {
                    let start = thread_seconds();
                    let next = self.routing.next(packet, &sight, from);
                    loads[at].other += thread_seconds() - start;
                    let Some(place) = next else { break };
                    (at, from) = ((home + place) % members, place + 1);
                    let start = thread_seconds();
                    let mut masks = std::mem::take(&mut packet.masks);
                    self.shards[at].clear_blocked(&shot.shooter, packet.points(), &mut masks);
                    packet.masks = masks;
                    loads[at].testing += thread_seconds() - start;
                    self.visits[0] += 1;
                }
            }
            let start = thread_seconds();
            for (packet, segments) in &packets {
                let mut masks = packet.masks.as_slice();
                for &(own, first, count) in segments {
                    let (these, rest) = masks.split_at(count);
                    works[own].packet().masks_mut()[first..first + count].copy_from_slice(these);
                    masks = rest;
                }
            }
            for ((cluster, light), work) in self.own[home].iter_mut().zip(&mut works) {
                shooting::add_received(&self.office.mesh, *cluster, light, shot, work);
            }
            loads[home].other += thread_seconds() - start;
        }
        loads
    }
}

/// Points of an own cluster: its place among these, the first point, and how many.
type Segment = (usize, usize, usize);

/// The packets of one member, as the solver makes them: of one cluster each where their way depends on boxes.
fn packets(
    mesh: &Mesh,
    clusters: &[usize],
    shot: &Shot,
    works: &mut [Work],
    routing: Routing,
    home: u32,
) -> Vec<(Packet, Vec<Segment>)> {
    let mut packets: Vec<(Packet, Vec<Segment>)> = Vec::new();
    for (own, (&cluster, work)) in clusters.iter().zip(works).enumerate() {
        shooting::collect(mesh, cluster, shot, work);
        let masks = work.packet().masks().to_vec();
        let points = work.packet().points();
        let mut first = 0;
        while first < masks.len() {
            let full = |(packet, _): &(Packet, _)| packet.masks.len() == PACKET_SIZE;
            if packets.last().is_none_or(full) || (routing == Routing::Boxes && first == 0) {
                packets.push((Packet { home, ..Packet::default() }, Vec::new()));
            }
            let Some((packet, segments)) = packets.last_mut() else { break };
            let range = first..masks.len().min(first + PACKET_SIZE - packet.masks.len());
            packet.x.extend_from_slice(&points.x[range.clone()]);
            packet.y.extend_from_slice(&points.y[range.clone()]);
            packet.z.extend_from_slice(&points.z[range.clone()]);
            packet.plane.extend_from_slice(&points.plane[range.clone()]);
            packet.masks.extend_from_slice(&masks[range.clone()]);
            segments.push((own, first, range.len()));
            first = range.end;
        }
    }
    packets
}
