//! What a point of a surface sees around it: rays over its hemisphere, each of which stands for as much of what arrives.

use super::emitter::sine_cosine;
use crate::mesh::walk::{Query, Rule, Walk};
use crate::mesh::{Holding, Mesh, OPAQUE_COVERAGE, RELATIVE_TOLERANCE};
use glam::DVec3;
use ringlight_visibility::{Hit, NO_PLANE, Ray};
use smallvec::SmallVec;

/// Surfaces behind each other after which a ray is given up.
const MOST_SURFACES: u32 = 64;

/// One ray on its way through see-through surfaces.
#[derive(Clone, Debug)]
pub struct Glance<'a> {
    mesh: &'a Mesh,
    ray: Ray,
    surfaces: u32,
    /// Share of the light behind what it has met that comes through.
    passing: f32,
    /// What it has met last, and the way that has to be free if that has the element's light.
    doubted: Option<(u32, f32, Ray)>,
    /// Lit elements that it met, and their shares of what it sees.
    pub seen: SmallVec<[(u32, f32); 1]>,
    /// Whether some of it meets nothing.
    pub escapes: bool,
}

/// `count` directions about the z axis, each of which stands for as much irradiance (Malley): above points of a disc along a spiral that
/// turns by the golden ratio (Vogel 1979). No line holds more than a few of them: no edge of a surface, however it lies, is crossed by
/// many at once. They come in the order in which they lie about the axis, so that those that follow each other meet the same things.
pub fn spiral(count: u32) -> Vec<DVec3> {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let place = |number: f64| ((number + 0.5) / f64::from(count), (number * GOLDEN).fract());
    let mut places: Vec<(f64, f64)> = (0..count).map(|number| place(number.into())).collect();
    places.sort_unstable_by(|(_, a), (_, b)| a.total_cmp(b));
    places.into_iter().map(above_disc).collect()
}

/// The direction about the z axis above a point of the unit disc, of which `share` lies nearer to the middle and which is turned by
/// `turn`.
fn above_disc((share, turn): (f64, f64)) -> DVec3 {
    let (sine, cosine) = sine_cosine(turn);
    DVec3::new(share.sqrt() * cosine, share.sqrt() * sine, (1.0 - share).sqrt())
}

