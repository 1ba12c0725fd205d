//! The light of many ranks, handed to rank 0 in the order of clusters without being gathered there.
//!
//! Every rank sends the bytes of its own clusters batch by batch; rank 0 holds no more of it than two batches.

use super::file::{BATCH_BYTES, LightSections, Writer};
use super::light::{OwnLight, SolvedLight, length};
use super::{Snapshot, digest};
use crate::column::Store;
use crate::mesh::Mesh;
use crate::transport::{Communicator, Failure};
use std::io::{self, Write};
use std::ops::Range;

/// Tag of light on its way to rank 0.
const LIGHT: u32 = 40;

/// Tag of hashes of clusters on their way to rank 0.
const HASHES: u32 = 41;

/// Bytes of the number that goes before what is sent of a cluster.
const NUMBER: usize = size_of::<u32>();

/// Hashes of clusters that rank 0 takes at a time.
const HASH_BATCH: usize = BATCH_BYTES / blake3::OUT_LEN;

/// Writes a solution that is still being solved, or has been: every rank calls it, and rank 0 writes to its `out`. If that
/// fails, all return, rank 0 with the error.
pub fn write_over_ranks(
    snapshot: &Snapshot<'_>,
    light: OwnLight<'_>,
    ranks: &mut Communicator<'_>,
    out: &mut dyn Write,
) -> Result<io::Result<()>, Failure> {
    let clusters = &snapshot.mesh.clusters;
    let sections = LightSections::new(clusters);
    let mut writer = Writer::new(out);
    // The first batch is empty: rank 0 writes all that is not light.
    let batches: Vec<Range<usize>> = std::iter::once(0..0).chain(sections.batches()).collect();
    in_order(
        ranks,
        LIGHT,
        light.own,
        &batches,
        |cluster| length(&clusters[cluster]),
        |index, bytes| light.append(index, bytes),
        |batch, bytes| match batch {
            0 => writer.begin(snapshot, sections.count()),
            _ => writer.light(&sections, batch - 1, &bytes),
        },
    )
}

impl OwnLight<'_> {
    /// The light of all ranks on rank 0, kept there in `store`. Every rank calls it.
    pub fn gather(
        &self,
        mesh: &Mesh,
        store: Store<'_>,
        ranks: &mut Communicator<'_>,
    ) -> Result<Option<SolvedLight>, Failure> {
        let clusters = &mesh.clusters;
        let batches: Vec<Range<usize>> = LightSections::new(clusters).batches().collect();
        let failure = |error: io::Error| Failure { rank: 0, message: error.to_string() };
        let mut whole = (ranks.rank() == 0).then(|| SolvedLight::dark(mesh, store)).transpose().map_err(failure)?;
        let taken = in_order(
            ranks,
            LIGHT,
            self.own,
            &batches,
            |cluster| length(&clusters[cluster]),
            |index, bytes| self.append(index, bytes),
            |batch, bytes| {
                if let Some(whole) = &mut whole {
                    whole.take(&clusters[batches[batch].clone()], &bytes);
                }
                Ok(())
            },
        )?;
        taken.map_err(failure)?;
        Ok(whole)
    }

    /// The digest after so many shots, on rank 0; see [`super::digest()`]. Every rank calls it.
    pub fn digest(&self, mesh: &Mesh, shots: u64, ranks: &mut Communicator<'_>) -> Result<Option<String>, Failure> {
        let count = mesh.clusters.len();
        let batches: Vec<Range<usize>> =
            (0..count).step_by(HASH_BATCH).map(|first| first..count.min(first + HASH_BATCH)).collect();
        let mut all = blake3::Hasher::new();
        let mut buffer = Vec::new();
        let taken = in_order(
            ranks,
            HASHES,
            self.own,
            &batches,
            |_| blake3::OUT_LEN,
            |index, bytes| {
                buffer.clear();
                self.append(index, &mut buffer);
                bytes.extend_from_slice(blake3::hash(&buffer).as_bytes());
            },
            |_, hashes| {
                all.update(&hashes);
                Ok(())
            },
        )?;
        taken.map_err(|error| Failure { rank: 0, message: error.to_string() })?;
        Ok((ranks.rank() == 0).then(|| digest::finish(all, shots)))
    }
}

/// Hands rank 0 what all ranks have of their clusters in the order of clusters, batch by batch. `append` appends what there
/// is of the rank's `index`-th own cluster, `length` is how many bytes that is for a cluster.
fn in_order(
    ranks: &mut Communicator<'_>,
    tag: u32,
    own: &[u32],
    batches: &[Range<usize>],
    length: impl Fn(usize) -> usize,
    mut append: impl FnMut(usize, &mut Vec<u8>),
    mut take: impl FnMut(usize, Vec<u8>) -> io::Result<()>,
) -> Result<io::Result<()>, Failure> {
    let part = |batch: usize| {
        let mut bytes = Vec::new();
        for index in super::light::within(own, &batches[batch]) {
            bytes.extend_from_slice(&own[index].to_le_bytes());
            append(index, &mut bytes);
        }
        bytes
    };
    let merge = |batch: usize, parts: Vec<Vec<u8>>| {
        let whole = merge(&parts, &batches[batch], &length)
            .ok_or_else(|| io::Error::other("the ranks' parts of the light do not make a whole"))?;
        drop(parts);
        take(batch, whole)
    };
    ranks.gather_batches(tag, batches.len(), part, merge)
}

/// Puts what the ranks have sent of the clusters of a batch in the order of clusters; none if some of it is missing.
fn merge(parts: &[Vec<u8>], clusters: &Range<usize>, length: impl Fn(usize) -> usize) -> Option<Vec<u8>> {
    let mut places = Vec::with_capacity(clusters.len());
    let mut end = 0;
    for cluster in clusters.clone() {
        places.push(end..end + length(cluster));
        end += length(cluster);
    }
    let mut whole = vec![0; end];
    let mut found = 0;
    for part in parts {
        let mut rest = part.as_slice();
        while let Some((number, bytes)) = rest.split_first_chunk::<NUMBER>() {
            let index = (u32::from_le_bytes(*number) as usize).checked_sub(clusters.start)?;
            let place = places.get(index)?.clone();
            let (light, after) = bytes.split_at_checked(place.len())?;
            whole[place].copy_from_slice(light);
            (rest, found) = (after, found + 1);
        }
    }
    (found == clusters.len()).then_some(whole)
}
