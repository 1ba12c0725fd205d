//! The triangles of a facet with their displayed light.

use super::look::{Kind, Look};
use crate::mesh::{Colour, Facet, Frame, NONE, Patch};
use crate::quantity::Rgb;
use crate::smooth::sheet::Hanging;
use crate::smooth::{Smooth, between};
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
        for sheet in lit.smooth.sheets().of_facet(number) {
            piece.add_sheet(lit, facet, sheet, kind, look, local);
        }
        piece
    }

    fn add_sheet(&mut self, lit: &Lit<'_>, facet: &Facet, number: u32, kind: Kind, look: &Look, local: &DMat4) {
        let (mesh, sheets) = (&lit.solution.mesh, lit.smooth.sheets());
        let sheet = sheets.get(number);
        let (frame, lattice) = (facet.frame(), sheet.lattice);
        let corner_count = Frame::corner_parameters(lattice.layout).len();
        let mirrored = sheet.back != (local.determinant() < 0.0);
        // Elements of one colour, on one side of all walls, share their vertices.
        let sharing = kind == Kind::Reflecting || facet.colours[0] == NONE;
        let mut shared = vec![NONE; lattice.vertex_count()];
        let mut patch: Option<Patch> = None;
        for cell in 0..lattice.cell_count() {
            let element = sheets.element(number, cell);
            if patch.as_ref().is_none_or(|p| !p.elements().contains(&element)) {
                patch = Some(mesh.patch(mesh.patch_of(element)));
            }
            let Some(patch) = &patch else { continue };
            let colour = mesh.colour(patch, element);
            if Kind::of(&colour) != kind {
                continue;
            }
            let light = lit.smooth.corners(element);
            let own = !sharing || lit.smooth.is_split(element);
            let made = |at: DVec2, light: Rgb| Vertex {
                position: local.transform_point3(frame.at(at)).as_vec3().to_array(),
                colour: displayed(lit, facet, &colour, light, look, at),
                uv: texture_coordinates(lit, facet, look, at),
            };
            let mut corners = [0; 4];
            let vertices = lattice.corners(cell);
            for (k, vertex) in vertices.into_iter().enumerate().take(corner_count) {
                let slot = &mut shared[lattice.vertex_index(vertex)];
                if own || *slot == NONE {
                    corners[k] = self.add_vertex(made(sheet.parameters(vertex), light[k]));
                    if !own {
                        *slot = corners[k];
                    }
                } else {
                    corners[k] = *slot;
                }
            }
            if corner_count == 3 {
                corners[3] = corners[2];
            }
            // With the vertices that finer sheets have on its edges, so that there is no crack.
            let mut outline = Vec::with_capacity(corner_count);
            for k in 0..corner_count {
                let next = (k + 1) % corner_count;
                outline.push(corners[k]);
                for Hanging { along, sheet, vertex } in sheets.hanging(&sheet, [vertices[k], vertices[next]]) {
                    let light = match lit.smooth.is_split(element) {
                        true => between(light[k], light[next], along),
                        false => lit.smooth.vertex(sheet, vertex),
                    };
                    outline.push(self.add_vertex(made(sheets.get(sheet).parameters(vertex), light)));
                }
            }
            if outline.len() == corner_count {
                self.add_triangles(&outline, mirrored);
            } else {
                let at = sheet.tile(cell).at(Frame::middle(lattice.layout));
                let mean = |c: usize| light[..corner_count].iter().map(|l| l[c]).sum::<f32>() / corner_count as f32;
                let middle = self.add_vertex(made(at, std::array::from_fn(mean)));
                for k in 0..outline.len() {
                    self.add_triangles(&[middle, outline[k], outline[(k + 1) % outline.len()]], mirrored);
                }
            }
            self.elements.push((patch.element_area(element - patch.first_element), corners));
        }
    }

    fn add_vertex(&mut self, vertex: Vertex) -> u32 {
        self.vertices.push(vertex);
        self.vertices.len() as u32 - 1
    }

    /// Adds the triangles of a convex outline.
    fn add_triangles(&mut self, outline: &[u32], mirrored: bool) {
        for k in 2..outline.len() {
            let triangle = [outline[0], outline[k - 1], outline[k]];
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::fixture::{mixed, paint, read, solve_refined};
    use crate::output::gltf::texture::Textures;
    use glam::{DVec3, Vec3};
    use std::collections::HashMap;

    /// Distance from the border of a convex outline.
    fn off_border(corners: &[DVec3], point: DVec3) -> f64 {
        let to_edge = |k: usize| {
            let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
            (point - a).cross((b - a).normalize()).length()
        };
        (0..corners.len()).map(to_edge).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn where_patches_are_cut_differently_there_are_no_cracks_and_no_jumps() {
        let obj = "v 0 0 0\nv 3 0 0\nv 3 2 0\nv 0 2.5 0\nv 5 0 0\nv 8 0 0\nv 5 3 0\nusemtl grey\nf 1 2 3 4\nf 5 6 7\n";
        for (sizes, choices) in [([1.0, 0.5], [1, 2, 4]), ([0.5, 0.5], [1, 4, 2]), ([0.5, 0.5], [2, 3, 1])] {
            let mut solution = solve_refined(read(obj), sizes, 1.0, mixed(choices));
            paint(&mut solution, |p, n| 3.0 + p.x * p.x + p.x * p.y + n.z);
            let look = Look::new(&solution, 0, Kind::Reflecting, &[0, 1], &mut Textures::new(&solution));
            let (smooth, ambient) = (Smooth::new(&solution), [0.0; 3]);
            let lit = Lit { solution: &solution, smooth, scale: 0.01, ambient };
            for (number, facet) in (0..).zip(&solution.mesh.facets) {
                let piece = Piece::new(&lit, number, Kind::Reflecting, &look, &DMat4::IDENTITY);
                // A light for each place on each side, and each edge once in either direction.
                let mut light: HashMap<(bool, [u32; 3]), f32> = HashMap::new();
                let mut edges: HashMap<(bool, [[u32; 3]; 2]), u32> = HashMap::new();
                let mut area = 0.0;
                for triangle in &piece.triangles {
                    let vertices = triangle.map(|v| piece.vertices[v as usize]);
                    let [a, b, c] = vertices.map(|v| Vec3::from(v.position));
                    let normal = (b - a).cross(c - a);
                    let front = normal.z > 0.0;
                    assert!(normal.length() > 1e-6, "a triangle without an area");
                    area += f64::from(normal.length()) / 2.0;
                    let keys = vertices.map(|v| v.position.map(|x| (x + 0.0).to_bits()));
                    for k in 0..3 {
                        *edges.entry((front, [keys[k], keys[(k + 1) % 3]])).or_default() += 1;
                        let known = *light.entry((front, keys[k])).or_insert(vertices[k].colour[0]);
                        let jump = (known - vertices[k].colour[0]).abs();
                        assert!(jump < 1e-5 * known.max(0.1), "{sizes:?}: {jump} of {known}");
                    }
                }
                assert!((area / (2.0 * facet.frame().area_vector().length()) - 1.0).abs() < 1e-5);
                let (corners, count) = facet.frame().corners();
                for (&(front, [from, to]), &times) in &edges {
                    let [a, b] = [from, to].map(|p| Vec3::from(p.map(f32::from_bits)).as_dvec3());
                    let middle = (a + b) / 2.0;
                    let closed = edges.contains_key(&(front, [to, from]));
                    assert!(
                        times == 1 && (closed || off_border(&corners[..count], middle) < 1e-5),
                        "a crack at {middle}"
                    );
                }
            }
        }
    }
}
