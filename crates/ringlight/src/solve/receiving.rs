//! The points of a rank's own clusters that receive a shot: out in packets, home with final masks.

use super::among::Among;
use super::exchange::Part;
use super::share::Share;
use crate::mesh::Mesh;
use crate::ring::{Answers, Content, Packet, Samples};
use crate::shooting::{self, ClusterLight, Shot, Work};
use rayon::prelude::*;
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

/// A cluster of which points are under way.
#[derive(Default)]
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

/// A rank's part in a shot.
pub struct Receiving<'a> {
    mesh: &'a Mesh,
    shot: Arc<Shot>,
    among: Among,
    share: Arc<Share>,
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
    /// Slots whose masks are final.
    seen: Vec<usize>,
}

impl<'a> Receiving<'a> {
    /// The part of a rank with this share. Packets have at most `packet_size` points; `compact` ones are of one cluster
    /// each. The buffers `spare` come from [`Receiving::into_buffers`] of an earlier shot.
    pub fn new(
        mesh: &'a Mesh,
        share: Arc<Share>,
        (shot, among): (Arc<Shot>, Among),
        packet_size: usize,
        compact: bool,
        spare: Vec<Work>,
    ) -> Receiving<'a> {
        assert!(packet_size > 0, "packets without points go nowhere");
        Receiving {
            mesh,
            shot,
            among,
            share,
            packet_size,
            compact,
            next: 0,
            free: (0..spare.len()).collect(),
            slots: spare.into_iter().map(|work| Slot { work, ..Slot::default() }).collect(),
            filling: VecDeque::new(),
            under_way: BTreeMap::new(),
            tickets: 0,
            seen: Vec::new(),
        }
    }

    /// Buffers that another shot may use when this one is over.
    pub fn into_buffers(self) -> impl Iterator<Item = Work> {
        self.slots.into_iter().map(|slot| slot.work)
    }

    /// Number of clusters whose masks are final and wait for [`Receiving::add_seen`].
    pub fn seen(&self) -> usize {
        self.seen.len()
    }

    /// Adds to `light`, the light of own clusters, what those receive whose masks are final.
    pub fn add_seen(&mut self, light: &mut [ClusterLight]) {
        let take = |slot: usize| {
            let Slot { cluster, work, .. } = &mut self.slots[slot];
            (*cluster, slot, std::mem::take(work))
        };
        let mut seen: Vec<(usize, usize, Work)> = self.seen.iter().copied().map(take).collect();
        seen.sort_unstable_by_key(|&(cluster, ..)| cluster);
        let light = chosen(light, seen.iter().map(|&(cluster, ..)| cluster));
        let (mesh, shot) = (self.mesh, &self.shot);
        let add = |((cluster, _, work), light): (&mut (usize, usize, Work), &mut ClusterLight)| {
            shooting::add_received(mesh, self.share.own[*cluster] as usize, light, shot, work);
        };
        if seen.len() > 1 {
            seen.par_iter_mut().zip(light).for_each(add);
        } else {
            seen.iter_mut().zip(light).for_each(add);
        }
        for (_, slot, work) in seen {
            self.slots[slot].work = work;
        }
        self.free.append(&mut self.seen);
    }

    /// Collects the points of next own clusters that face the shooter, one for each thread; false if there are none.
    fn collect(&mut self) -> bool {
        while self.next < self.share.own.len() {
            let count = rayon::current_num_threads().min(self.share.own.len() - self.next);
            while self.free.len() < count {
                self.free.push(self.slots.len());
                self.slots.push(Slot::default());
            }
            let chosen = self.free.split_off(self.free.len() - count);
            for (i, &slot) in chosen.iter().enumerate() {
                let slot = &mut self.slots[slot];
                (slot.cluster, slot.sent, slot.home) = (self.next + i, 0, 0);
            }
            let range = self.next..self.next + count;
            self.next = range.end;
            let (mesh, own, shot, among) = (self.mesh, &self.share.own, &self.shot, &self.among);
            let collect = |slot: &mut Slot| {
                let receivers = (own[slot.cluster] as usize, among.at(slot.cluster));
                shooting::collect(mesh, receivers, shot, &mut slot.work);
            };
            if let [slot] = chosen[..] {
                collect(&mut self.slots[slot]);
            } else {
                let fresh = |slot: &&mut Slot| range.contains(&slot.cluster);
                self.slots.par_iter_mut().filter(fresh).for_each(collect);
            }
            for slot in chosen {
                let empty = self.slots[slot].work.packet().points().is_empty();
                if empty { self.free.push(slot) } else { self.filling.push_back(slot) }
            }
            if !self.filling.is_empty() {
                return true;
            }
        }
        false
    }
}

impl Part for Receiving<'_> {
    fn next(&mut self) -> Option<Packet> {
        let (mut segments, mut count) = (Vec::new(), 0);
        while count < self.packet_size
            && (segments.is_empty() || !self.compact)
            && (!self.filling.is_empty() || self.collect())
        {
            let slot = self.filling[0];
            let Slot { work, sent, .. } = &mut self.slots[slot];
            let left = work.packet().masks().len() - *sent;
            let segment = Segment { slot, first: *sent, count: left.min(self.packet_size - count) };
            *sent += segment.count;
            count += segment.count;
            if segment.count == left {
                self.filling.pop_front();
            }
            segments.push(segment);
        }
        if segments.is_empty() {
            return None;
        }
        let run = |&Segment { slot, first, count }: &Segment| self.slots[slot].work.packet().run(first..first + count);
        let samples = Samples::of(&segments.iter().map(run).collect::<Vec<_>>());
        self.under_way.insert(self.tickets, segments);
        self.tickets += 1;
        Some(Packet { ticket: self.tickets - 1, content: Content::Samples(samples), ..Packet::default() })
    }

    fn finish(&mut self, ticket: u32, answers: Answers) {
        let Answers::Masks(masks) = answers else { return };
        let mut masks = masks.as_slice();
        for Segment { slot, first, count } in self.under_way.remove(&ticket).unwrap_or_default() {
            let Slot { work, home, .. } = &mut self.slots[slot];
            let (these, others) = masks.split_at(count);
            work.packet_mut().masks_mut()[first..first + count].copy_from_slice(these);
            masks = others;
            *home += count;
            if *home == work.packet().masks().len() {
                self.seen.push(slot);
            }
        }
    }
}

/// The values at ascending places.
fn chosen<T>(values: &mut [T], places: impl Iterator<Item = usize>) -> Vec<&mut T> {
    let (mut rest, mut start) = (values, 0);
    let mut chosen = Vec::new();
    for place in places {
        let (head, tail) = rest.split_at_mut(place - start + 1);
        chosen.extend(head.last_mut());
        (rest, start) = (tail, place + 1);
    }
    chosen
}
