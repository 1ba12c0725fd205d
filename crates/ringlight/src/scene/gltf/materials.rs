//! Materials, textures and images: what of them matters for diffuse light.

use super::geometry::UvTransform;
use super::json::{self, TextureInfo};
use super::uri;
use super::views::{Views, find};
use crate::resources::{Bytes, Resources};
use crate::scene::{Alpha, Image, Material, Place, SceneError, Texture, Warnings, Wrap};
use std::collections::BTreeMap;

/// Where a texture takes its coordinates from.
#[derive(Clone, Copy, Debug)]
pub(super) struct UvSource {
    /// Number of the `TEXCOORD` set.
    pub set: u32,
    /// `KHR_texture_transform`.
    pub transform: UvTransform,
}

/// Which coordinates a material needs.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct UvSources {
    /// For the base texture.
    pub base: Option<UvSource>,
    /// For the emission texture.
    pub emission: Option<UvSource>,
}

/// Reads materials one by one and gathers the images they show.
pub(super) struct Materials<'v, 'd> {
    views: &'v mut Views<'d>,
    resources: &'v dyn Resources,
    warnings: &'v mut Warnings,
    /// The images shown so far.
    pub images: Vec<Image>,
    /// Their place in `images` by their index in the file; `None` for those that cannot be read.
    known: BTreeMap<u32, Option<u32>>,
}

/// The material of primitives that name none (glTF 2.0, section 3.7.2.1).
pub(super) fn default_material() -> Material {
    Material {
        name: String::new(),
        base_colour: [1.0; 4],
        base_texture: None,
        emission: [0.0; 3],
        emission_texture: None,
        alpha: Alpha::Opaque,
        transmission: 0.0,
        double_sided: false,
        extras: None,
    }
}

impl<'v, 'd> Materials<'v, 'd> {
    /// No material read yet.
    pub fn new(views: &'v mut Views<'d>, resources: &'v dyn Resources, warnings: &'v mut Warnings) -> Self {
        Materials { views, resources, warnings, images: Vec::new(), known: BTreeMap::new() }
    }

    /// Material `index`. The images of one that no surface uses are not opened, nor is it warned about.
    pub fn read(&mut self, index: usize, is_used: bool) -> Result<(Material, UvSources), SceneError> {
        let document = self.views.document;
        let Some(source) = document.materials.get(index) else { return Ok((default_material(), UvSources::default())) };
        let path = format!("materials[{index}]");
        let pbr = &source.pbr_metallic_roughness;
        let glossy = source.extensions.specular_glossiness.as_ref();
        let (factor, texture, base_path) = match glossy {
            Some(glossy) => {
                let path = format!("{path}.extensions.KHR_materials_pbrSpecularGlossiness");
                (glossy.diffuse_factor, glossy.diffuse_texture.as_ref(), format!("{path}.diffuseTexture"))
            }
            None => {
                let path = format!("{path}.pbrMetallicRoughness.baseColorTexture");
                (pbr.base_color_factor, pbr.base_color_texture.as_ref(), path)
            }
        };
        let strength = source.extensions.emissive_strength.as_ref().and_then(|extension| extension.emissive_strength);
        let emission = source.emissive_factor.unwrap_or_default();
        let transmission = source.extensions.transmission.as_ref();
        let mut material = Material {
            name: source.name.clone().unwrap_or_default(),
            base_colour: factor.unwrap_or([1.0; 4]).map(|value| value as f32),
            emission: emission.map(|value| (value * strength.unwrap_or(1.0)) as f32),
            alpha: self.alpha(source, &path)?,
            transmission: transmission.map_or(0.0, |extension| extension.transmission_factor.clamp(0.0, 1.0) as f32),
            double_sided: source.double_sided,
            extras: source.extras.clone(),
            ..default_material()
        };
        if material.emission.iter().any(|channel| !channel.is_finite() || *channel < 0.0) {
            let found = format!("emission {:?}", material.emission);
            return Err(self.views.error(
                &format!("{path}.emissiveFactor"),
                found,
                "finite numbers that are not negative",
            ));
        }
        if !is_used {
            return Ok((material, UvSources::default()));
        }
        self.warn(source, &path);
        if material.base_colour.iter().any(|channel| !(0.0..=1.0).contains(channel)) {
            let message = "colours outside 0 to 1 are limited to it";
            self.warnings.add("colour-out-of-range", message, Place::new(self.views.name, path.as_str()));
            material.base_colour = material.base_colour.map(|channel| channel.clamp(0.0, 1.0));
        }
        let mut sources = UvSources::default();
        (material.base_texture, sources.base) = self.texture(texture, &base_path)?;
        // A texture on an emission of zero lights nothing.
        if material.emission != [0.0; 3] {
            (material.emission_texture, sources.emission) =
                self.texture(source.emissive_texture.as_ref(), &format!("{path}.emissiveTexture"))?;
        }
        Ok((material, sources))
    }

