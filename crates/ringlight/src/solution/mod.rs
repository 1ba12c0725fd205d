//! A solved (or half-solved) scene: mesh, light, and what is needed to show it or to go on.

mod digest;
mod file;

pub use digest::digest;
pub use file::{FileError, read, write, write_snapshot};

use crate::mesh::{Mesh, Patch};
use crate::quantity::Rgb;
use crate::resources::Bytes;
use crate::scene::{Camera, Image, Light, Material, Node, Scene, Surface, Warnings};
use crate::shooting::ElementLight;
use crate::solve::{Energy, SolveSettings, State};
use serde::{Deserialize, Serialize};

/// What a solution keeps of the scene besides its surfaces' geometry.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
    /// The light.
    pub state: State,
    /// The audit at the time of writing.
    pub energy: Energy,
    /// Encoded images where they are at hand, in the order of `description.images`.
    pub images: Vec<Option<Bytes>>,
}

/// What a solution file holds, borrowed: a running solver saves its light without copying it.
#[derive(Clone, Copy, Debug)]
pub struct Snapshot<'a> {
    /// The scene without geometry.
    pub description: &'a Description,
    /// Patches and elements.
    pub mesh: &'a Mesh,
    /// Settings that decide the result.
    pub settings: &'a SolveSettings,
    /// The light.
    pub state: &'a State,
    /// The audit of `state`.
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
        let cluster = self.mesh.clusters.partition_point(|c| c.elements.end <= element);
        &self.state.clusters[cluster].elements[(element - self.mesh.clusters[cluster].elements.start) as usize]
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

    /// Takes the bytes of images from a scene, where the hashes agree; gives the number still missing.
    pub fn attach_images(&mut self, images: &[Image]) -> usize {
        let found: Vec<(String, Bytes)> =
            images.iter().map(|i| (blake3::hash(&i.bytes).to_hex().to_string(), i.bytes.clone())).collect();
        for (slot, wanted) in self.images.iter_mut().zip(&self.description.images) {
            if slot.is_none() {
                *slot = found.iter().find(|(hash, _)| *hash == wanted.hash).map(|(_, bytes)| bytes.clone());
            }
        }
        self.images.iter().filter(|i| i.is_none()).count()
    }
}
