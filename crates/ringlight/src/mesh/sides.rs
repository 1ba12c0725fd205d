//! On which side of what stands on an element its light is found.
//!
//! A box without a bottom, or with two lit sides, hides from its inside that it is closed: an element half under it has
//! samples that lie as free in there as the others do outside. All of them cannot have one light. Those in the narrower room, a pocket that
//! nobody outside sees, count as covered: the others' light is what the element shows and gives. An element that glows keeps them.

use super::look::DIRECTIONS;
use super::validity::area_samples;
use super::walk::{Query, Rule};
use super::{ALL_VALID, Frame, Inquiry, MIDDLE, Mesh, Patch};
use glam::{DVec2, DVec3};
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

/// What is nearer to the middle than this share of the element's width stands on it.
const ON_EDGE: f64 = 0.01;

/// A short ray just above an element's surface, from a point of it to another: what it hits stands between them.
pub fn across(patch: &Patch, from: DVec3, to: DVec3) -> Ray {
    let [origin, direction] = [from + lift(patch), to - from].map(|v| v.as_vec3().to_array());
    Ray { origin, direction, near: 0.0, far: 1.0, plane: patch.plane }
}

/// How high above a patch walls are looked for.
fn lift(patch: &Patch) -> DVec3 {
    LIFT * (patch.area / f64::from(patch.element_count())).sqrt() * patch.normal
}

/// An element of a patch, and which of its samples are valid.
pub struct Sampled {
    /// The patch.
    pub patch: Patch,
    /// Number of the element in the patch.
    pub element: u32,
    /// Its valid samples.
    pub valid: u32,
}

impl Sampled {
    fn point(&self, sample: u32) -> DVec3 {
        let Patch { frame, .. } = &self.patch;
        let tile = self.patch.element_tile(self.element);
        match sample == MIDDLE {
            true => frame.at(tile.at(Frame::middle(frame.layout))),
            false => self.patch.area_sample(&tile, sample),
        }
    }

    /// The valid samples besides the middle, if that is valid.
    fn beside(&self) -> impl Iterator<Item = u32> + use<> {
        area_samples(if self.valid >> MIDDLE & 1 == 1 { self.valid } else { 0 })
    }

    /// From a sample in a direction.
    fn ray(&self, from: DVec3, direction: DVec3) -> Query {
        let [origin, direction] = [from, direction].map(|v| v.as_vec3().to_array());
        let ray = Ray { origin, direction, near: 0.0, far: f32::INFINITY, plane: self.patch.plane };
        Query { ray, rule: Rule::All }
    }

    /// Short rays over the middle along both sides.
    fn over_middle(&self) -> [Query; 2] {
        let Patch { frame, .. } = &self.patch;
        let (tile, middle) = (self.patch.element_tile(self.element), Frame::middle(frame.layout));
        [DVec2::X, DVec2::Y].map(|side| {
            let [from, to] = [-ON_EDGE, ON_EDGE].map(|step| frame.at(tile.at(middle + step * side)));
            Query { ray: across(&self.patch, from, to), rule: Rule::All }
        })
    }

    /// Short rays from the middle to the samples beside it, just above the surface.
    fn across(&self) -> impl Iterator<Item = Query> + '_ {
        let from = self.point(MIDDLE);
        let ray = move |sample| across(&self.patch, from, self.point(sample));
        self.beside().map(move |sample| Query { ray: ray(sample), rule: Rule::All })
    }
}

/// Takes away the middle of elements where a wall stands on it: there one would see into both rooms.
pub async fn leave_edges(inquiry: &Inquiry<'_>, elements: &mut [Sampled]) {
    let doubted = |element: &Sampled| element.valid != ALL_VALID && element.valid >> MIDDLE & 1 == 1;
    let queries: Vec<Query> =
        elements.iter().filter(|element| doubted(element)).flat_map(Sampled::over_middle).collect();
    let hits = inquiry.nearest_hits(&queries).await;
    let mut hits = hits.chunks(2);
    for element in elements.iter_mut().filter(|element| doubted(element)) {
        if hits.next().is_some_and(|hits| hits.iter().any(Option::is_some)) {
            element.valid &= !(1 << MIDDLE);
        }
    }
}

