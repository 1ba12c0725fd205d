//! Lines along which light breaks on large facets (discontinuity meshing: Heckbert 1992; Lischinski, Tampieri & Greenberg 1992).
//!
//! *D⁰ lines*, where light jumps: something stands on the facet, or passes through it. *D¹ lines*, where its slope does: an edge of an
//! area light and an edge that hides it are parallel, and the plane of both meets the facet. Where edges are not parallel, light breaks
//! in its second derivative alone; elements between which light is linear do not profit from lines there.

mod cut;
mod outline;
#[cfg(test)]
mod tests;

use crate::mesh::{Facet, Mesh, size};
use crate::quantity::photometric;
use crate::scene::{Alpha, Scene};
use cut::Ground;
pub use cut::cut;
use glam::{DVec2, DVec3};
use outline::{Edge, edges};
use rayon::prelude::*;
use ringlight_visibility::{HalfSpace, Hierarchy, Layout, OPAQUE, Ray, Triangle};

/// Facets are cut only if both sides have so many elements.
const LARGE: f64 = 2.0;

/// Edges shorter than this share of an element cast no line.
const SHORT: f64 = 0.5;

/// A line may leave the place where light breaks by this share of an element.
const STRAY: f64 = 1.0 / 16.0;

/// What is nearer to a facet than this share of an element touches it.
const TOUCHING: f64 = 1.0 / 64.0;

/// Edges of one light that are looked at, the longest ones.
const MOST_EDGES: usize = 64;

/// Places on a line from which it is seen whether light changes there.
const LOOKS: u32 = 8;

/// A straight line on a facet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Number of the facet.
    pub facet: u32,
    /// Its ends, metres.
    pub ends: [DVec3; 2],
}

/// An edge of an area light.
struct Lit {
    ends: [DVec3; 2],
    /// Normal of the side that shines; both do if `both`.
    normal: DVec3,
    both: bool,
    /// From the edge into the light, a unit vector.
    inward: DVec3,
    /// Plane id.
    plane: u32,
}

/// What is needed to find lines.
struct Search<'a> {
    mesh: &'a Mesh,
    /// Facets that block light.
    opaque: Hierarchy,
    /// Facets that may be cut.
    large: Hierarchy,
    element: f64,
}

/// The lines of the `lights` strongest area lights of a scene, sorted by facet. Patches need not be numbered yet.
pub fn lines(mesh: &Mesh, scene: &Scene, lights: u32) -> Vec<Line> {
    let facets: &[Facet] = &mesh.facets;
    let material = |f: u32| &scene.materials[scene.surfaces[facets[f as usize].surface as usize].material as usize];
    let shines = |f: u32| material(f).emission.iter().any(|&e| e > 0.0);
    let opaque = |f: u32| material(f).alpha == Alpha::Opaque && material(f).transmission == 0.0;
    let element = mesh.sizes.element;
    let is_large = |f: u32| {
        let lengths = size::lengths(&facets[f as usize]);
        !shines(f) && lengths.iter().all(|&l| l >= LARGE * element * size::scale(lengths, &mesh.sizes))
    };
    let all = 0..facets.len() as u32;
    let lit = outlines(mesh, scene, lights);
    let edges = edges(facets, SHORT * element, opaque);
    let search = Search {
        mesh,
        opaque: hierarchy(facets, all.clone().filter(|&f| opaque(f))),
        large: hierarchy(facets, all.filter(|&f| is_large(f))),
        element,
    };
    let mut lines: Vec<Line> = edges.par_iter().flat_map_iter(|edge| search.of_edge(edge, &lit)).collect();
    let numbers = (0..facets.len() as u32).into_par_iter().filter(|&f| opaque(f));
    lines.par_extend(numbers.flat_map_iter(|f| search.crossings(f)));
    let key = |line: &Line| (line.facet, line.ends.map(|end| end.to_array().map(|x| (x + 0.0).to_bits())));
    lines.par_sort_unstable_by_key(key);
    lines.dedup();
    lines
}

/// A facet that shines, by surface and plane.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Shining {
    surface: u32,
    plane: u32,
    facet: u32,
}

