//! The mesh is the same wherever it is built and however it came.

use super::{Mesh, MeshOptions, Quality, build, find_valid_samples, hierarchy, hierarchy_of};
use crate::column::tests::HeapScratch;
use crate::column::{Bytes, Store};
use crate::resources::Resources;
use crate::scene::{self, ReadOptions, Scene};
use std::io;
use std::path::Path;

/// Files of `scenes/`, and a texture with holes.
struct Files<'a>(Store<'a>);

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

/// Textures of all kinds, vertex colours, materials in turn, and more facets than are coloured at once.
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
    obj
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
        let hierarchy = hierarchy(&shared);
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
