use super::model::least_length;
use super::{LitOptions, LitReport, check_glb, write_glb, write_gltf};
use crate::output::Exposure;
use crate::output::fixture::{closed_box, elements, mixed, paint, read, solve, solve_refined};
use crate::resources::Bytes;
use crate::scene::{Alpha, Camera, Node, Texture, Wrap};
use crate::solution::{ImageReference, Solution};
use glam::{DMat4, DVec3, Vec3};
use serde_json::Value;
use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Stdio};

fn options(scale: f32) -> LitOptions {
    LitOptions { exposure: Exposure { scale }, ambient: false }
}

/// A written file, taken apart.
struct File {
    bytes: Vec<u8>,
    document: Value,
    data: Vec<u8>,
    report: LitReport,
}

fn write(solution: &Solution, options: &LitOptions) -> File {
    let mut bytes = Vec::new();
    let report = write_glb(solution, options, &mut bytes).unwrap();
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!((&bytes[..4], word(4), word(8)), (b"glTF".as_slice(), 2, bytes.len()));
    let text = word(12);
    let data = bytes[20 + text + 8..].to_vec();
    assert_eq!((text % 4, word(20 + text), &bytes[24 + text..28 + text]), (0, data.len(), b"BIN\0".as_slice()));
    let document = serde_json::from_slice(&bytes[20..20 + text]).unwrap();
    assert!(least_length(&solution.mesh) <= data.len() as u64);
    File { bytes, document, data, report }
}

impl File {
    fn u(&self, path: &str) -> usize {
        self.document.pointer(path).and_then(Value::as_u64).unwrap_or(0) as usize
    }

    /// Where the values of an accessor lie: offset, stride, count.
    fn place(&self, accessor: usize) -> (usize, usize, usize) {
        let view = self.u(&format!("/accessors/{accessor}/bufferView"));
        let offset =
            self.u(&format!("/bufferViews/{view}/byteOffset")) + self.u(&format!("/accessors/{accessor}/byteOffset"));
        (offset, self.u(&format!("/bufferViews/{view}/byteStride")), self.u(&format!("/accessors/{accessor}/count")))
    }

    fn positions(&self, primitive: &Value) -> Vec<Vec3> {
        let (offset, stride, count) = self.place(primitive["attributes"]["POSITION"].as_u64().unwrap() as usize);
        let float = |at: usize| f32::from_le_bytes(self.data[at..at + 4].try_into().unwrap());
        (0..count).map(|i| Vec3::from_array([0, 4, 8].map(|k| float(offset + i * stride + k)))).collect()
    }

    fn colours(&self, primitive: &Value) -> Vec<[f32; 4]> {
        let (offset, stride, count) = self.place(primitive["attributes"]["COLOR_0"].as_u64().unwrap() as usize);
        let short = |at: usize| f32::from(u16::from_le_bytes(self.data[at..at + 2].try_into().unwrap())) / 65_535.0;
        (0..count).map(|i| [0, 2, 4, 6].map(|k| short(offset + i * stride + k))).collect()
    }

    fn indices(&self, primitive: &Value) -> Vec<usize> {
        let accessor = primitive["indices"].as_u64().unwrap() as usize;
        let (offset, _, count) = self.place(accessor);
        assert_eq!(self.u(&format!("/accessors/{accessor}/componentType")), 5123);
        (0..count)
            .map(|i| u16::from_le_bytes(self.data[offset + 2 * i..offset + 2 * i + 2].try_into().unwrap()).into())
            .collect()
    }

    fn primitives(&self) -> Vec<&Value> {
        let meshes = self.document["meshes"].as_array().unwrap();
        meshes.iter().flat_map(|m| m["primitives"].as_array().unwrap()).collect()
    }
}