/// The outlines of the strongest lights: what shines of one surface in one plane is one.
fn outlines(mesh: &Mesh, scene: &Scene, lights: u32) -> Vec<Lit> {
    let facets: &[Facet] = &mesh.facets;
    let emission = |facet: &Facet| {
        let material = scene.surfaces[facet.surface as usize].material;
        f64::from(photometric(scene.materials[material as usize].emission))
    };
    let numbered = (0..).zip(facets).filter(|(_, facet)| emission(facet) > 0.0);
    let mut shining: Vec<Shining> =
        numbered.map(|(number, f)| Shining { surface: f.surface, plane: f.plane, facet: number }).collect();
    shining.sort_unstable();
    let power = |of: &Shining| {
        let facet = &facets[of.facet as usize];
        emission(facet) * facet.frame().area_vector().length()
    };
    let alike = |a: &Shining, b: &Shining| (a.surface, a.plane) == (b.surface, b.plane);
    let mut groups: Vec<(f64, &[Shining])> =
        shining.chunk_by(alike).map(|group| (group.iter().map(power).sum(), group)).collect();
    groups.sort_by(|a, b| b.0.total_cmp(&a.0));
    groups.truncate(lights as usize);
    let of_group = |(_, group): (f64, &[Shining])| {
        let is_in = |f: u32| group.binary_search_by_key(&f, |of| of.facet).is_ok();
        let mut edges = edges(facets, 0.0, is_in);
        let length = |edge: &Edge| (edge.ends[1] - edge.ends[0]).length();
        edges.sort_by(|a, b| length(b).total_cmp(&length(a)));
        edges.truncate(MOST_EDGES);
        edges
    };
    let lit = |edge: Edge| {
        let facet = &facets[edge.facet as usize];
        let normal = facet.frame().area_vector().normalize();
        Lit { ends: edge.ends, normal, both: facet.double_sided(), inward: edge.inward[0], plane: facet.plane }
    };
    groups.into_iter().flat_map(of_group).map(lit).collect()
}

/// The hierarchy over some facets: triangle ids as in [`super::hierarchy`].
fn hierarchy(facets: &[Facet], numbers: impl Iterator<Item = u32>) -> Hierarchy {
    let triangles = numbers.flat_map(|number| {
        let facet = &facets[number as usize];
        let c = facet.corners.map(|c| c.to_array());
        let halves = if facet.layout() == Layout::Triangle { 1 } else { 2 };
        let half = move |half: usize| {
            let corners = [c[0], c[1 + half], c[2 + half]];
            Triangle { corners, plane: facet.plane, id: 2 * number + half as u32, filter: OPAQUE }
        };
        (0..halves).map(half)
    });
    Hierarchy::build(triangles.collect(), Vec::new())
}

