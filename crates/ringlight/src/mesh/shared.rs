//! A built mesh as bytes that other processes of the machine map: they touch what they need of it.
//!
//! ```text
//! u64        length of the header
//! header     JSON
//! columns    in the order of `Header::bytes`, native numbers; header and columns padded to whole lines of 64 bytes
//! ```
//!
//! Not a format: the bytes are read by the program that wrote them, on the same machine, and then thrown away.

use super::{Cluster, Colour, Mesh, Occluder, Sizes};
use crate::column::{Bytes, Column};
use crate::scene::Warnings;
use bytemuck::{Pod, Zeroable, cast_slice};
use ringlight_visibility::Bitmap;
use serde::{Deserialize, Serialize};
use std::io::{self, Write};
use std::ops::Range;
use std::sync::Arc;

/// Columns start on multiples of this, which suits all of their types.
const LINE: usize = 64;

/// Columns of a mesh.
const COLUMNS: usize = 12;

#[derive(Serialize, Deserialize)]
struct Header {
    origin: [f64; 3],
    diagonal: f64,
    sizes: Sizes,
    warnings: Warnings,
    skipped: Vec<(String, u64)>,
    coverage: Vec<f32>,
    cutout: Vec<Option<u32>>,
    bitmaps: Vec<[u32; 2]>,
    /// Lengths of the columns.
    bytes: [usize; COLUMNS],
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct PlainCluster {
    patches: [u32; 2],
    elements: [u32; 2],
    low: [f32; 3],
    high: [f32; 3],
}

impl Mesh {
    /// Writes the mesh for [`Mesh::shared`].
    pub fn share(&self, out: &mut dyn Write) -> io::Result<()> {
        let occluder = &self.occluder;
        let plain = |c: &Cluster| PlainCluster {
            patches: [c.patches.start, c.patches.end],
            elements: [c.elements.start, c.elements.end],
            low: c.low.to_array(),
            high: c.high.to_array(),
        };
        let clusters: Vec<PlainCluster> = self.clusters.iter().map(plain).collect();
        let bits: Vec<u64> = occluder.bitmaps.iter().flat_map(|b| b.bits.iter().copied()).collect();
        let columns: [&[u8]; COLUMNS] = [
            cast_slice(&self.facets),
            cast_slice(&self.patch_facets),
            cast_slice(&self.first_elements),
            cast_slice(&clusters),
            cast_slice(&self.base_uv),
            cast_slice(&self.emission_uv),
            cast_slice(&self.vertex_colours),
            cast_slice(&self.colours),
            cast_slice(&self.surface_colours),
            cast_slice(&self.valid),
            cast_slice(&occluder.facet_coverage),
            cast_slice(&bits),
        ];
        let header = serde_json::to_vec(&Header {
            origin: self.origin,
            diagonal: self.diagonal,
            sizes: self.sizes,
            warnings: self.warnings.clone(),
            skipped: self.skipped.clone(),
            coverage: occluder.coverage.clone(),
            cutout: occluder.cutout.clone(),
            bitmaps: occluder.bitmaps.iter().map(|b| [b.width, b.height]).collect(),
            bytes: columns.map(<[u8]>::len),
        })?;
        let start = [&(header.len() as u64).to_ne_bytes(), &header[..]].concat();
        for part in [&start[..]].into_iter().chain(columns) {
            out.write_all(part)?;
            out.write_all(&[0; LINE][..part.len().next_multiple_of(LINE) - part.len()])?;
        }
        Ok(())
    }

    /// The mesh in bytes that [`Mesh::share`] wrote. Its columns stay in the bytes; clusters are copied.
    pub fn shared(bytes: &Bytes) -> Result<Mesh, SharedError> {
        let length = u64::from_ne_bytes(*bytes.first_chunk().ok_or(SharedError)?) as usize;
        let mut end = length.checked_add(8).filter(|&end| end <= bytes.len()).ok_or(SharedError)?;
        let header: Header = serde_json::from_slice(&bytes[8..end]).map_err(|_| SharedError)?;
        let parts = header.bytes.map(|length| {
            let start = end.next_multiple_of(LINE);
            end = start.saturating_add(length);
            start..end
        });
        let [facets, patch_facets, first_elements, clusters, base_uv, emission_uv, rest @ ..] = parts;
        let [vertex_colours, colours, surface_colours, valid, facet_coverage, bits] = rest;
        let cluster = |c: &PlainCluster| Cluster {
            patches: c.patches[0]..c.patches[1],
            elements: c.elements[0]..c.elements[1],
            low: c.low.into(),
            high: c.high.into(),
        };
        let bits: Column<u64> = column(bytes, bits)?;
        let mut rest = &bits[..];
        let mut bitmaps = Vec::new();
        for &[width, height] in &header.bitmaps {
            let words = (u64::from(width) * u64::from(height)).div_ceil(64) as usize;
            let (bits, after) = rest.split_at_checked(words).ok_or(SharedError)?;
            bitmaps.push(Arc::new(Bitmap { width, height, bits: bits.to_vec() }));
            rest = after;
        }
        Ok(Mesh {
            origin: header.origin,
            diagonal: header.diagonal,
            sizes: header.sizes,
            facets: column(bytes, facets)?,
            patch_facets: column(bytes, patch_facets)?,
            first_elements: column(bytes, first_elements)?,
            clusters: column::<PlainCluster>(bytes, clusters)?.iter().map(cluster).collect(),
            base_uv: column(bytes, base_uv)?,
            emission_uv: column(bytes, emission_uv)?,
            vertex_colours: column(bytes, vertex_colours)?,
            colours: column(bytes, colours)?,
            surface_colours: column::<Colour>(bytes, surface_colours)?.to_vec(),
            valid: column(bytes, valid)?,
            occluder: Occluder {
                coverage: header.coverage,
                cutout: header.cutout,
                bitmaps,
                facet_coverage: column(bytes, facet_coverage)?,
            },
            warnings: header.warnings,
            skipped: header.skipped,
        })
    }
}

fn column<T: Pod>(bytes: &Bytes, range: Range<usize>) -> Result<Column<T>, SharedError> {
    Column::shared(bytes, range).ok_or(SharedError)
}

/// Bytes that are no shared mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the shared mesh is cut off or not of this program")]
pub struct SharedError;
