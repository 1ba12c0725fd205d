//! Surface → patches → elements → sample points, clusters, plane ids.
//!
//! Input triangles are paired into planar convex quadrilaterals where they can be; these *facets* are stored. A facet is
//! cut on a regular grid into patches, a patch on a regular grid into elements, finer where it is refined: both are computed
//! from the facet when needed. Facets are ordered so that neighbours in space and direction follow each other; a *cluster* is a run of
//! patches, formed from the scene alone.

mod build;
mod check;
mod cluster;
mod colour;
mod discontinuity;
mod facet;
mod frame;
mod inquiry;
mod look;
mod occluders;
mod pairing;
mod plane;
mod refine;
mod shared;
mod sides;
mod size;
#[cfg(test)]
mod tests;
mod validity;
pub mod walk;

pub use build::{MeshOptions, build};
pub use colour::Colour;
pub use facet::Facet;
pub use frame::{Frame, Tile};
pub use inquiry::{Answer, Inquiry, Mailbox, Question, at_once};
pub use look::{LookAbout, View};
pub use occluders::{CLEAR_COVERAGE, FacetCoverage, OPAQUE_COVERAGE, Occluder, hierarchy, hierarchy_of};
pub use plane::{Planes, RELATIVE_TOLERANCE};
pub use shared::SharedError;
pub use size::{Quality, Sizes};
pub use validity::{
    area_samples, find_valid_samples, free_share, is_hidden_beside, look_outs, sample_parameters, valid_samples,
};

use crate::column::Column;
use crate::scene::Warnings;
use glam::{DVec2, DVec3, Vec3};
use ringlight_visibility::{Hit, Ray};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Absent index.
pub const NONE: u32 = u32::MAX;

/// The bit of an element's middle among its valid samples; those below are of its sixteen parts.
pub const MIDDLE: u32 = 16;

/// All sixteen samples of an element are valid, and its middle.
pub const ALL_VALID: u32 = (2 << MIDDLE) - 1;

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
    /// For each patch its first element, and at the end the number of elements.
    pub first_elements: Column<u32>,
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
    pub valid: Column<u32>,
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

/// Whether a point has the light of its element.
#[derive(Clone, Copy, Debug)]
pub enum Holding {
    /// It does: it lies in a free sample, or its element has none.
    Sure,
    /// It lies beside a free sample: it does if nothing is on the way to where the element's light was found.
    IfFree(Ray),
    /// It lies far from all free samples: deep in a crack.
    Dark,
}

/// Points nearer to the middle of a free sample than this share of the element's width lie beside it. Samples are a quarter apart: of
/// one whose middle is covered, what is open lies in the half beside a free one.
const BESIDE: f64 = 0.3;

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
        let (number, back) = self.side_of(id);
        let facet = &self.facets[number as usize];
        let tile = facet.patch_tile(id - facet.patch_range(back).start);
        let frame = facet.frame().tile(tile);
        let area_vector = frame.area_vector();
        let area = area_vector.length();
        let normal = area_vector / area;
        let elements = self.elements_of(id);
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
            grid: facet.element_grid(elements.len() as u32),
        }
    }

    /// The facet of patch `id`, and whether it is on the facet's back.
    pub fn side_of(&self, id: u32) -> (u32, bool) {
        let code = self.patch_facets[id as usize];
        (code >> 1, code & 1 == 1)
    }

    /// Elements of patch `id`: those of [`Patch::elements`], without its geometry.
    pub fn elements_of(&self, id: u32) -> Range<u32> {
        self.first_elements[id as usize]..self.first_elements[id as usize + 1]
    }

    /// Elements of a lit side of a facet.
    pub fn side_elements(&self, facet: &Facet, back: bool) -> Range<u32> {
        let Range { start, end } = facet.patch_range(back);
        self.first_elements[start as usize]..self.first_elements[end as usize]
    }

    /// The patch that holds an element.
    pub fn patch_of(&self, element: u32) -> u32 {
        self.first_elements.partition_point(|&first| first <= element) as u32 - 1
    }

    /// Into how many parts each side of an unrefined element of patch `id` is cut: 1 where the patch is not refined.
    pub fn subdivision(&self, id: u32) -> u32 {
        self.facets[self.side_of(id).0 as usize].subdivision(self.elements_of(id).len() as u32)
    }

    /// The subdivision of all patches of a lit side, if it is the same.
    pub fn common_subdivision(&self, facet: &Facet, back: bool) -> Option<u32> {
        let patches = facet.patch_range(back);
        let count = |id: u32| self.elements_of(id).len();
        patches.clone().all(|id| count(id) == count(patches.start)).then(|| self.subdivision(patches.start))
    }

    /// The patch and the element at parameters `at` of a lit side of a facet, and the parameters within the element.
    pub fn find_element(&self, facet: &Facet, back: bool, at: DVec2) -> (u32, u32, DVec2) {
        let (place, within) = Tile::find(facet.layout(), facet.patches.map(u32::from), at);
        let patch = facet.patch_at(back, place);
        let elements = self.elements_of(patch);
        let (element, within) = Tile::find(facet.layout(), facet.element_grid(elements.len() as u32), within);
        (patch, elements.start + element, within)
    }

    /// Colour of element `element` of `patch`.
    pub fn colour(&self, patch: &Patch, element: u32) -> Colour {
        let facet = &self.facets[patch.facet as usize];
        let first = facet.colours[usize::from(patch.back)];
        if first == NONE {
            return self.surface_colours[facet.surface as usize];
        }
        self.colours[(first + (element - self.side_elements(facet, patch.back).start)) as usize]
    }

    /// Share of element `element` that lies free of other geometry.
    pub fn valid_share(&self, element: u32) -> f64 {
        free_share(self.valid[element as usize])
    }

    /// The element that a ray hits, and where within it; none if it hits an unlit back.
    pub fn element_at(&self, ray: &Ray, hit: Hit) -> Option<(u32, DVec2)> {
        let facet = &self.facets[(hit.triangle >> 1) as usize];
        let lit = hit.front || facet.double_sided();
        lit.then(|| {
            let (_, element, within) = self.find_element(facet, !hit.front, facet.parameters_at(ray, &hit));
            (element, within)
        })
    }

    /// Whether a point of an element has the element's light.
    pub fn holding(&self, element: u32, within: DVec2) -> Holding {
        let valid = self.valid[element as usize];
        if valid == 0 || valid == ALL_VALID {
            return Holding::Sure;
        }
        let patch = self.patch(self.patch_of(element));
        let layout = patch.frame.layout;
        if valid >> Tile::find(layout, [4, 4], within).0 & 1 == 1 {
            return Holding::Sure;
        }
        let middle = Frame::middle(layout);
        let beside = |s| (Tile::of(layout, [4, 4], s).at(middle) - within).length() < BESIDE;
        let Some(to) = sample_parameters(layout, valid).filter(|_| area_samples(valid).any(beside)) else {
            return Holding::Dark;
        };
        let tile = patch.element_tile(element - patch.first_element);
        let [from, to] = [within, to].map(|at| patch.frame.at(tile.at(at)));
        Holding::IfFree(sides::across(&patch, from, to))
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

    /// Where light is evaluated on its `k`-th element: its middle, or, where that is covered by other geometry, the free sample
    /// nearest to it. None if all are covered.
    pub fn sample_point(&self, k: u32, valid: u32) -> Option<DVec3> {
        let at = sample_parameters(self.frame.layout, valid)?;
        Some(self.frame.at(self.element_tile(k).at(at)))
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