impl Search<'_> {
    /// The facets that may be cut and may reach into a region.
    fn large_in(&self, region: &[HalfSpace]) -> Vec<u32> {
        let mut found = Vec::new();
        self.large.visit(region, |triangle| found.push(triangle.id >> 1));
        found.sort_unstable();
        found.dedup();
        found
    }

    fn facet(&self, number: u32) -> &Facet {
        &self.mesh.facets[number as usize]
    }

    /// All lines that an edge casts, or makes where it touches.
    fn of_edge(&self, edge: &Edge, lit: &[Lit]) -> Vec<Line> {
        let mut lines = Vec::new();
        let touching = TOUCHING * self.element;
        let [from, to] = edge.ends;
        for number in self.large_in(&around([from, to], touching)) {
            let ground = Ground::of(self.facet(number));
            let lies = edge.ends.iter().all(|&end| ground.normal.dot(end - ground.origin).abs() <= touching);
            let rises = |inward: DVec3| {
                let slope = ground.normal.dot(inward);
                slope > 0.01 || (self.facet(number).double_sided() && slope < -0.01)
            };
            if lies && edge.inward.into_iter().any(rises) {
                lines.push(Line { facet: number, ends: edge.ends });
            }
        }
        lit.iter().for_each(|light| self.cast(edge, light, &mut lines));
        lines
    }

    /// The lines that an edge casts from one of a light's edges.
    fn cast(&self, edge: &Edge, light: &Lit, lines: &mut Vec<Line>) {
        let [along, parallel] = [edge.ends, light.ends].map(|[a, b]| (b - a).normalize());
        if along.cross(parallel).length_squared() > 0.01 {
            return;
        }
        let [from, to] = [light.ends, edge.ends].map(|[a, b]| (a + b) / 2.0);
        let sign = if light.both { light.normal.dot(to - from).signum() } else { 1.0 };
        let before = |end: DVec3| sign * light.normal.dot(end - from) > TOUCHING * self.element;
        let across = (to - from).cross(along);
        let (Some(across), true) = (across.try_normalize(), edge.ends.into_iter().all(before)) else { return };
        // Seen along the plane of both edges, what meets at the edge lies on one side.
        let [one, other] = edge.inward.map(|inward| inward.dot(across));
        if one * other < -1e-6 {
            return;
        }
        let beyond = (to - from).reject_from_normalized(along).normalize();
        let slack = STRAY * self.element;
        let half = |normal: DVec3, offset: f64| HalfSpace { normal: normal.to_array(), offset };
        // Beyond the edge, and between what goes from one end of the light's edge past the other end of this one.
        let ordered = |[a, b]: [DVec3; 2]| if along.dot(b - a) < 0.0 { [b, a] } else { [a, b] };
        let ([low, high], [lowest, highest]) = (ordered(edge.ends), ordered(light.ends));
        let past = |from: DVec3, end: DVec3, outwards: DVec3| {
            let normal = across.cross(end - from).normalize();
            let normal = if normal.dot(outwards) < 0.0 { -normal } else { normal };
            half(normal, normal.dot(end) + slack)
        };
        let region = [
            half(across, across.dot(to) + slack),
            half(-across, slack - across.dot(to)),
            half(-beyond, slack - beyond.dot(to)),
            past(lowest, high, along),
            past(highest, low, -along),
        ];
        for number in self.large_in(&region).into_iter().filter(|&f| self.facet(f).plane != light.plane) {
            lines.extend(self.meet(number, edge, light, across));
        }
    }

    /// Where the plane of an edge and a light's edge, whose normal is `across`, meets a facet, and light breaks there.
    fn meet(&self, number: u32, edge: &Edge, light: &Lit, across: DVec3) -> Option<Line> {
        let facet = self.facet(number);
        let ground = Ground::of(facet);
        let middle = (light.ends[0] + light.ends[1]) / 2.0;
        let sign = ground.normal.dot(middle - ground.origin).signum();
        if sign < 0.0 && !facet.double_sided() {
            return None;
        }
        let height = |point: DVec3| sign * ground.normal.dot(point - ground.origin);
        let ends = above(edge.ends, height)?;
        let mut feet = Vec::with_capacity(4);
        for from in light.ends {
            for to in ends {
                let [start, end] = [from, to].map(height);
                // What is as high as the light casts no shadow down.
                if start < TOUCHING * self.element || end > 0.999 * start {
                    return None;
                }
                feet.push(ground.coordinates(from + start / (start - end) * (to - from)));
            }
        }
        let along = (feet[1] - feet[0]).try_normalize()?;
        let offsets = feet.iter().map(|&foot| along.perp_dot(foot));
        let (low, high) = offsets.fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x), h.max(x)));
        if high - low > 2.0 * STRAY * self.element {
            return None;
        }
        let on_line = |at: f64| at * along + (low + high) / 2.0 * along.perp();
        let places = feet.iter().map(|&foot| along.dot(foot));
        let (start, end) = places.fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x), h.max(x)));
        let (start, end) =
            within(facet, &ground, [on_line(start), on_line(end)]).map(|[a, b]| (along.dot(a), along.dot(b)))?;
        if end - start < SHORT * self.element {
            return None;
        }
        let breaks = |k: u32| {
            let at = start + (end - start) * (f64::from(k) + 0.5) / f64::from(LOOKS);
            let point = ground.at(on_line(at));
            self.breaks((point, sign * ground.normal, facet.plane), ends, light, across)
        };
        let seen: Vec<u32> = (0..LOOKS).filter(|&k| breaks(k)).collect();
        let (&first, &last) = (seen.first()?, seen.last()?);
        let place = |k: u32| ground.at(on_line(start + (end - start) * f64::from(k) / f64::from(LOOKS)));
        Some(Line { facet: number, ends: [place(first), place(last + 1)] })
    }

    /// Whether of two points beside `point` one sees what is behind the edge of a light, and the other does not.
    fn breaks(
        &self,
        (point, normal, plane): (DVec3, DVec3, u32),
        edge: [DVec3; 2],
        light: &Lit,
        across: DVec3,
    ) -> bool {
        let along = (edge[1] - edge[0]).normalize();
        let place = |p: DVec3| along.dot(p - point);
        // The light's edge is seen through the edge in part: the middle of that.
        let beyond = |p: DVec3| (p - point).reject_from_normalized(along).length();
        let far = beyond(light.ends[0]) / beyond(edge[0]).max(1e-9);
        let order = |[a, b]: [f64; 2]| if a < b { [a, b] } else { [b, a] };
        let [low, high] = order(edge.map(|end| far * place(end)));
        let [first, last] = order(light.ends.map(place));
        let (low, high) = (low.max(first), high.min(last));
        if low > high {
            return false;
        }
        let share = ((low + high) / 2.0 - place(light.ends[0])) / (place(light.ends[1]) - place(light.ends[0]));
        let to = light.ends[0].lerp(light.ends[1], share) + 1e-3 * self.element * light.inward;
        let aside = across.reject_from_normalized(normal).normalize_or_zero() * self.element / 32.0;
        let sees = |from: DVec3| {
            let origin = from + 1e-4 * self.element * normal;
            let direction = (to - origin).as_vec3().to_array();
            let ray = Ray { origin: origin.as_vec3().to_array(), direction, near: 0.0, far: 0.999, plane };
            self.opaque.nearest_hit_where(&ray, |triangle| triangle.plane != light.plane).is_none()
        };
        sees(point - aside) != sees(point + aside)
    }

    /// Where a facet passes through others.
    fn crossings(&self, number: u32) -> Vec<Line> {
        let corners: Vec<DVec3> = self.facet(number).outline().iter().map(|c| c.as_dvec3()).collect();
        let touching = TOUCHING * self.element;
        let through = |other: u32| {
            let ground = Ground::of(self.facet(other));
            let height = |k: usize| ground.normal.dot(corners[k % corners.len()] - ground.origin);
            let crossing = |k: usize| {
                let ([a, b], [from, to]) = ([k, k + 1].map(height), [k, k + 1].map(|k| corners[k % corners.len()]));
                let passes = a * b < 0.0 && a.abs().min(b.abs()) > touching;
                passes.then(|| from.lerp(to, a / (a - b)))
            };
            let found: Vec<DVec3> = (0..corners.len()).filter_map(crossing).collect();
            let ends = <[DVec3; 2]>::try_from(found).ok()?;
            ((ends[1] - ends[0]).length() >= SHORT * self.element).then_some(Line { facet: other, ends })
        };
        self.large_in(&around(corners.iter().copied(), touching)).into_iter().filter_map(through).collect()
    }
}

