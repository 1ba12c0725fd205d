//! A ring whose members work one after the other on one thread, so that their times do not disturb each other.

use crate::clock::thread_seconds;
use crate::office::Office;
use ringlight::mesh::Mesh;
use ringlight::ring::{Content, Load, Outlines, Packet, Rings, Routing, Samples, Sight, outline, owners};
use ringlight::shooting::{self, ClusterLight, Shot, Work};
use ringlight::solve::OUTLINE;
use ringlight_visibility::{Hierarchy, PreparedShooter};
use std::sync::Arc;

/// Points in a packet (paper, section 4).
pub const PACKET_SIZE: usize = 200;

/// Boxes that describe a shard.
pub const BOXES: usize = OUTLINE;

/// Parcels between two members gather to messages of so many bytes.
const MESSAGE: u64 = 16 << 10;

/// Bytes of a parcel, of a point on its way, and of its mask on the way home.
const PARCEL: u64 = 20;
const POINT: u64 = 24;
const MASK: u64 = 8;

/// One ring of many.
pub struct SerialRing<'a> {
    office: &'a Office,
    routing: Routing,
    /// The clusters of each member, with their light.
    own: Vec<Vec<(usize, ClusterLight)>>,
    shards: Vec<Hierarchy>,
    outlines: Arc<Outlines>,
    /// Packets that were tested, and their owners' number of packets.
    pub visits: [u64; 2],
    /// Bytes that each member has sent to each other for the last shot.
    sent: Vec<Vec<u64>>,
}

/// The boxes around what each member holds.
pub fn outlines(office: &Office, holders: &[u32], members: usize) -> Arc<Outlines> {
    let held =
        |m: u32| office.pieces.iter().zip(holders).filter(move |(_, holder)| **holder == m).map(|(piece, _)| *piece);
    let shards: Vec<_> = (0..members as u32).map(|m| outline(&held(m).collect::<Vec<_>>(), BOXES)).collect();
    Arc::new(Outlines::new(&shards))
}

impl<'a> SerialRing<'a> {
    /// Ring number `ring`, of which the members hold the office's pieces as told.
    pub fn new(office: &'a Office, rings: Rings, ranks: usize, ring: usize, holders: &[u32], routing: Routing) -> Self {
        let sizes: Vec<u64> = office.mesh.clusters.iter().map(|c| c.elements.len() as u64).collect();
        let owners = owners(&sizes, &vec![u64::MAX; ranks]);
        let own_of = |rank: usize| {
            let own = (0..sizes.len()).filter(|&c| owners[c] as usize == rank);
            own.map(|c| (c, ClusterLight::new(&office.mesh, c))).collect()
        };
        let own = rings.members(ring).map(own_of).collect();
        let mut ring = SerialRing {
            office,
            routing,
            own,
            shards: Vec::new(),
            outlines: Arc::new(Outlines::new(&[])),
            visits: [0; 2],
            sent: Vec::new(),
        };
        ring.hold(holders);
        ring
    }

    /// Number of members.
    pub fn members(&self) -> usize {
        self.own.len()
    }

    /// Messages and bytes that a member has sent for the last shot: parcels to one member gather as far as they can.
    pub fn traffic(&self, member: usize) -> [u64; 2] {
        let sent = &self.sent[member];
        [sent.iter().map(|bytes| bytes.div_ceil(MESSAGE)).sum(), sent.iter().sum()]
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
        self.sent = vec![vec![0; members]; members];
        let shooter = Arc::new(PreparedShooter::new(&shot.shooter));
        let sight = Sight::new(shooter.clone(), self.outlines.clone());
        for home in 0..members {
            let start = thread_seconds();
            let mut works: Vec<Work> = self.own[home].iter().map(|_| Work::default()).collect();
            let clusters: Vec<usize> = self.own[home].iter().map(|(c, _)| *c).collect();
            let mut packets = packets(&self.office.mesh, &clusters, shot, &mut works, self.routing, home as u32);
            loads[home].other += thread_seconds() - start;
            self.visits[1] += packets.len() as u64;
            for (packet, _) in &mut packets {
                let points = samples(packet).len() as u64;
                loads[home].points += points;
                let (mut at, mut from) = (home, 0);
                loop {
                    let start = thread_seconds();
                    let next = self.routing.next(packet, &sight, from);
                    loads[at].other += thread_seconds() - start;
                    let Some(place) = next else { break };
                    let to = (home + place) % members;
                    self.sent[at][to] += if to == at { 0 } else { PARCEL + points * POINT };
                    (at, from) = (to, place + 1);
                    let start = thread_seconds();
                    let (points, masks) = samples(packet).split_mut();
                    self.shards[at].clear_blocked_of(&shooter, points, masks);
                    loads[at].testing += thread_seconds() - start;
                    self.visits[0] += 1;
                }
                self.sent[at][home] += if at == home { 0 } else { PARCEL + points * MASK };
            }
            let start = thread_seconds();
            for (packet, segments) in &mut packets {
                let mut masks = samples(packet).masks();
                for &mut (own, first, count) in segments {
                    let (these, rest) = masks.split_at(count);
                    works[own].packet_mut().masks_mut()[first..first + count].copy_from_slice(these);
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

/// What a packet asks for: here always masks.
fn samples(packet: &mut Packet) -> &mut Samples {
    match &mut packet.content {
        Content::Samples(samples) => samples,
        Content::Aimed(_) | Content::Rays(_) => unreachable!("only shots are asked for here"),
    }
}

/// The packets of one member, as the solver makes them: of one cluster each where their way depends on boxes.
fn packets(
    mesh: &Mesh,
    clusters: &[usize],
    shot: &Shot,
    works: &mut [Work],
    routing: Routing,
    home: u32,
) -> Vec<(Packet, Vec<Segment>)> {
    let mut packets: Vec<Vec<Segment>> = Vec::new();
    for (own, (&cluster, work)) in clusters.iter().zip(&mut *works).enumerate() {
        shooting::collect(mesh, (cluster, |_| true), shot, work);
        let (mut first, count) = (0, work.packet().masks().len());
        while first < count {
            let held = |packet: &Vec<Segment>| packet.iter().map(|segment| segment.2).sum::<usize>();
            let room = packets.last().map_or(0, |packet| PACKET_SIZE - held(packet));
            let fresh = room == 0 || (routing == Routing::Boxes && first == 0);
            let segment = (own, first, (count - first).min(if fresh { PACKET_SIZE } else { room }));
            match packets.last_mut() {
                Some(packet) if !fresh => packet.push(segment),
                _ => packets.push(vec![segment]),
            }
            first += segment.2;
        }
    }
    let packet = |segments: Vec<Segment>| {
        let run = |&(own, first, count): &Segment| works[own].packet().run(first..first + count);
        let content = Content::Samples(Samples::of(&segments.iter().map(run).collect::<Vec<_>>()));
        (Packet { home, content, ..Packet::default() }, segments)
    };
    packets.into_iter().map(packet).collect()
}
