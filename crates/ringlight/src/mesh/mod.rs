//! Surface → patches → elements → sample points, clusters, plane ids.
//!
//! Input triangles are paired into planar convex quadrilaterals where they can be; these *facets* are stored. A facet is
//! cut on a regular grid into patches, a patch on a regular grid into elements: both are computed from the facet when
//! needed. Facets are ordered so that neighbours in space and direction follow each other; a *cluster* is a run of
//! patches, formed from the scene alone.

mod build;
mod cluster;
mod colour;
mod frame;
mod inquiry;
mod look;
mod occluders;
mod pairing;
mod plane;
mod shared;
mod size;
#[cfg(test)]
mod tests;
mod validity;
pub mod walk;

pub use build::{MeshOptions, build};
pub use colour::Colour;
pub use frame::{Frame, Tile};
pub use inquiry::{Answer, Inquiry, Mailbox, Question, at_once};
pub use look::{LookAbout, View};
pub use occluders::{CLEAR_COVERAGE, FacetCoverage, OPAQUE_COVERAGE, Occluder, hierarchy, hierarchy_of};
pub use plane::{Planes, RELATIVE_TOLERANCE};
pub use shared::SharedError;
pub use size::{Quality, Sizes};
pub use validity::{find_valid_samples, is_hidden_beside, look_about, look_outs, sample_parameters, valid_samples};

use crate::column::Column;
use crate::scene::Warnings;
use bytemuck::{Pod, Zeroable};
use glam::{DVec2, DVec3, Vec3};
use ringlight_visibility::{Hit, Layout, Ray};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Absent index.
pub const NONE: u32 = u32::MAX;

/// All sixteen samples of an element are valid.
pub const ALL_VALID: u16 = u16::MAX;

/// A flat triangle or convex quadrilateral of the input; cut into patches on a grid.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Facet {
    /// Corners, metres, relative to [`Mesh::origin`], counter-clockwise seen from the front; a triangle repeats corner 0
    /// as corner 3.
    pub corners: [Vec3; 4],
    /// Index into the scene's surfaces.
    pub surface: u32,
    /// Plane id; coplanar facets share it.
    pub plane: u32,
    /// First patch of the front; the back's patches start at `first_back_patch`, or [`NONE`] if the back is unlit.
    pub first_patch: u32,
    /// First patch of the back, or [`NONE`].
    pub first_back_patch: u32,
    /// First element of the front.
    pub first_element: u32,
    /// First element of the back, or [`NONE`].
    pub first_back_element: u32,
    /// Index into [`Mesh::base_uv`], [`Mesh::emission_uv`] and [`Mesh::colours`], or [`NONE`].
    pub base_uv: u32,
    /// Index into [`Mesh::emission_uv`], or [`NONE`].
    pub emission_uv: u32,
    /// Index into [`Mesh::vertex_colours`], or [`NONE`].
    pub vertex_colour: u32,
    /// Index of the colours of this facet's elements in [`Mesh::colours`], shared by both sides, or [`NONE`] if all of
    /// them have the surface's colour [`Mesh::surface_colours`].
    pub colour: u32,
    /// Columns and rows of patches.
    pub patches: [u16; 2],
    /// Columns and rows of elements in a patch.
    pub elements: [u16; 2],
}

/// Discretised surfaces of a scene.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// What was subtracted from world coordinates, metres.
    pub origin: [f64; 3],
    /// Length of the diagonal of the scene's box, metres.
    pub diagonal: f64,
    /// Sizes in force.
    pub sizes: Sizes,
    /// Facets in cluster order.
    pub facets: Column<Facet>,
    /// For each patch: twice its facet, plus 1 for the back.
    pub patch_facets: Column<u32>,
    /// Clusters in order.
    pub clusters: Vec<Cluster>,
    /// Base texture coordinates of the corners of textured facets.
    pub base_uv: Column<[[f32; 2]; 4]>,
    /// Emission texture coordinates of the corners.
    pub emission_uv: Column<[[f32; 2]; 4]>,
    /// Vertex colours of the corners, linear RGBA.
    pub vertex_colours: Column<[[f32; 4]; 4]>,
    /// Colours of elements that differ from their surface's.
    pub colours: Column<Colour>,
    /// Colour of each surface.
    pub surface_colours: Vec<Colour>,
    /// For each element, which of its sixteen samples (the tiles of a 4 × 4 grid) lie free of other geometry.
    pub valid: Column<u16>,
    /// What light passes through.
    pub occluder: Occluder,
    /// What was changed or left out at meshing.
    pub warnings: Warnings,
    /// Triangles left out, by reason.
    pub skipped: Vec<(String, u64)>,
}

