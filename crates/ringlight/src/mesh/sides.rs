//! On which side of what stands on an element its light is found.
//!
//! A box without a bottom, or with two lit sides, hides from its inside that it is closed: an element half under it has
//! samples that lie as free in there as the others do outside. All of them cannot have one light. Those in the narrower room count as
//! covered: they have next to no light, and the others' is what the element shows and gives.

use super::look::DIRECTIONS;
use super::validity::order;
use super::walk::{Query, Rule};
use super::{Frame, Inquiry, Mesh, Patch};
use glam::DVec3;
use ringlight_visibility::Ray;

/// A room is wider than another if what is seen in it is so many times as far away on average. Two rooms with a wall between them
/// are about as wide: their light stays one, and the wall is for smaller elements.
const WIDER: f64 = 3.0;

/// How high above the surface walls are looked for, relative to the element's width.
const LIFT: f64 = 0.02;

/// An element of a patch, and which of its samples are valid.
pub struct Sampled {
    /// The patch.
    pub patch: Patch,
    /// Number of the element in the patch.
    pub element: u32,
    /// Its valid samples.
    pub valid: u16,
}

impl Sampled {
    /// The sample that stands for the middle.
    fn middle(&self) -> u32 {
        order(self.patch.frame.layout)[0].into()
    }

    fn point(&self, sample: u32) -> DVec3 {
        let Patch { frame, .. } = &self.patch;
        let tile = self.patch.element_tile(self.element);
        match sample == self.middle() {
            true => frame.at(tile.at(Frame::middle(frame.layout))),
            false => self.patch.area_sample(&tile, sample),
        }
    }

    /// The valid samples besides the middle, if that is valid.
    fn beside(&self) -> impl Iterator<Item = u32> + use<> {
        let (valid, middle) = (self.valid, self.middle());
        let asked = if valid >> middle & 1 == 1 { valid & !(1 << middle) } else { 0 };
        (0..16).filter(move |sample| asked >> sample & 1 == 1)
    }

    fn ray(&self, from: DVec3, direction: DVec3, far: f32) -> Query {
        let [origin, direction] = [from, direction].map(|v| v.as_vec3().to_array());
        Query { ray: Ray { origin, direction, near: 0.0, far, plane: self.patch.plane }, rule: Rule::All }
    }

    /// Short rays from the middle to the samples beside it, just above the surface.
    fn across(&self) -> impl Iterator<Item = Query> + '_ {
        let lift = LIFT * (self.patch.area / f64::from(self.patch.element_count())).sqrt() * self.patch.normal;
        let from = self.point(self.middle());
        self.beside().map(move |sample| self.ray(from + lift, self.point(sample) - from, 1.0))
    }
}

/// Takes away the valid samples in the narrower room, where something stands between the middle of an element and others.
pub async fn keep_wider(mesh: &Mesh, inquiry: &Inquiry<'_>, elements: &mut [Sampled]) {
    let queries: Vec<Query> = elements.iter().flat_map(Sampled::across).collect();
    let mut hits = inquiry.nearest_hits(&queries).await.into_iter();
    for element in elements {
        let apart: Vec<u32> = element.beside().filter(|_| hits.next().flatten().is_some()).collect();
        if apart.is_empty() {
            continue;
        }
        let here = width(mesh, inquiry, element, element.middle()).await;
        let mut there = Vec::with_capacity(apart.len());
        for &sample in &apart {
            there.push(width(mesh, inquiry, element, sample).await);
        }
        let least = there.iter().copied().fold(here, f64::max) / WIDER;
        let narrow = apart.iter().zip(there).filter(|(_, width)| *width < least).fold(0, |bits, (s, _)| bits | 1 << s);
        let others = apart.iter().fold(0, |bits, s| bits | 1 << s);
        element.valid &= if here < least { others & !narrow } else { !narrow };
    }
}

/// How far away on average is what a sample sees, metres.
async fn width(mesh: &Mesh, inquiry: &Inquiry<'_>, element: &Sampled, sample: u32) -> f64 {
    let normal = element.patch.normal;
    let (t, b) = normal.any_orthonormal_pair();
    let point = element.point(sample);
    let queries = DIRECTIONS.map(|[x, y, z]| element.ray(point, x * t + y * b + z * normal, f32::INFINITY));
    let hits = inquiry.nearest_hits(&queries).await;
    let distances = hits.iter().map(|hit| hit.map_or(mesh.diagonal, |hit| f64::from(hit.distance)));
    distances.sum::<f64>() / DIRECTIONS.len() as f64
}
