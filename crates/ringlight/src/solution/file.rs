//! The solution file, `.ringlight`.
//!
//! ```text
//! 8 bytes    magic "RINGLIGH"
//! u32        version
//! u32        number of sections
//! sections:  16 bytes name, u64 bytes raw, u64 bytes stored, 32 bytes BLAKE3 of the stored bytes, stored bytes (zstd)
//! ```
//!
//! All numbers are little-endian. The `header` section is JSON, the others are plain arrays; the light comes in sections of
//! [`CLUSTERS_PER_SECTION`] clusters each. The file holds no times, ranks, paths or stop rule: equal solutions are equal
//! bytes.

use super::{Description, Snapshot, Solution};
use crate::mesh::{Cluster, Colour, Facet, FacetCoverage, Mesh, Occluder, Sizes};
use crate::scene::Warnings;
use crate::shooting::{ClusterLight, ElementLight, PatchLight};
use crate::solve::{Energy, SolveSettings, State};
use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;
use ringlight_visibility::Bitmap;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::io::{self, Write};
use std::sync::Arc;

const MAGIC: &[u8; 8] = b"RINGLIGH";
const VERSION: u32 = 1;
const LEVEL: i32 = 3;

/// Clusters in one section of light.
pub const CLUSTERS_PER_SECTION: usize = 4096;

/// A solution file that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// It does not begin like a solution.
    #[error("not a Ringlight solution (it does not begin with RINGLIGH)")]
    NotASolution,
    /// It was written by another version.
    #[error("solution format version {0}; this program reads version {VERSION}")]
    Version(u32),
    /// It ends early, or a checksum or count is wrong.
    #[error("damaged solution: section '{section}': {what}")]
    Damaged {
        /// Section.
        section: String,
        /// What is wrong.
        what: String,
    },
    /// Reading or writing failed.
    #[error(transparent)]
    Io(#[from] io::Error),
}

#[derive(Serialize, Deserialize)]
struct Header {
    description: Description,
    settings: SolveSettings,
    energy: Energy,
    origin: [f64; 3],
    diagonal: f64,
    sizes: Sizes,
    warnings: Warnings,
    skipped: Vec<(String, u64)>,
    coverage: Vec<f32>,
    cutout: Vec<Option<u32>>,
    bitmaps: Vec<[u32; 2]>,
    shots: u64,
    emitters_shot: u64,
    emitted: f64,
    escaped: f64,
    absorbed_by_backs: f64,
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct StoredCluster {
    patches: [u32; 2],
    elements: [u32; 2],
    low: [f32; 3],
    high: [f32; 3],
}

/// Writes a solution.
pub fn write(solution: &Solution, out: &mut dyn Write) -> io::Result<()> {
    let Solution { description, mesh, settings, state, energy, .. } = solution;
    write_snapshot(&Snapshot { description, mesh, settings, state, energy }, out)
}

/// Writes a solution that is still being solved.
pub fn write_snapshot(snapshot: &Snapshot<'_>, out: &mut dyn Write) -> io::Result<()> {
    let Snapshot { description, mesh, settings, state, energy } = *snapshot;
    let occluder = &mesh.occluder;
    let header = Header {
        description: description.clone(),
        settings: *settings,
        energy: *energy,
        origin: mesh.origin,
        diagonal: mesh.diagonal,
        sizes: mesh.sizes,
        warnings: mesh.warnings.clone(),
        skipped: mesh.skipped.clone(),
        coverage: occluder.coverage.clone(),
        cutout: occluder.cutout.clone(),
        bitmaps: occluder.bitmaps.iter().map(|b| [b.width, b.height]).collect(),
        shots: state.shots,
        emitters_shot: state.emitters_shot,
        emitted: state.emitted,
        escaped: state.escaped,
        absorbed_by_backs: state.absorbed_by_backs,
    };
    let clusters: Vec<StoredCluster> = mesh.clusters.iter().map(StoredCluster::new).collect();
    let bits: Vec<u64> = occluder.bitmaps.iter().flat_map(|b| b.bits.iter().copied()).collect();
    let light_sections = state.clusters.chunks(CLUSTERS_PER_SECTION);
    let count = 11 + light_sections.len() as u32;
    out.write_all(MAGIC)?;
    out.write_all(&VERSION.to_le_bytes())?;
    out.write_all(&count.to_le_bytes())?;
    section(out, "header", &serde_json::to_vec(&header).map_err(io::Error::other)?)?;
    section(out, "facets", bytemuck::cast_slice(&mesh.facets))?;
    section(out, "patch-facets", bytemuck::cast_slice(&mesh.patch_facets))?;
    section(out, "clusters", bytemuck::cast_slice(&clusters))?;
    section(out, "base-uv", bytemuck::cast_slice(&mesh.base_uv))?;
    section(out, "emission-uv", bytemuck::cast_slice(&mesh.emission_uv))?;
    section(out, "vertex-colours", bytemuck::cast_slice(&mesh.vertex_colours))?;
    section(out, "colours", bytemuck::cast_slice(&[&mesh.surface_colours[..], &mesh.colours[..]].concat()))?;
    section(out, "valid", bytemuck::cast_slice(&mesh.valid))?;
    section(out, "facet-coverage", bytemuck::cast_slice(&occluder.facet_coverage))?;
    section(out, "bitmaps", bytemuck::cast_slice(&bits))?;
    for (i, chunk) in light_sections.enumerate() {
        let mut bytes = Vec::new();
        for cluster in chunk {
            bytes.extend_from_slice(bytemuck::cast_slice(&cluster.elements));
            bytes.extend(cluster.patches.iter().map(|p| u8::from(p.emission_waits)));
        }
        section(out, &format!("light-{i}"), &bytes)?;
    }
    Ok(())
}

fn section(out: &mut dyn Write, name: &str, raw: &[u8]) -> io::Result<()> {
    let stored = zstd::bulk::compress(raw, LEVEL)?;
    let mut label = [0u8; 16];
    label[..name.len()].copy_from_slice(name.as_bytes());
    out.write_all(&label)?;
    out.write_all(&(raw.len() as u64).to_le_bytes())?;
    out.write_all(&(stored.len() as u64).to_le_bytes())?;
    out.write_all(blake3::hash(&stored).as_bytes())?;
    out.write_all(&stored)
}

impl StoredCluster {
    fn new(c: &Cluster) -> StoredCluster {
        StoredCluster {
            patches: [c.patches.start, c.patches.end],
            elements: [c.elements.start, c.elements.end],
            low: c.low.to_array(),
            high: c.high.to_array(),
        }
    }
}

/// The stored sections of a file, checked when taken.
struct Sections<'a>(HashMap<String, (u64, &'a [u8])>);

