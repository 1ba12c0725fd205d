//! What a solve keeps in memory, counted from what is stored.

use crate::mesh::{Cluster, Colour, Facet, Mesh};
use crate::ring::Demand;
use crate::scene::{Node, Surface};
use crate::shooting::{ClusterLight, ElementLight, PatchLight};
use ringlight_visibility::Triangle;

/// Numbers that decide how much is stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Triangles that block light: two for each quadrilateral.
    pub triangles: u64,
    /// Facets.
    pub facets: u64,
    /// Patches.
    pub patches: u64,
    /// Elements.
    pub elements: u64,
    /// Clusters.
    pub clusters: u64,
    /// Surfaces.
    pub surfaces: u64,
    /// Bytes of texture coordinates, vertex colours and colours of elements.
    pub painted: u64,
}

/// Bytes of the hierarchy for each triangle: itself and its part of the nodes. Of the latter office floors have 32 to 44, so
/// that it holds up to a quarter more than this; the test holds the whole hierarchy near it.
const HELD: u64 = size_of::<Triangle>() as u64 + 24;

/// Bytes for each triangle while the hierarchy is built, besides those that stay: their boxes (28), and about 24 of the tree
/// before it is flattened.
const BUILDING: u64 = 52;

/// Bytes of the program itself: stacks, buffers, what allocators and MPI keep. Small scenes peak at 4 MiB, with MPI at 5.
const PROGRAM: u64 = 6 << 20;

/// Bytes of a cluster besides the cluster: its owner, and while owners are found its size and place in their order.
const OWNERSHIP: u64 = 28;

/// Most pieces in which geometry is dealt out, and bytes of each: itself (32), its holder and weight (12), and as much again
/// of the latter, a copy and an order while they are dealt out.
const PIECES: (u64, u64) = (1 << 16, 96);

/// Bytes of a surface besides its colour: itself, its node and their names where outputs are made, what it covers on all ranks.
const SURFACE: u64 = (size_of::<Surface>() + size_of::<Node>() + 64) as u64;

/// Most bytes of light on their way to a file: of batches of 2 MiB one in order, one compressed and one that comes next, and
/// what compression takes.
const WRITING: u64 = 10 << 20;

/// Where a mesh lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshPlace {
    /// In the memory of the only rank.
    Heap,
    /// In files that all ranks of a machine map: no memory of theirs.
    Files,
}

impl Counts {
    /// Those of a mesh.
    pub fn of(mesh: &Mesh) -> Counts {
        let painted = size_of_val(&mesh.base_uv[..])
            + size_of_val(&mesh.emission_uv[..])
            + size_of_val(&mesh.vertex_colours[..])
            + size_of_val(&mesh.colours[..])
            + mesh.surface_colours.len() * size_of::<Colour>();
        Counts {
            triangles: mesh.facets.iter().map(Facet::triangle_count).sum(),
            facets: mesh.facets.len() as u64,
            patches: mesh.patch_count() as u64,
            elements: mesh.element_count() as u64,
            clusters: mesh.clusters.len() as u64,
            surfaces: mesh.surface_colours.len() as u64,
            painted: painted as u64,
        }
    }

    /// Bytes of the mesh.
    pub fn mesh_bytes(&self) -> u64 {
        self.facets * size::<Facet>()
            + (2 * self.patches + 1) * size::<u32>()
            + self.elements * size::<u32>()
            + self.clusters * size::<Cluster>()
            + self.painted
    }

    /// Bytes of the light.
    pub fn light_bytes(&self) -> u64 {
        self.elements * size::<ElementLight>()
            + self.patches * size::<PatchLight>()
            + self.clusters * size::<ClusterLight>()
    }

    /// Bytes of the hierarchy.
    pub fn hierarchy_bytes(&self) -> u64 {
        self.triangles * HELD
    }

    /// What a solve keeps: its own light, its share of the hierarchy, and of the mesh the clusters, or all where it is alone.
    /// With several shooters in flight geometry may move while shots still see it as it was.
    pub fn demand(&self, mesh: MeshPlace, shooters_in_flight: u32) -> Demand {
        let kept = match mesh {
            MeshPlace::Heap => self.mesh_bytes(),
            MeshPlace::Files => self.clusters * size::<Cluster>() + self.surfaces * size::<Colour>(),
        };
        let ownership = self.clusters * OWNERSHIP + self.facets.min(PIECES.0) * PIECES.1;
        Demand {
            everywhere: PROGRAM + kept + ownership + self.surfaces * SURFACE,
            // Beside the light the bits of valid samples, until they are told to all.
            owned: self.light_bytes() + self.elements * size::<u32>(),
            triangles: self.triangles,
            held: HELD,
            building: BUILDING,
            moved: if shooters_in_flight > 1 { HELD } else { 0 },
            writing: WRITING.min(5 * self.light_bytes()),
            ..Demand::default()
        }
    }
}

fn size<T>() -> u64 {
    size_of::<T>() as u64
}
