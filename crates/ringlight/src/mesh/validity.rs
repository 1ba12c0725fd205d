//! Which sample points lie free of other geometry.
//!
//! A sample under a table's foot or inside a wall sees only backs, or surfaces that touch it. It receives no light, and
//! its element takes its light from its free samples, so that contacts leave no black rims.

use super::{ALL_VALID, Frame, Mesh, Patch};
use glam::DVec3;
use rayon::prelude::*;
use ringlight_visibility::{Hierarchy, Layout, NO_PLANE, Ray};

/// Samples of a quadrilateral element from the middle outwards.
pub const QUAD_ORDER: [u8; 16] = [5, 6, 9, 10, 1, 2, 4, 7, 8, 11, 13, 14, 0, 3, 12, 15];

/// Samples of a triangular element from the middle outwards.
pub const TRIANGLE_ORDER: [u8; 16] = [9, 3, 8, 10, 2, 4, 7, 11, 12, 14, 1, 5, 13, 0, 6, 15];

/// Surfaces nearer than this share of an element's width touch it.
const CONTACT: f64 = 0.02;

/// Elements narrower than this share of the element size are judged by their middle alone.
const SMALL: f64 = 0.25;

/// Directions (tangent, bitangent, normal) in which a sample looks about: the normal first, then two rings.
const DIRECTIONS: [[f64; 3]; 13] = [
    [0.02, 0.01, 0.999_75],
    [0.51, 0.04, 0.859_25],
    [-0.04, 0.51, 0.859_25],
    [-0.51, -0.04, 0.859_25],
    [0.04, -0.51, 0.859_25],
    [0.80, 0.33, 0.501_1],
    [0.33, 0.80, 0.501_1],
    [-0.33, 0.80, 0.501_1],
    [-0.80, 0.33, 0.501_1],
    [-0.80, -0.33, 0.501_1],
    [-0.33, -0.80, 0.501_1],
    [0.33, -0.80, 0.501_1],
    [0.80, -0.33, 0.501_1],
];

/// Fills [`Mesh::valid`].
pub fn find_valid_samples(mesh: &mut Mesh, hierarchy: &Hierarchy) {
    let mut valid = std::mem::take(&mut mesh.valid);
    let mut rest = valid.as_mut_slice();
    let mut parts = Vec::with_capacity(mesh.clusters.len());
    for cluster in &mesh.clusters {
        let (part, tail) = rest.split_at_mut(cluster.elements.len());
        parts.push((cluster, part));
        rest = tail;
    }
    parts.into_par_iter().for_each(|(cluster, part)| {
        for id in cluster.patches.clone() {
            let patch = mesh.patch(id);
            for k in 0..patch.element_count() {
                part[(patch.first_element + k - cluster.elements.start) as usize] =
                    valid_samples(mesh, hierarchy, &patch, k);
            }
        }
    });
    mesh.valid = valid;
}

fn valid_samples(mesh: &Mesh, hierarchy: &Hierarchy, patch: &Patch, k: u32) -> u16 {
    let width = (patch.area / f64::from(patch.element_count())).sqrt();
    let contact = CONTACT * width;
    let tile = patch.element_tile(k);
    let free = |p: DVec3| is_free(mesh, hierarchy, patch, p, contact);
    let middle = free(patch.frame.at(tile.at(Frame::middle(patch.frame.layout))));
    if width < SMALL * mesh.sizes.element {
        return if middle { ALL_VALID } else { 0 };
    }
    let samples = (0..16).filter(|&s| free(patch.area_sample(&tile, s))).fold(0u16, |bits, s| bits | 1 << s);
    // A covered middle must not be the sample point: one bit less says so.
    let innermost = match patch.frame.layout {
        Layout::Quad => QUAD_ORDER[0],
        Layout::Triangle => TRIANGLE_ORDER[0],
    };
    if samples == ALL_VALID && !middle { samples & !(1 << innermost) } else { samples }
}

/// Whether a point sees anything but backs and what touches it. Where a coplanar surface faces it (a box's bottom on the
/// floor), it must see a lit surface; elsewhere it is enough to see nothing.
fn is_free(mesh: &Mesh, hierarchy: &Hierarchy, patch: &Patch, point: DVec3, contact: f64) -> bool {
    let n = patch.normal;
    let (t, b) = n.any_orthonormal_pair();
    let mut escapes = false;
    for d in &DIRECTIONS {
        let direction = d[0] * t + d[1] * b + d[2] * n;
        let ray = Ray {
            origin: point.as_vec3().to_array(),
            direction: direction.as_vec3().to_array(),
            near: 0.0,
            far: f32::INFINITY,
            plane: patch.plane,
        };
        match hierarchy.nearest_hit(&ray) {
            None => escapes = true,
            Some(hit) => {
                let lit = hit.front || mesh.facets[(hit.triangle >> 1) as usize].double_sided();
                if lit && f64::from(hit.distance) > contact {
                    return true;
                }
            }
        }
    }
    escapes && !is_faced(mesh, hierarchy, patch, point)
}

/// Whether another facet in the patch's plane, facing the other way, lies on the point.
fn is_faced(mesh: &Mesh, hierarchy: &Hierarchy, patch: &Patch, point: DVec3) -> bool {
    let step = 10.0 * super::plane::RELATIVE_TOLERANCE * mesh.diagonal;
    let ray = Ray {
        origin: (point - step * patch.normal).as_vec3().to_array(),
        direction: (2.0 * step * patch.normal).as_vec3().to_array(),
        near: 0.0,
        far: 1.0,
        plane: NO_PLANE,
    };
    let faces = |id: u32| {
        let facet = &mesh.facets[(id >> 1) as usize];
        id >> 1 != patch.facet && facet.frame().area_vector().dot(patch.normal) < 0.0
    };
    hierarchy.nearest_hit_where(&ray, |t| t.plane == patch.plane && faces(t.id)).is_some()
}