    fn warn(&mut self, source: &json::Material, path: &str) {
        let place = || Place::new(self.views.name, path);
        let pbr = &source.pbr_metallic_roughness;
        if source.extensions.specular_glossiness.is_some() {
            let message = "KHR_materials_pbrSpecularGlossiness: only the diffuse colour counts";
            self.warnings.add("specular-glossiness-as-diffuse", message, place());
        } else if pbr.metallic_factor.unwrap_or(1.0) > 0.5 && pbr.metallic_roughness_texture.is_none() {
            let message = "metals reflect their base colour diffusely";
            self.warnings.add("metal-as-diffuse", message, place());
        }
        if source.extensions.transmission.as_ref().is_some_and(|extension| extension.transmission_texture.is_some()) {
            let message = "transmission textures are ignored; the factor counts everywhere";
            self.warnings.add("transmission-texture-ignored", message, place());
        }
    }

    fn alpha(&self, source: &json::Material, path: &str) -> Result<Alpha, SceneError> {
        match source.alpha_mode.as_deref() {
            None | Some("OPAQUE") => Ok(Alpha::Opaque),
            Some("MASK") => Ok(Alpha::Mask(source.alpha_cutoff.unwrap_or(0.5) as f32)),
            Some("BLEND") => Ok(Alpha::Blend),
            Some(mode) => {
                Err(self.views.error(&format!("{path}.alphaMode"), format!("{mode:?}"), "OPAQUE, MASK or BLEND"))
            }
        }
    }

    /// The texture that the property at `path` names, and its coordinates.
    fn texture(
        &mut self,
        info: Option<&TextureInfo>,
        path: &str,
    ) -> Result<(Option<Texture>, Option<UvSource>), SceneError> {
        let Some(info) = info else { return Ok((None, None)) };
        let document = self.views.document;
        let texture = find(&document.textures, info.index).ok_or_else(|| {
            self.views.index_error(&format!("{path}.index"), "texture", info.index, document.textures.len())
        })?;
        let texture_path = format!("textures[{}]", info.index);
        let sampler = match texture.sampler {
            None => None,
            Some(sampler) => Some(find(&document.samplers, sampler).ok_or_else(|| {
                let at = format!("{texture_path}.sampler");
                self.views.index_error(&at, "sampler", sampler, document.samplers.len())
            })?),
        };
        let webp = texture.extensions.webp.as_ref().and_then(|extension| extension.source);
        let Some(source) = webp.or(texture.source) else {
            let message = "textures in formats other than PNG, JPEG and WebP are ignored; the factor counts alone";
            self.warnings.add("unsupported-image", message, Place::new(self.views.name, texture_path));
            return Ok((None, None));
        };
        let Some(image) = self.image(source, &texture_path)? else { return Ok((None, None)) };
        let wrap = |code: Option<u32>| match code {
            Some(33071) => Wrap::Clamp,
            Some(33648) => Wrap::Mirror,
            _ => Wrap::Repeat,
        };
        let texture = Texture {
            image,
            wrap: [wrap(sampler.and_then(|s| s.wrap_s)), wrap(sampler.and_then(|s| s.wrap_t))],
            nearest: sampler.and_then(|s| s.mag_filter) == Some(9728),
        };
        Ok((Some(texture), Some(uv_source(info))))
    }

