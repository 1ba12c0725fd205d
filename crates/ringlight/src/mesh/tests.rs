//! The mesh is the same wherever it is built and however it came.

use super::{Frame, Mesh, MeshOptions, NONE, Quality, build, find_valid_samples, hierarchy, hierarchy_of};
use crate::column::tests::HeapScratch;
use crate::column::{Bytes, Store};
use crate::output::fixture::mixed;
use crate::resources::Resources;
use crate::scene::{self, ReadOptions, Scene};
use std::io;
use std::path::Path;
use std::sync::Arc;

/// Files of `scenes/`, and a texture with holes.
pub(super) struct Files<'a>(pub(super) Store<'a>);

impl Resources for Files<'_> {
    fn read(&self, path: &str) -> io::Result<Bytes> {
        match path {
            "panes.mtl" => Ok(Bytes::new(MATERIALS)),
            "leaf.png" => {
                let texels =
                    |x: u32, y: u32| image::Rgba([50 * x as u8, 200, 30 * y as u8, (60 * (x + y) % 255) as u8]);
                let mut png = io::Cursor::new(Vec::new());
                image::RgbaImage::from_fn(5, 4, texels).write_to(&mut png, image::ImageFormat::Png).unwrap();
                Ok(Bytes::new(png.into_inner()))
            }
            _ => {
                let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
                std::fs::read(folder.join(path)).map(Bytes::new)
            }
        }
    }

    fn store(&self) -> Store<'_> {
        self.0
    }
}

const MATERIALS: &[u8] =
    b"newmtl pane\nKd 0.8 0.8 0.8\nd 0.5\nmap_Kd leaf.png\nnewmtl leaf\nmap_Kd leaf.png\nmap_d leaf.png\n\
    newmtl lamp\nKe 9 8 7\nmap_Ke leaf.png\nnewmtl wall\nKd 0.6 0.5 0.4\n";

/// Textures of all kinds, vertex colours, materials in turn, and more facets than are coloured at once, and a large triangle.
fn panes() -> String {
    let mut obj = String::from("mtllib panes.mtl\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n");
    for k in 0..2000 {
        let (x, y, z) = (k % 20, k / 20 % 20, f64::from(k / 400) + 0.01 * f64::from(k % 7));
        for (dx, dy) in [(0.0, 0.0), (0.9, 0.0), (0.9, 0.8), (0.0, 0.8)] {
            obj += &format!("v {} {} {z} 0.5 {} 1\n", f64::from(x) + dx, f64::from(y) + dy, 0.05 * f64::from(x));
        }
        let material = ["pane", "leaf", "lamp", "wall"][k as usize / 3 % 4];
        obj += &format!("usemtl {material}\nf -4/1 -3/2 -2/3 -1/4\n");
    }
    obj + "usemtl wall\nv 0 0 -3\nv 20 0 -3\nv 0 20 -3\nf -3 -2 -1\n"
}

fn read(name: &str, store: Store<'_>) -> Scene {
    let files = Files(store);
    let bytes = if name == "panes.obj" { Bytes::new(panes()) } else { files.read(name).unwrap() };
    scene::read(name, bytes, &files, &ReadOptions::default()).unwrap()
}

fn bytes(mesh: &Mesh) -> Vec<u8> {
    let mut bytes = Vec::new();
    mesh.share(&mut bytes).unwrap();
    bytes
}

const SCENES: [&str; 3] = ["panes.obj", "cornell_box.obj", "office.glb"];

#[test]
fn a_mesh_built_in_scratch_memory_is_that_built_on_the_heap() {
    let options = MeshOptions { quality: Quality::Draft, ..MeshOptions::default() };
    for name in SCENES {
        let of = |store| build(&read(name, store), &options, store).unwrap();
        let (heap, scratch) = (of(Store::Heap), of(Store::Scratch(&HeapScratch)));
        heap.check().unwrap();
        assert!(bytes(&heap) == bytes(&scratch), "{name}");
        assert!(name != "panes.obj" || heap.occluder.facet_coverage.len() > 400 && !heap.occluder.bitmaps.is_empty());
    }
}

