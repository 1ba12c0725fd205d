//! What is stored of the geometry: facets, and how patches lie in them.

use super::{Frame, NONE, Tile};
use bytemuck::{Pod, Zeroable};
use glam::{DVec2, DVec3, Vec3};
use ringlight_visibility::{Hit, Layout, Ray};
use std::ops::Range;

/// A flat triangle or convex quadrilateral of the input; cut into patches on a grid.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Facet {
    /// Corners, metres, relative to [`super::Mesh::origin`], counter-clockwise seen from the front; a triangle repeats corner 0
    /// as corner 3.
    pub corners: [Vec3; 4],
    /// Index into the scene's surfaces.
    pub surface: u32,
    /// Plane id; coplanar facets share it.
    pub plane: u32,
    /// First patch of the front.
    pub first_patch: u32,
    /// First patch of the back, or [`NONE`] if the back is unlit.
    pub first_back_patch: u32,
    /// Index into [`super::Mesh::base_uv`], or [`NONE`].
    pub base_uv: u32,
    /// Index into [`super::Mesh::emission_uv`], or [`NONE`].
    pub emission_uv: u32,
    /// Index into [`super::Mesh::vertex_colours`], or [`NONE`].
    pub vertex_colour: u32,
    /// Where the colours of the elements of the front and of the back begin in [`super::Mesh::colours`]: at the same place if both
    /// sides are cut alike. [`NONE`] if all of them have the surface's colour [`super::Mesh::surface_colours`].
    pub colours: [u32; 2],
    /// Columns and rows of patches.
    pub patches: [u16; 2],
    /// Columns and rows of elements in a patch that is not refined.
    pub elements: [u16; 2],
    /// 1 if it is part of a facet of the input that was cut along lines, else 0.
    pub part: u32,
}

/// A quadrilateral is a parallelogram if opposite sides differ by less than this share of its diagonal.
const STRAIGHT: f32 = 1e-5;

impl Facet {
    /// Quadrilateral or triangle.
    pub fn layout(&self) -> Layout {
        if self.corners[3] == self.corners[0] { Layout::Triangle } else { Layout::Quad }
    }

    /// Its corners, three or four, in order.
    pub fn outline(&self) -> Vec<Vec3> {
        self.corners[..if self.layout() == Layout::Triangle { 3 } else { 4 }].to_vec()
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

    /// The parameters of the point where a ray hits.
    pub fn parameters_at(&self, ray: &Ray, hit: &Hit) -> DVec2 {
        let [a, b, c, d] = self.corners;
        let [second, third] = hit.barycentric.map(f64::from);
        let at = match self.layout() {
            Layout::Triangle => DVec2::new(second, third),
            Layout::Quad if ((c - b) - (d - a)).abs().max_element() > STRAIGHT * (c - a).abs().max_element() => {
                let [origin, direction] = [ray.origin, ray.direction].map(|v| DVec3::from(v.map(f64::from)));
                self.frame().parameters(origin + f64::from(hit.distance) * direction)
            }
            // Of its two triangles, see [`super::hierarchy`].
            Layout::Quad if hit.triangle & 1 == 0 => DVec2::new(second + third, third),
            Layout::Quad => DVec2::new(second, second + third),
        };
        at.clamp(DVec2::ZERO, DVec2::ONE)
    }

    /// Number of patches of one side.
    pub fn patch_count(&self) -> u32 {
        u32::from(self.patches[0]) * u32::from(self.patches[1])
    }

    /// Number of elements of one side if no patch is refined.
    pub fn unrefined_count(&self) -> u32 {
        self.patch_count() * self.elements.map(u32::from).iter().product::<u32>()
    }

    /// Whether both sides are lit.
    pub fn double_sided(&self) -> bool {
        self.first_back_patch != NONE
    }

    /// Into how many parts each side of an unrefined element is cut in a patch of `count` elements: 1 if it is not refined.
    pub fn subdivision(&self, count: u32) -> u32 {
        let [columns, rows] = self.elements.map(u32::from);
        match count / (columns * rows) {
            1 => 1,
            parts => parts.isqrt(),
        }
    }

    /// Columns and rows of elements in a patch that has `count` of them.
    pub fn element_grid(&self, count: u32) -> [u32; 2] {
        self.elements.map(|n| u32::from(n) * self.subdivision(count))
    }

    /// The lit sides: false for the front, true for the back.
    pub fn sides(&self) -> impl Iterator<Item = bool> + use<> {
        [false, true].into_iter().take(1 + usize::from(self.double_sided()))
    }

    /// The patches of a lit side.
    pub fn patch_range(&self, back: bool) -> Range<u32> {
        let first = if back { self.first_back_patch } else { self.first_patch };
        first..first + self.patch_count()
    }

    /// Tile of patch `k` (0 is the side's first).
    pub fn patch_tile(&self, k: u32) -> Tile {
        Tile::of(self.layout(), self.patches.map(u32::from), self.place_in_grid(k))
    }

    /// Place of patch `k` (0 is the side's first) in the grid of patches, as [`Tile::of`] numbers them.
    pub fn place_in_grid(&self, k: u32) -> u32 {
        storage_to_grid(self.layout(), self.patches.map(u32::from), k)
    }

    /// The patch of a side at a place in the grid of patches: the inverse of [`Facet::place_in_grid`].
    pub fn patch_at(&self, back: bool, place: u32) -> u32 {
        self.patch_range(back).start + grid_to_storage(self.layout(), self.patches.map(u32::from), place)
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
