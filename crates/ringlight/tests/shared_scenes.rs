//! The shared scenes load with the triangle counts that their table states.

mod support;

use ringlight::resources::Bytes;
use ringlight::scene::{self, LightKind, ReadOptions, Scene};
use std::path::{Path, PathBuf};
use support::{Folder, triangles};

/// Where developers keep the shared scenes; none on a fresh clone.
fn folder() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scenes");
    if !folder.is_dir() {
        println!("the shared scenes were not found; nothing is tested");
        return None;
    }
    Some(folder)
}

fn load(path: &Path) -> Scene {
    let bytes = std::fs::read(path).unwrap_or_else(|cause| panic!("{}: {cause}", path.display()));
    let parent = path.parent().expect("a file has a folder");
    scene::read(&path.to_string_lossy(), Bytes::new(bytes), &Folder(parent.into()), &ReadOptions::default())
        .unwrap_or_else(|error| panic!("{error}"))
}

/// Surfaces' triangle counts, after reading every triangle.
fn count(scene: &Scene) -> u64 {
    triangles(scene).unwrap_or_else(|error| panic!("{error}")).iter().map(|surface| surface.len() as u64).sum()
}

#[test]
fn every_gltf_scene_has_the_triangles_of_the_table() {
    let Some(folder) = folder() else { return };
    for (file, expected) in [
        ("bakinglab_box/bakinglab_box.gltf", 1_810),
        ("veach_ajar.glb", 4_546),
        ("godot_living_room.glb", 5_088),
        ("lq_e3m4.glb", 26_527),
        ("bimwhale_large_building.glb", 35_474),
        ("radiance_office.glb", 42_122),
        ("classroom.glb", 103_832),
        ("living_room_grey_white/living_room_grey_white.gltf", 143_167),
        ("staircase.glb", 262_663),
        ("radiance_cabin.glb", 274_141),
        ("bathroom.glb", 380_290),
        ("godot_rooms_16.glb", 1_019_520),
        ("robustness/veach_ajar_draco.glb", 4_484),
        ("robustness/veach_ajar_meshopt.glb", 4_546),
        ("robustness/veach_ajar_emissive_texture.glb", 4_546),
        ("robustness/bakinglab_box_quantized.glb", 1_810),
        ("robustness/bakinglab_box_nonindexed_interleaved.glb", 1_810),
        ("robustness/cornell_u8_indices.glb", 38),
        ("robustness/cornell_strip_fan.glb", 38),
        ("robustness/cornell_negative_scale.glb", 152),
        ("robustness/uri escapes/cornell ü.gltf", 38),
        ("robustness/box_sparse.gltf", 12),
        ("robustness/box_sparse.glb", 12),
        ("robustness/SimpleMorph.gltf", 1),
    ] {
        let scene = load(&folder.join(file));
        assert_eq!(count(&scene), expected, "{file}");
        println!("{file}: {:?}", scene.warnings.0.iter().map(|w| (&w.code, w.count)).collect::<Vec<_>>());
        for image in &scene.images {
            scene::texture::TextureImage::decode(image).unwrap_or_else(|error| panic!("{file}: {error}"));
        }
    }
}

/// Total area, area-weighted centre and signed volume: equal for the same scene in another encoding, if no winding flips.
fn moments(scene: &Scene) -> (f64, glam::DVec3, f64) {
    let (mut area, mut centre, mut volume) = (0.0, glam::DVec3::ZERO, 0.0);
    for triangle in triangles(scene).expect("readable").iter().flatten() {
        let [a, b, c] = triangle.position.map(glam::DVec3::from);
        let own = (b - a).cross(c - a).length() / 2.0;
        area += own;
        centre += own * (a + b + c) / 3.0;
        volume += a.dot(b.cross(c)) / 6.0;
    }
    (area, centre / area, volume)
}

