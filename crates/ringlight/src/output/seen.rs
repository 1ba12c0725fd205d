//! What a ray of sight meets.

use crate::mesh::Mesh;
use crate::mesh::walk::{Query, Rule};
use glam::DVec2;
use ringlight_visibility::{Hit, Ray};

/// A lit side of a surface, met by a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Distance in units of the ray's direction.
    pub distance: f32,
    /// Number of the facet.
    pub facet: u32,
    /// Number of the patch.
    pub patch: u32,
    /// Number of the element.
    pub element: u32,
    /// Parameters within the element.
    pub within: DVec2,
    /// The facet's corners between which the place lies.
    pub corners: [usize; 3],
    /// Weights of these corners.
    pub weights: [f32; 3],
}

/// Asks for the first lit side along a ray. Unlit backs of single-sided surfaces are not seen, as in viewers of glTF.
pub fn sight(ray: Ray) -> Query {
    Query { ray, rule: Rule::Lit }
}

/// The place at which a ray of sight hits a facet.
pub fn seen(mesh: &Mesh, ray: &Ray, hit: Hit) -> Seen {
    let facet = &mesh.facets[(hit.triangle >> 1) as usize];
    let back = facet.double_sided() && !hit.front;
    let (patch, element, within) = mesh.find_element(facet, back, facet.parameters_at(ray, &hit));
    let [b, c] = hit.barycentric;
    Seen {
        distance: hit.distance,
        facet: hit.triangle >> 1,
        patch,
        element,
        within: within.clamp(DVec2::ZERO, DVec2::ONE),
        corners: if hit.triangle & 1 == 0 { [0, 1, 2] } else { [0, 2, 3] },
        weights: [1.0 - b - c, b, c],
    }
}

impl Seen {
    /// A value between those at the facet's four corners.
    pub fn between<const N: usize>(&self, values: &[[f32; N]; 4]) -> [f32; N] {
        std::array::from_fn(|i| (0..3).map(|k| self.weights[k] * values[self.corners[k]][i]).sum())
    }
}