/// A run of neighbouring patches with similar normals: the unit of decisions and of ownership.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cluster {
    /// Patches.
    pub patches: Range<u32>,
    /// Their elements.
    pub elements: Range<u32>,
    /// Box around them, metres.
    pub low: Vec3,
    /// Upper corner of the box.
    pub high: Vec3,
}

/// A patch, computed from its facet.
#[derive(Clone, Copy, Debug)]
pub struct Patch {
    /// Number of the patch.
    pub id: u32,
    /// Number of its facet.
    pub facet: u32,
    /// Whether it is the facet's back.
    pub back: bool,
    /// The patch within the facet.
    pub tile: Tile,
    /// Geometry; counter-clockwise about the *facet's* front, whichever side the patch is.
    pub frame: Frame,
    /// Unit normal of the lit side.
    pub normal: DVec3,
    /// Area, m².
    pub area: f64,
    /// Plane id.
    pub plane: u32,
    /// First element.
    pub first_element: u32,
    /// Columns and rows of elements.
    pub grid: [u32; 2],
}

impl Facet {
    /// Quadrilateral or triangle.
    pub fn layout(&self) -> Layout {
        if self.corners[3] == self.corners[0] { Layout::Triangle } else { Layout::Quad }
    }

    /// Triangles that it is made of: one, or two.
    pub fn triangle_count(&self) -> u64 {
        if self.layout() == Layout::Triangle { 1 } else { 2 }
    }

    /// Geometry.
    pub fn frame(&self) -> Frame {
        let corners = self.corners.map(|c| c.as_dvec3());
        match self.layout() {
            Layout::Quad => Frame::from_corners(&corners),
            Layout::Triangle => Frame::from_corners(&corners[..3]),
        }
    }

    /// Number of patches of one side.
    pub fn patch_count(&self) -> u32 {
        u32::from(self.patches[0]) * u32::from(self.patches[1])
    }

    /// Number of elements of one patch.
    pub fn elements_per_patch(&self) -> u32 {
        u32::from(self.elements[0]) * u32::from(self.elements[1])
    }

    /// Number of elements of one side.
    pub fn element_count(&self) -> u32 {
        self.patch_count() * self.elements_per_patch()
    }

    /// Whether both sides are lit.
    pub fn double_sided(&self) -> bool {
        self.first_back_patch != NONE
    }

    /// Tile of patch `k` (0 is the side's first).
    pub fn patch_tile(&self, k: u32) -> Tile {
        let grid = self.patches.map(u32::from);
        Tile::of(self.layout(), grid, storage_to_grid(self.layout(), grid, k))
    }

    /// The element number (0 is the side's first) at facet parameters `at`, and the parameters within the element.
    pub fn find_element(&self, at: DVec2) -> (u32, DVec2) {
        let grid = self.patches.map(u32::from);
        let (tile, within) = Tile::find(self.layout(), grid, at);
        let patch = grid_to_storage(self.layout(), grid, tile);
        let (element, within) = Tile::find(self.layout(), self.elements.map(u32::from), within);
        (patch * self.elements_per_patch() + element, within)
    }
}

/// Columns of patches that are stored together: keeps runs of patches compact.
const BLOCK: u32 = 4;

/// Patches of a quadrilateral are stored in blocks of [`BLOCK`] columns, row by row: place in store → place in grid.
fn storage_to_grid(layout: Layout, grid: [u32; 2], k: u32) -> u32 {
    if layout == Layout::Triangle {
        return k;
    }
    let first = k / (BLOCK * grid[1]) * BLOCK;
    let width = BLOCK.min(grid[0] - first);
    let rest = k - first * grid[1];
    rest / width * grid[0] + first + rest % width
}