    /// The place in [`Materials::images`] of image `index`; `None`, with a warning, if it cannot be read.
    fn image(&mut self, index: u32, referrer: &str) -> Result<Option<u32>, SceneError> {
        if let Some(known) = self.known.get(&index) {
            return Ok(*known);
        }
        let document = self.views.document;
        let source = find(&document.images, index).ok_or_else(|| {
            self.views.index_error(&format!("{referrer}.source"), "image", index, document.images.len())
        })?;
        let path = format!("images[{index}]");
        let loaded = self.load(source, index, &path)?;
        let slot = match loaded {
            Err(reason) => {
                let message = format!("textures that cannot be read are left out, the factor counts alone: {reason}");
                self.warnings.add("missing-texture", message, Place::new(self.views.name, path));
                None
            }
            Ok((name, bytes, said)) => match media_type(&bytes) {
                None => {
                    let message = format!("images that are neither PNG, JPEG nor WebP are left out ({said:?})");
                    self.warnings.add("unsupported-image", message, Place::new(self.views.name, path));
                    None
                }
                Some(media_type) => {
                    self.images.push(Image { name, media_type: media_type.to_owned(), bytes });
                    Some(self.images.len() as u32 - 1)
                }
            },
        };
        self.known.insert(index, slot);
        Ok(slot)
    }

    /// Name, bytes and stated media type of an image, or why there are no bytes.
    #[allow(clippy::type_complexity, reason = "an outer error is fatal, an inner one is a warning")]
    fn load(
        &mut self,
        source: &json::Image,
        index: u32,
        path: &str,
    ) -> Result<Result<(String, Bytes, String), String>, SceneError> {
        let embedded = format!("image {index}");
        let said = source.mime_type.clone().unwrap_or_default();
        if let Some(view) = source.buffer_view {
            let slice = self.views.view(view, &format!("{path}.bufferView"))?;
            return Ok(Ok((embedded, Bytes::new(slice), said)));
        }
        let Some(text) = &source.uri else {
            return Ok(Err(format!("{path} has neither a URI nor a buffer view")));
        };
        let at = format!("{path}.uri");
        match uri::parse(text).map_err(|(found, expected)| self.views.error(&at, found, expected))? {
            uri::Target::Data { media_type, bytes } => Ok(Ok((embedded, Bytes::new(bytes), media_type))),
            uri::Target::Path(file) => match self.resources.read(&file) {
                Ok(bytes) => Ok(Ok((file, bytes, said))),
                Err(cause) => Ok(Err(format!("{file}: {cause}"))),
            },
        }
    }
}

fn uv_source(info: &TextureInfo) -> UvSource {
    let Some(transform) = &info.extensions.transform else {
        return UvSource { set: info.tex_coord, transform: UvTransform::IDENTITY };
    };
    // KHR_texture_transform: scale first, then rotate, then move. v points down, hence the signs.
    let [offset_u, offset_v] = transform.offset.unwrap_or_default();
    let [scale_u, scale_v] = transform.scale.unwrap_or([1.0; 2]);
    let (sine, cosine) = libm::sincos(transform.rotation);
    UvSource {
        set: transform.tex_coord.unwrap_or(info.tex_coord),
        transform: UvTransform([
            [cosine * scale_u, sine * scale_v, offset_u],
            [-sine * scale_u, cosine * scale_v, offset_v],
        ]),
    }
}

/// Media type by the first bytes, since files lie about it.
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
