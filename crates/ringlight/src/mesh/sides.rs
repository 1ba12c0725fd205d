//! On which side of what stands on an element its light is found.
//!
//! A box without a bottom, or with two lit sides, hides from its inside that it is closed: an element half under it has
//! samples that lie as free in there as the others do outside. All of them cannot have one light. Those in the narrower room, a pocket that
//! nobody outside sees, count as covered: the others' light is what the element shows and gives.

use super::look::DIRECTIONS;
use super::validity::order;
use super::walk::{Query, Rule};
use super::{Frame, Inquiry, Mesh, Patch};
use glam::DVec3;
use ringlight_visibility::Ray;

/// A room is wider than another if one sees so many times as far in it, at most. Two rooms with a wall between them are about as wide:
/// their light stays one, and the wall is for smaller elements. So is what is narrow but open.
const WIDER: f64 = 3.0;

/// Directions (tangent, bitangent, normal) close to the surface, besides those in which any sample looks about: an opening beside a low pocket
/// is seen along no others.
const LOW_DIRECTIONS: [[f64; 3]; 8] = [
    [0.92, 0.38, 0.1],
    [0.38, 0.92, 0.1],
    [-0.38, 0.92, 0.1],
    [-0.92, 0.38, 0.1],
    [-0.92, -0.38, 0.1],
    [-0.38, -0.92, 0.1],
    [0.38, -0.92, 0.1],
    [0.92, -0.38, 0.1],
];

/// How high above the surface walls are looked for, relative to the element's width.
const LIFT: f64 = 0.02;

/// A short ray just above an element's surface, from a point of it to another: what it hits stands between them.
pub fn across(patch: &Patch, from: DVec3, to: DVec3) -> Ray {
    let lift = LIFT * (patch.area / f64::from(patch.element_count())).sqrt() * patch.normal;
    let [origin, direction] = [from + lift, to - from].map(|v| v.as_vec3().to_array());
    Ray { origin, direction, near: 0.0, far: 1.0, plane: patch.plane }
}

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

    /// From a sample in a direction.
    fn ray(&self, from: DVec3, direction: DVec3) -> Query {
        let [origin, direction] = [from, direction].map(|v| v.as_vec3().to_array());
        let ray = Ray { origin, direction, near: 0.0, far: f32::INFINITY, plane: self.patch.plane };
        Query { ray, rule: Rule::All }
    }

    /// Short rays from the middle to the samples beside it, just above the surface.
    fn across(&self) -> impl Iterator<Item = Query> + '_ {
        let from = self.point(self.middle());
        let ray = move |sample| across(&self.patch, from, self.point(sample));
        self.beside().map(move |sample| Query { ray: ray(sample), rule: Rule::All })
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

/// How far away at most is what a sample sees, metres.
async fn width(mesh: &Mesh, inquiry: &Inquiry<'_>, element: &Sampled, sample: u32) -> f64 {
    let normal = element.patch.normal;
    let (t, b) = normal.any_orthonormal_pair();
    let point = element.point(sample);
    let directions = DIRECTIONS.iter().chain(&LOW_DIRECTIONS);
    let queries: Vec<Query> = directions.map(|&[x, y, z]| element.ray(point, x * t + y * b + z * normal)).collect();
    let hits = inquiry.nearest_hits(&queries).await;
    hits.iter().map(|hit| hit.map_or(mesh.diagonal, |hit| f64::from(hit.distance))).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use crate::mesh::ALL_VALID;
    use crate::output::fixture::{closed_box, read, solve};
    use glam::DVec3;

    /// A cap of 0.4 m on the floor, open below, of which one wall may be missing.
    fn cap(walls: usize) -> String {
        let mut obj = closed_box("grey");
        for [y, x, z] in [0.0, 0.1].iter().flat_map(|&y| [[y, 0.3, 0.3], [y, 0.7, 0.3], [y, 0.7, 0.7], [y, 0.3, 0.7]]) {
            obj += &format!("v {x} {y} {z}\n");
        }
        obj += "o cap\nusemtl grey\nf -4 -3 -2 -1\n";
        for wall in &["f -8 -7 -3 -4\n", "f -7 -6 -2 -3\n", "f -6 -5 -1 -2\n", "f -5 -8 -4 -1\n"][..walls] {
            obj += wall;
        }
        obj
    }

    #[test]
    fn elements_across_the_wall_of_a_pocket_take_the_light_outside() {
        for (walls, closed) in [(4, true), (3, false)] {
            let solution = solve(read(&cap(walls)), 0.25, 1.0);
            let mesh = &solution.mesh;
            let (mut across, mut within) = (0, 0);
            for id in 0..mesh.patch_count() as u32 {
                let patch = mesh.patch(id);
                if patch.normal != DVec3::Y || patch.frame.origin.y != 0.0 {
                    continue;
                }
                for (k, element) in (0..).zip(patch.elements()) {
                    let tile = patch.element_tile(k);
                    let inside = |p: DVec3| p.x > 0.3 && p.x < 0.7 && p.z > 0.3 && p.z < 0.7;
                    let samples = (0..16).filter(|&s| inside(patch.area_sample(&tile, s)));
                    let hidden = samples.fold(0u16, |bits, s| bits | 1 << s);
                    let valid = mesh.valid[element as usize];
                    let expected = if closed && hidden != ALL_VALID { !hidden } else { ALL_VALID };
                    // The bit of the sample in the middle tells of the middle.
                    assert_eq!((valid ^ expected) & !(1 << 5), 0, "{walls} walls: {valid:016b} {hidden:016b}");
                    across += u32::from(hidden != 0 && hidden != ALL_VALID);
                    within += u32::from(hidden == ALL_VALID);
                }
            }
            assert_eq!((across, within), (4, 0));
        }
    }
}