impl<'a> Sections<'a> {
    fn find(bytes: &'a [u8]) -> Result<Sections<'a>, FileError> {
        let version = match bytes.strip_prefix(MAGIC) {
            Some([a, b, c, d, ..]) => u32::from_le_bytes([*a, *b, *c, *d]),
            _ => return Err(FileError::NotASolution),
        };
        if version != VERSION {
            return Err(FileError::Version(version));
        }
        let mut rest = &bytes[12..];
        let mut take = |n: u64| -> Result<&'a [u8], FileError> {
            match usize::try_from(n).ok().and_then(|n| rest.split_at_checked(n)) {
                Some((head, tail)) => {
                    rest = tail;
                    Ok(head)
                }
                None => Err(damaged("directory", "the file ends early")),
            }
        };
        let number = |b: &[u8]| b.iter().rev().fold(0u64, |n, &x| n << 8 | u64::from(x));
        let count = number(take(4)?);
        let mut sections = HashMap::new();
        for _ in 0..count {
            let name = String::from_utf8_lossy(take(16)?).trim_end_matches('\0').to_string();
            let (raw, stored) = (number(take(8)?), number(take(8)?));
            let hash = take(32)?;
            let bytes = take(stored)?;
            if blake3::hash(bytes).as_bytes() != hash {
                return Err(damaged(&name, "its checksum is wrong"));
            }
            sections.insert(name, (raw, bytes));
        }
        Ok(Sections(sections))
    }

    fn bytes(&self, name: &str) -> Result<Vec<u8>, FileError> {
        let &(raw, stored) = self.0.get(name).ok_or_else(|| damaged(name, "it is missing"))?;
        let bytes = zstd::stream::decode_all(stored).map_err(|e| damaged(name, &e.to_string()))?;
        if bytes.len() as u64 == raw { Ok(bytes) } else { Err(damaged(name, "its length is wrong")) }
    }

    fn array<T: Pod>(&self, name: &str) -> Result<Vec<T>, FileError> {
        let bytes = self.bytes(name)?;
        if !bytes.len().is_multiple_of(size_of::<T>()) {
            return Err(damaged(name, "its length is wrong"));
        }
        Ok(bytemuck::pod_collect_to_vec(&bytes))
    }
}

fn damaged(section: &str, what: &str) -> FileError {
    FileError::Damaged { section: section.into(), what: what.into() }
}

