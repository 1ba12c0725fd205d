//! Writing: a few sections are compressed side by side, and written in order.

use super::{ARRAYS, HEADER, Header, LIGHT, MAGIC, NAME, SECTION, StoredCluster, VERSION};
use crate::mesh::{Cluster, Mesh};
use crate::solution::light::{length, runs};
use crate::solution::{Snapshot, Solution};
use bytemuck::Pod;
use rayon::prelude::*;
use std::borrow::Cow;
use std::io::{self, Write};
use std::ops::Range;

/// Level of compression: more of it takes much more time, and numbers hardly get smaller.
const LEVEL: i32 = 3;

/// Sections held at a time.
const BATCH: usize = 2;

/// What they are together before they are compressed, bytes.
pub const BATCH_BYTES: usize = BATCH * SECTION;

/// Writes a solution.
pub fn write(solution: &Solution, out: &mut dyn Write) -> io::Result<()> {
    let Solution { description, mesh, settings, ledger, light, energy, .. } = solution;
    let sections = LightSections::new(&mesh.clusters);
    let mut writer = Writer::new(out);
    writer.begin(&Snapshot { description, mesh, settings, ledger, energy }, sections.count())?;
    for (batch, clusters) in sections.batches().enumerate() {
        writer.light(&sections, batch, &light.bytes(&mesh.clusters[clusters]))?;
    }
    Ok(())
}

/// How the light is cut into sections, and sections into batches that are written at a time.
pub struct LightSections<'a> {
    clusters: &'a [Cluster],
    runs: Vec<Range<usize>>,
}

impl<'a> LightSections<'a> {
    /// Of all clusters.
    pub fn new(clusters: &'a [Cluster]) -> LightSections<'a> {
        LightSections { clusters, runs: runs(clusters, SECTION) }
    }

    /// Number of sections.
    pub fn count(&self) -> usize {
        self.runs.len()
    }

    /// The clusters of each batch.
    pub fn batches(&self) -> impl Iterator<Item = Range<usize>> {
        self.runs.chunks(BATCH).map(|runs| runs[0].start..runs[runs.len() - 1].end)
    }

    /// The sections of a batch, from its bytes.
    fn cut<'b>(&self, batch: usize, mut bytes: &'b [u8]) -> Vec<(String, Cow<'b, [u8]>)> {
        let first = batch * BATCH;
        let runs = &self.runs[first..self.runs.len().min(first + BATCH)];
        let cut = |(number, run): (usize, &Range<usize>)| {
            let (section, rest) = bytes.split_at(self.clusters[run.clone()].iter().map(length).sum());
            bytes = rest;
            (format!("{LIGHT}-{}", first + number), Cow::Borrowed(section))
        };
        runs.iter().enumerate().map(cut).collect()
    }
}

/// Writes a file section by section.
pub struct Writer<'w>(&'w mut dyn Write);

impl<'w> Writer<'w> {
    /// To `out`.
    pub fn new(out: &'w mut dyn Write) -> Writer<'w> {
        Writer(out)
    }

    /// Writes all that is not light. So many sections of light follow.
    pub fn begin(&mut self, snapshot: &Snapshot<'_>, light_sections: usize) -> io::Result<()> {
        let header = header(snapshot);
        // Written twice rather than held: it has all nodes and surfaces.
        let mut length = Length(0);
        serde_json::to_writer(&mut length, &header)?;
        let arrays = arrays(snapshot.mesh);
        let mut sections = arrays.iter().flat_map(|a| (0..a.sections()).map(move |number| (a, number)));
        self.0.write_all(MAGIC)?;
        self.0.write_all(&VERSION.to_le_bytes())?;
        let count = length.0.div_ceil(SECTION) + sections.clone().count() + light_sections;
        self.0.write_all(&u32::try_from(count).map_err(io::Error::other)?.to_le_bytes())?;
        let mut text = Text { writer: self, number: 0, bytes: Vec::with_capacity(SECTION) };
        serde_json::to_writer(&mut text, &header)?;
        text.flush()?;
        loop {
            let batch: Vec<_> = sections.by_ref().take(BATCH).collect();
            if batch.is_empty() {
                return Ok(());
            }
            self.sections(batch.into_par_iter().map(|(array, number)| array.section(number)))?;
        }
    }

    /// Writes a batch of the light's sections.
    pub fn light(&mut self, sections: &LightSections<'_>, batch: usize, bytes: &[u8]) -> io::Result<()> {
        self.sections(sections.cut(batch, bytes).into_par_iter())
    }

    fn sections<'a>(
        &mut self,
        sections: impl IndexedParallelIterator<Item = (String, Cow<'a, [u8]>)>,
    ) -> io::Result<()> {
        let store = |(name, raw): (String, Cow<'_, [u8]>)| {
            let stored = zstd::bulk::compress(&raw, LEVEL)?;
            let hash = blake3::hash(&stored);
            Ok((name, raw.len() as u64, hash, stored))
        };
        for (name, raw, hash, stored) in sections.map(store).collect::<io::Result<Vec<_>>>()? {
            let mut label = [0u8; NAME];
            label[..name.len()].copy_from_slice(name.as_bytes());
            self.0.write_all(&label)?;
            self.0.write_all(&raw.to_le_bytes())?;
            self.0.write_all(&(stored.len() as u64).to_le_bytes())?;
            self.0.write_all(hash.as_bytes())?;
            self.0.write_all(&stored)?;
        }
        Ok(())
    }
}

/// Counts what is written.
struct Length(usize);

impl Write for Length {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0 += bytes.len();
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Writes the header section by section.
struct Text<'a, 'w> {
    writer: &'a mut Writer<'w>,
    /// Of the next section.
    number: usize,
    /// Its bytes so far.
    bytes: Vec<u8>,
}

impl Write for Text<'_, '_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let taken = bytes.len().min(SECTION - self.bytes.len());
        self.bytes.extend_from_slice(&bytes[..taken]);
        if self.bytes.len() == SECTION {
            self.flush()?;
        }
        Ok(taken)
    }

