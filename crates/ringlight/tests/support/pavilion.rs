//! A pavilion in the open: everything that lets a part of the light pass, in few triangles.

use super::{Builder, read, shorts};
use ringlight::scene::Scene;
use serde_json::json;

/// Quadrilaterals of one material.
#[derive(Default)]
struct Quads {
    positions: Vec<f32>,
    uv: Vec<f32>,
    indices: Vec<u16>,
}

impl Quads {
    /// The parallelogram of a corner and two edges, seen from where they run counter-clockwise, textured `repeats` times.
    fn add(&mut self, at: [f32; 3], u: [f32; 3], v: [f32; 3], repeats: f32) {
        let first = (self.positions.len() / 3) as u16;
        for (a, b) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            self.positions.extend((0..3).map(|i| at[i] + a * u[i] + b * v[i]));
            self.uv.extend([a * repeats, b * repeats]);
        }
        self.indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
    }

    /// The outside of a box.
    fn add_box(&mut self, low: [f32; 3], [x, y, z]: [f32; 3]) {
        let high = [low[0] + x, low[1] + y, low[2] + z];
        self.add(low, [0.0, y, 0.0], [x, 0.0, 0.0], 1.0);
        self.add(low, [0.0, 0.0, z], [0.0, y, 0.0], 1.0);
        self.add(low, [x, 0.0, 0.0], [0.0, 0.0, z], 1.0);
        self.add(high, [-x, 0.0, 0.0], [0.0, -y, 0.0], 1.0);
        self.add(high, [0.0, -y, 0.0], [0.0, 0.0, -z], 1.0);
        self.add(high, [0.0, 0.0, -z], [-x, 0.0, 0.0], 1.0);
    }
}

/// A floor of 4 m × 4 m, two walls, a table that stands through a plinth and a lamp. Over them a roof of panes of two strengths,
/// one above the other in part; between them lattices, cut out of a texture. A sun shines through all of it.
pub fn pavilion() -> Scene {
    let [mut stone, mut lamp, mut glass, mut smoke, mut lattice] = [(); 5].map(|()| Quads::default());
    stone.add([0.0, 0.0, 0.0], [0.0, 0.0, 4.0], [4.0, 0.0, 0.0], 1.0);
    stone.add([0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 2.5, 0.0], 1.0);
    stone.add([0.0, 0.0, 4.0], [0.0, 0.0, -4.0], [0.0, 2.5, 0.0], 1.0);
    stone.add_box([1.2, -0.1, 1.3], [0.9, 0.8, 0.7]);
    stone.add_box([1.0, 0.0, 1.1], [1.4, 0.2, 1.2]);
    lamp.add([1.5, 2.2, 2.5], [0.5, 0.0, 0.0], [0.0, 0.0, 0.4], 1.0);
    for i in 0..12 {
        let (x, z) = ((i % 4) as f32, (i / 4) as f32 * 1.3);
        let panes = if i % 3 == 0 { &mut smoke } else { &mut glass };
        panes.add([x, 2.5, z], [0.0, 0.1, 1.3], [1.0, 0.0, 0.0], 1.0);
    }
    smoke.add([0.7, 2.8, 0.5], [0.0, 0.0, 2.1], [2.3, 0.2, 0.0], 1.0);
    for i in 0..4 {
        lattice.add([0.9 + 0.7 * i as f32, 0.0, 2.6], [0.7, 0.0, 0.1], [0.0, 1.9, 0.0], 3.0);
    }
    lattice.add([2.9, 0.3, 0.4], [0.3, 0.0, 1.9], [0.0, 1.7, 0.0], 2.0);

    let mut builder = Builder::default();
    let mut png = Vec::new();
    let texel = |x: u32, y: u32| image::Rgba([200, 180, 90, if (x / 2 + y / 3).is_multiple_of(2) { 255 } else { 0 }]);
    let holes = image::RgbaImage::from_fn(12, 12, texel);
    holes.write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png).expect("written");
    let image = builder.view(&png);
    let primitives: Vec<_> = [stone, lamp, glass, smoke, lattice]
        .iter()
        .enumerate()
        .map(|(material, quads)| {
            let position = builder.vectors(&quads.positions, 3);
            let uv = builder.vectors(&quads.uv, 2);
            let indices = builder.rows(&shorts(&quads.indices), "SCALAR", 5123, quads.indices.len());
            json!({ "attributes": { "POSITION": position, "TEXCOORD_0": uv }, "indices": indices, "material": material })
        })
        .collect();
    let colour = |rgba: [f64; 4]| json!({ "metallicFactor": 0, "baseColorFactor": rgba });
    let document = json!({
        "nodes": [
            { "name": "pavilion", "mesh": 0 },
            // It comes from above and from two sides.
            { "rotation": [-0.5, -0.4, -0.3, 0.7], "extensions": { "KHR_lights_punctual": { "light": 0 } } },
        ],
        "meshes": [{ "primitives": primitives }],
        "materials": [
            { "pbrMetallicRoughness": colour([0.7, 0.6, 0.5, 1.0]) },
            { "pbrMetallicRoughness": colour([0.1, 0.1, 0.1, 1.0]), "emissiveFactor": [1, 1, 0.8], "doubleSided": true },
            { "pbrMetallicRoughness": colour([0.9, 0.9, 0.9, 0.3]), "alphaMode": "BLEND", "doubleSided": true },
            { "pbrMetallicRoughness": colour([0.2, 0.2, 0.2, 0.6]), "alphaMode": "BLEND", "doubleSided": true },
            { "pbrMetallicRoughness": { "metallicFactor": 0, "baseColorTexture": { "index": 0 } },
              "alphaMode": "MASK", "doubleSided": true },
        ],
        "textures": [{ "source": 0 }],
        "images": [{ "bufferView": image, "mimeType": "image/png" }],
        "extensions": { "KHR_lights_punctual": { "lights": [{ "type": "directional", "intensity": 2.5 }] } },
    });
    read("pavilion.glb", &builder.finish(document)).unwrap_or_else(|error| panic!("{error}"))
}
