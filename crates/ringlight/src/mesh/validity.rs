//! Which sample points lie free of other geometry.
//!
//! A sample under a table's foot or inside a wall sees only backs, or surfaces that touch it. It receives no light, and
//! its element takes its light from its free samples, so that contacts leave no black rims.

use super::plane::RELATIVE_TOLERANCE;
use super::{ALL_VALID, Facet, Frame, Mesh, NONE, Patch, Tile};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use ringlight_visibility::{Hierarchy, Layout, NO_PLANE, Ray, Triangle};

/// Samples of a quadrilateral element from the middle outwards.
const QUAD_ORDER: [u8; 16] = [5, 6, 9, 10, 1, 2, 4, 7, 8, 11, 13, 14, 0, 3, 12, 15];

/// Samples of a triangular element from the middle outwards.
const TRIANGLE_ORDER: [u8; 16] = [9, 3, 8, 10, 2, 4, 7, 11, 12, 14, 1, 5, 13, 0, 6, 15];

/// Samples from the middle outwards, and the bits of those around the middle: when they are free, so is the middle.
pub fn order(layout: Layout) -> (&'static [u8; 16], u16) {
    match layout {
        Layout::Quad => (&QUAD_ORDER, 1 << 5 | 1 << 6 | 1 << 9 | 1 << 10),
        Layout::Triangle => (&TRIANGLE_ORDER, 1 << 9),
    }
}

/// Where within an element its sample point lies: see [`Patch::sample_point`].
pub fn sample_parameters(layout: Layout, valid: u16) -> Option<DVec2> {
    let middle = Frame::middle(layout);
    let (order, innermost) = order(layout);
    if valid & innermost == innermost {
        return Some(middle);
    }
    let sample = *order.iter().find(|&&s| valid >> s & 1 == 1)?;
    Some(Tile::of(layout, [4, 4], sample.into()).at(middle))
}

/// Surfaces nearer than this share of an element's width touch it.
const CONTACT: f64 = 0.02;

/// A sample that sees nothing farther away than this share of an element's width lies in a crack.
const CRACK: f64 = 0.25;

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
    let mut rest = &mut valid[..];
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
    let tile = patch.element_tile(k);
    let view = |p: DVec3| look_about(mesh, hierarchy, patch, p, width);
    let middle = view(patch.frame.at(tile.at(Frame::middle(patch.frame.layout))));
    if width < SMALL * mesh.sizes.element {
        return if middle == View::Covered { 0 } else { ALL_VALID };
    }
    let views: [View; 16] = std::array::from_fn(|s| view(patch.area_sample(&tile, s as u32)));
    // An element that is open in part takes its light there; one wholly in a crack is as dark as the crack.
    let wanted = if views.contains(&View::Open) { View::Open } else { View::Crack };
    let samples = views.iter().enumerate().fold(0u16, |bits, (s, &v)| bits | u16::from(v >= wanted) << s);
    // A middle without light must not be the sample point: one bit less says so.
    if middle >= wanted { samples } else { samples & !(1 << order(patch.frame.layout).0[0]) }
}

/// Whether a point of a patch sees nothing but backs and what touches it.
pub fn is_covered(mesh: &Mesh, hierarchy: &Hierarchy, patch: &Patch, point: DVec3) -> bool {
    let width = (patch.area / f64::from(patch.element_count())).sqrt();
    look_about(mesh, hierarchy, patch, point, width) == View::Covered
}

/// Whether a point of a patch is covered, or lies in a crack, while `other`, of the same element, is not or does not: then
/// the light found there says nothing about the point, which by itself would take none.
pub fn is_hidden_beside(mesh: &Mesh, hierarchy: &Hierarchy, patch: &Patch, point: DVec3, other: DVec3) -> bool {
    let width = (patch.area / f64::from(patch.element_count())).sqrt();
    let view = |p: DVec3| look_about(mesh, hierarchy, patch, p, width);
    match view(point) {
        View::Open => false,
        hidden => hidden == View::Covered || hidden < view(other),
    }
}

/// What a sample sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum View {
    /// Backs, and what touches it.
    Covered,
    /// Lit surfaces, all of them near.
    Crack,
    /// More.
    Open,
}

/// What a point sees besides backs and what touches it. Where a coplanar surface faces it (a box's bottom on the
/// floor), it must see a lit surface; elsewhere it is enough to see nothing. Where surfaces lie in each other, looking the
/// same way, one of them has the light: twice the light would never die out.
fn look_about(mesh: &Mesh, hierarchy: &Hierarchy, patch: &Patch, point: DVec3, width: f64) -> View {
    let this = &mesh.facets[patch.facet as usize];
    let overlays = |other: u32| {
        let facet = &mesh.facets[other as usize];
        let same_way = facet.double_sided() || facet.frame().area_vector().dot(patch.normal) > 0.0;
        same_way && precedence(mesh, other, facet) < precedence(mesh, patch.facet, this)
    };
    if meets_coplanar(mesh, hierarchy, patch, point, overlays) {
        return View::Covered;
    }
    let n = patch.normal;
    let (t, b) = n.any_orthonormal_pair();
    let (mut escapes, mut seen) = (false, View::Covered);
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
                let distance = f64::from(hit.distance);
                if lit && distance > CRACK * width {
                    return View::Open;
                }
                if lit && distance > CONTACT * width {
                    seen = View::Crack;
                }
            }
        }
    }
    let faces = |other: u32| mesh.facets[other as usize].frame().area_vector().dot(patch.normal) < 0.0;
    if escapes && !meets_coplanar(mesh, hierarchy, patch, point, faces) { View::Open } else { seen }
}

/// Which of two facets that lie in each other has the light: the smaller key. Lamps come before others, small facets before
/// large ones.
fn precedence(mesh: &Mesh, number: u32, facet: &Facet) -> (bool, u64, u32) {
    let colour = match facet.colour {
        NONE => mesh.surface_colours[facet.surface as usize],
        first => mesh.colours[first as usize],
    };
    // Non-negative floats order like their bits.
    (!colour.emits(), facet.frame().area_vector().length().to_bits(), number)
}

/// Whether another facet in the patch's plane that `accept` takes lies on the point.
fn meets_coplanar(
    mesh: &Mesh,
    hierarchy: &Hierarchy,
    patch: &Patch,
    point: DVec3,
    accept: impl Fn(u32) -> bool,
) -> bool {
    let step = 10.0 * RELATIVE_TOLERANCE * mesh.diagonal;
    let ray = Ray {
        origin: (point - step * patch.normal).as_vec3().to_array(),
        direction: (2.0 * step * patch.normal).as_vec3().to_array(),
        near: 0.0,
        far: 1.0,
        plane: NO_PLANE,
    };
    let accept = |t: &Triangle| t.plane == patch.plane && t.id >> 1 != patch.facet && accept(t.id >> 1);
    hierarchy.nearest_hit_where(&ray, accept).is_some()
}
