//! Which extensions are understood (glTF 2.0, section 3.12).

use super::json::Document;
use crate::scene::{Place, SceneError, Warnings};

/// Extensions that are read, or that change nothing about diffuse light.
const KNOWN: &[&str] = &[
    // Read.
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_transmission",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_texture_transform",
    // About shine, looks or data that are not used.
    "KHR_animation_pointer",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_dispersion",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_xmp",
    "KHR_xmp_json_ld",
];

/// Refuses what the file requires and is not known; warns of what it only uses.
pub(super) fn check(name: &str, document: &Document, warnings: &mut Warnings) -> Result<(), SceneError> {
    let is_known = |extension: &String| KNOWN.contains(&extension.as_str());
    for (index, extension) in document.extensions_required.iter().enumerate() {
        if !is_known(extension) {
            return Err(SceneError::new(
                Place::new(name, format!("extensionsRequired[{index}]")),
                format!("extension {extension:?}, which is not supported"),
                "a file that needs only supported extensions; `gltf-transform` can remove many",
            ));
        }
    }
    let unknown: Vec<(usize, &String)> =
        document.extensions_used.iter().enumerate().filter(|(_, extension)| !is_known(extension)).collect();
    if let Some((first, _)) = unknown.first() {
        let names: Vec<&str> = unknown.iter().map(|(_, extension)| extension.as_str()).collect();
        let message = format!("extensions that are not supported are ignored: {}", names.join(", "));
        let place = Place::new(name, format!("extensionsUsed[{first}]"));
        warnings.add_many("extension-ignored", message, place, unknown.len() as u64);
    }
    Ok(())
}
