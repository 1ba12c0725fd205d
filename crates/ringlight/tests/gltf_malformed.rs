//! Damaged glTF is refused with its place.

mod support;

use serde_json::{Value, json};
use support::{document, glb, read_all, shorts, split, valid};

/// The valid scene with the value at `pointer` replaced, or removed by `null`.
fn changed(pointer: &str, value: Value) -> Vec<u8> {
    let (mut json, binary) = split(&valid());
    let (parent, key) = pointer.rsplit_once('/').expect("a pointer");
    let parent = json.pointer_mut(parent).unwrap_or_else(|| panic!("{pointer}"));
    match parent {
        Value::Array(items) => items[key.parse::<usize>().expect("an index")] = value,
        _ if value.is_null() => drop(parent.as_object_mut().expect("an object").remove(key)),
        _ => parent[key] = value,
    }
    glb(&json.to_string(), &binary)
}

fn refused(case: &str, file: &[u8], place: &str) {
    match read_all("test.glb", file) {
        Ok(_) => panic!("{case}: accepted"),
        Err(error) => {
            let at = &error.place.at;
            assert!(at.contains(place), "{case}: error at {at:?}, expected {place:?} ({error})");
            assert_eq!(&*error.place.file, "test.glb", "{case}");
        }
    }
}

#[test]
fn the_scene_that_is_damaged_below_is_valid() {
    let surfaces = read_all("test.glb", &valid()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(surfaces.iter().map(Vec::len).collect::<Vec<_>>(), [2, 2, 2]);
}

#[test]
fn changed_values_are_refused_at_their_place() {
    let huge = json!(4_294_967_295_u32);
    let enormous = json!(u64::MAX);
    for (pointer, value, place) in [
        ("/asset/version", json!("1.0"), "asset.version"),
        ("/asset/version", json!(null), "asset.version"),
        ("/asset/minVersion", json!("2.1"), "asset.minVersion"),
        ("/extensionsRequired", json!(["KHR_texture_basisu"]), "extensionsRequired[0]"),
        ("/scene", json!(7), "scene"),
        ("/scene", json!(-1), "scene"),
        ("/scenes/0/nodes", json!([9]), "scenes[0].nodes[0]"),
        ("/scenes/0/nodes", json!([0, 0]), "scenes[0].nodes[1]"),
        ("/scenes/0/nodes", json!([1]), "scenes[0].nodes[0]"),
        ("/scenes/0/nodes", json!([3]), "scenes"),
        ("/scenes/0/nodes", json!([]), "scenes"),
        ("/nodes/0/children", json!([99]), "nodes[0].children[0]"),
        ("/nodes/0/children", json!([0]), "nodes[0].children"),
        ("/nodes/0/children", json!([1, 1]), "nodes[0].children[1]"),
        ("/nodes/1/children", json!([0]), "children"),
        ("/nodes/3/children", json!([1]), "nodes[3].children[0]"),
        ("/nodes/0/scale", json!([1e300, 1e300, 1e300]), "meshes[0].primitives[0].attributes.POSITION[1]"),
        ("/nodes/1/scale", json!([1.7e308, 1.7e308, 1.7e308]), "nodes[1]"),
        ("/nodes/0/scale", json!([1, 2]), "nodes[0].scale"),
        ("/nodes/0/matrix", json!([1, 2, 3]), "nodes[0].matrix"),
        ("/nodes/1/mesh", json!(2), "nodes[1].mesh"),
        ("/nodes/2/skin", json!(1), "nodes[2].skin"),
        ("/nodes/2/camera", json!(1), "nodes[2].camera"),
        ("/nodes/3/extensions/KHR_lights_punctual/light", json!(1), "nodes[3].extensions.KHR_lights_punctual.light"),
        ("/nodes/1/extensions/EXT_mesh_gpu_instancing/attributes/TRANSLATION", json!(99), "nodes[1].extensions"),
        (
            "/nodes/1/extensions/EXT_mesh_gpu_instancing/attributes/SCALE",
            json!(0),
            "EXT_mesh_gpu_instancing.attributes",
        ),
        ("/extensions/KHR_lights_punctual/lights/0/type", json!("area"), "lights[0].type"),
        ("/extensions/KHR_lights_punctual/lights/0/intensity", json!(-1), "lights[0].intensity"),
        ("/extensions/KHR_lights_punctual/lights/0/range", json!(0), "lights[0].range"),
        ("/meshes/0/primitives/0/mode", json!(7), "meshes[0].primitives[0].mode"),
        ("/meshes/0/primitives/0/indices", json!(99), "meshes[0].primitives[0].indices"),
        ("/meshes/0/primitives/0/indices", json!(0), "accessors[0].componentType"),
        ("/meshes/0/primitives/0/material", json!(3), "meshes[0].primitives[0].material"),
        ("/meshes/0/primitives/0/attributes/POSITION", json!(2), "accessors[2].type"),
        ("/meshes/0/primitives/0/attributes/POSITION", json!("0"), "meshes[0].primitives[0].attributes.POSITION"),
        ("/meshes/0/primitives/0/targets/0/POSITION", json!(8), "meshes[0].primitives[0].targets[0].POSITION"),
        ("/skins/0/joints", json!([8]), "skins[0].joints[0]"),
        ("/skins/0/joints", json!([3, 3]), "skins[0].inverseBindMatrices"),
        ("/skins/0/joints", json!([]), "JOINTS_0[0]"),
        ("/materials/0/alphaMode", json!("FOG"), "materials[0].alphaMode"),
        ("/materials/0/emissiveFactor", json!([1e39, 0, 0]), "materials[0].emissiveFactor"),
        ("/materials/0/pbrMetallicRoughness/baseColorTexture/index", json!(4), "baseColorTexture.index"),
        ("/textures/0/source", json!(4), "textures[0].source"),
        ("/textures/0/sampler", json!(4), "textures[0].sampler"),
        ("/images/0/uri", json!("../secret.png"), "images[0].uri"),
        ("/images/0/uri", json!("file:///etc/passwd"), "images[0].uri"),
        ("/buffers/0/uri", json!("../../etc/passwd"), "buffers[0].uri"),
        ("/buffers/0/uri", json!("%2e%2e/x.bin"), "buffers[0].uri"),
        ("/buffers/0/uri", json!("/etc/passwd"), "buffers[0].uri"),
        ("/buffers/0/uri", json!("http://example.org/x.bin"), "buffers[0].uri"),
        ("/buffers/0/uri", json!("nowhere.bin"), "buffers[0].uri"),
        ("/buffers/0/uri", json!("data:;base64,!"), "buffers[0].uri"),
        ("/buffers/0/byteLength", huge.clone(), "buffers[0].byteLength"),
        ("/buffers/0/byteLength", enormous.clone(), "buffers[0].byteLength"),
        ("/buffers", json!([]), "bufferViews["),
        ("/bufferViews/0/buffer", json!(1), "bufferViews[0].buffer"),
        ("/bufferViews/0/byteOffset", huge.clone(), "bufferViews[0]"),
        ("/bufferViews/0/byteOffset", enormous.clone(), "bufferViews[0]"),
        ("/bufferViews/0/byteLength", enormous.clone(), "bufferViews[0]"),
        ("/bufferViews/0/byteLength", json!(-4), "bufferViews[0].byteLength"),
        ("/bufferViews/0/byteStride", json!(4), "bufferViews[0].byteStride"),
        ("/bufferViews/0/byteStride", json!(0), "bufferViews[0].byteStride"),
        ("/bufferViews/0/byteStride", enormous.clone(), "accessors[0]"),
        ("/accessors/0/bufferView", json!(99), "accessors[0].bufferView"),
        ("/accessors/0/byteOffset", json!(4), "accessors[0]"),
        ("/accessors/0/byteOffset", enormous.clone(), "accessors[0]"),
        ("/accessors/0/count", json!(5), "accessors[0]"),
        ("/accessors/0/count", huge.clone(), "accessors[0]"),
        ("/accessors/0/count", enormous.clone(), "accessors[0]"),
        ("/accessors/0/count", json!(1), "meshes[0].primitives[0].indices[1]"),
        ("/accessors/0/componentType", json!(1), "accessors[0].componentType"),
        ("/accessors/0/type", json!("VEC9"), "accessors[0].type"),
        ("/accessors/3/count", json!(3), "meshes[0].primitives[0].attributes.COLOR_0"),
        ("/accessors/4/count", enormous.clone(), "accessors[4]"),
        ("/accessors/4/count", huge.clone(), "accessors[4]"),
        ("/accessors/4/count", json!(3), "accessors[4].sparse.indices[1]"),
        ("/accessors/4/sparse/count", json!(3), "accessors[4].sparse.indices"),
        ("/accessors/4/sparse/count", enormous.clone(), "accessors[4].sparse.indices"),
        ("/accessors/4/sparse/indices/bufferView", json!(99), "accessors[4].sparse.indices"),
        ("/accessors/4/sparse/values/byteOffset", huge.clone(), "accessors[4].sparse.values"),
        ("/accessors/4/sparse/indices/componentType", json!(5126), "accessors[4].sparse.indices.componentType"),
    ] {
        refused(&format!("{pointer} = {value}"), &changed(pointer, value.clone()), place);
    }
}

/// The valid scene with `bytes` written over the start of buffer view `view`.
fn overwritten(view: usize, offset: usize, bytes: &[u8]) -> Vec<u8> {
    let (json, mut binary) = split(&valid());
    let start = json["bufferViews"][view]["byteOffset"].as_u64().expect("an offset") as usize + offset;
    binary[start..start + bytes.len()].copy_from_slice(bytes);
    glb(&json.to_string(), &binary)
}

#[test]
fn undefined_positions_and_wrong_indices_are_found_when_triangles_are_read() {
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let file = overwritten(0, 12 * 2 + 4, &value.to_le_bytes());
        refused("undefined position", &file, "meshes[0].primitives[0].attributes.POSITION[2]");
    }
    refused("index", &overwritten(1, 2 * 5, &shorts(&[4])), "meshes[0].primitives[0].indices[5]");
    refused("index", &overwritten(1, 0, &shorts(&[65535])), "meshes[0].primitives[0].indices[0]");
    refused("joint", &overwritten(6, 0, &[9]), "meshes[1].primitives[0].attributes.JOINTS_0[0]");
    refused("translation", &overwritten(9, 12, &f32::NAN.to_le_bytes()), "nodes[1].mesh");
    refused("sparse order", &overwritten(4, 0, &shorts(&[3, 3])), "accessors[4].sparse.indices[1]");
    refused("sparse range", &overwritten(4, 2, &shorts(&[4])), "accessors[4].sparse.indices[1]");
}

