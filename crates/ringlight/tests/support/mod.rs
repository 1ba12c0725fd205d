//! Help for the tests of the scene readers: files in memory or in a folder, and scenes written in code.
#![allow(dead_code, reason = "each test binary uses a part of it")]

pub mod pavilion;

use ringlight::column::Store;
use ringlight::mesh::Mesh;
use ringlight::resources::{Bytes, Resources};
use ringlight::scene::{self, ReadOptions, Scene, SceneError, SourceTriangle};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io;
use std::path::PathBuf;

/// A mesh with patches refined here and there, or as it is.
pub fn refined(mesh: Mesh, scene: &Scene, mixed: bool) -> Mesh {
    let subdivision = |patch: u32| [1, 2, 1, 4, 3][(patch.wrapping_mul(0x9e37_79b9) >> 8) as usize % 5];
    let subdivisions: Vec<u8> = (0..mesh.patch_count() as u32).map(subdivision).collect();
    if mixed { mesh.refined(scene, &subdivisions, Store::Heap).unwrap() } else { mesh }
}

/// Files in memory.
#[derive(Default)]
pub struct Files(pub BTreeMap<String, Vec<u8>>);

impl Resources for Files {
    fn read(&self, path: &str) -> io::Result<Bytes> {
        let bytes = self.0.get(path).ok_or_else(|| io::Error::new(io::ErrorKind::NotFound, "no such file"))?;
        Ok(Bytes::new(bytes.clone()))
    }
}

/// Files in a folder.
pub struct Folder(pub PathBuf);

impl Resources for Folder {
    fn read(&self, path: &str) -> io::Result<Bytes> {
        Ok(Bytes::new(std::fs::read(self.0.join(path))?))
    }
}

/// Reads a scene held in memory that refers to nothing else.
pub fn read(name: &str, bytes: &[u8]) -> Result<Scene, SceneError> {
    scene::read(name, Bytes::new(bytes.to_vec()), &Files::default(), &ReadOptions::default())
}

/// All triangles of a scene, surface by surface; checks that the counts hold.
pub fn triangles(scene: &Scene) -> Result<Vec<Vec<SourceTriangle>>, SceneError> {
    let mut all = Vec::new();
    for (index, surface) in scene.surfaces.iter().enumerate() {
        let mut triangles = Vec::new();
        scene.geometry.triangles(index, &mut |triangle| triangles.push(triangle))?;
        assert_eq!(triangles.len() as u64, surface.triangles, "surface {index}");
        all.push(triangles);
    }
    Ok(all)
}

/// Reads a scene and all of its triangles, to see that nothing panics.
pub fn read_all(name: &str, bytes: &[u8]) -> Result<Vec<Vec<SourceTriangle>>, SceneError> {
    triangles(&read(name, bytes)?)
}

/// A GLB of a document and a binary chunk.
pub fn glb(json: &str, binary: &[u8]) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut binary = binary.to_vec();
    binary.resize(binary.len().next_multiple_of(4), 0);
    let mut file = b"glTF".to_vec();
    let length = 12 + 8 + json.len() + 8 + binary.len();
    for word in [2, length as u32, json.len() as u32] {
        file.extend(word.to_le_bytes());
    }
    file.extend(b"JSON");
    file.extend(json);
    file.extend((binary.len() as u32).to_le_bytes());
    file.extend(b"BIN\0");
    file.extend(binary);
    file
}

/// Floats as bytes.
pub fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// 16-bit numbers as bytes.
pub fn shorts(values: &[u16]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// A document under construction: each block of bytes becomes a buffer view.
#[derive(Default)]
pub struct Builder {
    binary: Vec<u8>,
    views: Vec<serde_json::Value>,
    accessors: Vec<serde_json::Value>,
}

impl Builder {
    /// Adds a buffer view and gives its index.
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        self.views.push(serde_json::json!({
            "buffer": 0, "byteOffset": self.binary.len(), "byteLength": bytes.len(),
        }));
        self.binary.extend(bytes);
        self.views.len() - 1
    }

    /// The JSON of a buffer view, to be changed.
    pub fn view_json(&mut self, view: usize) -> &mut serde_json::Value {
        &mut self.views[view]
    }

    /// Adds an accessor from its JSON and gives its index.
    pub fn accessor(&mut self, accessor: serde_json::Value) -> usize {
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// Adds a view and an accessor of `kind` with components of type `component`.
    pub fn rows(&mut self, bytes: &[u8], kind: &str, component: u32, count: usize) -> usize {
        let view = self.view(bytes);
        self.accessor(serde_json::json!({
            "bufferView": view, "componentType": component, "count": count, "type": kind,
        }))
    }

    /// Adds an accessor of float vectors.
    pub fn vectors(&mut self, values: &[f32], width: usize) -> usize {
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"].get(width - 1).copied().unwrap_or("MAT4");
        self.rows(&floats(values), kind, 5126, values.len() / width)
    }

    /// The GLB with the other members of `document`.
    pub fn finish(self, mut document: serde_json::Value) -> Vec<u8> {
        document["asset"] = serde_json::json!({ "version": "2.0" });
        document["buffers"] = serde_json::json!([{ "byteLength": self.binary.len() }]);
        document["bufferViews"] = self.views.into();
        document["accessors"] = self.accessors.into();
        glb(&document.to_string(), &self.binary)
    }
}

/// The smallest PNG: one white texel.
pub fn tiny_png() -> Vec<u8> {
    let mut png = Vec::new();
    let white = image::RgbaImage::from_pixel(1, 1, image::Rgba([255; 4]));
    white.write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png).expect("written");
    png
}

