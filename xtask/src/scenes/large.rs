//! `cargo xtask large-scene`: a house of furnished offices, as many as it takes, for measuring memory. Not committed.

use super::gltf;
use super::model::{Model, Node, Rectangle};
use super::office;
use anyhow::{Context, Result, bail, ensure};
use glam::{DQuat, DVec3};
use serde_json::json;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// Distance from one office to the next, metres.
const PITCH: [f64; 3] = [7.6, 3.2, 5.8];

/// Writes a scene of at least `triangles` triangles, in whole offices. `form` is `glb` (one mesh), `nodes` (a GLB with a node for
/// each piece of furniture, which share meshes) or `obj` (with its `.mtl` beside it).
pub fn run(triangles: &str, form: &str, path: &Path) -> Result<()> {
    let triangles: u64 = triangles.parse().with_context(|| format!("{triangles}: not a number of triangles"))?;
    let office = office::model();
    let rectangles = flatten(&office);
    let offices = triangles.div_ceil(2 * rectangles.len() as u64).max(1);
    // Twice as wide and as deep as high, in offices.
    let side = ((offices as f64 / 2.0).cbrt().ceil() as u64).max(1);
    let places: Vec<DVec3> = (0..offices)
        .map(|k| DVec3::new((k % (2 * side)) as f64, (k / (2 * side * side)) as f64, (k / (2 * side) % side) as f64))
        .map(|cell| cell * DVec3::from(PITCH))
        .collect();
    let file = File::create(path).with_context(|| format!("cannot write {}", path.display()))?;
    let mut out = BufWriter::new(file);
    match form {
        "glb" => one_mesh(&office, &rectangles, &places, &mut out)?,
        "nodes" => out.write_all(&gltf::glb(&repeated(&office, &places))?)?,
        "obj" => {
            let materials = path.with_extension("mtl");
            std::fs::write(&materials, mtl(&office))
                .with_context(|| format!("cannot write {}", materials.display()))?;
            let name = materials.file_name().unwrap_or_default().to_string_lossy();
            obj(&office, &rectangles, &places, &name, &mut out)?;
        }
        _ => bail!("{form}: not one of glb, nodes, obj"),
    }
    out.flush()?;
    println!("{offices} offices, {} triangles", offices * 2 * rectangles.len() as u64);
    Ok(())
}

/// All rectangles of the model in world space, by paint.
fn flatten(model: &Model) -> Vec<Rectangle> {
    let mut found = Vec::new();
    let mut open: Vec<(usize, DVec3, DQuat)> =
        model.roots.iter().map(|&root| (root, DVec3::ZERO, DQuat::IDENTITY)).collect();
    while let Some((index, origin, turn)) = open.pop() {
        let node = &model.nodes[index];
        let (origin, turn) = (origin + turn * node.translation, turn * node.rotation);
        open.extend(node.children.iter().map(|&child| (child, origin, turn)));
        for r in node.mesh.iter().flat_map(|&mesh| &model.meshes[mesh].rectangles) {
            let (corner, along, up) = (origin + turn * r.corner, turn * r.along, turn * r.up);
            found.push(Rectangle { corner, along, up, paint: r.paint });
        }
    }
    found.sort_by_key(|r| r.paint);
    found
}

/// The model once for each place, under a node of its own.
fn repeated(model: &Model, places: &[DVec3]) -> Model {
    let mut house = Model { name: "offices".into(), sizes: model.sizes, ..Model::default() };
    house.materials = model.materials.clone();
    house.meshes = model.meshes.clone();
    for (number, &place) in places.iter().enumerate() {
        let first = house.nodes.len() + 1;
        house.roots.push(first - 1);
        let children = model.roots.iter().map(|root| first + root).collect();
        let name = format!("office {number}");
        house.nodes.push(Node { name, translation: place, children, ..Node::default() });
        house.nodes.extend(model.nodes.iter().map(|node| Node {
            children: node.children.iter().map(|child| first + child).collect(),
            camera: None,
            ..node.clone()
        }));
    }
    house
}

fn corners(r: &Rectangle, place: DVec3) -> [[f32; 3]; 4] {
    [r.corner, r.corner + r.along, r.corner + r.along + r.up, r.corner + r.up]
        .map(|corner| (corner + place).as_vec3().to_array().map(|x| x + 0.0))
}

