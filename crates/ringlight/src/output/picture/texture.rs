//! The textures of a picture, decoded once.

use crate::scene::{Texture, Wrap};
use crate::solution::Solution;

/// A decoded image.
pub trait Sampler: Send + Sync {
    /// Linear RGB and alpha at `uv`.
    fn sample(&self, uv: [f32; 2], wrap: [Wrap; 2], nearest: bool) -> [f32; 4];
}

/// Decoded images, by the number of the image; None for those that are not at hand.
pub struct Textures(pub Vec<Option<Box<dyn Sampler>>>);

impl Textures {
    /// Decodes the images of a solution.
    pub fn decode(solution: &Solution) -> Textures {
        Textures(solution.images.iter().map(|_| None).collect())
    }

    /// Linear RGB and alpha of a texture at `uv`; None if its image is not at hand.
    pub fn sample(&self, texture: &Texture, uv: [f32; 2]) -> Option<[f32; 4]> {
        let image = self.0.get(texture.image as usize)?.as_ref()?;
        Some(image.sample(uv, texture.wrap, texture.nearest))
    }
}
