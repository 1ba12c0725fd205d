//! `cargo xtask scenes`: writes the scenes of this repository, always the same bytes.

mod cornell;
mod furnace;
mod furniture;
mod gallery;
mod gltf;
pub mod large;
mod model;
mod office;

use anyhow::{Context, Result};
use std::fs;
use std::path::Path;

/// Every generated file with its contents.
pub fn files() -> Result<Vec<(&'static str, Vec<u8>)>> {
    Ok(vec![
        ("cornell_box.obj", cornell::obj().into_bytes()),
        ("cornell_box.mtl", cornell::mtl().into_bytes()),
        ("furnace.glb", gltf::glb(&furnace::model())?),
        ("gallery.glb", gltf::glb(&gallery::model())?),
        ("office.glb", gltf::glb(&office::model())?),
    ])
}

/// Writes the scenes into `folder` and says how big they are.
pub fn run(folder: &Path) -> Result<()> {
    for (name, bytes) in files()? {
        let path = folder.join(name);
        fs::write(&path, &bytes).with_context(|| format!("cannot write {}", path.display()))?;
        println!("{name}: {} bytes", bytes.len());
    }
    for model in [office::model(), gallery::model(), furnace::model()] {
        let (patch_size, element_size) = model.sizes;
        let (patches, elements, _) = model.count(patch_size, element_size);
        println!("{}: {patches} patches of {patch_size} m, {elements} elements of {element_size} m", model.name);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    #[test]
    fn the_committed_scenes_are_what_the_generator_writes() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
        for (name, bytes) in super::files().unwrap() {
            assert!(std::fs::read(folder.join(name)).unwrap() == bytes, "{name} differs: run `cargo xtask scenes`");
        }
    }
}
