//! A solved (or half-solved) scene: mesh, light, and what is needed to show it or to go on.

mod digest;
mod file;
mod light;
mod over_ranks;
#[cfg(test)]
mod tests;

pub use digest::digest;
pub use file::{FileError, LightFile, SolutionFile, read, write};
pub use light::{OwnLight, SolvedLight};
pub use over_ranks::write_over_ranks;

use crate::mesh::{Mesh, Patch};
use crate::quantity::Rgb;
use crate::resources::Bytes;
use crate::scene::{Camera, Image, Light, Material, Node, Scene, Surface, Warnings};
use crate::shooting::ElementLight;
use crate::solve::{Energy, Ledger, SolveSettings};
use serde::{Deserialize, Serialize};

/// What a solution keeps of the scene besides its surfaces' geometry.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Description {
    /// Name of the scene.
    pub name: String,
    /// Node hierarchy.
    pub nodes: Vec<Node>,
    /// Surfaces.
    pub surfaces: Vec<Surface>,
    /// Materials.
    pub materials: Vec<Material>,
    /// Images, by name and hash; their bytes stay with the scene.
    pub images: Vec<ImageReference>,
    /// Punctual lights.
    pub lights: Vec<Light>,
    /// Cameras.
    pub cameras: Vec<Camera>,
    /// Warnings of the reader.
    pub warnings: Warnings,
}

/// An image that a solution refers to.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ImageReference {
    /// Name, relative to the scene, or `image N`.
    pub name: String,
    /// Media type.
    pub media_type: String,
    /// BLAKE3 hash of the encoded bytes, hexadecimal.
    pub hash: String,
}

/// A solution.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The scene without geometry.
    pub description: Description,
    /// Patches and elements.
    pub mesh: Mesh,
    /// Settings that decide the result.
    pub settings: SolveSettings,
    /// How far the solver has come.
    pub ledger: Ledger,
    /// The light.
    pub light: SolvedLight,
    /// The audit at the time of writing.
    pub energy: Energy,
    /// Encoded images where they are at hand, in the order of `description.images`.
    pub images: Vec<Option<Bytes>>,
}

/// What a solution file holds besides the light.
#[derive(Clone, Copy, Debug)]
pub struct Snapshot<'a> {
    /// The scene without geometry.
    pub description: &'a Description,
    /// Patches and elements.
    pub mesh: &'a Mesh,
    /// Settings that decide the result.
    pub settings: &'a SolveSettings,
    /// How far the solver has come.
    pub ledger: &'a Ledger,
    /// The audit at that time.
    pub energy: &'a Energy,
}

impl Description {
    /// Of a scene.
    pub fn new(scene: &Scene) -> Description {
        Description {
            name: scene.name.clone(),
            nodes: scene.nodes.clone(),
            surfaces: scene.surfaces.clone(),
            materials: scene.materials.clone(),
            images: scene.images.iter().map(ImageReference::new).collect(),
            lights: scene.lights.clone(),
            cameras: scene.cameras.clone(),
            warnings: scene.warnings.clone(),
        }
    }

    /// The bytes of its images, from those of a scene with the same hashes.
    pub fn find_images(&self, images: &[Image]) -> Vec<Option<Bytes>> {
        let found: Vec<(String, &Bytes)> =
            images.iter().map(|i| (blake3::hash(&i.bytes).to_hex().to_string(), &i.bytes)).collect();
        let find = |wanted: &ImageReference| found.iter().find(|(hash, _)| *hash == wanted.hash);
        self.images.iter().map(|wanted| find(wanted).map(|&(_, bytes)| bytes.clone())).collect()
    }
}

impl ImageReference {
    fn new(image: &Image) -> ImageReference {
        ImageReference {
            name: image.name.clone(),
            media_type: image.media_type.clone(),
            hash: blake3::hash(&image.bytes).to_hex().to_string(),
        }
    }
}

impl Solution {
    /// Light of element `element`.
    pub fn light(&self, element: u32) -> &ElementLight {
        &self.light.elements[element as usize]
    }

    /// Irradiance at the sample point of an element, W/m² or lux.
    pub fn irradiance(&self, element: u32) -> Rgb {
        self.light(element).at_point()
    }

    /// Radiosity of an element at its sample point, W/m² or lm/m²: exitance + reflectance × irradiance.
    pub fn radiosity(&self, patch: &Patch, element: u32) -> Rgb {
        let (colour, e) = (self.mesh.colour(patch, element), self.irradiance(element));
        std::array::from_fn(|c| colour.exitance[c] + colour.reflectance[c] * e[c])
    }
}
