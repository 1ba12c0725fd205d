//! The lit model: what is written, in two passes. The first counts, so that the document can come before the data; the
//! second makes the data piece by piece, so that memory does not hold it.

use super::look::{Kind, Look};
use super::nodes;
use super::piece::{Lit, Piece};
use super::texture::Textures;
use crate::mesh::{Mesh, NONE};
use crate::quantity::Rgb;
use crate::smooth::sheet::of_patches;
use glam::{DMat4, DVec3};
use rayon::prelude::*;
use ringlight_visibility::Layout;
use serde_json::{Value, json};
use std::io::{self, Write};

/// Elements of pieces held at a time.
const BATCH: u32 = 1 << 14;

/// One primitive: the elements of one kind of one surface.
pub struct Primitive {
    surface: u32,
    kind: Kind,
    look: Look,
    divisors: Rgb,
    facets: Vec<u32>,
    /// Mesh frame to the node's space.
    local: DMat4,
    /// Whether the node's transformation has no inverse: the primitive then stands in world space, outside of it.
    detached: bool,
    vertices: u64,
    triangles: u64,
    low: [f32; 3],
    high: [f32; 3],
    material: usize,
}

/// All that is written.
pub struct Model<'a> {
    lit: &'a Lit<'a>,
    textures: Textures<'a>,
    primitives: Vec<Primitive>,
    materials: Vec<Value>,
}

/// Bytes of a vertex without texture coordinates: position 3 × f32, colour 4 × u16.
const PLAIN_VERTEX: u64 = 20;

/// Vertices of which there may be, so that an index takes 2 bytes. The largest value of its type is kept free, as glTF asks.
const SHORT_INDICES: u64 = 65_535;

/// Least length of the binary data of a mesh's model: without texture coordinates, and with no vertex more than the corners of
/// its facets' grids before they are refined.
pub fn least_length(mesh: &Mesh) -> u64 {
    // Vertices, triangles, and whether all elements have the surface's colour: then they are one primitive.
    let mut surfaces = vec![(0u64, 0u64, true); mesh.surface_colours.len()];
    for facet in &mesh.facets {
        let (lattice, sides) = (of_patches(facet).refined(facet.elements.map(u32::from)), facet.sides().count() as u64);
        let halves = if lattice.layout == Layout::Quad { 2 } else { 1 };
        let (vertices, triangles, plain) = &mut surfaces[facet.surface as usize];
        *vertices += sides * lattice.vertex_count() as u64;
        *triangles += sides * halves * u64::from(lattice.cell_count());
        *plain &= facet.colours[0] == NONE;
    }
    let bytes = |&(vertices, triangles, plain): &(u64, u64, bool)| {
        vertices * PLAIN_VERTEX + triangles * 3 * if plain && vertices > SHORT_INDICES { 4 } else { 2 }
    };
    surfaces.iter().map(bytes).sum()
}

/// Areas found while writing, m².
#[derive(Clone, Copy, Debug, Default)]
pub struct Clipping {
    lit: f64,
    clipped: f64,
}

