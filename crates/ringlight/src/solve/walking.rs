//! Walks over a ring: many are under way at once, and a packet holds the rays that some of them follow now.

use super::Ring;
use super::exchange::Part;
use crate::mesh::walk::{self, Query, Rule, Walk};
use crate::mesh::{self, LookAbout, Mesh, View};
use crate::quantity::ExactSum;
use crate::ring::{Answers, Content, Packet, Rays};
use crate::shooting::{Audit, Fate, Following};
use crate::transport::{Communicator, Failure};
use rayon::prelude::*;
use ringlight_visibility::Hierarchy;
use std::collections::{BTreeMap, VecDeque};

/// Tag of the messages that join fates.
const FATES: u32 = 7;

/// Walks that travel together until all are over, and what they are for.
pub type Group<Purpose, W> = (Purpose, Vec<W>);

/// A rank's part in walks: rays of its own walks in packets, and what has ended given to `end`.
pub struct Walking<Purpose, W, Groups, End> {
    /// Those that have not set off.
    groups: Groups,
    end: End,
    /// Those that have, by ticket.
    under_way: BTreeMap<u32, Group<Purpose, W>>,
    /// Tickets of those whose rays have come home.
    home: VecDeque<u32>,
    tickets: u32,
}

/// Finds what a shard has in the way of rays.
pub fn test(mesh: &Mesh, shard: &Hierarchy, rays: &mut Rays) {
    rays.test(|&ray, rule| walk::nearest_hit(mesh, shard, &Query { ray, rule: Rule::from_words(rule) }));
}

/// Groups that are run together where all triangles are held, for each thread.
const TOGETHER: usize = 64;

/// Runs walks to their ends where all triangles are held.
pub fn run<Purpose: Send, W: Walk + Send>(
    mesh: &Mesh,
    hierarchy: &Hierarchy,
    mut groups: impl Iterator<Item = Group<Purpose, W>>,
    mut end: impl FnMut(Purpose, Vec<W>),
) {
    loop {
        let together: Vec<_> = groups.by_ref().take(TOGETHER * rayon::current_num_threads()).collect();
        if together.is_empty() {
            return;
        }
        let to_the_end = |(purpose, walks): Group<Purpose, W>| {
            (purpose, walks.into_iter().map(|w| walk::run(mesh, hierarchy, w)).collect())
        };
        let ended: Vec<Group<Purpose, W>> = together.into_par_iter().map(to_the_end).collect();
        ended.into_iter().for_each(|(purpose, walks)| end(purpose, walks));
    }
}

impl<Purpose, W, Groups, End> Walking<Purpose, W, Groups, End>
where
    W: Walk,
    Groups: Iterator<Item = Group<Purpose, W>>,
    End: FnMut(Purpose, Vec<W>),
{
    /// Groups are taken when there is room for them: no more are held than packets may be under way.
    pub fn new(groups: Groups, end: End) -> Self {
        let (under_way, home, tickets) = (BTreeMap::new(), VecDeque::new(), 0);
        Walking { groups, end, under_way, home, tickets }
    }

    /// A group that may have rays to follow: one that is home, else a new one.
    fn next_group(&mut self) -> Option<(u32, Group<Purpose, W>)> {
        if let Some(ticket) = self.home.pop_front() {
            return Some((ticket, self.under_way.remove(&ticket)?));
        }
        self.tickets += 1;
        Some((self.tickets, self.groups.next()?))
    }
}

impl<Purpose, W, Groups, End> Part for Walking<Purpose, W, Groups, End>
where
    W: Walk,
    Groups: Iterator<Item = Group<Purpose, W>>,
    End: FnMut(Purpose, Vec<W>),
{
    fn next(&mut self) -> Option<Packet> {
        while let Some((ticket, (purpose, walks))) = self.next_group() {
            let mut rays = Rays::default();
            walks.iter().filter_map(W::query).for_each(|query| rays.push(query.ray, query.rule.to_words()));
            if !rays.rays.is_empty() {
                self.under_way.insert(ticket, (purpose, walks));
                return Some(Packet { ticket, content: Content::Rays(rays), ..Packet::default() });
            }
            (self.end)(purpose, walks);
        }
        None
    }

    fn finish(&mut self, ticket: u32, answers: Answers) {
        if let (Some((_, walks)), Answers::Hits(hits)) = (self.under_way.get_mut(&ticket), answers) {
            walks.iter_mut().filter(|walk| walk.query().is_some()).zip(hits).for_each(|(walk, hit)| walk.answer(hit));
            self.home.push_back(ticket);
        }
    }
}