    fn flush(&mut self) -> io::Result<()> {
        if !self.bytes.is_empty() {
            let section = (format!("{HEADER}-{}", self.number), Cow::Borrowed(&self.bytes[..]));
            self.writer.sections([section].into_par_iter())?;
            self.number += 1;
            self.bytes.clear();
        }
        Ok(())
    }
}

/// Gives the bytes of some items.
type Items<'a> = Box<dyn Fn(Range<usize>) -> Cow<'a, [u8]> + Sync + 'a>;

/// An array that is written in sections.
struct Array<'a> {
    name: &'static str,
    len: usize,
    item_size: usize,
    items: Items<'a>,
}

impl<'a> Array<'a> {
    /// Of what is stored as it is held.
    fn of<T: Pod + Sync>(name: &'static str, items: &'a [T]) -> Array<'a> {
        let bytes = |range: Range<usize>| Cow::Borrowed(bytemuck::cast_slice(&items[range]));
        Array { name, len: items.len(), item_size: size_of::<T>(), items: Box::new(bytes) }
    }

    /// Of what is stored in another form than it is held.
    fn made<T: Sync, S: Pod>(name: &'static str, items: &'a [T], make: impl Fn(&T) -> S + Sync + 'a) -> Array<'a> {
        let bytes = move |range: Range<usize>| {
            let made: Vec<S> = items[range].iter().map(&make).collect();
            Cow::Owned(bytemuck::cast_slice(&made).to_vec())
        };
        Array { name, len: items.len(), item_size: size_of::<S>(), items: Box::new(bytes) }
    }

    fn per_section(&self) -> usize {
        SECTION / self.item_size
    }

    fn sections(&self) -> usize {
        self.len.div_ceil(self.per_section())
    }

    fn section(&self, number: usize) -> (String, Cow<'a, [u8]>) {
        let first = number * self.per_section();
        let bytes = (self.items)(first..self.len.min(first + self.per_section()));
        (format!("{}-{number}", self.name), bytes)
    }
}

fn header<'a>(snapshot: &Snapshot<'a>) -> Header<'a> {
    let Snapshot { description, mesh, settings, ledger, energy } = *snapshot;
    let occluder = &mesh.occluder;
    Header {
        description: Cow::Borrowed(description),
        settings: *settings,
        energy: *energy,
        ledger: *ledger,
        origin: mesh.origin,
        diagonal: mesh.diagonal,
        sizes: mesh.sizes,
        warnings: Cow::Borrowed(&mesh.warnings),
        skipped: Cow::Borrowed(&mesh.skipped),
        coverage: Cow::Borrowed(&occluder.coverage),
        cutout: Cow::Borrowed(&occluder.cutout),
        bitmaps: occluder.bitmaps.iter().map(|b| [b.width, b.height]).collect(),
    }
}

/// All arrays but the header and the light, in the order of [`ARRAYS`].
fn arrays(mesh: &Mesh) -> [Array<'_>; ARRAYS.len()] {
    let [facets, patch_facets, first_elements, clusters, base_uv, emission_uv, vertices, rest @ ..] = ARRAYS;
    let [surfaces, colours, valid, coverage, bits] = rest;
    let occluder = &mesh.occluder;
    let bitmaps = Array {
        name: bits,
        len: occluder.bitmaps.iter().map(|b| b.bits.len()).sum(),
        item_size: size_of::<u64>(),
        items: Box::new(|range| {
            let words = occluder.bitmaps.iter().flat_map(|b| &b.bits).skip(range.start).take(range.len());
            Cow::Owned(words.flat_map(|word| word.to_le_bytes()).collect())
        }),
    };
    [
        Array::of(facets, &mesh.facets),
        Array::of(patch_facets, &mesh.patch_facets),
        Array::of(first_elements, &mesh.first_elements),
        Array::made(clusters, &mesh.clusters, |c| StoredCluster::from(c)),
        Array::of(base_uv, &mesh.base_uv),
        Array::of(emission_uv, &mesh.emission_uv),
        Array::of(vertices, &mesh.vertex_colours),
        Array::of(surfaces, &mesh.surface_colours),
        Array::of(colours, &mesh.colours),
        Array::of(valid, &mesh.valid),
        Array::of(coverage, &occluder.facet_coverage),
        bitmaps,
    ]
}