impl<'a> Model<'a> {
    /// First pass.
    pub fn new(lit: &'a Lit<'a>) -> io::Result<Model<'a>> {
        let solution = lit.solution;
        let mut model = Model { lit, textures: Textures::new(solution), primitives: vec![], materials: vec![] };
        let mut of_surface: Vec<Vec<u32>> = vec![Vec::new(); solution.description.surfaces.len()];
        for (f, facet) in solution.mesh.facets.iter().enumerate() {
            if let Some(list) = of_surface.get_mut(facet.surface as usize) {
                list.push(f as u32);
            }
        }
        for (surface, facets) in of_surface.into_iter().enumerate().filter(|(_, f)| !f.is_empty()) {
            for kind in [Kind::Reflecting, Kind::Emitting] {
                if let Some(primitive) = model.measure(surface as u32, kind, &facets)? {
                    model.primitives.push(primitive);
                }
            }
        }
        if model.primitives.is_empty() {
            return Err(io::Error::other("no triangle is large enough to be written as glTF"));
        }
        Ok(model)
    }

    fn measure(&mut self, surface: u32, kind: Kind, facets: &[u32]) -> io::Result<Option<Primitive>> {
        let solution = self.lit.solution;
        let node = solution.description.surfaces[surface as usize].node;
        let placed = solution.description.nodes.get(node as usize).and_then(|n| inverse(&n.world));
        let origin = DMat4::from_translation(DVec3::from(solution.mesh.origin));
        let mut missing = Textures::new(solution);
        let mut primitive = Primitive {
            surface,
            kind,
            look: Look::new(solution, surface, kind, facets, &mut missing),
            divisors: [1.0; 3],
            facets: facets.to_vec(),
            local: placed.unwrap_or(DMat4::IDENTITY) * origin,
            detached: placed.is_none(),
            vertices: 0,
            triangles: 0,
            low: [f32::INFINITY; 3],
            high: [f32::NEG_INFINITY; 3],
            material: 0,
        };
        let (mut peak, mut finite) = ([0.0f32; 3], true);
        let (mut low, mut high) = (primitive.low, primitive.high);
        let (mut vertices, mut triangles) = (0, 0);
        primitive.pieces(self.lit, &mut |piece| {
            vertices += piece.vertices.len() as u64;
            triangles += piece.triangles.len() as u64;
            for vertex in &piece.vertices {
                for (i, &x) in vertex.position.iter().enumerate() {
                    // Adding 0 turns −0 into 0.
                    (low[i], high[i]) = (low[i].min(x + 0.0), high[i].max(x + 0.0));
                    finite &= x.is_finite();
                }
                peak = std::array::from_fn(|c| peak[c].max(vertex.colour[c]));
            }
            Ok(())
        })?;
        if triangles == 0 {
            return Ok(None);
        }
        if vertices >= u64::from(u32::MAX) || !finite {
            let name = &solution.description.surfaces[surface as usize].name;
            return Err(io::Error::other(format!("surface '{name}' has too many or too distant vertices for glTF")));
        }
        (primitive.vertices, primitive.triangles) = (vertices, triangles);
        (primitive.low, primitive.high) = (low, high);
        // Again, so that only images count that something shown wanted.
        Look::new(solution, surface, kind, &[], &mut self.textures);
        primitive.divisors = primitive.look.make_room(peak);
        let material = primitive.look.material(solution, surface, primitive.divisors, &mut self.textures);
        primitive.material = self.materials.iter().position(|m| *m == material).unwrap_or_else(|| {
            self.materials.push(material);
            self.materials.len() - 1
        });
        Ok(Some(primitive))
    }

    /// Length of the binary data, bytes.
    pub fn length(&self) -> u64 {
        let blocks = self.primitives.iter().map(|p| p.vertex_bytes() + p.index_bytes().next_multiple_of(4));
        blocks.sum::<u64>() + self.textures.embedded().map(|i| (i.len() as u64).next_multiple_of(4)).sum::<u64>()
    }

    /// Numbers of vertices and triangles.
    pub fn size(&self) -> (u64, u64) {
        self.primitives.iter().fold((0, 0), |a, p| (a.0 + p.vertices, a.1 + p.triangles))
    }

    /// Number of images that were wanted and are not at hand.
    pub fn missing_images(&self) -> u64 {
        self.textures.missing()
    }

    /// The document; `uri` names the file of the binary data, none if it follows in the same file.
    pub fn document(&self, uri: Option<&str>, extras: Value) -> Value {
        let mut buffer = json!({ "byteLength": self.length() });
        if let Some(uri) = uri {
            buffer["uri"] = json!(uri);
        }
        let mut document = json!({
            "asset": {
                "version": "2.0",
                "generator": concat!("Ringlight ", env!("CARGO_PKG_VERSION")),
                "extras": { "ringlight": extras },
            },
            "extensionsUsed": ["KHR_materials_unlit"],
            "buffers": [buffer],
            "materials": self.materials,
        });
        let (mut views, mut accessors, mut offset) = (Vec::new(), Vec::new(), 0);
        let mut view = |length: u64, more: Value| {
            let mut view = json!({ "buffer": 0, "byteOffset": offset, "byteLength": length });
            if let (Value::Object(view), Value::Object(more)) = (&mut view, more) {
                view.extend(more);
            }
            offset += length.next_multiple_of(4);
            views.push(view);
            views.len() - 1
        };
        let primitives: Vec<Value> = self
            .primitives
            .iter()
            .map(|p| {
                let vertices = view(p.vertex_bytes(), json!({ "byteStride": p.stride(), "target": 34_962 }));
                let indices = view(p.index_bytes(), json!({ "target": 34_963 }));
                p.describe(vertices, indices, &mut accessors)
            })
            .collect();
        let images: Vec<usize> = self.textures.embedded().map(|i| view(i.len() as u64, json!({}))).collect();
        self.textures.describe(&mut document, images.first().copied().unwrap_or(0));
        document["bufferViews"] = json!(views);
        document["accessors"] = json!(accessors);
        self.describe_meshes(&mut document, primitives);
        document
    }

    /// A mesh for each node that has surfaces.
    fn describe_meshes(&self, document: &mut Value, primitives: Vec<Value>) {
        let description = &self.lit.solution.description;
        let mut meshes: Vec<Value> = Vec::new();
        let mut mesh_of_node = vec![None; description.nodes.len()];
        let mut roots: Vec<(String, usize)> = Vec::new();
        let mut root_of_surface = None;
        for (primitive, value) in self.primitives.iter().zip(primitives) {
            let surface = &description.surfaces[primitive.surface as usize];
            let new = || json!({ "name": surface.name, "primitives": [] });
            let mesh = match mesh_of_node.get_mut(surface.node as usize).filter(|_| !primitive.detached) {
                Some(mesh) => *mesh.get_or_insert_with(|| place(&mut meshes, new())),
                None => match root_of_surface {
                    Some((number, mesh)) if number == primitive.surface => mesh,
                    _ => {
                        let mesh = place(&mut meshes, new());
                        root_of_surface = Some((primitive.surface, mesh));
                        roots.push((surface.name.to_string(), mesh));
                        mesh
                    }
                },
            };
            if let Some(list) = meshes[mesh]["primitives"].as_array_mut() {
                list.push(value);
            }
        }
        document["meshes"] = json!(meshes);
        nodes::describe(document, self.lit.solution, &mesh_of_node, &roots);
    }

    /// Second pass: the binary data.
    pub fn write(&self, out: &mut dyn Write) -> io::Result<Clipping> {
        let mut clipping = Clipping::default();
        for primitive in &self.primitives {
            primitive.write_vertices(self.lit, out, &mut clipping)?;
            primitive.write_indices(self.lit, out)?;
        }
        for image in self.textures.embedded() {
            out.write_all(image)?;
            pad(out, image.len() as u64, 0)?;
        }
        Ok(clipping)
    }
}

