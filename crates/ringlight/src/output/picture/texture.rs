//! The textures of a picture, decoded once.

use crate::scene::texture::TextureImage;
use crate::scene::{Image, Texture};
use crate::solution::Solution;
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Decoded images, by the number of the image; None for those that are not at hand, not used or not readable.
pub struct Textures(Vec<Option<TextureImage>>);

impl Textures {
    /// Decodes the images that the materials of a solution use.
    pub fn decode(solution: &Solution) -> Textures {
        let materials = &solution.description.materials;
        let used: BTreeSet<u32> =
            materials.iter().flat_map(|m| [m.base_texture, m.emission_texture]).flatten().map(|t| t.image).collect();
        let decode = |(number, bytes): (usize, &Option<_>)| {
            let bytes = bytes.clone().filter(|_| used.contains(&(number as u32)))?;
            let reference = solution.description.images.get(number)?;
            let image = Image { name: reference.name.clone(), media_type: reference.media_type.clone(), bytes };
            TextureImage::decode(&image).ok()
        };
        Textures(solution.images.par_iter().enumerate().map(decode).collect())
    }

    /// Linear RGB and alpha of a texture at `uv`; None if its image is not at hand.
    pub fn sample(&self, texture: &Texture, uv: [f32; 2]) -> Option<[f32; 4]> {
        Some(self.0.get(texture.image as usize)?.as_ref()?.sample(uv, texture.wrap, texture.nearest))
    }
}
