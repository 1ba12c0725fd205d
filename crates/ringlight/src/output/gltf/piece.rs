//! The triangles of a facet with their displayed light.

use super::look::{Kind, Look};
use crate::mesh::{Colour, Facet, Frame, NONE, Patch};
use crate::quantity::Rgb;
use crate::smooth::Smooth;
use crate::smooth::lattice::Lattice;
use crate::solution::Solution;
use glam::{DMat4, DVec2};
use ringlight_visibility::Layout;

/// What all pieces need.
pub struct Lit<'a> {
    /// The solution.
    pub solution: &'a Solution,
    /// Its interpolated light.
    pub smooth: Smooth<'a>,
    /// Display value of irradiance 1 on a white surface: exposure / π.
    pub scale: f32,
    /// Irradiance added to all that is displayed, W/m² or lux.
    pub ambient: Rgb,
}

/// Part of a facet: both lit sides, those elements that are of one kind.
#[derive(Default)]
pub struct Piece {
    /// Vertices.
    pub vertices: Vec<Vertex>,
    /// Corners of triangles, counter-clockwise seen from the lit side in the node's space.
    pub triangles: Vec<[u32; 3]>,
    /// Elements: area in m², and their first vertices.
    pub elements: Vec<(f64, [u32; 4])>,
}

/// A vertex in the node's space.
#[derive(Clone, Copy)]
pub struct Vertex {
    /// Position.
    pub position: [f32; 3],
    /// Display value by which the material's factor and texture are multiplied, not clipped, and alpha.
    pub colour: [f32; 4],
    /// Texture coordinates.
    pub uv: [f32; 2],
}

impl Piece {
    /// Of facet `number`, placed by `local` (mesh frame to node's space).
    pub fn new(lit: &Lit<'_>, number: u32, kind: Kind, look: &Look, local: &DMat4) -> Piece {
        let mut piece = Piece::default();
        let facet = &lit.solution.mesh.facets[number as usize];
        for back in [false, true].into_iter().take(1 + usize::from(facet.double_sided())) {
            piece.add_side(lit, facet, back, kind, look, local);
        }
        piece
    }

    fn add_side(&mut self, lit: &Lit<'_>, facet: &Facet, back: bool, kind: Kind, look: &Look, local: &DMat4) {
        let mesh = &lit.solution.mesh;
        let (frame, lattice) = (facet.frame(), Lattice::of(facet));
        let corner_count = Frame::corner_parameters(lattice.layout).len();
        let mirrored = back != (local.determinant() < 0.0);
        let (first_patch, first_element) = if back {
            (facet.first_back_patch, facet.first_back_element)
        } else {
            (facet.first_patch, facet.first_element)
        };
        // Elements of one colour, on one side of all walls, share their vertices.
        let sharing = kind == Kind::Reflecting || facet.colour == NONE;
        let mut shared = vec![NONE; lattice.vertex_count()];
        let mut patch: Option<Patch> = None;
        for cell in 0..lattice.cell_count() {
            let element = first_element + facet.find_element(lattice.middle(cell)).0;
            let id = first_patch + (element - first_element) / facet.elements_per_patch();
            if patch.as_ref().is_none_or(|p| p.id != id) {
                patch = Some(mesh.patch(id));
            }
            let Some(patch) = &patch else { continue };
            let colour = mesh.colour(patch, element);
            if Kind::of(&colour) != kind {
                continue;
            }
            let light = lit.smooth.corners(element);
            let own = !sharing || lit.smooth.is_split(element);
            let mut corners = [0; 4];
            for (k, vertex) in lattice.corners(cell).into_iter().enumerate().take(corner_count) {
                let slot = &mut shared[lattice.vertex_index(vertex)];
                if own || *slot == NONE {
                    let at = lattice.parameters(vertex);
                    let made = Vertex {
                        position: local.transform_point3(frame.at(at)).as_vec3().to_array(),
                        colour: displayed(lit, facet, &colour, light[k], look, at),
                        uv: texture_coordinates(lit, facet, look, at),
                    };
                    corners[k] = self.vertices.len() as u32;
                    if !own {
                        *slot = corners[k];
                    }
                    self.vertices.push(made);
                } else {
                    corners[k] = *slot;
                }
            }
            if corner_count == 3 {
                corners[3] = corners[2];
            }
            self.add_triangles(corners, corner_count, mirrored);
            self.elements.push((patch.element_area(element - patch.first_element), corners));
        }
    }

    fn add_triangles(&mut self, corners: [u32; 4], corner_count: usize, mirrored: bool) {
        for [a, b, c] in [[0, 1, 2], [0, 2, 3]].into_iter().take(corner_count - 2) {
            let triangle = [corners[a], corners[b], corners[c]];
            let [p, q, r] = triangle.map(|v| self.vertices[v as usize].position);
            // Too small for single precision in the node's space: nothing to see.
            if p != q && q != r && r != p {
                let [p, q, r] = triangle;
                self.triangles.push(if mirrored { [p, r, q] } else { triangle });
            }
        }
    }
}

/// What COLOR_0 says, before clipping.
fn displayed(lit: &Lit<'_>, facet: &Facet, colour: &Colour, light: Rgb, look: &Look, at: DVec2) -> [f32; 4] {
    let vertex = match look.vertex_colours && facet.vertex_colour != NONE {
        true => blend(facet.layout(), &lit.solution.mesh.vertex_colours[facet.vertex_colour as usize], at),
        false => [1.0; 4],
    };
    let rgb: Rgb = std::array::from_fn(|c| {
        let irradiance = light[c] + lit.ambient[c];
        let reflected = colour.reflectance[c] * irradiance;
        lit.scale
            * match look.emission {
                None => irradiance * vertex[c],
                Some(None) => reflected + colour.exitance[c],
                // The texture shows the emission; the little that is reflected brightens it.
                Some(Some(emission)) => {
                    let brighter =
                        if colour.exitance[c] > 0.0 { (reflected / colour.exitance[c]).min(1.0) } else { 0.0 };
                    std::f32::consts::PI * emission[c] * (1.0 + brighter)
                }
            }
    });
    let clean = |x: f32| if x.is_finite() { x.max(0.0) } else { 0.0 };
    [clean(rgb[0]), clean(rgb[1]), clean(rgb[2]), clean(vertex[3]).min(1.0)]
}

fn texture_coordinates(lit: &Lit<'_>, facet: &Facet, look: &Look, at: DVec2) -> [f32; 2] {
    if look.texture.is_none() {
        return [0.0; 2];
    }
    let mesh = &lit.solution.mesh;
    let (table, index) = match look.emission {
        None => (&mesh.base_uv, facet.base_uv),
        Some(_) => (&mesh.emission_uv, facet.emission_uv),
    };
    let uv = table.get(index as usize).map_or([0.0; 2], |corners| blend(facet.layout(), corners, at));
    uv.map(|x| if x.is_finite() { x } else { 0.0 })
}

/// Interpolates what stands at a facet's corners.
fn blend<const N: usize>(layout: Layout, corners: &[[f32; N]; 4], at: DVec2) -> [f32; N] {
    let (u, v) = (at.x, at.y);
    let weights = match layout {
        Layout::Quad => [(1.0 - u) * (1.0 - v), u * (1.0 - v), u * v, (1.0 - u) * v],
        Layout::Triangle => [1.0 - u - v, u, v, 0.0],
    };
    std::array::from_fn(|i| (0..4).map(|k| weights[k] * f64::from(corners[k][i])).sum::<f64>() as f32)
}