fn place(list: &mut Vec<Value>, value: Value) -> usize {
    list.push(value);
    list.len() - 1
}

/// The inverse of a transformation, if it has one worth the name.
fn inverse(world: &[[f64; 4]; 4]) -> Option<DMat4> {
    let world = DMat4::from_cols_array_2d(world);
    let extent: f64 = [world.x_axis, world.y_axis, world.z_axis].iter().map(|a| a.truncate().length()).product();
    let inverse = world.inverse();
    (world.determinant().abs() > 1e-9 * extent && inverse.is_finite()).then_some(inverse)
}

/// Fills up to a multiple of 4 bytes.
pub fn pad(out: &mut dyn Write, length: u64, with: u8) -> io::Result<()> {
    out.write_all(&[with; 3][..(length.next_multiple_of(4) - length) as usize])
}

impl Clipping {
    /// Clipped area over lit area.
    pub fn share(&self) -> f64 {
        if self.lit > 0.0 { self.clipped / self.lit } else { 0.0 }
    }
}

impl Primitive {
    /// Hands out the pieces in order, made in parallel.
    fn pieces(&self, lit: &Lit<'_>, sink: &mut dyn FnMut(Piece) -> io::Result<()>) -> io::Result<()> {
        let mesh = &lit.solution.mesh;
        let mut rest = self.facets.as_slice();
        while !rest.is_empty() {
            let mut elements = 0u32;
            let full = rest.iter().position(|&f| {
                let facet = &mesh.facets[f as usize];
                let count = |back| mesh.side_elements(facet, back).len() as u32;
                elements = facet.sides().map(count).fold(elements, u32::saturating_add);
                elements >= BATCH
            });
            let (batch, after) = rest.split_at(full.map_or(rest.len(), |last| last + 1));
            let pieces: Vec<Piece> =
                batch.par_iter().map(|&f| Piece::new(lit, f, self.kind, &self.look, &self.local)).collect();
            pieces.into_iter().try_for_each(&mut *sink)?;
            rest = after;
        }
        Ok(())
    }

