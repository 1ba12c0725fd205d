//! Randomly damaged glTF never panics.

mod support;

use proptest::prelude::*;
use ringlight::resources::Bytes;
use ringlight::scene::{self, ReadOptions};
use serde_json::Value;
use support::{Files, glb, split, valid};

fn never_panics(name: &str, bytes: Vec<u8>) {
    let read = scene::read(name, Bytes::new(bytes), &Files::default(), &ReadOptions::default());
    if let Ok(scene) = read {
        for surface in 0..scene.surfaces.len() {
            let mut count = 0;
            let result = scene.geometry.triangles(surface, &mut |_| count += 1);
            assert!(result.is_err() || count == scene.surfaces[surface].triangles);
        }
    }
}

/// Writes `changes` (place as a share of the length, new byte) into `file`.
fn mutate(mut file: Vec<u8>, changes: &[(f64, u8)]) -> Vec<u8> {
    for &(share, byte) in changes {
        let at = (share * file.len() as f64) as usize;
        if let Some(slot) = file.get_mut(at) {
            *slot = byte;
        }
    }
    file
}

/// The shared scenes with compressed data, where they are.
fn compressed() -> Vec<Vec<u8>> {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scenes/robustness");
    let files = ["veach_ajar_draco.glb", "veach_ajar_meshopt.glb"];
    files.iter().filter_map(|file| std::fs::read(folder.join(file)).ok()).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_bytes_in_a_glb_never_panic(
        changes in proptest::collection::vec((0.0..1.0, any::<u8>()), 0..8), keep in 0.5..1.0_f64, whole in any::<bool>(),
    ) {
        let mut file = mutate(valid(), &changes);
        if !whole {
            file.truncate((keep * file.len() as f64) as usize);
        }
        never_panics("test.glb", file);
    }

    #[test]
    fn random_characters_in_the_json_never_panic(
        changes in proptest::collection::vec((0.0..1.0, prop::sample::select(&b"0123456789-.eE[]{}\",:nN"[..])), 1..8),
    ) {
        let (json, binary) = split(&valid());
        let text = String::from_utf8(mutate(json.to_string().into_bytes(), &changes)).expect("ASCII");
        never_panics("test.glb", glb(&text, &binary));
    }

    #[test]
    fn random_numbers_in_the_json_never_panic(
        choice in any::<prop::sample::Index>(),
        value in prop_oneof![0..20_u64, any::<u64>(), Just(u64::from(u32::MAX)), Just(1 << 31)],
    ) {
        let (mut json, binary) = split(&valid());
        let mut pointers = Vec::new();
        numbers(&json, String::new(), &mut pointers);
        let pointer = choice.get(&pointers);
        *json.pointer_mut(pointer).expect("the pointer exists") = value.into();
        never_panics("test.glb", glb(&json.to_string(), &binary));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_bytes_in_compressed_data_never_panic(
        changes in proptest::collection::vec((0.0..1.0, any::<u8>()), 1..200),
    ) {
        for file in compressed() {
            // Only the binary chunk: the JSON is tested above.
            let json = u32::from_le_bytes(file[12..16].try_into().expect("four bytes")) as usize;
            let (head, binary) = file.split_at(28 + json);
            never_panics("test.glb", [head, &mutate(binary.to_vec(), &changes)].concat());
        }
    }
}

/// JSON pointers of all numbers.
fn numbers(value: &Value, path: String, found: &mut Vec<String>) {
    match value {
        Value::Number(_) => found.push(path),
        Value::Array(items) => {
            for (index, item) in items.iter().enumerate() {
                numbers(item, format!("{path}/{index}"), found);
            }
        }
        Value::Object(members) => {
            for (key, member) in members {
                numbers(member, format!("{path}/{key}"), found);
            }
        }
        _ => {}
    }
}
