//! Which sample points lie free of other geometry.
//!
//! A sample under a table's foot or inside a wall sees only backs, or surfaces that touch it. It receives no light, and
//! its element takes its light from its free samples, so that contacts leave no black rims.

use super::look::{LookAbout, View};
use super::{ALL_VALID, Frame, Inquiry, Mesh, Patch, Tile, walk};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use ringlight_visibility::{Hierarchy, Layout};
use std::ops::Range;

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

/// Elements narrower than this share of the element size are judged by their middle alone.
const SMALL: f64 = 0.25;

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
            let first = (patch.first_element - cluster.elements.start) as usize;
            let views: Vec<View> = look_about(mesh, &patch, 0..patch.element_count())
                .map(|look| walk::run(mesh, hierarchy, look).view())
                .collect();
            part[first..].iter_mut().zip(valid_samples(mesh, &patch, &views)).for_each(|(bits, found)| *bits = found);
        }
    });
    mesh.valid = valid;
}

/// How many points of each element of a patch look about: the middle, and the sixteen samples if it is not small.
pub fn looks(mesh: &Mesh, patch: &Patch) -> usize {
    let width = (patch.area / f64::from(patch.element_count())).sqrt();
    if width < SMALL * mesh.sizes.element { 1 } else { 17 }
}

/// The walks whose views tell which samples of the patch's `elements` (0 is its first) are valid; [`looks`] for each.
pub fn look_about<'a>(
    mesh: &'a Mesh,
    patch: &Patch,
    elements: Range<u32>,
) -> impl Iterator<Item = LookAbout<'a>> + use<'a> {
    let (patch, looks) = (*patch, looks(mesh, patch) as u32);
    elements.flat_map(move |k| {
        let tile = patch.element_tile(k);
        (0..looks).map(move |look| {
            let point = match look.checked_sub(1) {
                None => patch.frame.at(tile.at(Frame::middle(patch.frame.layout))),
                Some(sample) => patch.area_sample(&tile, sample),
            };
            LookAbout::new(mesh, &patch, point)
        })
    })
}

/// The valid samples of as many elements of a patch as have looked about, from what they saw.
pub fn valid_samples(mesh: &Mesh, patch: &Patch, views: &[View]) -> impl Iterator<Item = u16> {
    let innermost = order(patch.frame.layout).0[0];
    views.chunks_exact(looks(mesh, patch)).map(move |views| {
        let (&middle, views) = views.split_first().expect("the middle always looks");
        if views.is_empty() {
            return if middle == View::Covered { 0 } else { ALL_VALID };
        }
        // An element that is open in part takes its light there; one wholly in a crack is as dark as the crack.
        let wanted = if views.contains(&View::Open) { View::Open } else { View::Crack };
        let samples = views.iter().enumerate().fold(0u16, |bits, (s, &v)| bits | u16::from(v >= wanted) << s);
        // A middle without light must not be the sample point: one bit less says so.
        if middle >= wanted { samples } else { samples & !(1 << innermost) }
    })
}

/// Whether a point of a patch is covered, or lies in a crack, while `other`, of the same element, is not or does not: then
/// the light found there says nothing about the point, which by itself would take none.
pub async fn is_hidden_beside(mesh: &Mesh, inquiry: &Inquiry<'_>, patch: &Patch, point: DVec3, other: DVec3) -> bool {
    let view = async |p: DVec3| inquiry.follow([LookAbout::new(mesh, patch, p)]).await[0].view();
    match view(point).await {
        View::Open => false,
        hidden => hidden == View::Covered || hidden < view(other).await,
    }
}