impl<'a> Glance<'a> {
    /// From points of planes whose lit sides have this normal in directions about it, given about the z axis: from all of them in the
    /// first direction, then in the next.
    pub fn about(mesh: &'a Mesh, points: &[(DVec3, u32)], normal: DVec3, directions: &[DVec3]) -> Vec<Glance<'a>> {
        // Just above the surface, lest rounding lets a flat ray pass under a neighbour's edge.
        let above = RELATIVE_TOLERANCE * mesh.diagonal * normal;
        let start = |&(point, plane): &(DVec3, u32)| ((point + above).as_vec3().to_array(), plane);
        let starts: Vec<([f32; 3], u32)> = points.iter().map(start).collect();
        let (t, u) = normal.any_orthonormal_pair();
        let mut glances = Vec::with_capacity(starts.len() * directions.len());
        for d in directions {
            let direction = (d.x * t + d.y * u + d.z * normal).as_vec3().to_array();
            glances.extend(starts.iter().map(|&(origin, plane)| {
                let ray = Ray { origin, direction, near: 0.0, far: f32::INFINITY, plane };
                Glance { mesh, ray, surfaces: 0, passing: 1.0, doubted: None, seen: SmallVec::new(), escapes: false }
            }));
        }
        glances
    }

    /// From a point of a plane whose lit side has this normal, in the direction above a point of the unit disc, of which the first of
    /// two shares lies nearer to the middle and which is turned by the second: evenly spread ones send and receive as much.
    pub fn along(mesh: &'a Mesh, point: DVec3, (normal, plane): (DVec3, u32), disc: (f64, f64)) -> Glance<'a> {
        Glance::about(mesh, &[(point, plane)], normal, &[above_disc(disc)]).remove(0)
    }
}

impl Walk for Glance<'_> {
    fn query(&self) -> Option<Query> {
        if let Some((.., ray)) = self.doubted {
            return Some(Query { ray, rule: Rule::All });
        }
        let goes_on = self.passing >= 1e-3 && self.surfaces < MOST_SURFACES;
        goes_on.then_some(Query { ray: self.ray, rule: Rule::All })
    }

    fn answer(&mut self, hit: Option<Hit>) {
        if let Some((element, share, _)) = self.doubted.take() {
            if hit.is_none() {
                self.seen.push((element, share));
            }
            return;
        }
        let Some(hit) = hit else {
            (self.passing, self.escapes) = (0.0, true);
            return;
        };
        let mesh = self.mesh;
        let number = hit.triangle >> 1;
        let facet = &mesh.facets[number as usize];
        // A cut-out blocks wholly where it is hit.
        let cutout = mesh.occluder.cutout[facet.surface as usize].is_some();
        let coverage = if cutout { 1.0 } else { mesh.occluder.coverage(number, facet) };
        let blocked = if coverage >= OPAQUE_COVERAGE { 1.0 } else { coverage };
        if let Some((element, within)) = mesh.element_at(&self.ray, hit) {
            // What an element returns is less by its coverage already; only what covers is hit of a cut-out.
            let share = if cutout { coverage.max(1e-3) } else { 1.0 };
            match mesh.holding(element, within) {
                Holding::Sure => self.seen.push((element, self.passing / share)),
                Holding::IfFree(way) => self.doubted = Some((element, self.passing / share, way)),
                Holding::Dark => (),
            }
        }
        self.passing *= 1.0 - blocked;
        self.surfaces += 1;
        self.ray.near = hit.distance.next_up();
        self.ray.plane = NO_PLANE;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::fixture::{block, closed_box, read, solve_by_groups};

    #[test]
    fn directions_stand_for_equal_shares_of_irradiance() {
        let (normal, count) = (DVec3::Z, 500);
        let all = spiral(count);
        assert!(all.iter().all(|d| (d.length() - 1.0).abs() < 1e-12 && d.dot(normal) > 0.0));
        // Within any cone about the normal there are as many as its projected area says, and their sum is along it.
        for share in [0.1, 0.5, 0.9] {
            let within = all.iter().filter(|d| 1.0 - d.dot(normal).powi(2) < share).count();
            assert!((within as f64 - share * f64::from(count)).abs() <= 1.0);
        }
        let sum: DVec3 = all.iter().sum();
        assert!(sum.x.abs() < 2.0 && sum.y.abs() < 2.0, "{sum}");
    }

    #[test]
    fn light_on_the_open_part_of_an_element_does_not_shine_deep_in_a_crack() {
        // Two books of which one juts out, 8 mm apart: elements are as large as their sides.
        let books = block([0.40, 0.2, 0.40], [0.44, 0.4, 0.60]) + &block([0.448, 0.2, 0.45], [0.48, 0.4, 0.60]);
        let solution = solve_by_groups(read(&(closed_box("glow") + &books)), 0.2);
        let mesh = &solution.mesh;
        let light = |x: f64, normal: DVec3| {
            let side = |id: &u32| {
                let patch = mesh.patch(*id);
                patch.normal.dot(normal) > 0.99 && (mesh.to_world(patch.frame.origin).x - x).abs() < 1e-6
            };
            let patch = mesh.patch((0..mesh.patch_count() as u32).find(side).unwrap());
            assert_eq!(patch.element_count(), 1);
            solution.irradiance(patch.first_element)[1]
        };
        let (open, crack) = (light(0.44, DVec3::X), light(0.448, -DVec3::X));
        assert!(open > 1.0 && crack < 0.05 * open, "{open} {crack}");
    }
}