#[test]
fn compressed_and_rewritten_scenes_equal_their_plain_twins() {
    let Some(folder) = folder() else { return };
    // Draco's and meshopt's quantization moves vertices by up to 2^-14 of a mesh's extent.
    for (plain, twin, tolerance) in [
        ("veach_ajar.glb", "robustness/veach_ajar_draco.glb", 1e-3),
        ("veach_ajar.glb", "robustness/veach_ajar_meshopt.glb", 1e-3),
        ("veach_ajar.glb", "robustness/veach_ajar_emissive_texture.glb", 0.0),
        ("bakinglab_box/bakinglab_box.gltf", "robustness/bakinglab_box_quantized.glb", 1e-3),
        ("bakinglab_box/bakinglab_box.gltf", "robustness/bakinglab_box_nonindexed_interleaved.glb", 1e-6),
        // The measured red wall is not quite flat, and strips cut it along the other diagonal.
        ("robustness/cornell_u8_indices.glb", "robustness/cornell_strip_fan.glb", 2e-3),
        ("robustness/cornell_u8_indices.glb", "robustness/uri escapes/cornell ü.gltf", 1e-6),
    ] {
        let (plain_area, plain_centre, plain_volume) = moments(&load(&folder.join(plain)));
        let (area, centre, volume) = moments(&load(&folder.join(twin)));
        assert!((area / plain_area - 1.0).abs() <= tolerance, "{twin}: area {area}, expected {plain_area}");
        let distance = (centre - plain_centre).length() / plain_area.sqrt();
        assert!(distance <= tolerance, "{twin}: centre {centre}, expected {plain_centre}");
        let difference = (volume - plain_volume).abs() / plain_area.powf(1.5);
        assert!(difference <= tolerance, "{twin}: volume {volume}, expected {plain_volume}");
    }
}

/// Every uv of `twin` near that of `plain`, triangle by triangle.
#[test]
fn meshopt_keeps_texture_coordinates() {
    let Some(folder) = folder() else { return };
    let range = |file: &str| {
        let scene = load(&folder.join(file));
        let (mut low, mut high) = ([f32::MAX; 2], [f32::MIN; 2]);
        for uv in triangles(&scene).expect("readable").iter().flatten().flat_map(|triangle| triangle.base_uv) {
            low = std::array::from_fn(|axis| low[axis].min(uv[axis]));
            high = std::array::from_fn(|axis| high[axis].max(uv[axis]));
        }
        (low, high)
    };
    let (low, high) = range("veach_ajar.glb");
    for twin in ["robustness/veach_ajar_meshopt.glb", "robustness/veach_ajar_draco.glb"] {
        let (twin_low, twin_high) = range(twin);
        for axis in 0..2 {
            assert!((low[axis] - twin_low[axis]).abs() < 2e-2, "{twin}: {low:?} {twin_low:?}");
            assert!((high[axis] - twin_high[axis]).abs() < 2e-2, "{twin}: {high:?} {twin_high:?}");
        }
    }
}

#[test]
fn instances_lights_and_cameras_are_found() {
    let Some(folder) = folder() else { return };
    let rooms = load(&folder.join("robustness/godot_two_rooms_gpu_instancing.glb"));
    // 8 batches hold 34 instances, which make two rooms of 63 720 triangles.
    assert_eq!((rooms.surfaces.len(), count(&rooms)), (34, 2 * 63_720));

    let living_room = load(&folder.join("godot_living_room.glb"));
    assert_eq!(living_room.lights.len(), 3);
    let sun = living_room.lights.iter().find(|light| matches!(light.kind, LightKind::Directional { .. }));
    let LightKind::Directional { direction } = sun.expect("a sun").kind else { unreachable!() };
    assert!(direction[1] < 0.0, "the sun shines downwards: {direction:?}");

    assert_eq!(load(&folder.join("lq_e3m4.glb")).lights.len(), 296);
    assert_eq!(load(&folder.join("godot_rooms_16.glb")).lights.len(), 16);

    let staircase = load(&folder.join("staircase.glb"));
    assert_eq!(staircase.cameras.len(), 1);
    assert!(staircase.cameras[0].vertical_field_of_view > 0.0);
    assert_eq!(staircase.images.len(), 9);
}
