//! The solution file, `.ringlight`.
//!
//! ```text
//! 8 bytes    magic "RINGLIGH"
//! u32        version
//! u32        number of sections
//! sections:  24 bytes name, u64 bytes raw, u64 bytes stored, 32 bytes BLAKE3 of the stored bytes, stored bytes (zstd)
//! ```
//!
//! All numbers are little-endian. Every array is cut into sections of at most 1 MiB, called `facets-0`, `facets-1`, …, so
//! that neither a writer nor a reader holds more than some of them at a time; they hold whole items. The array `header` is
//! JSON, the others are plain numbers. The light comes cluster by cluster, in sections of as many clusters as 1 MiB holds. The file
//! holds no times, ranks, paths or stop rule: equal solutions are equal bytes.

mod read;
mod sections;
mod write;

pub use read::{LightFile, SolutionFile, read};
pub use write::write;
pub(super) use write::{BATCH_BYTES, LightSections, Writer};

use super::Description;
use crate::mesh::{Cluster, Sizes};
use crate::scene::Warnings;
use crate::solve::{Energy, Ledger, SolveSettings};
use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::io;

const MAGIC: &[u8; 8] = b"RINGLIGH";
const VERSION: u32 = 5;

/// Bytes of a section's name.
const NAME: usize = 24;

/// Most bytes of a section before it is compressed; one cluster's light may be more.
const SECTION: usize = 1 << 20;

/// The first array.
const HEADER: &str = "header";

/// The arrays between the header and the light, in the order in which they stand.
const ARRAYS: [&str; 12] = [
    "facets",
    "patch-facets",
    "first-elements",
    "clusters",
    "base-uv",
    "emission-uv",
    "vertex-colours",
    "surface-colours",
    "colours",
    "valid",
    "facet-coverage",
    "bitmaps",
];

/// The sections that hold light.
const LIGHT: &str = "light";

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

fn damaged(section: &str, what: &str) -> FileError {
    FileError::Damaged { section: section.into(), what: what.into() }
}

#[derive(Serialize, Deserialize)]
struct Header<'a> {
    description: Cow<'a, Description>,
    settings: SolveSettings,
    energy: Energy,
    ledger: Ledger,
    origin: [f64; 3],
    diagonal: f64,
    sizes: Sizes,
    warnings: Cow<'a, Warnings>,
    skipped: Cow<'a, [(String, u64)]>,
    coverage: Cow<'a, [f32]>,
    cutout: Cow<'a, [Option<u32>]>,
    bitmaps: Vec<[u32; 2]>,
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct StoredCluster {
    patches: [u32; 2],
    elements: [u32; 2],
    low: [f32; 3],
    high: [f32; 3],
}

impl From<&Cluster> for StoredCluster {
    fn from(c: &Cluster) -> StoredCluster {
        StoredCluster {
            patches: [c.patches.start, c.patches.end],
            elements: [c.elements.start, c.elements.end],
            low: c.low.to_array(),
            high: c.high.to_array(),
        }
    }
}

impl From<&StoredCluster> for Cluster {
    fn from(c: &StoredCluster) -> Cluster {
        Cluster {
            patches: c.patches[0]..c.patches[1],
            elements: c.elements[0]..c.elements[1],
            low: c.low.into(),
            high: c.high.into(),
        }
    }
}
