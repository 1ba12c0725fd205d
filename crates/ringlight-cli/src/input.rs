//! Reading scenes and solutions from files.

use crate::arguments::{QualityChoice, SizeArguments, UnitChoice};
use crate::failure::Failure;
use crate::files::{self, FileResources};
use anyhow::Context;
use ringlight::column::Store;
use ringlight::mesh::{Mesh, MeshOptions, Quality};
use ringlight::quantity::Rgb;
use ringlight::resources::{Bytes, Resources};
use ringlight::scene::{self, Image, Place, ReadOptions, Scene, SceneError};
use ringlight::solution::Description;
use std::path::{Path, PathBuf};

/// Reads a scene, of which what has to be kept goes to `store`; gives also the files that it refers to.
pub fn scene(path: &Path, unit: Option<UnitChoice>, store: Store<'_>) -> Result<(Scene, Vec<PathBuf>), Failure> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    if unit.is_some() && !name.to_ascii_lowercase().ends_with(".obj") {
        return Err(Failure::Usage(format!("{}: --unit is for OBJ; glTF lengths are metres", path.display())));
    }
    let unit_in_metres = match unit.unwrap_or(UnitChoice::M) {
        UnitChoice::Mm => 0.001,
        UnitChoice::Cm => 0.01,
        UnitChoice::M => 1.0,
        UnitChoice::In => 0.0254,
    };
    let bytes = bytes(path)?;
    let resources =
        FileResources::beside(path, store).with_context(|| format!("{}: cannot be read", path.display()))?;
    let options = ReadOptions { unit_in_metres };
    let scene = scene::read(&name, bytes, &resources, &options).map_err(|error| locate(error, path))?;
    Ok((scene, resources.opened()))
}

/// An error whose file can be found from where the user is: readers know files from the scene's folder only.
pub fn locate(mut error: SceneError, scene: &Path) -> Failure {
    let beside = scene.with_file_name(&*error.place.file);
    let found = if !error.place.file.is_empty() && beside.is_file() { &beside } else { scene };
    error.place.file = found.display().to_string().into();
    Failure::Scene(error)
}

/// Whether anything shines.
pub fn has_light(scene: &Scene, mesh: &Mesh, sky: Option<Rgb>) -> bool {
    let shines = |rgb: &Rgb| rgb.iter().any(|&x| x > 0.0);
    sky.is_some()
        || scene.lights.iter().any(|light| shines(&light.intensity))
        || mesh.colours.iter().any(|colour| colour.emits())
        || mesh.facets.iter().any(|facet| mesh.surface_colours[facet.surface as usize].emits())
}

/// The error of a scene in which nothing shines.
pub fn no_light(scene: &Path) -> Failure {
    Failure::Scene(SceneError::new(
        Place::new(scene.display().to_string(), ""),
        "no light: no surface emits, and there is no lamp",
        "a material with emissiveFactor (and KHR_materials_emissive_strength) or a light of KHR_lights_punctual in glTF, \
         a material with Ke in OBJ, or --sky RADIANCE",
    ))
}

/// How the mesh is asked for.
pub fn mesh_options(sizes: &SizeArguments) -> MeshOptions {
    let quality = match sizes.quality {
        QualityChoice::Draft => Quality::Draft,
        QualityChoice::Normal => Quality::Normal,
        QualityChoice::High => Quality::High,
    };
    MeshOptions { quality, patch_size: sizes.patch_size, element_size: sizes.element_size, lines: sizes.lines }
}

/// Cells of a shooter that go with a quality.
pub fn default_cells(quality: QualityChoice) -> u32 {
    match quality {
        QualityChoice::Draft => 4,
        QualityChoice::Normal => 16,
        QualityChoice::High => 64,
    }
}

/// The bytes of a file.
pub fn bytes(path: &Path) -> anyhow::Result<Bytes> {
    files::open(path).with_context(|| format!("{}: cannot be read", path.display()))
}

/// The images that a solution shows: from `scene_path` if given, else from files beside the solution. What has to be kept
/// on the way goes to `store`.
pub fn images(
    path: &Path,
    scene_path: Option<&Path>,
    description: &Description,
    store: Store<'_>,
) -> Result<Vec<Option<Bytes>>, Failure> {
    let images = match scene_path {
        Some(scene_path) => scene(scene_path, None, store)?.0.images,
        None => images_beside(path, description, store),
    };
    Ok(description.find_images(&images))
}

fn images_beside(path: &Path, description: &Description, store: Store<'_>) -> Vec<Image> {
    let Ok(resources) = FileResources::beside(path, store) else { return Vec::new() };
    let wanted = description.images.iter();
    wanted
        .filter_map(|image| {
            let bytes = resources.read(&image.name).ok()?;
            Some(Image { name: image.name.clone(), media_type: image.media_type.clone(), bytes })
        })
        .collect()
}