/// Runs the Khronos validator if it is installed under `target/tools`; gives errors and warnings.
fn check_with_validator(name: &str, bytes: &[u8]) {
    let tools = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../target/tools");
    if !tools.join("node_modules/gltf-validator").is_dir() {
        eprintln!("NOT RUN: {name} was not checked, no node_modules/gltf-validator under target/tools");
        return;
    }
    let script = "const v = require('gltf-validator'); const c = [];\
        process.stdin.on('data', d => c.push(d)).on('end', () => v.validateBytes(new Uint8Array(Buffer.concat(c)))\
        .then(r => console.log(JSON.stringify(r.issues))));";
    let child = Command::new("node")
        .args(["-e", script])
        .current_dir(tools)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn();
    let Ok(mut child) = child else {
        eprintln!("NOT RUN: {name} was not checked, node does not start");
        return;
    };
    child.stdin.take().unwrap().write_all(bytes).unwrap();
    let output = child.wait_with_output().unwrap();
    let issues: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&issues["numErrors"], &issues["numWarnings"]), (&0.into(), &0.into()), "{name}: {issues:#}");
    eprintln!("{name}: validator has {} hints and {} notes", issues["numHints"], issues["numInfos"]);
    issues["messages"].as_array().into_iter().flatten().for_each(|m| eprintln!("  {m}"));
}

/// A floor under two nodes, the upper one mirrored and stretched, with a camera beside it.
fn placed_floor() -> Solution {
    let obj = "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\no floor\nusemtl grey\nf 1 2 3 4\n";
    let mut solution = solve(read(obj), 0.25, 1.0);
    let identity = DMat4::IDENTITY.to_cols_array_2d();
    let upper = DMat4::from_scale_rotation_translation(
        DVec3::new(-2.0, 1.0, 0.5),
        glam::DQuat::from_rotation_z(0.5),
        DVec3::new(3.0, 4.0, 5.0),
    );
    let lower = DMat4::from_translation(DVec3::new(0.0, 0.0, 100.0));
    solution.description.nodes = vec![
        Node {
            name: "top".into(),
            local: upper.to_cols_array_2d(),
            world: upper.to_cols_array_2d(),
            ..Node::default()
        },
        Node {
            name: "floor".into(),
            parent: Some(0),
            local: lower.to_cols_array_2d(),
            world: (upper * lower).to_cols_array_2d(),
            extras: Some(serde_json::json!({ "shelf": 7 })),
            ..Node::default()
        },
        Node {
            name: "eye".into(),
            parent: Some(1),
            local: identity,
            world: identity,
            camera: Some(0),
            ..Node::default()
        },
    ];
    solution.description.cameras = vec![Camera {
        name: "eye".into(),
        world: identity,
        vertical_field_of_view: 1.0,
        half_height: 0.0,
        aspect: Some(1.5),
    }];
    solution.description.surfaces[0].node = 1;
    solution
}

#[test]
fn nodes_cameras_and_extras_stay_and_meshes_stand_where_they_stood() {
    let mut solution = placed_floor();
    let light = |p: DVec3, n: DVec3| if n.z > 0.0 { 1.0 + p.x } else { 0.25 };
    paint(&mut solution, light);
    let file = write(&solution, &options(std::f32::consts::PI / 4.0));
    let document = &file.document;
    let nodes = document["nodes"].as_array().unwrap();
    assert_eq!(nodes.iter().map(|n| n["name"].as_str().unwrap()).collect::<Vec<_>>(), ["top", "floor", "eye"]);
    assert_eq!((&nodes[0]["children"][0], &nodes[1]["children"][0]), (&1.into(), &2.into()));
    assert_eq!(nodes[1]["extras"]["shelf"], 7);
    assert_eq!((&nodes[2]["camera"], &document["cameras"][0]["perspective"]["yfov"]), (&0.into(), &1.0.into()));
    assert_eq!(document["scenes"][0]["nodes"], serde_json::json!([0]));
    let note = &document["asset"]["extras"]["ringlight"];
    assert_eq!((note["units"].as_str(), note["solutionDigest"].as_str().map(str::len)), (Some("W/m²"), Some(64)));

    // 8 × 4 elements: front and back of 9 × 5 vertices each.
    let primitive = file.primitives()[0];
    let (positions, colours, indices) = (file.positions(primitive), file.colours(primitive), file.indices(primitive));
    assert_eq!((positions.len(), indices.len()), (2 * 45, 2 * 32 * 6));
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    positions.iter().for_each(|&p| (low, high) = (low.min(p), high.max(p)));
    let accessor = &document["accessors"][primitive["attributes"]["POSITION"].as_u64().unwrap() as usize];
    for i in 0..3 {
        assert_eq!(accessor["min"][i].as_f64().unwrap(), f64::from(low[i]));
        assert_eq!(accessor["max"][i].as_f64().unwrap(), f64::from(high[i]));
    }
    let world = DMat4::from_cols_array_2d(&solution.description.nodes[1].world);
    let mut area = 0.0;
    for triangle in indices.chunks(3) {
        let [a, b, c] = [0, 1, 2].map(|k| world.transform_point3(positions[triangle[k]].as_dvec3()));
        // A viewer turns the triangles of mirrored nodes around.
        let normal = if world.determinant() < 0.0 { (c - a).cross(b - a) } else { (b - a).cross(c - a) };
        area += normal.length() / 2.0;
        for &v in triangle {
            let p = world.transform_point3(positions[v].as_dvec3());
            assert!(p.z.abs() < 1e-4 && p.x > -1e-4 && p.x < 2.0001);
            // Light over π, times the exposure π/4, clipped.
            let expected = (light(p, normal) / 4.0).min(1.0) as f32;
            assert!((colours[v][0] - expected).abs() < 2e-5, "{} for {expected} at {p}", colours[v][0]);
        }
    }
    assert!((area - 4.0).abs() < 1e-4);
    assert_eq!(file.report.clipped, 0.0);
    check_with_validator("placed floor", &file.bytes);
}