#[test]
fn a_shared_mesh_is_the_same_and_can_be_written() {
    let options = MeshOptions { quality: Quality::Draft, ..MeshOptions::default() };
    for name in SCENES {
        let mut mesh = build(&read(name, Store::Heap), &options, Store::Heap).unwrap();
        let written = Bytes::new(bytes(&mesh));
        let mut shared = Mesh::shared(&written).unwrap();
        assert!(bytes(&shared) == written[..], "{name}");
        let hierarchy = Arc::new(hierarchy(&shared));
        find_valid_samples(&mut mesh, &hierarchy);
        find_valid_samples(&mut shared, &hierarchy);
        assert!(bytes(&shared) == bytes(&mesh) && (name != "office.glb" || bytes(&mesh) != written[..]), "{name}");
    }
}

#[test]
fn bytes_that_are_no_mesh_are_refused() {
    let mesh = build(&read("cornell_box.obj", Store::Heap), &MeshOptions::default(), Store::Heap).unwrap();
    let written = bytes(&mesh);
    for length in [0, 7, 8, 50, written.len() / 2, written.len() - 64] {
        assert!(Mesh::shared(&Bytes::new(written[..length].to_vec())).is_err(), "{length}");
    }
}

#[test]
fn parts_of_a_hierarchy_hold_the_triangles_of_the_whole() {
    let mesh = build(&read("panes.obj", Store::Heap), &MeshOptions::default(), Store::Heap).unwrap();
    let whole = hierarchy(&mesh);
    let count = mesh.facets.len() as u32;
    let part = |third| hierarchy_of(&mesh, (0..count).filter(move |f| f / 10 % 3 == third)).triangles().to_vec();
    let mut found = [part(0), part(1), part(2)].concat();
    let mut expected = whole.triangles().to_vec();
    for triangles in [&mut found, &mut expected] {
        triangles.iter_mut().for_each(|t| t.filter = u32::from(t.filter == ringlight_visibility::OPAQUE));
        triangles.sort_by_key(|t| t.id);
    }
    assert!(found == expected && !found.is_empty());
}

/// A scene and its mesh with patches refined here and there.
fn refined(name: &str, subdivision: impl Fn(u32) -> u8) -> (Mesh, Mesh) {
    let options = MeshOptions { quality: Quality::Draft, ..MeshOptions::default() };
    let scene = read(name, Store::Heap);
    let mesh = build(&scene, &options, Store::Heap).unwrap();
    let subdivisions: Vec<u8> = (0..mesh.patch_count() as u32).map(subdivision).collect();
    let refined = mesh.refined(&scene, &subdivisions, Store::Heap).unwrap();
    (mesh, refined)
}

#[test]
fn a_mesh_without_a_refined_patch_is_the_same() {
    for name in SCENES {
        let (mesh, same) = refined(name, |_| 1);
        assert!(bytes(&mesh) == bytes(&same), "{name}");
        let (_, finer) = refined(name, mixed([1, 2, 4, 3]));
        let scene = read(name, Store::Heap);
        let again = finer.refined(&scene, &vec![1; mesh.patch_count()], Store::Scratch(&HeapScratch)).unwrap();
        assert!(bytes(&mesh) == bytes(&again), "{name}");
    }
}

#[test]
fn refined_patches_consist_of_their_elements() {
    for name in SCENES {
        let subdivision = mixed([1, 2, 4, 3]);
        let (coarse, mesh) = refined(name, &subdivision);
        mesh.check().unwrap();
        let (mut mixed, mut triangles) = (0, 0);
        for facet in &mesh.facets {
            mixed += facet.sides().filter(|&back| mesh.common_subdivision(facet, back).is_none()).count();
            triangles += usize::from(facet.triangle_count() == 1 && facet.patch_count() > 1);
        }
        assert!(mixed > 0 && (name != "panes.obj" || triangles > 0), "{name}: {mixed} sides, {triangles} triangles");
        for id in 0..mesh.patch_count() as u32 {
            let (patch, whole) = (mesh.patch(id), coarse.patch(id));
            assert_eq!((patch.frame, patch.facet, patch.back), (whole.frame, whole.facet, whole.back));
            let s = u32::from(subdivision(id));
            assert_eq!((patch.grid, mesh.subdivision(id)), (whole.grid.map(|n| n * s), s));
            let facet = &mesh.facets[patch.facet as usize];
            let (mut area, middle) = (0.0, Frame::middle(facet.layout()));
            for (k, element) in (0..).zip(patch.elements()) {
                let at = patch.tile.compose(patch.element_tile(k)).at(middle);
                let (found, of_it, within) = mesh.find_element(facet, patch.back, at);
                assert_eq!((found, of_it, mesh.patch_of(element)), (id, element, id));
                assert!((within - middle).length() < 1e-6);
                area += patch.element_area(k);
            }
            assert!((area / patch.area - 1.0).abs() < 1e-6, "{name}: patch {id}: {area} of {}", patch.area);
        }
    }
}