/// What of a line lies within a convex facet.
fn within(facet: &Facet, ground: &Ground, [from, to]: [DVec2; 2]) -> Option<[DVec2; 2]> {
    let corners: Vec<DVec2> = facet.outline().iter().map(|c| ground.coordinates(c.as_dvec3())).collect();
    let (mut first, mut last) = (0.0f64, 1.0f64);
    for (k, &a) in corners.iter().enumerate() {
        let side = corners[(k + 1) % corners.len()] - a;
        let [start, end] = [from, to].map(|p| side.perp_dot(p - a));
        match (start < 0.0, end < 0.0) {
            (true, true) => return None,
            (true, false) => first = first.max(start / (start - end)),
            (false, true) => last = last.min(start / (start - end)),
            (false, false) => {}
        }
    }
    (first < last).then(|| [from.lerp(to, first), from.lerp(to, last)])
}

/// What of an edge is not below.
fn above([a, b]: [DVec3; 2], height: impl Fn(DVec3) -> f64) -> Option<[DVec3; 2]> {
    match [a, b].map(&height) {
        [x, y] if x < 0.0 && y < 0.0 => None,
        [x, y] if x < 0.0 => Some([a.lerp(b, x / (x - y)), b]),
        [x, y] if y < 0.0 => Some([a, a.lerp(b, x / (x - y))]),
        _ => Some([a, b]),
    }
}

/// The box around points, this much larger on all sides.
fn around(points: impl IntoIterator<Item = DVec3>, margin: f64) -> [HalfSpace; 6] {
    let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (low, high) = points.into_iter().fold(none, |(low, high), p| (low.min(p), high.max(p)));
    std::array::from_fn(|i| {
        let (axis, sign) = (DVec3::AXES[i / 2], if i % 2 == 0 { 1.0 } else { -1.0 });
        let offset = if i % 2 == 0 { high[i / 2] } else { -low[i / 2] };
        HalfSpace { normal: (sign * axis).to_array(), offset: offset + margin }
    })
}