/// Corners of the triangle that most scenes here consist of; it faces +z.
pub const TRIANGLE: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];

fn merge(mut document: Value, more: Value) -> Value {
    for (key, value) in more.as_object().expect("an object") {
        document[key] = value.clone();
    }
    document
}

/// A scene of one triangle under one node; `more` replaces members of the document.
pub fn one_triangle(more: Value) -> Scene {
    let mut builder = Builder::default();
    let position = builder.vectors(&TRIANGLE, 3);
    let document = json!({
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": position } }] }],
    });
    scene_of(builder, merge(document, more))
}

pub fn scene_of(builder: Builder, document: Value) -> Scene {
    read("test.glb", &builder.finish(document)).unwrap_or_else(|error| panic!("{error}"))
}

pub fn all(scene: &Scene) -> Vec<SourceTriangle> {
    triangles(scene).unwrap_or_else(|error| panic!("{error}")).concat()
}

pub fn positions(scene: &Scene) -> Vec<[[f64; 3]; 3]> {
    all(scene).iter().map(|triangle| triangle.position).collect()
}

pub fn codes(scene: &Scene) -> Vec<&str> {
    scene.warnings.0.iter().map(|warning| warning.code.as_str()).collect()
}

/// A scene with most of what a file can have: a hierarchy, instances, a skin, morph targets, sparse data, textures.
pub fn document() -> (Builder, Value) {
    let mut builder = Builder::default();
    let positions = builder.vectors(&[0., 0., 0., 1., 0., 0., 0., 1., 0., 1., 1., 0.], 3);
    let indices = builder.rows(&shorts(&[0, 1, 2, 2, 1, 3]), "SCALAR", 5123, 6);
    let uv = builder.vectors(&[0., 0., 1., 0., 0., 1., 1., 1.], 2);
    let colours = builder.rows(&[255; 16], "VEC4", 5121, 4);
    let sparse_indices = builder.view(&shorts(&[1, 3]));
    let sparse_values = builder.view(&floats(&[0., 0., 1., 0., 0., 2.]));
    let target = builder.accessor(json!({
        "componentType": 5126, "count": 4, "type": "VEC3",
        "sparse": {
            "count": 2,
            "indices": { "bufferView": sparse_indices, "componentType": 5123 },
            "values": { "bufferView": sparse_values },
        },
    }));
    let joints = builder.rows(&[0; 16], "VEC4", 5121, 4);
    let weights = builder.vectors(&[1., 0., 0., 0.].repeat(4), 4);
    let inverse = builder.vectors(&[1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.], 16);
    let translations = builder.vectors(&[0., 0., 0., 5., 0., 0.], 3);
    let document = json!({
        "scene": 0,
        "scenes": [{ "nodes": [0, 2, 3] }],
        "nodes": [
            { "children": [1], "scale": [-1, 2, 1] },
            { "mesh": 0, "extensions":
                { "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": translations } } } },
            { "mesh": 1, "skin": 0, "camera": 0 },
            { "extensions": { "KHR_lights_punctual": { "light": 0 } } },
        ],
        "meshes": [
            { "weights": [0.5], "primitives": [{
                "attributes": { "POSITION": positions, "TEXCOORD_0": uv, "COLOR_0": colours },
                "indices": indices, "material": 0, "targets": [{ "POSITION": target }],
            }] },
            { "primitives": [{
                "attributes": { "POSITION": positions, "JOINTS_0": joints, "WEIGHTS_0": weights }, "mode": 5,
            }] },
        ],
        "skins": [{ "joints": [3], "inverseBindMatrices": inverse }],
        "materials": [{ "alphaMode": "BLEND", "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }],
        "textures": [{ "source": 0, "sampler": 0 }],
        "samplers": [{}],
        "images": [{ "uri": "data:image/png;base64,iVBORw0KGgo=" }],
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 1 } }],
        "extensions": { "KHR_lights_punctual": { "lights": [{ "type": "point" }] } },
    });
    (builder, document)
}

/// The scene of [`document`] as a GLB.
pub fn valid() -> Vec<u8> {
    let (builder, document) = document();
    builder.finish(document)
}

/// JSON and binary chunk of a GLB.
pub fn split(file: &[u8]) -> (Value, Vec<u8>) {
    let length = u32::from_le_bytes(file[12..16].try_into().expect("four bytes")) as usize;
    let json = serde_json::from_slice(&file[20..20 + length]).expect("valid JSON");
    (json, file[28 + length..].to_vec())
}