#[test]
fn the_clipped_share_counts_area_and_dark_surfaces_have_room() {
    let mut solution = placed_floor();
    paint(&mut solution, |p, _| if p.x < 1.0 { 1.0 } else { 10.0 });
    // Grey 0.5 shows light up to 2 in full: 10 is clipped on a half, less half a column of the ramp between.
    let file = write(&solution, &options(std::f32::consts::PI));
    assert!((file.report.clipped - 0.5).abs() < 0.08, "{}", file.report.clipped);
    let material = &file.document["materials"][0];
    assert_eq!(material["pbrMetallicRoughness"]["baseColorFactor"][0], 1.0);
    assert_eq!(material["extras"]["ringlight"]["vertexColourDivisor"], serde_json::json!([2.0, 2.0, 2.0]));
    let colours = file.colours(file.primitives()[0]);
    assert!(colours.iter().any(|c| (c[0] - 0.5).abs() < 1e-4) && colours.iter().any(|c| c[0] == 1.0));
}

#[test]
fn coloured_surfaces_are_clipped_where_a_channel_shows_one() {
    let mut solution = placed_floor();
    solution.description.materials[0].base_colour = [0.5, 0.25, 0.1, 1.0];
    paint(&mut solution, |_, _| 5.0);
    let file = write(&solution, &options(std::f32::consts::PI));
    let material = &file.document["materials"][0];
    let factor = |c: usize| material["pbrMetallicRoughness"]["baseColorFactor"][c].as_f64().unwrap();
    for colour in file.colours(file.primitives()[0]) {
        for (c, reflectance) in [0.5f64, 0.25, 0.1].into_iter().enumerate() {
            let shown = factor(c) * f64::from(colour[c]);
            assert!((shown - (5.0 * reflectance).min(1.0)).abs() < 1e-4, "channel {c} shows {shown}");
        }
    }
    check_with_validator("coloured floor", &file.bytes);
}