/// A GLB with one mesh: a primitive for each paint, written office by office.
fn one_mesh(model: &Model, rectangles: &[Rectangle], places: &[DVec3], out: &mut impl Write) -> Result<()> {
    let (mut accessors, mut primitives) = (Vec::new(), Vec::new());
    let total = (rectangles.len() * places.len()) as u64;
    let (positions, indices) = (total * 48, total * 24);
    ensure!(positions + indices < u64::from(u32::MAX) - (1 << 20), "more than a GLB can hold");
    let mut first = 0;
    for run in rectangles.chunk_by(|a, b| a.paint == b.paint) {
        let count = (run.len() * places.len()) as u64;
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for corner in places.iter().flat_map(|&place| run.iter().flat_map(move |r| corners(r, place))) {
            for axis in 0..3 {
                (low[axis], high[axis]) = (low[axis].min(corner[axis]), high[axis].max(corner[axis]));
            }
        }
        accessors.push(json!({
            "bufferView": 0, "byteOffset": first * 48, "componentType": 5126, "count": count * 4, "type": "VEC3",
            "min": low, "max": high,
        }));
        accessors.push(json!({
            "bufferView": 1, "byteOffset": first * 24, "componentType": 5125, "count": count * 6, "type": "SCALAR",
        }));
        primitives.push(json!({
            "attributes": {"POSITION": accessors.len() - 2}, "indices": accessors.len() - 1, "material": run[0].paint,
        }));
        first += count;
    }
    let document = json!({
        "asset": {"version": "2.0", "generator": "Ringlight cargo xtask large-scene"},
        "extensionsUsed": ["KHR_materials_emissive_strength"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "offices", "mesh": 0}],
        "meshes": [{"name": "offices", "primitives": primitives}],
        "materials": gltf::materials(model)?,
        "accessors": accessors,
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": positions, "byteStride": 12, "target": 34962},
            {"buffer": 0, "byteOffset": positions, "byteLength": indices, "target": 34963},
        ],
        "buffers": [{"byteLength": positions + indices}],
    });
    let mut text = serde_json::to_vec(&document)?;
    text.resize(text.len().next_multiple_of(4), b' ');
    let binary = positions + indices;
    let words = |numbers: [u64; 2]| numbers.map(|n| (n as u32).to_le_bytes()).concat();
    out.write_all(b"glTF")?;
    out.write_all(&words([2, 28 + text.len() as u64 + binary]))?;
    out.write_all(&(text.len() as u32).to_le_bytes())?;
    out.write_all(b"JSON")?;
    out.write_all(&text)?;
    out.write_all(&(binary as u32).to_le_bytes())?;
    out.write_all(b"BIN\0")?;
    let paints = || rectangles.chunk_by(|a, b| a.paint == b.paint);
    for run in paints() {
        for coordinate in places.iter().flat_map(|&place| run.iter().flat_map(move |r| corners(r, place))).flatten() {
            out.write_all(&coordinate.to_le_bytes())?;
        }
    }
    for run in paints() {
        for rectangle in 0..(run.len() * places.len()) as u32 {
            for corner in [0, 1, 2, 0, 2, 3] {
                out.write_all(&(4 * rectangle + corner).to_le_bytes())?;
            }
        }
    }
    Ok(())
}

/// An object for each office; quadrilaterals with corners of their own.
fn obj(model: &Model, rectangles: &[Rectangle], places: &[DVec3], materials: &str, out: &mut impl Write) -> Result<()> {
    writeln!(out, "mtllib {materials}")?;
    for (number, &place) in places.iter().enumerate() {
        writeln!(out, "o office {number}")?;
        for run in rectangles.chunk_by(|a, b| a.paint == b.paint) {
            writeln!(out, "usemtl {}", model.materials[run[0].paint].name)?;
            for r in run {
                for [x, y, z] in corners(r, place) {
                    writeln!(out, "v {x} {y} {z}")?;
                }
                writeln!(out, "f -4 -3 -2 -1")?;
            }
        }
    }
    Ok(())
}

fn mtl(model: &Model) -> String {
    let mut text = String::new();
    for material in &model.materials {
        let ([red, green, blue], (emission, luminance)) = (material.colour, material.emission);
        let [e, f, g] = emission.map(|x| x * luminance);
        text += &format!("newmtl {}\nKd {red} {green} {blue}\nKe {e} {f} {g}\n", material.name);
    }
    text
}
