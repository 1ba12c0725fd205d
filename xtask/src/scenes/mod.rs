//! `cargo xtask scenes`: writes the scenes of this repository, always the same bytes.

mod cornell;
mod furnace;
mod furniture;
mod gallery;
mod gltf;
mod model;
mod office;

use anyhow::{Context, Result, ensure};
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

/// Writes the scenes into `folder`; with `check`, compares them with what is there instead.
pub fn run(folder: &Path, check: bool) -> Result<()> {
    for (name, bytes) in files()? {
        let path = folder.join(name);
        if check {
            let there = fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
            ensure!(there == bytes, "{} differs from what `cargo xtask scenes` writes", path.display());
        } else {
            fs::write(&path, &bytes).with_context(|| format!("cannot write {}", path.display()))?;
            println!("{}: {} bytes", path.display(), bytes.len());
        }
    }
    for model in [office::model(), gallery::model(), furnace::model()] {
        let (patches, elements, _) = model.count(model.sizes.0, model.sizes.1);
        println!("{}: {patches} patches, {elements} elements at {:?}", model.name, model.sizes);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_committed_scenes_are_what_the_generator_writes() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
        super::run(&folder, true).unwrap();
    }
}
