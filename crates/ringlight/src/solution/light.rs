//! The light of all elements, and of a rank's own.
//!
//! Both as bytes, cluster by cluster: the light of its elements, then for each patch 1 if its own emission has not been
//! shot yet. That is what a file holds, what the digest hashes and what ranks send.

use crate::column::{Bytes, Column, Store};
use crate::mesh::{Cluster, Mesh};
use crate::shooting::{ClusterLight, ElementLight};
use std::io::{self, Write};
use std::ops::Range;

/// The light of all elements.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SolvedLight {
    /// Light of each element.
    pub elements: Column<ElementLight>,
    /// For each patch, 1 if its own emission has not been shot yet, else 0.
    pub emission_waits: Column<u8>,
}

/// The light that a rank owns.
#[derive(Clone, Copy, Debug)]
pub struct OwnLight<'a> {
    /// Numbers of the rank's clusters, ascending.
    pub own: &'a [u32],
    /// Their light.
    pub clusters: &'a [ClusterLight],
}

impl SolvedLight {
    /// Dark; kept in `store`.
    pub fn dark(mesh: &Mesh, store: Store<'_>) -> io::Result<SolvedLight> {
        let mut light = SolvedLight { elements: store.column()?, emission_waits: store.column()? };
        light.elements.resize(mesh.element_count(), ElementLight::default())?;
        light.emission_waits.resize(mesh.patch_count(), 0)?;
        Ok(light)
    }

    /// Of all clusters, in order; kept in `store`.
    pub fn of(clusters: Vec<ClusterLight>, store: Store<'_>) -> io::Result<SolvedLight> {
        let mut whole = SolvedLight { elements: store.column()?, emission_waits: store.column()? };
        whole.elements.reserve(clusters.iter().map(|c| c.elements.len()).sum())?;
        whole.emission_waits.reserve(clusters.iter().map(|c| c.patches.len()).sum())?;
        for light in clusters {
            whole.elements.extend_from_slice(&light.elements)?;
            whole.emission_waits.extend(light.patches.iter().map(|p| u8::from(p.emission_waits)))?;
        }
        Ok(whole)
    }

    /// Writes it for [`SolvedLight::shared`].
    pub fn share(&self, out: &mut dyn Write) -> io::Result<()> {
        out.write_all(bytemuck::cast_slice(&self.elements))?;
        out.write_all(&self.emission_waits)
    }

    /// The light of a mesh in bytes that [`SolvedLight::share`] wrote, in which it stays. None if they are not.
    pub fn shared(mesh: &Mesh, bytes: &Bytes) -> Option<SolvedLight> {
        let elements = mesh.element_count() * size_of::<ElementLight>();
        let whole = bytes.len() == elements + mesh.patch_count();
        let (elements, emission_waits) = (0..elements, elements..bytes.len());
        let light = SolvedLight {
            elements: Column::shared(bytes, elements)?,
            emission_waits: Column::shared(bytes, emission_waits)?,
        };
        whole.then_some(light)
    }

    /// The bytes of some clusters, in order.
    pub(super) fn bytes(&self, clusters: &[Cluster]) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(clusters.iter().map(length).sum());
        for cluster in clusters {
            bytes.extend_from_slice(bytemuck::cast_slice(&self.elements[range(&cluster.elements)]));
            bytes.extend_from_slice(&self.emission_waits[range(&cluster.patches)]);
        }
        bytes
    }

    /// Takes the light of some clusters from their bytes.
    pub(super) fn take(&mut self, clusters: &[Cluster], mut bytes: &[u8]) {
        for cluster in clusters {
            let (elements, flags);
            (elements, flags, bytes) = split(cluster, bytes);
            bytemuck::cast_slice_mut(&mut self.elements[range(&cluster.elements)]).copy_from_slice(elements);
            self.emission_waits[range(&cluster.patches)].copy_from_slice(flags);
        }
    }
}

impl OwnLight<'_> {
    /// Appends the bytes of the rank's `index`-th cluster.
    pub(super) fn append(&self, index: usize, bytes: &mut Vec<u8>) {
        let light = &self.clusters[index];
        bytes.extend_from_slice(bytemuck::cast_slice(&light.elements));
        bytes.extend(light.patches.iter().map(|p| u8::from(p.emission_waits)));
    }
}

/// Places of the numbers that lie in a range, in an ascending list.
pub(super) fn within(own: &[u32], clusters: &Range<usize>) -> Range<usize> {
    let before = |end: usize| own.partition_point(|&cluster| (cluster as usize) < end);
    before(clusters.start)..before(clusters.end)
}

/// Length of a cluster's bytes.
pub(super) fn length(cluster: &Cluster) -> usize {
    cluster.elements.len() * size_of::<ElementLight>() + cluster.patches.len()
}

/// The parts of a cluster's bytes, and what follows them.
pub(super) fn split<'a>(cluster: &Cluster, bytes: &'a [u8]) -> (&'a [u8], &'a [u8], &'a [u8]) {
    let (elements, rest) = bytes.split_at(cluster.elements.len() * size_of::<ElementLight>());
    let (flags, rest) = rest.split_at(cluster.patches.len());
    (elements, flags, rest)
}

/// Cuts clusters into runs of at most `most` bytes of light, but at least one cluster.
pub(super) fn runs(clusters: &[Cluster], most: usize) -> Vec<Range<usize>> {
    let mut runs = Vec::new();
    let (mut start, mut held) = (0, 0);
    for (c, cluster) in clusters.iter().enumerate() {
        let more = length(cluster);
        if c > start && held + more > most {
            runs.push(start..c);
            (start, held) = (c, 0);
        }
        held += more;
    }
    if start < clusters.len() {
        runs.push(start..clusters.len());
    }
    runs
}

fn range(numbers: &Range<u32>) -> Range<usize> {
    numbers.start as usize..numbers.end as usize
}