#[test]
fn damaged_containers_are_refused_at_their_byte() {
    let file = valid();
    let with_word = |offset: usize, word: u32| {
        let mut file = file.clone();
        file[offset..offset + 4].copy_from_slice(&word.to_le_bytes());
        file
    };
    let json_length = u32::from_le_bytes(file[12..16].try_into().expect("four bytes"));
    refused("version", &with_word(4, 1), "byte 4");
    refused("file length", &with_word(8, u32::MAX), "byte 8");
    refused("chunk length", &with_word(12, u32::MAX), "byte 12");
    refused("chunk length", &with_word(12, json_length + 4_000_000), "byte 12");
    refused("chunk kind", &with_word(16, 0), "byte 12");
    refused("binary length", &with_word(20 + json_length as usize, u32::MAX), &format!("byte {}", 20 + json_length));
    refused("magic only", b"glTF", "byte 4");
    refused("truncated", &file[..file.len() - 1], "byte 8");
    for length in 0..file.len() {
        assert!(read_all("test.glb", &file[..length]).is_err(), "truncated to {length} bytes");
    }
}

#[test]
fn invalid_json_is_refused_with_line_and_column() {
    let refused = |text: &str, place: &str| {
        let error = read_all("test.gltf", text.as_bytes()).expect_err(text);
        assert!(error.place.at.contains(place), "{text:?}: {error}");
    };
    refused("", "line 1 column 0");
    refused("{\n  \"asset\": {,}\n}", "line 2 column 13");
    refused("{\"asset\":{\"version\":\"2.0\"}} x", "line 1 column 29");
    refused("[]", "line 1");
    refused("{\"asset\":{\"version\":\"2.0\"},\"nodes\":[{\"scale\":[1e999,1,1]}]}", "line 1");
    refused("{\"asset\":{\"version\":\"2.0\"},\"nodes\":[{\"name\":[]}]}", "nodes[0].name");
    refused("{\"asset\":{\"version\":\"2.0\"},\"nodes\":{}}", "nodes");
    let deep = format!("{{\"asset\":{{\"version\":\"2.0\",\"extras\":{}", "[".repeat(1_000_000));
    refused(&deep, "line 1");
    let deep = format!("{{\"nodes\":[{{\"extras\":{}", "{\"a\":".repeat(1_000_000));
    refused(&deep, "line 1");
}

