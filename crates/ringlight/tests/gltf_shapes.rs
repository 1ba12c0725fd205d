//! Nodes, meshes, accessors and buffers of glTF, each feature in the smallest scene that shows it.

mod support;

use ringlight::resources::Bytes;
use ringlight::scene::{self, ReadOptions};
use serde_json::json;
use support::{Builder, Files, TRIANGLE, all, codes, floats, one_triangle, positions, scene_of, shorts, tiny_png};

#[test]
fn a_plain_triangle() {
    let scene = one_triangle(json!({}));
    assert_eq!(positions(&scene), [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]]);
    assert_eq!(all(&scene)[0].colour, [[1.0; 4]; 3]);
    let surface = &scene.surfaces[0];
    assert_eq!((&*surface.name, &*surface.place.at), ("surface 0", "meshes[0].primitives[0]"));
    assert_eq!(scene.materials.len(), 1);
    assert_eq!(codes(&scene), [""; 0]);
}

#[test]
fn nodes_are_nested_parents_first() {
    let scene = one_triangle(json!({
        "scene": 1,
        "scenes": [{ "nodes": [0] }, { "name": "shown", "nodes": [2] }],
        "nodes": [
            { "name": "hidden", "mesh": 0 },
            { "mesh": 0, "translation": [0, 0, 5] },
            { "name": "parent", "scale": [2, 2, 2], "children": [1], "extras": { "a": 1 } },
        ],
    }));
    assert_eq!(scene.name, "shown");
    assert_eq!(scene.nodes.len(), 2);
    assert_eq!((scene.nodes[0].name.as_str(), scene.nodes[1].parent), ("parent", Some(0)));
    assert_eq!(scene.nodes[0].extras, Some(json!({ "a": 1 })));
    assert_eq!(positions(&scene), [[[0.0, 0.0, 10.0], [2.0, 0.0, 10.0], [0.0, 2.0, 10.0]]]);
}

#[test]
fn mirroring_keeps_the_front_in_front() {
    // Mirrored in x, the triangle still faces +z, so its corners come in the other order.
    let mirrored = one_triangle(json!({ "nodes": [{ "mesh": 0, "scale": [-1, 1, 1] }] }));
    assert_eq!(positions(&mirrored), [[[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]]);
    // Two mirrorings are a rotation.
    let turned = one_triangle(json!({ "nodes": [{ "mesh": 0, "scale": [-1, -1, 1] }] }));
    assert_eq!(positions(&turned), [[[0.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]]);
}

#[test]
fn rotations_are_normalised_and_matrices_column_major() {
    // Twice the quaternion of a quarter turn about z.
    let root = std::f64::consts::SQRT_2;
    let scene = one_triangle(json!({ "nodes": [{ "mesh": 0, "rotation": [0.0, 0.0, root, root] }] }));
    let [_, x, _] = positions(&scene)[0];
    assert!((x[0]).abs() < 1e-15 && (x[1] - 1.0).abs() < 1e-15, "{x:?}");
    let matrix = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 7, 8, 9, 1]);
    let scene = one_triangle(json!({ "nodes": [{ "mesh": 0, "matrix": matrix }] }));
    assert_eq!(positions(&scene)[0][0], [7.0, 8.0, 9.0]);
}

#[test]
fn lists_strips_and_fans() {
    let square: [f32; 12] = [0., 0., 0., 1., 0., 0., 0., 1., 0., 1., 1., 0.];
    let corners = |mode: u32| {
        let mut builder = Builder::default();
        let position = builder.vectors(&square, 3);
        let document = json!({
            "nodes": [{ "mesh": 0 }],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": position }, "mode": mode }] }],
        });
        positions(&scene_of(builder, document))
            .iter()
            .map(|corners| corners.map(|[x, y, _]| (x + 2.0 * y) as u32))
            .collect::<Vec<_>>()
    };
    assert_eq!(corners(4), [[0, 1, 2]]);
    assert_eq!(corners(5), [[0, 1, 2], [1, 3, 2]]);
    assert_eq!(corners(6), [[1, 2, 0], [2, 3, 0]]);
}

#[test]
fn points_and_lines_are_left_out() {
    let mut builder = Builder::default();
    let position = builder.vectors(&TRIANGLE, 3);
    let attributes = json!({ "POSITION": position });
    let document = json!({
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [
            { "attributes": attributes, "mode": 0 }, { "attributes": attributes, "mode": 3 }, { "attributes": attributes },
            { "attributes": {} },
        ] }],
    });
    let scene = scene_of(builder, document);
    assert_eq!(scene.surfaces.len(), 1);
    assert_eq!(codes(&scene), ["points-and-lines-ignored", "primitive-without-positions"]);
    assert_eq!(scene.warnings.0[0].count, 2);
}

