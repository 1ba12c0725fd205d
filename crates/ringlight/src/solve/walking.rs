//! Walks over a ring: many are under way at once, and a packet holds the rays that some of them follow now.

use super::exchange::Part;
use super::receiving::Ring;
use crate::mesh::walk::{self, Query, Rule, Walk};
use crate::mesh::{self, LookAbout, Mesh, View};
use crate::quantity::ExactSum;
use crate::ring::{Answers, Content, Packet, Rays};
use crate::shooting::{Audit, Fate, Following};
use crate::transport::{Communicator, Failure};
use ringlight_visibility::{Cells, Hierarchy, NO_PLANE, Shooter};
use std::collections::{BTreeMap, VecDeque};

/// Tag of the messages that join fates.
const FATE: u32 = 5;

/// Walks that travel together until all are over, and what they are for.
type Group<Purpose, W> = (Purpose, Vec<W>);

/// A rank's part in walks: rays of its own walks in packets, tests in its shard, and what has ended given to `end`.
pub(super) struct Walking<'a, Purpose, W, Groups, End> {
    mesh: &'a Mesh,
    shard: &'a Hierarchy,
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
pub(super) fn test(mesh: &Mesh, shard: &Hierarchy, rays: &mut Rays) {
    rays.test(|&ray, rule| walk::nearest_hit(mesh, shard, &Query { ray, rule: Rule::from_words(rule) }));
}

impl<'a, Purpose, W, Groups, End> Walking<'a, Purpose, W, Groups, End>
where
    W: Walk,
    Groups: Iterator<Item = Group<Purpose, W>>,
    End: FnMut(Purpose, Vec<W>),
{
    /// Groups are taken when there is room for them: no more are held than packets may be under way.
    pub fn new(mesh: &'a Mesh, shard: &'a Hierarchy, groups: Groups, end: End) -> Self {
        let (under_way, home, tickets) = (BTreeMap::new(), VecDeque::new(), 0);
        Walking { mesh, shard, groups, end, under_way, home, tickets }
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

impl<Purpose, W, Groups, End> Part for Walking<'_, Purpose, W, Groups, End>
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

    fn test(&mut self, packet: &mut Packet) {
        if let Content::Rays(rays) = &mut packet.content {
            test(self.mesh, self.shard, rays);
        }
    }

    fn finish(&mut self, ticket: u32, answers: Answers) {
        if let (Some((_, walks)), Answers::Hits(hits)) = (self.under_way.get_mut(&ticket), answers) {
            walks.iter_mut().filter(|walk| walk.query().is_some()).zip(hits).for_each(|(walk, hit)| walk.answer(hit));
            self.home.push_back(ticket);
        }
    }
}

impl Ring<'_, '_> {
    /// The valid samples of the elements of the clusters `own`, one cluster after the other. Every rank of the ring calls it,
    /// with a `number` that no other exchange has.
    pub fn find_valid_samples(&mut self, number: u64, mesh: &Mesh, own: &[u32]) -> Result<Vec<u16>, Failure> {
        let packet_size = self.packet_size;
        let mut valid = vec![0; own.iter().map(|&c| mesh.clusters[c as usize].elements.len()).sum()];
        let mut elements = 0;
        let groups = own.iter().flat_map(|&c| mesh.clusters[c as usize].patches.clone()).flat_map(|id| {
            let patch = mesh.patch(id);
            let (first, count) = (elements, patch.element_count());
            elements += count as usize;
            let size = (packet_size / mesh::looks(mesh, &patch)).max(1);
            (0..count).step_by(size).map(move |k| {
                let looks = mesh::look_about(mesh, &patch, k..count.min(k + size as u32));
                ((id, first + k as usize), looks.collect())
            })
        });
        let end = |(id, first): (u32, usize), looks: Vec<LookAbout<'_>>| {
            let views: Vec<View> = looks.iter().map(LookAbout::view).collect();
            let patch = mesh.patch(id);
            let found = mesh::valid_samples(mesh, &patch, &views);
            valid[first..].iter_mut().zip(found).for_each(|(bits, found)| *bits = found);
        };
        self.walk(number, mesh, groups, end)?;
        Ok(valid)
    }

    /// Follows this rank's share of the rays of each audit: rank i of N has the blocks b for which b + `number` is i modulo N,
    /// because audits of one block are frequent. Every rank calls it, with a `number` that no other exchange has;
    /// [`join`] tells the fates of all rays.
    pub fn follow(&mut self, number: u64, mesh: &Mesh, audits: &[Audit<'_>]) -> Result<Vec<Fate>, Failure> {
        let (rank, size) = (self.ranks.rank() as u64, self.ranks.size() as u64);
        let mut fates = vec![Fate::default(); audits.len()];
        let blocks = audits.iter().enumerate().flat_map(|(i, audit)| (0..audit.blocks()).map(move |b| (i, audit, b)));
        let groups = blocks
            .filter(|&(_, _, block)| (number + u64::from(block)) % size == rank)
            .map(|(i, audit, block)| (i, audit.walks(block).collect()));
        let end = |i: usize, rays: Vec<Following<'_>>| rays.iter().for_each(|ray| fates[i] = fates[i].join(ray.fate()));
        self.walk(number, mesh, groups, end)?;
        Ok(fates)
    }

    /// Follows walks of this rank to their ends, and helps others with theirs.
    fn walk<Purpose, W: Walk>(
        &mut self,
        number: u64,
        mesh: &Mesh,
        groups: impl Iterator<Item = Group<Purpose, W>>,
        end: impl FnMut(Purpose, Vec<W>),
    ) -> Result<(), Failure> {
        let nothing = Shooter { cells: Cells::Points(Vec::new()), plane: NO_PLANE, far: 1.0 };
        let mut part = Walking::new(mesh, self.shard, groups, end);
        self.exchange.see(self.ranks, number, &nothing, &mut part)
    }
}

/// The fate of the rays of all ranks. Every rank calls it.
pub fn join(ranks: &mut Communicator<'_>, fate: Fate) -> Result<Fate, Failure> {
    let joined = ranks.all_reduce(FATE, to_bytes(fate), |a, b| to_bytes(from_bytes(a).join(from_bytes(b))))?;
    Ok(from_bytes(joined))
}

/// A fate as four integers of 128 bits.
fn to_bytes(fate: Fate) -> [u8; 64] {
    let Fate { rays, escaped_at_once, escaped, backs } = fate;
    bytemuck::cast([i128::from(rays), i128::from(escaped_at_once), escaped.0, backs.0])
}

fn from_bytes(bytes: [u8; 64]) -> Fate {
    let [rays, escaped_at_once, escaped, backs]: [i128; 4] = bytemuck::pod_read_unaligned(&bytes);
    Fate {
        rays: rays as u64,
        escaped_at_once: escaped_at_once as u64,
        escaped: ExactSum(escaped),
        backs: ExactSum(backs),
    }
}
