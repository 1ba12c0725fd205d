//! The scenes in `scenes/`, read and cut as their README says.

use ringlight::column::Store;
use ringlight::mesh::{self, MeshOptions};
use ringlight::resources::{Bytes, Resources};
use ringlight::scene::{self, ReadOptions};
use std::path::PathBuf;

struct Folder(PathBuf);

impl Resources for Folder {
    fn read(&self, path: &str) -> std::io::Result<Bytes> {
        std::fs::read(self.0.join(path)).map(Bytes::new)
    }
}

fn counts(file: &str, patch: f64, element: f64) -> (usize, usize) {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let bytes = Bytes::new(std::fs::read(folder.join(file)).unwrap());
    let scene = scene::read(file, bytes, &Folder(folder), &ReadOptions::default()).unwrap();
    let options = MeshOptions { patch_size: Some(patch), element_size: Some(element), ..MeshOptions::default() };
    let mesh = mesh::build(&scene, &options, Store::Heap).unwrap();
    mesh.check().unwrap();
    (mesh.patch_count(), mesh.element_count())
}

#[test]
fn the_office_has_the_papers_patches_and_elements_at_its_recorded_sizes() {
    assert_eq!(counts("office.glb", 0.475, 0.1945), (4738, 17251));
}

#[test]
fn the_other_scenes_are_cut_as_recorded() {
    assert_eq!(counts("gallery.glb", 0.6, 0.19), (1049, 13788));
    assert_eq!(counts("furnace.glb", 0.5, 0.125), (546, 8264));
}
