//! Walks over a ring: those that travel together ask together.

use super::Ring;
use crate::mesh::walk::Walk;
use crate::mesh::{self, Inquiry};
use crate::quantity::ExactSum;
use crate::shooting::{Audit, Fate, Following};
use crate::transport::{Communicator, Failure};

/// Tag of the messages that join fates.
const FATES: u32 = 7;

/// Walks that travel together until all are over, and what they are for.
type Group<Purpose, W> = (Purpose, Vec<W>);

impl<'a> Ring<'a> {
    /// The valid samples of the elements of own clusters, one cluster after the other. Every rank of the ring calls it.
    pub fn find_valid_samples(&mut self, ranks: &mut Communicator<'_>) -> Result<Vec<u32>, Failure> {
        let (mesh, share, packet_size) = (self.mesh(), self.share().clone(), self.packet_size());
        let clusters = share.own.iter().map(|&c| &mesh.clusters[c as usize]);
        let mut valid = vec![0; clusters.clone().map(|cluster| cluster.elements.len()).sum()];
        let mut next = 0;
        let parts = clusters.flat_map(|cluster| mesh::look_outs(mesh, cluster, packet_size)).map(|elements| {
            let first = next;
            next += elements.len();
            (first, elements)
        });
        let task = |(first, elements): (usize, Vec<_>), inquiry: Inquiry<'a>| async move {
            (first, mesh::valid_samples(mesh, &elements, &inquiry).await)
        };
        self.ask(ranks, parts, task, |(first, found)| valid[first..][..found.len()].copy_from_slice(&found))?;
        Ok(valid)
    }

    /// Follows walks of this rank to their ends, and helps others with theirs. Every rank of the ring calls it.
    fn walk<Purpose: Send, W: Walk + Send>(
        &mut self,
        ranks: &mut Communicator<'_>,
        groups: impl Iterator<Item = Group<Purpose, W>>,
        mut end: impl FnMut(Purpose, Vec<W>),
    ) -> Result<(), Failure> {
        let task = |(purpose, walks): Group<Purpose, W>, inquiry: Inquiry<'a>| async move {
            (purpose, inquiry.follow(walks).await)
        };
        self.ask(ranks, groups, task, |(purpose, walks)| end(purpose, walks))
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