impl Ring<'_> {
    /// The valid samples of the elements of own clusters, one cluster after the other. Every rank of the ring calls it.
    pub fn find_valid_samples(&mut self, ranks: &mut Communicator<'_>) -> Result<Vec<u16>, Failure> {
        let (mesh, share, packet_size) = (self.mesh(), self.share().clone(), self.packet_size());
        let clusters = share.own.iter().map(|&c| &mesh.clusters[c as usize]);
        let mut valid = vec![0; clusters.clone().map(|cluster| cluster.elements.len()).sum()];
        let mut elements = 0;
        let groups = clusters.flat_map(|cluster| cluster.patches.clone()).flat_map(|id| {
            let patch = mesh.patch(id);
            let (first, count) = (elements, patch.element_count());
            elements += count as usize;
            let size = (packet_size / mesh::looks(mesh, &patch)).max(1);
            (0..count).step_by(size).map(move |k| {
                let looks = mesh::look_about(mesh, &patch, k..count.min(k.saturating_add(size as u32)));
                ((id, first + k as usize), looks.collect())
            })
        });
        let end = |(id, first): (u32, usize), looks: Vec<LookAbout<'_>>| {
            let views: Vec<View> = looks.iter().map(LookAbout::view).collect();
            let patch = mesh.patch(id);
            let found = mesh::valid_samples(mesh, &patch, &views);
            valid[first..].iter_mut().zip(found).for_each(|(bits, found)| *bits = found);
        };
        self.walk(ranks, groups, end)?;
        Ok(valid)
    }

    /// The fates of the rays of some audits. Every rank follows its share of their blocks: rank i of N those whose number,
    /// counted over all audits, is i modulo N. Every rank calls it.
    pub fn follow(&mut self, ranks: &mut Communicator<'_>, audits: &[Audit<'_>]) -> Result<Vec<Fate>, Failure> {
        if audits.is_empty() {
            return Ok(Vec::new());
        }
        let (rank, size) = (ranks.rank(), ranks.size());
        let mut fates = vec![Fate::default(); audits.len()];
        let blocks = audits.iter().enumerate().flat_map(|(i, audit)| (0..audit.blocks()).map(move |b| (i, audit, b)));
        let groups = blocks.skip(rank).step_by(size).map(|(i, audit, block)| (i, audit.walks(block).collect()));
        let end = |i: usize, rays: Vec<Following<'_>>| rays.iter().for_each(|ray| fates[i] = fates[i].join(ray.fate()));
        self.walk(ranks, groups, end)?;
        for some in fates.chunks_mut(TOLD) {
            let mut told = [Fate::default(); TOLD];
            told[..some.len()].copy_from_slice(some);
            let joined = from_bytes(ranks.all_reduce(FATES, to_bytes(told), |a, b| {
                let (a, b) = (from_bytes(a), from_bytes(b));
                to_bytes(std::array::from_fn(|i| a[i].join(b[i])))
            })?);
            some.copy_from_slice(&joined[..some.len()]);
        }
        Ok(fates)
    }
}

/// Fates that are joined by one message.
const TOLD: usize = 16;

/// Bytes of a fate: four integers of 128 bits.
const FATE: usize = 64;

fn to_bytes(fates: [Fate; TOLD]) -> [u8; TOLD * FATE] {
    bytemuck::cast(fates.map(|Fate { rays, escaped_at_once, escaped, backs }| {
        [i128::from(rays), i128::from(escaped_at_once), escaped.0, backs.0]
    }))
}

fn from_bytes(bytes: [u8; TOLD * FATE]) -> [Fate; TOLD] {
    let fates: [[i128; 4]; TOLD] = bytemuck::pod_read_unaligned(&bytes);
    fates.map(|[rays, escaped_at_once, escaped, backs]| Fate {
        rays: rays as u64,
        escaped_at_once: escaped_at_once as u64,
        escaped: ExactSum(escaped),
        backs: ExactSum(backs),
    })
}
