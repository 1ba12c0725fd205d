// What the targets for scene files share (included by each).

use ringlight::resources::{Bytes, Resources};
use ringlight::scene::{self, ReadOptions};

/// A scene file that stands alone.
struct Nothing;

impl Resources for Nothing {
    fn read(&self, _path: &str) -> std::io::Result<Bytes> {
        Err(std::io::ErrorKind::NotFound.into())
    }
}

/// Reads a scene and its triangles; errors are fine, panics are not.
fn read_scene(name: &str, data: &[u8]) {
    let Ok(scene) = scene::read(name, Bytes::new(data.to_vec()), &Nothing, &ReadOptions::default()) else {
        return;
    };
    for (index, surface) in scene.surfaces.iter().enumerate() {
        let mut count = 0;
        let result = scene.geometry.triangles(index, &mut |triangle| {
            assert!(triangle.position.as_flattened().iter().all(|coordinate| coordinate.is_finite()));
            count += 1;
        });
        assert!(result.is_err() || count == surface.triangles);
    }
}
