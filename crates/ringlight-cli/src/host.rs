//! What the ranks of one machine share: the first of them reads and makes what is large, and the others map it.

use crate::failure::Failure;
use crate::files;
use crate::launch::COMMAND;
use crate::machine;
use crate::scratch::FileScratch;
use anyhow::Context;
use bytemuck::Pod;
use ringlight::column::{Bytes, Column, Store};
use ringlight::mesh::Mesh;
use ringlight::plan::MeshPlace;
use ringlight::solve::Share;
use ringlight::transport::{self, Communicator};
use std::io::{self, BufWriter, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// The machine that a rank runs on.
pub struct Host {
    /// Its ranks' first.
    leader: usize,
    rank: usize,
    /// Number of machines.
    hosts: usize,
    /// For files that last as long as the command.
    folder: PathBuf,
    scratch: Option<FileScratch>,
}

/// Bytes that are handed on at a time.
const BATCH: usize = 1 << 20;

impl Host {
    /// Of this rank. Scratch files are in `folder`, by default the system's for temporary files; a rank that is alone needs
    /// them only if `frugal`. Every rank calls it.
    pub fn find(ranks: &mut Communicator<'_>, folder: Option<&Path>, frugal: bool) -> Result<Host, Failure> {
        let names = ranks.all_gather(COMMAND, machine::host().into_bytes())?;
        let first = |name: &Vec<u8>| names.iter().position(|other| other == name);
        let leader = first(&names[ranks.rank()]).unwrap_or(0);
        let hosts = (0..names.len()).filter(|&rank| first(&names[rank]) == Some(rank)).count();
        let apart = ranks.size() > 1 || frugal || folder.is_some();
        let folder = folder.map_or_else(std::env::temp_dir, Path::to_owned);
        let scratch = apart.then(|| FileScratch::new(&folder));
        Ok(Host { leader, rank: ranks.rank(), hosts, folder, scratch })
    }

    /// Whether this rank reads and makes what the others map.
    pub fn leads(&self) -> bool {
        self.leader == self.rank
    }

    /// Where the mesh lies.
    pub fn mesh_place(&self) -> MeshPlace {
        if self.scratch.is_some() { MeshPlace::Files } else { MeshPlace::Heap }
    }

    /// Where this rank keeps what is large.
    pub fn store(&self) -> Store<'_> {
        self.scratch.as_ref().map_or(Store::Heap, |scratch| Store::Scratch(scratch))
    }

    /// What the leader writes, mapped by all. Every rank calls it, and leaders with something to write.
    pub fn share(
        &self,
        ranks: &mut Communicator<'_>,
        write: Option<impl FnOnce(&mut dyn Write) -> io::Result<()>>,
    ) -> Result<Bytes, Failure> {
        let failed = || format!("{}: what ranks share cannot be kept there", self.folder.display());
        let file = write.map(|write| {
            let mut file = tempfile::NamedTempFile::new_in(&self.folder)?;
            let mut out = BufWriter::new(file.as_file_mut());
            write(&mut out)?;
            out.flush()?;
            drop(out);
            Ok::<_, io::Error>(file)
        });
        let file = file.transpose().with_context(failed)?;
        let path = file.as_ref().map_or(Vec::new(), |file| file.path().as_os_str().as_encoded_bytes().to_vec());
        let paths = ranks.all_gather(COMMAND, path)?;
        let path = String::from_utf8(paths[self.leader].clone()).context("the scratch folder's name is not UTF-8")?;
        let bytes = files::open(Path::new(&path)).with_context(failed)?;
        // Mapped by all, it needs no name any more.
        ranks.all_gather(COMMAND, Vec::new())?;
        Ok(bytes)
    }

    /// The bits of all elements' valid samples, of which every rank has found those of its own clusters.
    pub fn share_valid(
        &self,
        ranks: &mut Communicator<'_>,
        mesh: &Mesh,
        share: &Share,
        own: &[u32],
    ) -> Result<Column<u32>, Failure> {
        let batches = batches(mesh);
        let mut whole: Column<u32> = self.store().column().context("scratch memory")?;
        let mut sent = 0;
        let part = |batch: usize| {
            let Range { start, end } = batches[batch];
            let clusters = share.own.partition_point(|&c| c < start)..share.own.partition_point(|&c| c < end);
            let count: usize = share.own[clusters].iter().map(|&c| mesh.clusters[c as usize].elements.len()).sum();
            sent += count;
            bytemuck::cast_slice(&own[sent - count..sent]).to_vec()
        };
        let take = |batch: usize, parts: Vec<Vec<u8>>| {
            let mut parts: Vec<_> = parts.iter().map(|part| part.as_chunks().0.iter()).collect();
            for cluster in batches[batch].clone() {
                let owner = share.owners[cluster as usize] as usize;
                let bits = parts[owner].by_ref().take(mesh.clusters[cluster as usize].elements.len());
                whole.extend(bits.map(|bits| u32::from_ne_bytes(*bits)))?;
            }
            Ok::<_, io::Error>(())
        };
        ranks.gather_batches(COMMAND, batches.len(), part, take)?.context("scratch memory")?;
        self.hand_on(ranks, &mut whole)?;
        let leads = self.leads();
        let bytes =
            self.share(ranks, leads.then_some(|out: &mut dyn Write| out.write_all(bytemuck::cast_slice(&whole))))?;
        Column::shared(&bytes, 0..bytes.len()).context("what ranks share is cut off").map_err(Failure::from)
    }

    /// Gives the leaders of other machines what rank 0 has. Every rank calls it.
    pub fn hand_on<T: Pod>(&self, ranks: &mut Communicator<'_>, whole: &mut Column<T>) -> Result<(), Failure> {
        if self.hosts == 1 {
            return Ok(());
        }
        let values = BATCH / size_of::<T>();
        let count = ranks.broadcast(0, COMMAND, (whole.len() as u64).to_le_bytes().to_vec())?;
        let count = count.first_chunk().map_or(0, |bytes| u64::from_le_bytes(*bytes)) as usize;
        for start in (0..count).step_by(values) {
            let part = whole.get(start..count.min(start + values)).unwrap_or_default();
            let part = ranks.broadcast(0, COMMAND, bytemuck::cast_slice(part).to_vec())?;
            if self.leads() && self.rank > 0 {
                whole.extend_from_slice(&bytemuck::pod_collect_to_vec(&part)).context("scratch memory")?;
            }
            // Nobody runs ahead.
            ranks.all_reduce(COMMAND, [0], |a, _| a).map_err(|failure: transport::Failure| failure)?;
        }
        Ok(())
    }
}

/// Runs of clusters with about [`BATCH`] bytes of bits.
fn batches(mesh: &Mesh) -> Vec<Range<u32>> {
    let mut batches = Vec::new();
    let mut start = 0u32;
    let most = (BATCH / size_of::<u32>()) as u32;
    for (number, cluster) in mesh.clusters.iter().enumerate() {
        let first = mesh.clusters[start as usize].elements.start;
        if cluster.elements.end - first > most && number as u32 > start {
            batches.push(start..number as u32);
            start = number as u32;
        }
    }
    batches.push(start..mesh.clusters.len() as u32);
    batches
}
