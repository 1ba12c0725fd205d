//! What a rank's clusters receive from a shot when the occluders are spread over a ring.

use super::exchange::{Part, RingExchange};
use super::walking;
use crate::mesh::Mesh;
use crate::ring::{Answers, Content, Packet, Samples};
use crate::shooting::{self, ClusterLight, Shot, Work};
use crate::transport::{Communicator, Failure};
use ringlight_visibility::{Hierarchy, Tally};
use std::collections::{BTreeMap, VecDeque};

/// A cluster of which points are under way.
struct Slot {
    /// Place in the list of own clusters.
    cluster: usize,
    work: Work,
    /// Points that have set off.
    sent: usize,
    /// Masks that have come home.
    home: usize,
}

/// Points of one slot within a packet.
struct Segment {
    slot: usize,
    /// First point within the slot.
    first: usize,
    count: usize,
}

/// A rank's part in a shot: points of its own clusters in packets, tests in its shard, light from final masks.
struct Receiving<'a> {
    mesh: &'a Mesh,
    shot: &'a Shot,
    shard: &'a Hierarchy,
    own: &'a [u32],
    light: &'a mut [ClusterLight],
    packet_size: usize,
    /// Whether packets hold points of one cluster only.
    compact: bool,
    /// Next own cluster whose points are to be collected.
    next: usize,
    slots: Vec<Slot>,
    /// Slots whose cluster is done.
    free: Vec<usize>,
    /// Slots with points that have not set off.
    filling: VecDeque<usize>,
    under_way: BTreeMap<u32, Vec<Segment>>,
    tickets: u32,
    tally: Tally,
}

/// What a rank needs to ask its ring.
pub struct Ring<'a, 'b> {
    /// What this rank holds of the geometry.
    pub shard: &'a Hierarchy,
    /// Most points of a packet; does not change results.
    pub packet_size: usize,
    /// Its place in the pipeline.
    pub exchange: &'a mut RingExchange,
    /// Its way to the others.
    pub ranks: &'a mut Communicator<'b>,
}

impl Ring<'_, '_> {
    /// Adds to `light`, the light of the clusters `own` of this rank, what they receive from shot number `number`. Every
    /// rank of the ring calls it. The tally counts the tests made here, for whomever.
    pub fn receive(
        &mut self,
        mesh: &Mesh,
        own: &[u32],
        light: &mut [ClusterLight],
        number: u64,
        shot: &Shot,
    ) -> Result<Tally, Failure> {
        assert!(own.len() == light.len() && self.packet_size > 0);
        let mut part = Receiving {
            mesh,
            shot,
            shard: self.shard,
            own,
            light,
            packet_size: self.packet_size,
            compact: self.exchange.wants_compact_packets(),
            next: 0,
            slots: Vec::new(),
            free: Vec::new(),
            filling: VecDeque::new(),
            under_way: BTreeMap::new(),
            tickets: 0,
            tally: Tally::default(),
        };
        self.exchange.see(self.ranks, number, &shot.shooter, &mut part)?;
        Ok(part.tally)
    }
}

impl Receiving<'_> {
    /// Collects the points of the next own cluster that faces the shooter; false if there is none.
    fn collect_next(&mut self) -> bool {
        while self.next < self.own.len() {
            let cluster = self.next;
            self.next += 1;
            let slot = self.free.pop().unwrap_or_else(|| {
                self.slots.push(Slot { cluster, work: Work::default(), sent: 0, home: 0 });
                self.slots.len() - 1
            });
            let Slot { work, .. } = &mut self.slots[slot];
            shooting::collect(self.mesh, self.own[cluster] as usize, self.shot, work);
            if work.packet().points().is_empty() {
                self.free.push(slot);
                continue;
            }
            (self.slots[slot].cluster, self.slots[slot].sent, self.slots[slot].home) = (cluster, 0, 0);
            self.filling.push_back(slot);
            return true;
        }
        false
    }
}

impl Part for Receiving<'_> {
    fn next(&mut self) -> Option<Packet> {
        let mut samples = Samples::default();
        let mut segments = Vec::new();
        while samples.masks.len() < self.packet_size
            && (segments.is_empty() || !self.compact)
            && (!self.filling.is_empty() || self.collect_next())
        {
            let slot = self.filling[0];
            let Slot { work, sent, .. } = &mut self.slots[slot];
            let points = work.packet().points();
            let range = *sent..points.len().min(*sent + self.packet_size - samples.masks.len());
            samples.x.extend_from_slice(&points.x[range.clone()]);
            samples.y.extend_from_slice(&points.y[range.clone()]);
            samples.z.extend_from_slice(&points.z[range.clone()]);
            samples.plane.extend_from_slice(&points.plane[range.clone()]);
            samples.masks.extend_from_slice(&work.packet().masks()[range.clone()]);
            segments.push(Segment { slot, first: range.start, count: range.len() });
            *sent = range.end;
            if *sent == work.packet().masks().len() {
                self.filling.pop_front();
            }
        }
        if segments.is_empty() {
            return None;
        }
        let ticket = self.tickets;
        self.under_way.insert(ticket, segments);
        self.tickets += 1;
        Some(Packet { ticket, content: Content::Samples(samples), ..Packet::default() })
    }

    fn test(&mut self, packet: &mut Packet) {
        let samples = match &mut packet.content {
            Content::Samples(samples) => samples,
            Content::Rays(rays) => return walking::test(self.mesh, self.shard, rays),
        };
        let mut masks = std::mem::take(&mut samples.masks);
        let tally = self.shard.clear_blocked(&self.shot.shooter, samples.points(), &mut masks);
        samples.masks = masks;
        self.tally.rays += tally.rays;
        self.tally.masks += tally.masks;
        self.tally.masks_without_rays += tally.masks_without_rays;
    }

    fn finish(&mut self, ticket: u32, answers: Answers) {
        let Answers::Masks(masks) = answers else { return };
        let mut masks = masks.as_slice();
        for Segment { slot, first, count } in self.under_way.remove(&ticket).unwrap_or_default() {
            let Slot { cluster, work, home, .. } = &mut self.slots[slot];
            let (these, others) = masks.split_at(count);
            work.packet().masks_mut()[first..first + count].copy_from_slice(these);
            masks = others;
            *home += count;
            if *home == work.packet().masks().len() {
                let light = &mut self.light[*cluster];
                shooting::add_received(self.mesh, self.own[*cluster] as usize, light, self.shot, work);
                self.free.push(slot);
            }
        }
    }
}
