//! Model → binary glTF 2.0.

use super::model::{Model, Node};
use anyhow::Result;
use glam::DVec3;
use serde::Serialize;
use serde_json::{Value, json};

/// The bytes of a `.glb` file: a mesh has one primitive for each material, and four corners for each rectangle.
pub fn glb(model: &Model) -> Result<Vec<u8>> {
    let mut document = Document::default();
    let (mut positions, mut indices) = (Vec::new(), Vec::new());
    for mesh in &model.meshes {
        let mut paints: Vec<_> = mesh.rectangles.iter().map(|rectangle| rectangle.paint).collect();
        paints.sort_unstable();
        paints.dedup();
        let mut primitives = Vec::new();
        for paint in paints {
            let offsets = (positions.len(), indices.len());
            let (mut low, mut high, mut vertices) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3], 0u16);
            for r in mesh.rectangles.iter().filter(|rectangle| rectangle.paint == paint) {
                let corners = [r.corner, r.corner + r.along, r.corner + r.along + r.up, r.corner + r.up];
                for corner in corners {
                    for (axis, coordinate) in rounded(corner).into_iter().enumerate() {
                        low[axis] = low[axis].min(coordinate);
                        high[axis] = high[axis].max(coordinate);
                        positions.extend(coordinate.to_le_bytes());
                    }
                }
                for corner in [0, 1, 2, 0, 2, 3] {
                    indices.extend((vertices + corner).to_le_bytes());
                }
                vertices += 4;
            }
            let position = document.accessor(0, offsets.0, 5126, vertices.into(), "VEC3", Some((low, high)));
            let index = document.accessor(1, offsets.1, 5123, u32::from(vertices) / 4 * 6, "SCALAR", None);
            primitives.push(Primitive { attributes: Attributes { position }, indices: index, material: paint });
        }
        document.meshes.push(Mesh { name: mesh.name.clone(), primitives });
    }
    document.describe(model);
    document.buffer_views = vec![
        BufferView { buffer: 0, byte_offset: 0, byte_length: positions.len(), byte_stride: Some(12), target: 34962 },
        BufferView {
            buffer: 0,
            byte_offset: positions.len(),
            byte_length: indices.len(),
            byte_stride: None,
            target: 34963,
        },
    ];
    let mut binary = positions;
    binary.extend(indices);
    document.buffers = vec![Buffer { byte_length: binary.len() }];
    Ok(container(serde_json::to_vec(&document)?, binary))
}

/// The materials of a model, as JSON.
pub fn materials(model: &Model) -> Result<Value> {
    let mut document = Document::default();
    document.describe(model);
    Ok(serde_json::to_value(document.materials)?)
}

/// The GLB container: a header, a JSON chunk and a binary chunk, both padded to whole words.
fn container(mut json: Vec<u8>, mut binary: Vec<u8>) -> Vec<u8> {
    json.resize(json.len().next_multiple_of(4), b' ');
    binary.resize(binary.len().next_multiple_of(4), 0);
    let length = 28 + json.len() as u32 + binary.len() as u32;
    let mut file = [*b"glTF", 2u32.to_le_bytes(), length.to_le_bytes()].concat();
    for (kind, chunk) in [(b"JSON", json), (b"BIN\0", binary)] {
        file.extend((chunk.len() as u32).to_le_bytes());
        file.extend(kind);
        file.extend(chunk);
    }
    file
}

/// Single precision, without negative zeros.
fn rounded(vector: DVec3) -> [f32; 3] {
    vector.as_vec3().to_array().map(|coordinate| coordinate + 0.0)
}

#[derive(Default, Serialize)]
#[serde(rename_all = "camelCase")]
struct Document {
    asset: Value,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    extensions_used: Vec<&'static str>,
    scene: usize,
    scenes: Vec<Value>,
    nodes: Vec<NodeOut>,
    cameras: Vec<Value>,
    meshes: Vec<Mesh>,
    materials: Vec<Material>,
    accessors: Vec<Accessor>,
    buffer_views: Vec<BufferView>,
    buffers: Vec<Buffer>,
}

#[derive(Serialize)]
struct NodeOut {
    name: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    translation: Option<[f32; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rotation: Option<[f32; 4]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    mesh: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    camera: Option<usize>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    children: Vec<usize>,
}

#[derive(Serialize)]
struct Mesh {
    name: String,
    primitives: Vec<Primitive>,
}

#[derive(Serialize)]
struct Primitive {
    attributes: Attributes,
    indices: usize,
    material: usize,
}

#[derive(Serialize)]
#[serde(rename_all = "UPPERCASE")]
struct Attributes {
    position: usize,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Material {
    name: String,
    pbr_metallic_roughness: Value,
    #[serde(skip_serializing_if = "Option::is_none")]
    emissive_factor: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    extensions: Option<Value>,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Accessor {
    buffer_view: usize,
    byte_offset: usize,
    component_type: u32,
    count: u32,
    r#type: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    min: Option<[f32; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    max: Option<[f32; 3]>,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct BufferView {
    buffer: usize,
    byte_offset: usize,
    byte_length: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    byte_stride: Option<usize>,
    target: u32,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Buffer {
    byte_length: usize,
}

impl Document {
    fn accessor(
        &mut self,
        buffer_view: usize,
        byte_offset: usize,
        component_type: u32,
        count: u32,
        r#type: &'static str,
        bounds: Option<([f32; 3], [f32; 3])>,
    ) -> usize {
        let (min, max) = bounds.unzip();
        self.accessors.push(Accessor { buffer_view, byte_offset, component_type, count, r#type, min, max });
        self.accessors.len() - 1
    }

    /// Everything but the geometry.
    fn describe(&mut self, model: &Model) {
        let (patch_size, element_size) = model.sizes;
        self.asset = json!({
            "version": "2.0",
            "generator": "Ringlight cargo xtask scenes",
            "extras": {"ringlight": {"patch_size": patch_size, "element_size": element_size}},
        });
        self.scenes = vec![json!({"name": model.name, "nodes": model.roots})];
        for material in &model.materials {
            let [red, green, blue] = material.colour;
            let (emission, luminance) = material.emission;
            let shines = luminance > 0.0;
            let strength = json!({"KHR_materials_emissive_strength": {"emissiveStrength": luminance}});
            self.materials.push(Material {
                name: material.name.clone(),
                pbr_metallic_roughness: json!({
                    "baseColorFactor": [red, green, blue, 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0,
                }),
                emissive_factor: shines.then_some(emission),
                extensions: (shines && luminance != 1.0).then_some(strength),
            });
        }
        if self.materials.iter().any(|material| material.extensions.is_some()) {
            self.extensions_used = vec!["KHR_materials_emissive_strength"];
        }
        for node in &model.nodes {
            let camera = node.camera.map(|degrees| self.camera(node, degrees));
            let rotation = node.rotation.as_quat().to_array().map(|part| part + 0.0);
            let translation = rounded(node.translation);
            self.nodes.push(NodeOut {
                name: node.name.clone(),
                translation: (translation != [0.0; 3]).then_some(translation),
                rotation: (rotation != [0.0, 0.0, 0.0, 1.0]).then_some(rotation),
                mesh: node.mesh,
                camera,
                children: node.children.clone(),
            });
        }
    }

    fn camera(&mut self, node: &Node, degrees: f64) -> usize {
        let perspective = json!({"aspectRatio": 1.5, "yfov": degrees.to_radians(), "znear": 0.05});
        self.cameras.push(json!({"name": node.name, "type": "perspective", "perspective": perspective}));
        self.cameras.len() - 1
    }
}