#[test]
fn refined_elements_have_the_colours_of_their_place() {
    let (coarse, mesh) = refined("panes.obj", mixed([1, 2, 4, 3]));
    let own = |mesh: &Mesh| mesh.facets.iter().filter(|f| f.colours[0] != f.colours[1]).count();
    assert!(own(&coarse) == 0 && own(&mesh) > 200, "only {} facets have two sets of colours", own(&mesh));
    assert_eq!((&mesh.warnings, &mesh.skipped), (&coarse.warnings, &coarse.skipped));
    assert_eq!(mesh.occluder.facet_coverage, coarse.occluder.facet_coverage);
    let mut textured = 0;
    for id in 0..mesh.patch_count() as u32 {
        let mean = |mesh: &Mesh| {
            let (patch, mut sum) = (mesh.patch(id), [0.0f64; 2]);
            for (k, element) in (0..).zip(patch.elements()) {
                let (colour, share) = (mesh.colour(&patch, element), patch.element_area(k) / patch.area);
                // Alpha weighs reflectances, so it is their products with it that add up.
                sum[0] += share * f64::from(colour.returned()[1]);
                sum[1] += share * f64::from(colour.exitance[1]);
            }
            sum
        };
        let (fine, whole) = (mean(&mesh), mean(&coarse));
        textured += usize::from(mesh.facets[mesh.side_of(id).0 as usize].colours[0] != NONE);
        // Texels over small areas are added up otherwise than over large ones, and products of two averages are not their average.
        assert!(
            (0..2).all(|i| (fine[i] - whole[i]).abs() < 0.05 * whole[i].max(0.1)),
            "patch {id}: {fine:?} {whole:?}"
        );
    }
    assert!(textured > 1000);
}

#[test]
fn too_many_elements_are_refused() {
    let options = MeshOptions { element_size: Some(0.001), patch_size: Some(0.1), ..MeshOptions::default() };
    let scene = read("cornell_box.obj", Store::Heap);
    let mesh = build(&scene, &options, Store::Heap).unwrap();
    let error = mesh.refined(&scene, &vec![255; mesh.patch_count()], Store::Heap).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("at most 2 billion"), "{error}");
}

#[test]
fn numbers_of_elements_that_cannot_be_are_refused() {
    let (_, mesh) = refined("cornell_box.obj", mixed([1, 2, 3]));
    let last = mesh.patch_count();
    let refused = |how: &str, spoil: &dyn Fn(&mut Mesh)| {
        let mut spoilt = mesh.clone();
        spoil(&mut spoilt);
        assert!(spoilt.check().is_err(), "{how}");
    };
    refused("a first element too far", &|m| m.first_elements[1] += 1);
    refused("a descent", &|m| m.first_elements.swap(1, 2));
    refused("a start after the first", &|m| m.first_elements[0] = 1);
    refused("an end before the last", &|m| m.first_elements[last] -= 1);
    refused("an end beyond all", &|m| m.first_elements[last] = u32::MAX);
    refused("none", &|m| m.first_elements.clear());
    refused("one too few", &|m| m.first_elements.resize(last, 0).unwrap());
    refused("all the same", &|m| m.first_elements.fill(0));
    refused("more elements", &|m| m.valid.push(1).unwrap());
    refused("a cluster's end", &|m| m.clusters[0].elements.end -= 1);
    refused("no clusters", &|m| m.clusters.clear());
    refused("a grid of no elements", &|m| m.facets[0].elements = [0, 1]);
    refused("a grid of no patches", &|m| m.facets[0].patches = [0, 1]);
    refused("a patch of another facet", &|m| m.facets[1].first_patch = m.facets[0].first_patch);
    refused("a patch beyond all", &|m| m.facets[1].first_patch = NONE - 1);
    refused("a side that nothing refers to", &|m| m.facets[0].first_back_patch = NONE);
    refused("colours beyond all", &|m| m.facets[0].colours = [0, 7]);
}
