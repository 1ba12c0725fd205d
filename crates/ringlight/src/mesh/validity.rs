//! Which sample points lie free of other geometry.
//!
//! A sample under a table's foot or inside a wall sees only backs, or surfaces that touch it. It receives no light, and
//! its element takes its light from its free samples, so that contacts leave no black rims.

use super::look::{LookAbout, View};
use super::sides::{Sampled, keep_wider, leave_edges};
use super::{ALL_VALID, Cluster, Frame, Inquiry, MIDDLE, Mesh, Patch, Tile, at_once};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use ringlight_visibility::{Hierarchy, Layout};
use std::sync::Arc;

/// Samples of a quadrilateral element from the middle outwards.
const QUAD_ORDER: [u8; 16] = [5, 6, 9, 10, 1, 2, 4, 7, 8, 11, 13, 14, 0, 3, 12, 15];

/// Samples of a triangular element from the middle outwards.
const TRIANGLE_ORDER: [u8; 16] = [9, 3, 8, 10, 2, 4, 7, 11, 12, 14, 1, 5, 13, 0, 6, 15];

/// The samples of an element's area among its valid ones.
pub fn area_samples(valid: u32) -> impl Iterator<Item = u32> {
    (0..MIDDLE).filter(move |s| valid >> s & 1 == 1)
}

/// Share of an element's area that is free.
pub fn free_share(valid: u32) -> f64 {
    f64::from((valid & !(1 << MIDDLE)).count_ones()) / f64::from(MIDDLE)
}

/// Where within an element its sample point lies: see [`Patch::sample_point`].
pub fn sample_parameters(layout: Layout, valid: u32) -> Option<DVec2> {
    let middle = Frame::middle(layout);
    if valid >> MIDDLE & 1 == 1 {
        return Some(middle);
    }
    let order = match layout {
        Layout::Quad => &QUAD_ORDER,
        Layout::Triangle => &TRIANGLE_ORDER,
    };
    let sample = *order.iter().find(|&&s| valid >> s & 1 == 1)?;
    Some(Tile::of(layout, [4, 4], sample.into()).at(middle))
}

/// Elements narrower than this share of the element size are judged by their middle alone.
const SMALL: f64 = 0.25;

/// Share of its way to the sample point by which a point that may be on an edge is moved.
const EDGE: f64 = 1e-3;

/// Most points that look about together: more would not be quicker, and they take memory.
const TOGETHER: usize = 1024;

/// An element: its patch, and its number there.
type Place = (u32, u32);

/// Fills [`Mesh::valid`].
pub fn find_valid_samples(mesh: &mut Mesh, hierarchy: &Arc<Hierarchy>) {
    let mut valid = std::mem::take(&mut mesh.valid);
    let mut rest = &mut valid[..];
    let mut parts = Vec::with_capacity(mesh.clusters.len());
    for cluster in &mesh.clusters {
        let (part, tail) = rest.split_at_mut(cluster.elements.len());
        parts.push((cluster, part));
        rest = tail;
    }
    let inquiry = Inquiry::Here(mesh, hierarchy.clone());
    parts.into_par_iter().for_each(|(cluster, mut rest)| {
        for elements in look_outs(mesh, cluster, usize::MAX) {
            let (part, tail) = std::mem::take(&mut rest).split_at_mut(elements.len());
            part.copy_from_slice(&at_once(valid_samples(mesh, &elements, &inquiry)));
            rest = tail;
        }
    });
    mesh.valid = valid;
}

/// The elements of a cluster, in parts whose points look about together: at most `most` of them, or those of one element.
pub fn look_outs(mesh: &Mesh, cluster: &Cluster, most: usize) -> Vec<Vec<Place>> {
    let (mut parts, mut room): (Vec<Vec<Place>>, _) = (Vec::new(), 0);
    for id in cluster.patches.clone() {
        let patch = mesh.patch(id);
        let looks = looks(mesh, &patch);
        for element in 0..patch.element_count() {
            if room < looks {
                parts.push(Vec::new());
                room = most.min(TOGETHER);
            }
            room = room.saturating_sub(looks);
            parts.last_mut().expect("there was no room at first").push((id, element));
        }
    }
    parts
}