/// The inverse of [`storage_to_grid`].
fn grid_to_storage(layout: Layout, grid: [u32; 2], k: u32) -> u32 {
    if layout == Layout::Triangle {
        return k;
    }
    let (column, row) = (k % grid[0], k / grid[0]);
    let first = column / BLOCK * BLOCK;
    let width = BLOCK.min(grid[0] - first);
    first * grid[1] + row * width + column - first
}

impl Mesh {
    /// Number of patches.
    pub fn patch_count(&self) -> usize {
        self.patch_facets.len()
    }

    /// Number of elements.
    pub fn element_count(&self) -> usize {
        self.valid.len()
    }

    /// Patch `id`.
    pub fn patch(&self, id: u32) -> Patch {
        let (number, back, index, elements) = self.place_of(id);
        let facet = &self.facets[number as usize];
        let tile = facet.patch_tile(index);
        let frame = facet.frame().tile(tile);
        let area_vector = frame.area_vector();
        let area = area_vector.length();
        let normal = area_vector / area;
        Patch {
            id,
            facet: number,
            back,
            tile,
            frame,
            normal: if back { -normal } else { normal },
            area,
            plane: facet.plane,
            first_element: elements.start,
            grid: facet.elements.map(u32::from),
        }
    }

    /// Elements of patch `id`: those of [`Patch::elements`], without its geometry.
    pub fn elements_of(&self, id: u32) -> Range<u32> {
        self.place_of(id).3
    }

    /// The facet of patch `id`, whether it is on the facet's back, its number there, and its elements.
    fn place_of(&self, id: u32) -> (u32, bool, u32, Range<u32>) {
        let code = self.patch_facets[id as usize];
        let (number, back) = (code >> 1, code & 1 == 1);
        let facet = &self.facets[number as usize];
        let (first_patch, first_element) = if back {
            (facet.first_back_patch, facet.first_back_element)
        } else {
            (facet.first_patch, facet.first_element)
        };
        let (index, count) = (id - first_patch, facet.elements_per_patch());
        let first = first_element + index * count;
        (number, back, index, first..first + count)
    }

    /// Colour of element `element` of `patch`.
    pub fn colour(&self, patch: &Patch, element: u32) -> Colour {
        let facet = &self.facets[patch.facet as usize];
        if facet.colour == NONE {
            return self.surface_colours[facet.surface as usize];
        }
        let first = if patch.back { facet.first_back_element } else { facet.first_element };
        self.colours[(facet.colour + (element - first)) as usize]
    }

    /// Share of element `element` that lies free of other geometry.
    pub fn valid_share(&self, element: u32) -> f64 {
        f64::from(self.valid[element as usize].count_ones()) / 16.0
    }

    /// Whether all numbers refer to something that is there; for meshes read from files.
    pub fn check(&self) -> Result<(), String> {
        let within = |index: u32, len: usize| index == NONE || (index as usize) < len;
        let mut elements = 0u64;
        for (f, facet) in self.facets.iter().enumerate() {
            let count = |n: [u16; 2]| u64::from(n[0]) * u64::from(n[1]);
            let sides = if facet.double_sided() { 2 } else { 1 };
            let one = count(facet.patches) * count(facet.elements);
            elements += one * sides;
            let colours_end = u64::from(facet.colour) + one;
            let fine = one > 0
                && (facet.surface as usize) < self.surface_colours.len()
                && within(facet.base_uv, self.base_uv.len())
                && within(facet.emission_uv, self.emission_uv.len())
                && within(facet.vertex_colour, self.vertex_colours.len())
                && (facet.colour == NONE || colours_end <= self.colours.len() as u64)
                && facet.corners.iter().all(|c| c.is_finite());
            if !fine {
                return Err(format!("facet {f} refers to what is not there"));
            }
        }
        let runs = self
            .clusters
            .windows(2)
            .all(|w| w[0].patches.end == w[1].patches.start && w[0].elements.end == w[1].elements.start);
        let ends = self.clusters.first().zip(self.clusters.last()).is_some_and(|(a, b)| {
            (a.patches.start, a.elements.start) == (0, 0)
                && b.patches.end as usize == self.patch_facets.len()
                && b.elements.end as usize == self.valid.len()
        });
        let ordered =
            self.clusters.iter().all(|c| c.patches.start < c.patches.end && c.elements.start < c.elements.end);
        if !(runs && ends && ordered) || elements != self.valid.len() as u64 {
            return Err("clusters do not cover the elements".into());
        }
        let total = self.valid.len() as u64;
        let belongs = |(id, &code): (usize, &u32)| {
            let Some(facet) = self.facets.get((code >> 1) as usize) else { return false };
            let (patch, element) = match code & 1 {
                0 => (facet.first_patch, facet.first_element),
                _ => (facet.first_back_patch, facet.first_back_element),
            };
            let last = u64::from(element) + u64::from(facet.element_count());
            (id as u64).checked_sub(patch.into()).is_some_and(|k| k < facet.patch_count().into()) && last <= total
        };
        if !self.patch_facets.iter().enumerate().all(belongs) {
            return Err("a patch refers to a facet that is not there".into());
        }
        Ok(())
    }

