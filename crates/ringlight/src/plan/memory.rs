//! What a solve keeps in memory, counted from what is stored.

use crate::mesh::{Cluster, Colour, Facet, Mesh};
use crate::ring::Demand;
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
    /// Bytes of texture coordinates, vertex colours and colours of elements.
    pub painted: u64,
}

/// Bytes of the hierarchy's nodes for each triangle. The office has 20; the test holds the whole hierarchy near it.
const NODES: u64 = 24;

/// Bytes for each triangle while the hierarchy is built, besides those that stay: their boxes (28), and about 24 of the tree
/// before it is flattened.
const BUILDING: u64 = 52;

/// Bytes of the program itself: code, stacks, buffers, what allocators keep. Small scenes peak at 4 MiB; this leaves room.
const PROGRAM: u64 = 8 << 20;

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
            painted: painted as u64,
        }
    }

    /// Bytes of the mesh.
    pub fn mesh_bytes(&self) -> u64 {
        self.facets * size::<Facet>()
            + self.patches * size::<u32>()
            + self.elements * size::<u16>()
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
        self.triangles * (size::<Triangle>() + NODES)
    }

    /// What a solve keeps: every rank has the mesh, its own light, and its share of the hierarchy.
    pub fn demand(&self) -> Demand {
        Demand {
            everywhere: PROGRAM + self.mesh_bytes(),
            owned: self.light_bytes(),
            held: self.hierarchy_bytes(),
            building: self.triangles * BUILDING,
            ..Demand::default()
        }
    }
}

fn size<T>() -> u64 {
    size_of::<T>() as u64
}