#[test]
fn emitters_show_what_they_emit_and_reflectance_is_limited() {
    let obj = format!(
        "{}v 0.4 0.4 0.5\nv 0.6 0.4 0.5\nv 0.6 0.6 0.5\no lamp\nusemtl glow\nf 9 10 11\n",
        closed_box("mirror")
    );
    let mut solution = solve(read(&obj), 0.25, 1.0);
    paint(&mut solution, |_, _| 0.0);
    let file = write(&solution, &options(0.25));
    let materials = file.document["materials"].as_array().unwrap();
    let factor = |name: &str| {
        let material = materials.iter().find(|m| m["name"] == name).unwrap();
        material["pbrMetallicRoughness"]["baseColorFactor"][0].as_f64().unwrap() as f32
    };
    assert_eq!((factor("mirror"), factor("glow")), (0.95, 1.0));
    let primitives = file.primitives();
    assert_eq!(primitives.len(), 2);
    // Radiance 1 at exposure 1/4; and darkness.
    assert!(file.colours(primitives[1]).iter().all(|c| (c[0] - 0.25).abs() < 2e-5));
    assert!(file.colours(primitives[0]).iter().all(|c| c[0] == 0.0 && c[3] == 1.0));
    assert!(solution.mesh.facets.iter().any(|f| f.corners[3] == f.corners[0]), "the lamp is a triangle");
    check_with_validator("box with lamp", &file.bytes);
}

fn png(format: image::ImageFormat) -> Bytes {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::DynamicImage::from(image::RgbaImage::from_pixel(4, 4, image::Rgba([200, 100, 50, 255])))
        .write_to(&mut bytes, format)
        .unwrap();
    Bytes::new(bytes.into_inner())
}

/// The placed floor with two materials that use the same image under two names.
fn textured_floor(image: Option<Bytes>) -> Solution {
    let mut solution = placed_floor();
    let description = &mut solution.description;
    let texture = Texture { image: 1, wrap: [Wrap::Mirror, Wrap::Clamp], nearest: false };
    description.materials[0].base_texture = Some(texture);
    description.materials[0].alpha = Alpha::Mask(0.5);
    let reference =
        |name: &str| ImageReference { name: name.into(), media_type: "image/png".into(), hash: "same".into() };
    description.images = vec![reference("a"), reference("b")];
    solution.images = vec![image.clone(), image];
    for (f, facet) in solution.mesh.facets.iter_mut().enumerate() {
        facet.base_uv = f as u32;
        solution.mesh.base_uv.push([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]]).unwrap();
    }
    paint(&mut solution, |_, _| 0.5);
    solution
}

#[test]
fn textures_are_kept_and_identical_images_written_once() {
    for format in [image::ImageFormat::Png, image::ImageFormat::WebP] {
        let solution = textured_floor(Some(png(format)));
        let file = write(&solution, &options(1.0));
        let document = &file.document;
        assert_eq!(document["images"].as_array().unwrap().len(), 1);
        assert_eq!(document["images"][0]["name"], "a");
        assert_eq!(document["samplers"][0]["wrapS"], 33_648);
        assert_eq!((&document["materials"][0]["alphaMode"], file.report.missing_images), (&"MASK".into(), 0));
        assert!(file.primitives()[0]["attributes"]["TEXCOORD_0"].is_u64());
        check_with_validator(&format!("textured floor, {format:?}"), &file.bytes);
    }
}

#[test]
fn emission_textures_show_as_base_textures() {
    let mut solution = textured_floor(Some(png(image::ImageFormat::Png)));
    let material = &mut solution.description.materials[0];
    (material.emission_texture, material.emission) = (material.base_texture.take(), [2.0; 3]);
    solution.mesh.emission_uv = std::mem::take(&mut solution.mesh.base_uv);
    for facet in &mut solution.mesh.facets {
        (facet.base_uv, facet.emission_uv) = (u32::MAX, facet.base_uv);
    }
    // The texture's mean is a half.
    solution.mesh.surface_colours[0].exitance = [std::f32::consts::PI; 3];
    solution.mesh.surface_colours[0].reflectance = [0.0; 3];
    let file = write(&solution, &options(0.25));
    let primitive = file.primitives()[0];
    assert!(file.colours(primitive).iter().all(|c| (c[0] - 0.5).abs() < 2e-5));
    let material = &file.document["materials"][0];
    assert_eq!(material["pbrMetallicRoughness"]["baseColorTexture"]["index"], 0);
    assert_eq!((file.primitives().len(), material.get("alphaMode")), (1, None));
    check_with_validator("floor with an emission texture", &file.bytes);
}