#[test]
fn a_chain_of_a_hundred_thousand_nodes_is_read() {
    let (builder, mut document) = document();
    let depth = 100_000;
    let mut nodes: Vec<Value> = (0..depth).map(|index| json!({ "children": [index + 1] })).collect();
    nodes.push(json!({ "mesh": 0, "translation": [1, 0, 0] }));
    document["nodes"] = nodes.into();
    document["scenes"] = json!([{ "nodes": [0] }]);
    let surfaces = read_all("test.glb", &builder.finish(document)).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(surfaces[0][0].position[0], [1.0, 0.0, 0.0]);
}

#[test]
fn a_cycle_is_refused_at_a_node_of_it() {
    let (builder, mut document) = document();
    // 1 → 2 → 1, and 3 hangs below it.
    document["nodes"] = json!([{ "mesh": 0 }, { "children": [2, 3] }, { "children": [1] }, {}]);
    document["scenes"] = json!([{ "nodes": [0] }]);
    let error = read_all("test.glb", &builder.finish(document)).expect_err("a cycle");
    assert!(["nodes[1].children", "nodes[2].children"].contains(&&*error.place.at), "{error}");
}

#[test]
fn more_surfaces_than_any_memory_holds_are_refused() {
    // 3 000 nodes with a mesh of 3 000 primitives: 9 million surfaces from 200 kB.
    let (builder, mut document) = document();
    document["nodes"] = vec![json!({ "mesh": 0 }); 3_000].into();
    document["scenes"] = json!([{ "nodes": (0..3_000).collect::<Vec<_>>() }]);
    document["meshes"] = json!([{ "primitives": vec![json!({ "attributes": { "POSITION": 0 } }); 3_000] }]);
    let error = read_all("test.glb", &builder.finish(document)).expect_err("too many");
    assert!(error.place.at.starts_with("nodes["), "{error}");
}

#[test]
fn damaged_draco_data_is_refused_unless_the_plain_data_is_there_too() {
    let draco = |is_plain: bool| {
        let (builder, mut document) = document();
        let position = if is_plain { 0 } else { 4 };
        document["meshes"][0]["primitives"] = json!([{
            "attributes": { "POSITION": position },
            "extensions": { "KHR_draco_mesh_compression": { "bufferView": 0, "attributes": { "POSITION": 0 } } },
        }]);
        builder.finish(document)
    };
    refused("draco", &draco(false), "meshes[0].primitives[0].extensions.KHR_draco_mesh_compression");
    assert!(read_all("test.glb", &draco(true)).is_ok());
}

#[test]
fn unknown_kinds_of_files_are_refused() {
    let error = read_all("scene.blend", b"BLENDER").expect_err("not a scene");
    assert_eq!(&*error.place.file, "scene.blend");
}