/// How many points of each element of a patch look about: the middle, and the sixteen samples if it is not small.
fn looks(mesh: &Mesh, patch: &Patch) -> usize {
    let width = (patch.area / f64::from(patch.element_count())).sqrt();
    if width < SMALL * mesh.sizes.element { 1 } else { 17 }
}

/// The walks whose views tell which samples of the elements are valid: for each the middle, then its samples if it is not small.
fn look_about<'a>(mesh: &'a Mesh, elements: &[Place]) -> impl Iterator<Item = LookAbout<'a>> {
    elements.iter().flat_map(move |&(id, element)| {
        let patch = mesh.patch(id);
        let tile = patch.element_tile(element);
        (0..looks(mesh, &patch) as u32).map(move |look| {
            let point = match look.checked_sub(1) {
                None => patch.frame.at(tile.at(Frame::middle(patch.frame.layout))),
                Some(sample) => patch.area_sample(&tile, sample),
            };
            LookAbout::new(mesh, &patch, point)
        })
    })
}

/// The valid samples of the elements.
pub async fn valid_samples(mesh: &Mesh, elements: &[Place], inquiry: &Inquiry<'_>) -> Vec<u32> {
    let looks = inquiry.follow(look_about(mesh, elements).collect::<Vec<_>>()).await;
    let mut views = looks.iter().map(LookAbout::view);
    let mut valid = Vec::with_capacity(elements.len());
    let mut sampled = Vec::new();
    for (at, &(id, element)) in elements.iter().enumerate() {
        let patch = mesh.patch(id);
        let middle = views.next().expect("the middle always looks");
        if self::looks(mesh, &patch) == 1 {
            valid.push(if middle == View::Covered { 0 } else { ALL_VALID });
            continue;
        }
        let views: [View; MIDDLE as usize] = std::array::from_fn(|_| views.next().expect("each sample looks"));
        // An element that is open in part takes its light there; one wholly in a crack is as dark as the crack.
        let wanted = if views.contains(&View::Open) { View::Open } else { View::Crack };
        let bit = |view: View| u32::from(view >= wanted);
        let samples = views.iter().enumerate().fold(0, |bits, (s, &view)| bits | bit(view) << s);
        valid.push(if samples == 0 { 0 } else { samples | bit(middle) << MIDDLE });
        sampled.push((at, Sampled { patch, element, valid: valid[at] }));
    }
    let (places, mut sampled): (Vec<usize>, Vec<Sampled>) = sampled.into_iter().unzip();
    leave_edges(inquiry, &mut sampled).await;
    // What glows shines into a pocket, too.
    let glows = |s: &Sampled| mesh.colour(&s.patch, s.patch.first_element + s.element).emits();
    keep_wider(mesh, inquiry, &mut sampled, glows).await;
    places.iter().zip(sampled).for_each(|(&at, element)| valid[at] = element.valid);
    valid
}

/// Whether a point of a patch is covered, or lies in a crack, while `other`, of the same element, is not or does not: then
/// the light found there says nothing about the point, which by itself would take none. It is looked at a little towards the
/// other: on the very edge of two facets of a plane, each would seem to cover the other.
pub async fn is_hidden_beside(mesh: &Mesh, inquiry: &Inquiry<'_>, patch: &Patch, point: DVec3, other: DVec3) -> bool {
    let view = async |p: DVec3| inquiry.follow([LookAbout::new(mesh, patch, p)]).await[0].view();
    match view(point + EDGE * (other - point)).await {
        View::Open => false,
        hidden => hidden == View::Covered || hidden < view(other).await,
    }
}
