//! Definitions of materials → materials and images of the scene.

use super::lines::local_path;
use super::material::{Definition, Map, Mapping};
use crate::resources::Resources;
use crate::scene::{Alpha, Image, Material, Place, Texture, Warnings, Wrap};
use std::collections::HashMap;

/// Reflectance of a material that says none.
const DEFAULT_REFLECTANCE: f32 = 0.8;

/// The materials that faces use, in that order.
pub(super) struct Resolved {
    pub(super) materials: Vec<Material>,
    pub(super) images: Vec<Image>,
    /// For each material: of the base texture and of the emission texture.
    pub(super) mappings: Vec<[Mapping; 2]>,
}

/// Looks up the materials called `used`, first used at `places`, and reads their textures.
pub(super) fn resolve(
    used: &[String],
    places: &[Place],
    definitions: &HashMap<String, Definition>,
    resources: &dyn Resources,
    warnings: &mut Warnings,
) -> Resolved {
    let mut images = Images { resources, list: Vec::new(), by_path: HashMap::new() };
    let mut resolved = Resolved { materials: Vec::new(), images: Vec::new(), mappings: Vec::new() };
    let absent = Definition::default();
    for (name, place) in used.iter().zip(places) {
        let definition = definitions.get(name).unwrap_or_else(|| {
            let message = match name.as_str() {
                "" => format!("faces without a material get the reflectance {DEFAULT_REFLECTANCE}"),
                _ => format!("material {name:?} is not defined; it gets the reflectance {DEFAULT_REFLECTANCE}"),
            };
            warnings.add("missing-material", message, place.clone());
            &absent
        });
        let (material, mappings) = material(name, definition, &mut images, warnings);
        resolved.materials.push(material);
        resolved.mappings.push(mappings);
    }
    resolved.images = images.list;
    resolved
}

fn material(
    name: &str,
    definition: &Definition,
    images: &mut Images<'_>,
    warnings: &mut Warnings,
) -> (Material, [Mapping; 2]) {
    let mut texture = |map: &Option<Map>, warnings: &mut Warnings| {
        map.as_ref().and_then(|map| Some((images.texture(map, warnings)?, map.mapping))).unzip()
    };
    let (base_texture, base_mapping) = texture(&definition.reflectance_map, warnings);
    let (emission_texture, emission_mapping) = texture(&definition.emission_map, warnings);
    let default_reflectance = if base_texture.is_some() { 1.0 } else { DEFAULT_REFLECTANCE };
    let [red, green, blue] = definition.reflectance.unwrap_or([default_reflectance; 3]);
    let default_emission = if emission_texture.is_some() { 1.0 } else { 0.0 };
    let emission = definition.emission.unwrap_or([default_emission; 3]);
    let opacity = definition.dissolve.unwrap_or(1.0 - definition.transparency.unwrap_or(0.0));
    let alpha = match (&definition.dissolve_map, &definition.reflectance_map) {
        (Some(mask), Some(base)) if mask.name == base.name && base_texture.is_some() => Alpha::Mask(0.5),
        _ if opacity < 1.0 => Alpha::Blend,
        _ => Alpha::Opaque,
    };
    notice(name, definition, alpha, warnings);
    let material = Material {
        name: name.to_owned(),
        base_colour: [red, green, blue, opacity],
        base_texture,
        emission,
        emission_texture,
        alpha,
        transmission: 0.0,
        double_sided: true,
        extras: None,
    };
    (material, [base_mapping.unwrap_or_default(), emission_mapping.unwrap_or_default()])
}

/// Warns of what changes the light and is not followed.
fn notice(name: &str, definition: &Definition, alpha: Alpha, warnings: &mut Warnings) {
    let mut warn = |code: &str, message: String| warnings.add(code, message, definition.place.clone());
    if definition.dissolve_map.is_some() && !matches!(alpha, Alpha::Mask(_)) {
        warn("alpha-map", format!("map_d of material {name:?} is ignored: it is not the image of map_Kd"));
    }
    if definition.glass {
        warn("glass", format!("material {name:?} asks for glass by illum; only d and Tr let light through"));
    }
    let black = definition.reflectance == Some([0.0; 3]);
    if black && definition.reflectance_map.is_some() {
        warn("black-texture", format!("map_Kd of material {name:?} is multiplied by a black Kd"));
    }
    if black && definition.specular && definition.emission.is_none_or(|emission| emission == [0.0; 3]) {
        warn("specular-only", format!("material {name:?} reflects only by Ks, which is ignored; it is black"));
    }
    if definition.emission == Some([0.0; 3]) && definition.emission_map.is_some() {
        warn("black-texture", format!("map_Ke of material {name:?} is multiplied by a black Ke"));
    }
}

/// Images read so far.
struct Images<'a> {
    resources: &'a dyn Resources,
    list: Vec<Image>,
    by_path: HashMap<String, Option<u32>>,
}

impl Images<'_> {
    /// The texture of a map; nothing, with a warning, if its image cannot be had.
    fn texture(&mut self, map: &Map, warnings: &mut Warnings) -> Option<Texture> {
        let folder = map.place.file.rsplit_once('/').map_or("", |(folder, _)| folder);
        let Some(path) = local_path(folder, &map.name) else {
            let message = format!("the texture {:?} lies outside the scene's folder and was not read", map.name);
            warnings.add("path-outside", message, map.place.clone());
            return None;
        };
        let image = match self.by_path.get(&path) {
            Some(image) => *image,
            None => {
                let image = self.read(&path, &map.place, warnings);
                self.by_path.insert(path, image);
                image
            }
        };
        let wrap = if map.clamp { Wrap::Clamp } else { Wrap::Repeat };
        Some(Texture { image: image?, wrap: [wrap; 2], nearest: false })
    }

    fn read(&mut self, path: &str, place: &Place, warnings: &mut Warnings) -> Option<u32> {
        let bytes = match self.resources.read(path) {
            Ok(bytes) => bytes,
            Err(error) => {
                let message = format!("the texture {path:?} cannot be read: {error}");
                warnings.add("missing-texture", message, place.clone());
                return None;
            }
        };
        let Some(media_type) = media_type(&bytes) else {
            let message = format!("the texture {path:?} is neither PNG, JPEG nor WebP and was not read");
            warnings.add("texture-format", message, place.clone());
            return None;
        };
        self.list.push(Image { name: path.to_owned(), media_type: media_type.to_owned(), bytes });
        Some((self.list.len() - 1) as u32)
    }
}

/// Media type by the first bytes.
fn media_type(bytes: &[u8]) -> Option<&'static str> {
    if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        Some("image/png")
    } else if bytes.starts_with(b"\xff\xd8\xff") {
        Some("image/jpeg")
    } else if bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP") {
        Some("image/webp")
    } else {
        None
    }
}
