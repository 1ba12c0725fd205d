//! Foretold memory beside what is really stored.

use ringlight::column::Store;
use ringlight::mesh::{self, MeshOptions};
use ringlight::plan::Counts;
use ringlight::resources::{Bytes, Resources};
use ringlight::scene::{self, ReadOptions};
use ringlight::shooting::ClusterLight;
use std::io;

/// No files beside the scene.
struct Nothing;

impl Resources for Nothing {
    fn read(&self, _: &str) -> io::Result<Bytes> {
        Err(io::ErrorKind::NotFound.into())
    }
}

#[test]
fn what_is_foretold_is_what_is_stored() {
    for name in ["office.glb", "gallery.glb", "furnace.glb"] {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes").join(name);
        let bytes = Bytes::new(std::fs::read(path).expect("the scene can be read"));
        let scene = scene::read(name, bytes, &Nothing, &ReadOptions::default()).expect("it is valid");
        let mesh = mesh::build(&scene, &MeshOptions::default(), Store::Heap).expect("it has surfaces");
        let counts = Counts::of(&mesh);
        let mesh_bytes = size_of_val(&*mesh.facets)
            + size_of_val(&*mesh.patch_facets)
            + size_of_val(&*mesh.first_elements)
            + size_of_val(&*mesh.valid)
            + size_of_val(&*mesh.clusters);
        assert_eq!(counts.mesh_bytes() - counts.painted, mesh_bytes as u64, "{name}");
        let light = (0..mesh.clusters.len()).map(|cluster| {
            let light = ClusterLight::new(&mesh, cluster);
            size_of_val(&light) + size_of_val(&*light.elements) + size_of_val(&*light.patches)
        });
        assert_eq!(counts.light_bytes(), light.sum::<usize>() as u64, "{name}");
        // Nodes of small scenes are hardly full; of others the whole is within a quarter.
        let hierarchy = mesh::hierarchy(&mesh);
        assert_eq!(counts.triangles as usize, hierarchy.triangles().len() + hierarchy.slivers());
        let share = counts.hierarchy_bytes() as f64 / hierarchy.hierarchy_bytes() as f64;
        println!("{name}: {} triangles, foretold/stored {share:.3}", counts.triangles);
        assert!(counts.triangles < 1000 || (0.8..1.25).contains(&share), "{name}: {share}");
    }
}