    /// The element that a ray hits; none if it hits an unlit back.
    pub fn element_at(&self, ray: &Ray, hit: Hit) -> Option<u32> {
        let facet = &self.facets[(hit.triangle >> 1) as usize];
        let first = if hit.front { facet.first_element } else { facet.first_back_element };
        let [origin, direction] = [ray.origin, ray.direction].map(|v| DVec3::from(v.map(f64::from)));
        let at = facet.frame().parameters(origin + f64::from(hit.distance) * direction);
        (first != NONE).then(|| first + facet.find_element(at.clamp(DVec2::ZERO, DVec2::ONE)).0)
    }

    /// The cluster that holds patch `id`.
    pub fn cluster_of(&self, id: u32) -> usize {
        self.clusters.partition_point(|c| c.patches.end <= id)
    }

    /// Position in the world of a position in mesh coordinates.
    pub fn to_world(&self, p: DVec3) -> DVec3 {
        p + DVec3::from(self.origin)
    }
}

impl Patch {
    /// Number of elements.
    pub fn element_count(&self) -> u32 {
        self.grid[0] * self.grid[1]
    }

    /// Its elements.
    pub fn elements(&self) -> Range<u32> {
        self.first_element..self.first_element + self.element_count()
    }

    /// Area of its `k`-th element, m².
    pub fn element_area(&self, k: u32) -> f64 {
        if self.frame.twist == DVec3::ZERO {
            self.area / f64::from(self.element_count())
        } else {
            self.frame.tile(self.element_tile(k)).area_vector().length()
        }
    }

    /// Tile of its `k`-th element within the patch.
    pub fn element_tile(&self, k: u32) -> Tile {
        Tile::of(self.frame.layout, self.grid, k)
    }

    /// Where light is evaluated on its `k`-th element: its middle, or, when the samples there are covered by other
    /// geometry, the free sample nearest to the middle. None if all are covered.
    pub fn sample_point(&self, k: u32, valid: u16) -> Option<DVec3> {
        let tile = self.element_tile(k);
        let (order, innermost) = validity::order(self.frame.layout);
        if valid & innermost == innermost {
            return Some(self.frame.at(tile.at(Frame::middle(self.frame.layout))));
        }
        let sample = *order.iter().find(|&&s| valid >> s & 1 == 1)?;
        Some(self.area_sample(&tile, sample.into()))
    }

    /// Whether the surface at parameters `at` of the patch is covered by other geometry.
    pub fn is_covered(&self, mesh: &Mesh, at: DVec2) -> bool {
        let layout = self.frame.layout;
        let (element, within) = Tile::find(layout, self.grid, at);
        let sample = Tile::find(layout, [4, 4], within).0;
        mesh.valid[(self.first_element + element) as usize] >> sample & 1 == 0
    }

    /// Position of sample `sample` (0 to 15) of the element over `tile`.
    pub fn area_sample(&self, tile: &Tile, sample: u32) -> DVec3 {
        let inner = Tile::of(self.frame.layout, [4, 4], sample);
        self.frame.at(tile.compose(inner).at(Frame::middle(self.frame.layout)))
    }
}
