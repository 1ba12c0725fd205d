//! Walks over a ring: many are under way at once, and a packet holds the rays that some of them follow now.

use super::exchange::Part;
use crate::mesh::walk::{self, Query, Rule, Walk};
use crate::mesh::{self, LookAbout, Mesh};
use crate::ring::{Answers, Content, Packet, Rays};
use crate::shooting::{Audit, Following};
use ringlight_visibility::Hierarchy;
use std::collections::{BTreeMap, VecDeque};

/// Walks that travel together until all are over, and what they are for.
type Group<Purpose, W> = (Purpose, Vec<W>);

/// A rank's part in walks: rays of its own walks in packets, and what has ended given to `end`.
pub(super) struct Walking<Purpose, W, Groups, End> {
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

/// The looks of all elements of some patches: of so many at once that a packet holds `packet_size` rays, but one element at
/// least. Each group is for a patch, and for elements from a place on, counted over all patches.
pub(super) fn looks<'a>(
    mesh: &'a Mesh,
    patches: impl Iterator<Item = u32>,
    packet_size: usize,
) -> impl Iterator<Item = Group<(u32, usize), LookAbout<'a>>> {
    let mut elements = 0;
    patches.flat_map(move |id| {
        let patch = mesh.patch(id);
        let (first, count) = (elements, patch.element_count());
        elements += count as usize;
        let size = (packet_size / mesh::looks(mesh, &patch)).max(1);
        (0..count).step_by(size).map(move |k| {
            let looks = mesh::look_about(mesh, &patch, k..count.min(k + size as u32));
            ((id, first + k as usize), looks.collect())
        })
    })
}

/// The rays of every `step`-th block from `first` on, of some audits. Each group is for the audit with this number.
pub(super) fn rays<'a>(
    audits: &'a [Audit<'a>],
    first: u32,
    step: usize,
) -> impl Iterator<Item = Group<usize, Following<'a>>> {
    audits.iter().enumerate().flat_map(move |(i, audit)| {
        (first..audit.blocks()).step_by(step).map(move |block| (i, audit.walks(block).collect()))
    })
}