    /// Bytes of a vertex: texture coordinates, 2 × f32, only if there is a texture.
    fn stride(&self) -> u64 {
        if self.look.texture.is_some() { PLAIN_VERTEX + 8 } else { PLAIN_VERTEX }
    }

    fn vertex_bytes(&self) -> u64 {
        self.vertices * self.stride()
    }

    /// Bytes of an index.
    fn index_size(&self) -> u64 {
        if self.vertices <= SHORT_INDICES { 2 } else { 4 }
    }

    fn index_bytes(&self) -> u64 {
        self.triangles * 3 * self.index_size()
    }

    fn describe(&self, vertices: usize, indices: usize, accessors: &mut Vec<Value>) -> Value {
        let mut add = |value: Value| place(accessors, value);
        let position = add(json!({
            "bufferView": vertices, "componentType": 5126, "count": self.vertices, "type": "VEC3",
            "min": self.low.map(f64::from), "max": self.high.map(f64::from),
        }));
        let colour = add(json!({
            "bufferView": vertices, "byteOffset": 12, "componentType": 5123, "normalized": true,
            "count": self.vertices, "type": "VEC4",
        }));
        let mut attributes = json!({ "POSITION": position, "COLOR_0": colour });
        if self.look.texture.is_some() {
            attributes["TEXCOORD_0"] = json!(add(json!({
                "bufferView": vertices, "byteOffset": 20, "componentType": 5126, "count": self.vertices, "type": "VEC2",
            })));
        }
        let indices = add(json!({
            "bufferView": indices, "componentType": if self.index_size() == 2 { 5123 } else { 5125 },
            "count": self.triangles * 3, "type": "SCALAR",
        }));
        json!({ "attributes": attributes, "indices": indices, "material": self.material })
    }

    fn write_vertices(&self, lit: &Lit<'_>, out: &mut dyn Write, clipping: &mut Clipping) -> io::Result<()> {
        let mut bytes = Vec::new();
        self.pieces(lit, &mut |piece| {
            bytes.clear();
            for vertex in &piece.vertices {
                vertex.position.iter().for_each(|x| bytes.extend((x + 0.0).to_le_bytes()));
                let [r, g, b, a] = vertex.colour;
                let [r, g, b] = [r / self.divisors[0], g / self.divisors[1], b / self.divisors[2]];
                let values = [r, g, b, a];
                values.iter().for_each(|v| bytes.extend(((v.min(1.0) * 65_535.0 + 0.5) as u16).to_le_bytes()));
                if self.look.texture.is_some() {
                    vertex.uv.iter().for_each(|x| bytes.extend(x.to_le_bytes()));
                }
            }
            if self.kind == Kind::Reflecting {
                self.count_clipped(&piece, clipping);
            }
            out.write_all(&bytes)
        })
    }

    fn count_clipped(&self, piece: &Piece, clipping: &mut Clipping) {
        // What rounds to 1 is not clipped.
        let limits = self.divisors.map(|d| 1.0001 * d);
        for (area, corners) in &piece.elements {
            let colours = corners.map(|v| piece.vertices[v as usize].colour);
            let share = |above: Rgb| colours.iter().filter(|v| (0..3).any(|c| v[c] > above[c])).count() as f64 / 4.0;
            clipping.lit += if share([0.0; 3]) > 0.0 { *area } else { 0.0 };
            clipping.clipped += area * share(limits);
        }
    }

    fn write_indices(&self, lit: &Lit<'_>, out: &mut dyn Write) -> io::Result<()> {
        let (mut bytes, mut first) = (Vec::new(), 0u32);
        let short = self.index_size() == 2;
        self.pieces(lit, &mut |piece| {
            bytes.clear();
            for index in piece.triangles.iter().flatten() {
                let index = first + index;
                if short { bytes.extend((index as u16).to_le_bytes()) } else { bytes.extend(index.to_le_bytes()) }
            }
            first += piece.vertices.len() as u32;
            out.write_all(&bytes)
        })?;
        pad(out, self.index_bytes(), 0)
    }
}