#[test]
fn indices_of_every_width() {
    for (component, bytes) in [
        (5121, vec![2, 1, 0]),
        (5123, shorts(&[2, 1, 0])),
        (5125, [2_u32, 1, 0].iter().flat_map(|index| index.to_le_bytes()).collect()),
    ] {
        let mut builder = Builder::default();
        let position = builder.vectors(&TRIANGLE, 3);
        let indices = builder.rows(&bytes, "SCALAR", component, 3);
        let document = json!({
            "nodes": [{ "mesh": 0 }],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": position }, "indices": indices }] }],
        });
        let scene = scene_of(builder, document);
        assert_eq!(positions(&scene), [[[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]], "{component}");
    }
}

#[test]
fn interleaved_and_quantized_attributes() {
    // Rows of 12 bytes: three i16 positions, padding, two u8 texture coordinates, padding.
    let mut builder = Builder::default();
    let mut rows = Vec::new();
    for (position, uv) in [([0_i16, 0, 0], [0_u8, 0]), ([32767, 0, 0], [255, 0]), ([0, -32768, 0], [0, 51])] {
        rows.extend(position.iter().flat_map(|value| value.to_le_bytes()));
        rows.extend([0, 0]);
        rows.extend(uv);
        rows.extend([0, 0]);
    }
    let view = builder.view(&rows[..rows.len() - 2]);
    builder.view_json(view)["byteStride"] = 12.into();
    let row = |offset: usize, component: u32, kind: &str| {
        json!({ "bufferView": view, "byteOffset": offset, "componentType": component, "normalized": true,
            "count": 3, "type": kind })
    };
    let position = builder.accessor(row(0, 5122, "VEC3"));
    let uv = builder.accessor(row(8, 5121, "VEC2"));
    let image = builder.view(&tiny_png());
    let document = json!({
        "extensionsRequired": ["KHR_mesh_quantization"],
        "nodes": [{ "mesh": 0, "scale": [4, 4, 4] }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": position, "TEXCOORD_0": uv }, "material": 0 }] }],
        "materials": [{ "pbrMetallicRoughness": { "metallicFactor": 0, "baseColorTexture": { "index": 0 } } }],
        "textures": [{ "source": 0 }],
        "images": [{ "bufferView": image, "mimeType": "image/png" }],
    });
    let scene = scene_of(builder, document);
    let triangle = all(&scene)[0];
    // −32768 counts as −1.
    assert_eq!(triangle.position, [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, -4.0, 0.0]]);
    assert_eq!(triangle.base_uv, [[0.0, 0.0], [1.0, 0.0], [0.0, 0.2]]);
}

#[test]
fn sparse_accessors_with_and_without_a_base() {
    for has_base in [true, false] {
        let mut builder = Builder::default();
        let base = builder.view(&floats(&TRIANGLE));
        let indices = builder.view(&shorts(&[1, 2]));
        let values = builder.view(&floats(&[5.0, 0.0, 0.0, 0.0, 6.0, 0.0]));
        let mut accessor = json!({
            "componentType": 5126, "count": 3, "type": "VEC3",
            "sparse": {
                "count": 2,
                "indices": { "bufferView": indices, "componentType": 5123 },
                "values": { "bufferView": values },
            },
        });
        if has_base {
            accessor["bufferView"] = base.into();
        }
        let position = builder.accessor(accessor);
        let document = json!({
            "nodes": [{ "mesh": 0 }],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": position } }] }],
        });
        let scene = scene_of(builder, document);
        assert_eq!(positions(&scene), [[[0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [0.0, 6.0, 0.0]]]);
    }
}

#[test]
fn instances_hang_under_their_node() {
    let mut builder = Builder::default();
    let position = builder.vectors(&TRIANGLE, 3);
    let translation = builder.vectors(&[0.0, 0.0, 0.0, 0.0, 0.0, 3.0], 3);
    let scale = builder.vectors(&[1.0, 1.0, 1.0, -1.0, 1.0, 1.0], 3);
    // The second turns half round z, in normalized 16-bit integers.
    let rotation = builder.rows(&shorts(&[0, 0, 0, 32767, 0, 0, 32767, 0]), "VEC4", 5122, 2);
    let document = json!({
        "extensionsUsed": ["EXT_mesh_gpu_instancing"],
        "nodes": [{ "name": "many", "mesh": 0, "translation": [10, 0, 0], "extensions": { "EXT_mesh_gpu_instancing":
            { "attributes": { "TRANSLATION": translation, "ROTATION": rotation, "SCALE": scale } } } }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": position } }] }],
    });
    let scene = scene_of(builder, document);
    assert_eq!(scene.surfaces.len(), 2);
    assert!(scene.surfaces.iter().all(|surface| surface.node == 0 && &*surface.name == "many"));
    assert_eq!(
        positions(&scene),
        [
            [[10.0, 0.0, 0.0], [11.0, 0.0, 0.0], [10.0, 1.0, 0.0]],
            // Mirrored in x, then turned: x stays, y flips; the mirroring swaps the corners.
            [[10.0, 0.0, 3.0], [10.0, -1.0, 3.0], [11.0, 0.0, 3.0]],
        ]
    );
}

#[test]
fn vertex_colours_of_every_kind() {
    for (bytes, kind, component) in [
        (vec![255, 0, 51, 0, 255, 0, 51, 0, 255, 0, 51, 0], "VEC3", 5121),
        (shorts(&[65535, 0, 13107, 0].repeat(3)), "VEC3", 5123),
        (floats(&[1.0, -3.0, 0.2].repeat(3)), "VEC3", 5126),
        (floats(&[7.0, 0.0, 0.2, 1.0].repeat(3)), "VEC4", 5126),
    ] {
        let mut builder = Builder::default();
        let position = builder.vectors(&TRIANGLE, 3);
        let colour = builder.rows(&bytes, kind, component, 3);
        let stride = match component {
            5121 => Some(4),
            5123 => Some(8),
            _ => None,
        };
        if let Some(stride) = stride {
            builder.view_json(1)["byteStride"] = stride.into();
        }
        let document = json!({
            "nodes": [{ "mesh": 0 }],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": position, "COLOR_0": colour } }] }],
        });
        let scene = scene_of(builder, document);
        assert!(scene.surfaces[0].has_colours);
        assert_eq!(all(&scene)[0].colour, [[1.0, 0.0, 0.2, 1.0]; 3], "{kind} {component}");
    }
}

#[test]
fn morph_targets_count_at_their_default_weights() {
    let mut builder = Builder::default();
    let position = builder.vectors(&TRIANGLE, 3);
    let up = builder.vectors(&[0.0, 0.0, 2.0].repeat(3), 3);
    let right = builder.vectors(&[4.0, 0.0, 0.0].repeat(3), 3);
    let document = json!({
        "nodes": [{ "mesh": 0 }, { "mesh": 0, "weights": [0, 0.25] }],
        "meshes": [{ "weights": [0.5, 0], "primitives": [{
            "attributes": { "POSITION": position }, "targets": [{ "POSITION": up }, { "POSITION": right }],
        }] }],
        "animations": [{ "channels": [], "samplers": [] }],
    });
    let scene = scene_of(builder, document);
    assert_eq!(positions(&scene)[0][0], [0.0, 0.0, 1.0]);
    assert_eq!(positions(&scene)[1][0], [1.0, 0.0, 0.0]);
    assert_eq!(codes(&scene), ["morph-targets-at-default", "animation-ignored"]);
}

#[test]
fn skins_stand_at_rest() {
    let mut builder = Builder::default();
    let position = builder.vectors(&TRIANGLE, 3);
    let joints = builder.rows(&[0, 1, 0, 0].repeat(3), "VEC4", 5121, 3);
    let weights = builder.vectors(&[1., 0., 0., 0., 0., 1., 0., 0., 1., 1., 0., 0.], 4);
    let moved = |x: f32| [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., x, 0., 0., 1.];
    let inverse = builder.vectors(&[moved(0.0), moved(-1.0)].concat(), 16);
    let document = json!({
        // The mesh's own translation does not count (section 3.7.3.3).
        "nodes": [
            { "mesh": 0, "skin": 0, "translation": [100, 0, 0] }, { "translation": [0, 0, 2] }, { "translation": [1, 0, 4] },
        ],
        "skins": [{ "joints": [1, 2], "inverseBindMatrices": inverse }],
        "meshes": [{ "primitives": [{ "attributes":
            { "POSITION": position, "JOINTS_0": joints, "WEIGHTS_0": weights } }] }],
    });
    let scene = scene_of(builder, document);
    // The third vertex follows both joints alike; its weights add up to 2 and are scaled.
    assert_eq!(positions(&scene), [[[0.0, 0.0, 2.0], [1.0, 0.0, 4.0], [0.0, 1.0, 3.0]]]);
    assert_eq!(codes(&scene), ["skin-at-rest"]);
}

#[test]
fn buffers_from_files_and_data_uris() {
    let bytes = floats(&TRIANGLE);
    let document = |uri: &str| {
        json!({
            "asset": { "version": "2.0" },
            "buffers": [{ "uri": uri, "byteLength": 36 }],
            "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
            "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" }],
            "meshes": [{ "name": "mesh", "primitives": [{ "attributes": { "POSITION": 0 } }] }],
            "nodes": [{ "mesh": 0 }],
        })
    };
    let mut files = Files::default();
    files.0.insert("ein ordner/a#b.bin".into(), bytes);
    let base64 = "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";
    for uri in ["ein%20ordner/a%23b.bin".to_owned(), format!("data:application/octet-stream;base64,{base64}")] {
        let text = document(&uri).to_string();
        let scene = scene::read("a.gltf", Bytes::new(text), &files, &ReadOptions::default());
        let scene = scene.unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(positions(&scene), [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]]);
        assert_eq!(&*scene.surfaces[0].name, "mesh");
    }
}

#[test]
fn unknown_extensions_are_ignored_unless_required() {
    let scene = one_triangle(json!({ "extensionsUsed": ["ACME_glow", "KHR_materials_unlit", "ACME_smell"] }));
    assert_eq!((codes(&scene), scene.warnings.0[0].count), (vec!["extension-ignored"], 2));
    assert!(scene.warnings.0[0].message.contains("ACME_glow, ACME_smell"));
}