/// Reads a solution. Images are not attached, see [`Solution::attach_images`].
pub fn read(bytes: &[u8]) -> Result<Solution, FileError> {
    let sections = Sections::find(bytes)?;
    let header: Header =
        serde_json::from_slice(&sections.bytes("header")?).map_err(|e| damaged("header", &e.to_string()))?;
    let mut surface_colours: Vec<Colour> = sections.array("colours")?;
    let surfaces = header.description.surfaces.len();
    if surface_colours.len() < surfaces || header.coverage.len() != surfaces || header.cutout.len() != surfaces {
        return Err(damaged("colours", "there are fewer than surfaces"));
    }
    let colours = surface_colours.split_off(surfaces);
    let mut bits = sections.array::<u64>("bitmaps")?;
    let mut bitmaps = Vec::new();
    for &[width, height] in &header.bitmaps {
        let words = (u64::from(width) * u64::from(height)).div_ceil(64) as usize;
        if words == 0 || words > bits.len() {
            return Err(damaged("bitmaps", "it is too short"));
        }
        let tail = bits.split_off(words);
        bitmaps.push(Arc::new(Bitmap { width, height, bits: std::mem::replace(&mut bits, tail) }));
    }
    if header.cutout.iter().flatten().any(|&b| b as usize >= bitmaps.len()) {
        return Err(damaged("bitmaps", "one is missing"));
    }
    let Description { nodes, materials, surfaces, .. } = &header.description;
    if surfaces.iter().any(|s| s.material as usize >= materials.len() || s.node as usize >= nodes.len()) {
        return Err(damaged("header", "a surface refers to what is not there"));
    }
    let occluder = Occluder {
        coverage: header.coverage,
        cutout: header.cutout,
        bitmaps,
        facet_coverage: sections.array::<FacetCoverage>("facet-coverage")?.into(),
    };
    let clusters: Vec<StoredCluster> = sections.array("clusters")?;
    let mesh = Mesh {
        origin: header.origin,
        diagonal: header.diagonal,
        sizes: header.sizes,
        facets: sections.array::<Facet>("facets")?.into(),
        patch_facets: sections.array("patch-facets")?.into(),
        clusters: clusters
            .iter()
            .map(|c| Cluster {
                patches: c.patches[0]..c.patches[1],
                elements: c.elements[0]..c.elements[1],
                low: c.low.into(),
                high: c.high.into(),
            })
            .collect(),
        base_uv: sections.array("base-uv")?.into(),
        emission_uv: sections.array("emission-uv")?.into(),
        vertex_colours: sections.array("vertex-colours")?.into(),
        colours: colours.into(),
        surface_colours,
        valid: sections.array("valid")?.into(),
        occluder,
        warnings: header.warnings,
        skipped: header.skipped,
    };
    mesh.check().map_err(|what| damaged("facets", &what))?;
    let mut state = State {
        clusters: read_light(&sections, &mesh)?,
        shots: header.shots,
        emitters_shot: header.emitters_shot,
        emitted: header.emitted,
        escaped: header.escaped,
        absorbed_by_backs: header.absorbed_by_backs,
    };
    state.renew(&mesh);
    let images = vec![None; header.description.images.len()];
    Ok(Solution {
        description: header.description,
        mesh,
        settings: header.settings,
        state,
        energy: header.energy,
        images,
    })
}

fn read_light(sections: &Sections<'_>, mesh: &Mesh) -> Result<Vec<ClusterLight>, FileError> {
    let parts: Vec<Vec<ClusterLight>> = mesh
        .clusters
        .par_chunks(CLUSTERS_PER_SECTION)
        .enumerate()
        .map(|(i, clusters)| {
            let name = format!("light-{i}");
            let bytes = sections.bytes(&name)?;
            let mut rest = bytes.as_slice();
            let mut lights = Vec::with_capacity(clusters.len());
            for cluster in clusters {
                let (elements, patches) = (cluster.elements.len() * size_of::<ElementLight>(), cluster.patches.len());
                let (Some(head), Some(flags)) = (rest.get(..elements), rest.get(elements..elements + patches)) else {
                    return Err(damaged(&name, "it is too short"));
                };
                lights.push(ClusterLight {
                    elements: bytemuck::pod_collect_to_vec(head),
                    patches: flags.iter().map(|&f| PatchLight { unshot_power: 0.0, emission_waits: f != 0 }).collect(),
                });
                rest = &rest[elements + patches..];
            }
            Ok(lights)
        })
        .collect::<Result<_, FileError>>()?;
    Ok(parts.concat())
}