#[test]
fn without_the_image_a_surface_has_its_mean_colour() {
    let file = write(&textured_floor(None), &options(1.0));
    assert_eq!(file.report.missing_images, 1);
    assert!(file.document.get("images").is_none());
    assert_eq!(file.document["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"][0], 0.5);
    check_with_validator("floor without its image", &file.bytes);
}

#[test]
fn a_node_flattened_to_nothing_leaves_its_mesh_in_the_world() {
    let mut solution = placed_floor();
    let flat = DMat4::from_scale(DVec3::new(1.0, 0.0, 1.0)).to_cols_array_2d();
    solution.description.nodes[0].local = flat;
    solution.description.nodes[0].world = flat;
    solution.description.nodes[1].world = flat;
    let file = write(&solution, &options(1.0));
    let nodes = file.document["nodes"].as_array().unwrap();
    assert_eq!((nodes.len(), nodes[1].get("mesh")), (4, None));
    assert_eq!(
        (&nodes[3]["name"], &file.document["scenes"][0]["nodes"]),
        (&"floor".into(), &serde_json::json!([0, 3]))
    );
    check_with_validator("flattened node", &file.bytes);
}

#[test]
fn documents_with_data_beside_them_say_the_same() {
    let solution = placed_floor();
    let glb = write(&solution, &options(1.0));
    let (mut json, mut bin) = (Vec::new(), Vec::new());
    let report = write_gltf(&solution, &options(1.0), "my model.bin", &mut json, &mut bin).unwrap();
    assert_eq!((report, &bin), (glb.report, &glb.data));
    let mut document: Value = serde_json::from_slice(&json).unwrap();
    assert_eq!(document["buffers"][0]["uri"], "my%20model.bin");
    document["buffers"][0].as_object_mut().unwrap().remove("uri");
    assert_eq!(document, glb.document);
}

#[test]
fn equal_solutions_make_equal_files_for_any_number_of_threads() {
    let obj =
        format!("{}v 0.4 0.4 0.5\nv 0.6 0.4 0.5\nv 0.6 0.6 0.5\no lamp\nusemtl glow\nf 9 10 11\n", closed_box("grey"));
    let solution = solve(read(&obj), 0.1, 0.1);
    assert!(elements(&solution).len() > 1000);
    let bytes = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let ambient = LitOptions { exposure: Exposure::automatic(&solution), ambient: true };
        pool.install(|| write(&solution, &ambient).bytes)
    };
    assert!(bytes(1) == bytes(3));
}

#[test]
fn models_of_patches_that_are_cut_differently_are_valid() {
    let obj = format!("{}v 0.2 0.2 0.5\nv 0.8 0.2 0.5\nv 0.2 0.8 0.5\nusemtl glow\nf 9 10 11\n", closed_box("grey"));
    let solution = solve_refined(read(&obj), [0.3, 0.15], 0.1, mixed([1, 2, 3, 4]));
    check_with_validator("mixed elements", &write(&solution, &options(1.0)).bytes);
}

#[test]
fn a_model_beyond_4_gib_is_refused_before_there_is_light() {
    let mut solution = solve(read(&closed_box("grey")), 0.25, 1.0);
    // Fronts and backs of six faces of 4 × 4 elements, nothing left out.
    let length = 12 * (25 * 20 + 16 * 2 * 3 * 2);
    assert_eq!((write(&solution, &options(1.0)).data.len() as u64, least_length(&solution.mesh)), (length, length));
    assert!(check_glb(&solution.mesh).is_ok());
    let first = solution.mesh.facets[0];
    solution.mesh.facets.resize(1, first).unwrap();
    let facet = &mut solution.mesh.facets[0];
    facet.elements = [1, 1];
    facet.first_back_patch = crate::mesh::NONE;
    // 20 bytes a vertex, 24 an element: 4 GiB are 97.6 million.
    facet.patches = [9_850, 9_850];
    assert!(check_glb(&solution.mesh).is_ok());
    solution.mesh.facets[0].patches = [9_890, 9_890];
    let error = check_glb(&solution.mesh).unwrap_err().to_string();
    assert!(error.contains("takes at least 4304") && error.ends_with("write a .gltf instead"), "{error}");
}