/// Takes away the valid samples in the narrower room, where something stands between the middle of an element and others and nothing
/// that is seen in one room is seen in the other; not of those that glow.
pub async fn keep_wider(
    mesh: &Mesh,
    inquiry: &Inquiry<'_>,
    elements: &mut [Sampled],
    glows: impl Fn(&Sampled) -> bool,
) {
    let queries: Vec<Query> = elements.iter().flat_map(Sampled::across).collect();
    let mut hits = inquiry.nearest_hits(&queries).await.into_iter();
    for element in elements {
        let apart: Vec<u32> = element.beside().filter(|_| hits.next().flatten().is_some()).collect();
        if apart.is_empty() || glows(element) {
            continue;
        }
        let mut outlooks = vec![Outlook::new(mesh, inquiry, element, MIDDLE).await];
        for &sample in &apart {
            outlooks.push(Outlook::new(mesh, inquiry, element, sample).await);
        }
        let widest = outlooks.iter().max_by(|a, b| a.width.total_cmp(&b.width)).expect("the middle is one");
        let mut narrow = 0;
        for outlook in &outlooks {
            if WIDER * outlook.width < widest.width && !outlook.shares_room(inquiry, element, widest.sample).await {
                narrow |= 1 << outlook.sample;
            }
        }
        let others = apart.iter().fold(0, |bits, s| bits | 1 << s);
        element.valid &= if narrow >> MIDDLE & 1 == 1 { others & !narrow } else { !narrow };
    }
}

/// What a sample sees.
struct Outlook {
    sample: u32,
    /// How far away at most, metres.
    width: f64,
    /// Points just before what it sees.
    points: Vec<DVec3>,
}

impl Outlook {
    async fn new(mesh: &Mesh, inquiry: &Inquiry<'_>, element: &Sampled, sample: u32) -> Outlook {
        let normal = element.patch.normal;
        let (t, b) = normal.any_orthonormal_pair();
        let point = element.point(sample);
        let directions = DIRECTIONS.iter().chain(&LOW_DIRECTIONS).map(|&[x, y, z]| x * t + y * b + z * normal);
        let queries: Vec<Query> = directions.clone().map(|direction| element.ray(point, direction)).collect();
        let hits = inquiry.nearest_hits(&queries).await;
        let distances = hits.iter().map(|hit| hit.map_or(mesh.diagonal, |hit| f64::from(hit.distance)));
        let width = distances.clone().fold(0.0, f64::max);
        let points = distances.zip(directions).map(|(distance, to)| point + 0.99 * distance * to).collect();
        Outlook { sample, width, points }
    }

    /// Whether any of the points is seen from another sample.
    async fn shares_room(&self, inquiry: &Inquiry<'_>, element: &Sampled, other: u32) -> bool {
        let from = element.point(other) + lift(&element.patch);
        let to = |point: &DVec3| {
            let [origin, direction] = [from, *point - from].map(|v| v.as_vec3().to_array());
            Query { ray: Ray { origin, direction, near: 0.0, far: 1.0, plane: element.patch.plane }, rule: Rule::All }
        };
        let hits = inquiry.nearest_hits(&self.points.iter().map(to).collect::<Vec<_>>()).await;
        hits.iter().any(Option::is_none)
    }
}

#[cfg(test)]
mod tests {
    use super::Sampled;
    use crate::mesh::{ALL_VALID, MIDDLE};
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
                    let valid = mesh.valid[element as usize];
                    let sampled = Sampled { patch: mesh.patch(id), element: k, valid };
                    let inside = |p: DVec3| p.x > 0.3 && p.x < 0.7 && p.z > 0.3 && p.z < 0.7;
                    let samples = (0..=MIDDLE).filter(|&s| inside(sampled.point(s)));
                    let hidden = samples.fold(0, |bits, s| bits | 1 << s);
                    let expected = if closed && hidden != ALL_VALID { ALL_VALID & !hidden } else { ALL_VALID };
                    assert_eq!(valid, expected, "{walls} walls: {valid:017b} {hidden:017b}");
                    across += u32::from(hidden != 0 && hidden != ALL_VALID);
                    within += u32::from(hidden == ALL_VALID);
                }
            }
            assert_eq!((across, within), (4, 0));
        }
    }
}
