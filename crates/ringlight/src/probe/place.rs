//! Where a probe stands: on which surfaces, on which side of them, and whether inside things.
//!
//! A point within δ of a surface lies *on* it: 2·10⁻⁵ of the scene's diagonal, 0.2 mm in a room of 10 m, but in large scenes
//! no more than 1 mm, or what coordinates in single precision can tell. Such a point is put to where light can be computed:
//!
//! - on a surface in whose plane it lies (normals parallel to 2.5°) it is moved exactly into the plane, and what lies in
//!   that plane does not block it;
//! - off a surface that is tilted against it, to δ from the surface, on the side to which its normal looks;
//! - off walls that it touches at an edge or in a corner (normals more than 84° from its own), to δ from the wall, on the
//!   side where it stays on its own surface and is not inside things.

use super::nearest::closest_on_facet;
use crate::mesh::walk::{Query, Rule};
use crate::mesh::{Facet, Inquiry, Mesh, Tile};
use crate::quantity::Rgb;
use crate::shooting::sine_cosine;
use crate::smooth::places::Places;
use crate::solution::Solution;
use glam::{DVec2, DVec3};
use ringlight_visibility::{Hit, NO_PLANE, Ray};

/// A receiving point, mesh coordinates, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Position.
    pub point: DVec3,
    /// Unit normal.
    pub normal: DVec3,
    /// Plane id of the surface on which it lies, or [`NO_PLANE`].
    pub plane: u32,
}

/// A place on a facet's side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// Number of the element.
    pub element: u32,
    /// Number of the patch.
    pub patch: u32,
    /// Parameters within the element.
    pub within: DVec2,
    /// Whether other geometry covers it.
    pub covered: bool,
}

/// Points nearer to a surface than this share of the scene's diagonal, and than this many metres, lie on it.
const TOUCH: f64 = 2e-5;
const MOST_TOUCH: f64 = 1e-3;

/// Share of the diagonal that single precision can tell, some units in the last place.
const PRECISION: f64 = 4e-7;

/// Cosine above which a normal is a surface's own.
const SAME: f64 = 0.999;

/// Cosine below which a surface is a wall beside the point.
const WALL: f64 = 0.1;

/// Walls that a point can touch at once: those of a corner.
const MOST_WALLS: usize = 3;

/// Rays that look whether a point is inside things, and how many of them must see something lit, or nothing at all.
const RAYS: u32 = 64;
const ENOUGH: u32 = RAYS / 8;

/// Surfaces of two lit sides that are seen from the geometric back and have less than this share of the median irradiance
/// are the inside of something: a wall or a box.
const DIM: f64 = 0.01;

/// What is around points.
pub struct Surroundings<'a> {
    pub solution: &'a Solution,
    pub places: Places<'a>,
    /// Points that are nearer than this to a surface lie on it, metres.
    pub touch: f64,
    /// Irradiance, summed over channels, that a surface seen from its geometric back has at least if it is lit.
    dim: f64,
}

/// A surface that a point touches.
struct Touched {
    facet: u32,
    plane: u32,
    /// Unit normal of the facet's front.
    normal: DVec3,
    /// Distance from the facet, metres.
    distance: f64,
    /// Height above the facet's plane, metres.
    height: f64,
}

impl<'a> Surroundings<'a> {
    pub fn new(solution: &'a Solution) -> Surroundings<'a> {
        let places = Places::new(&solution.mesh);
        let diagonal = solution.mesh.diagonal;
        let touch = (TOUCH * diagonal).min(MOST_TOUCH.max(PRECISION * diagonal));
        Surroundings { solution, places, touch, dim: DIM * median_irradiance(solution) }
    }

    fn mesh(&self) -> &'a Mesh {
        &self.solution.mesh
    }

    /// Where a point with a unit normal stands; None if inside things.
    pub async fn stand(&self, inquiry: &Inquiry<'_>, point: DVec3, normal: DVec3) -> Option<Place> {
        let mut touched = self.touched(point);
        let mut place = Place { point, normal, plane: NO_PLANE };
        let own = touched.iter().position(|t| t.normal.dot(normal).abs() > SAME).map(|k| touched.remove(k));
        if let Some(own) = &own {
            place.point -= own.height * own.normal;
            place.plane = own.plane;
        }
        let mut walls = Vec::new();
        for t in touched.iter().filter(|t| t.plane != place.plane) {
            let cosine = t.normal.dot(normal);
            if cosine.abs() > WALL {
                place.point += (self.touch - t.height * cosine.signum()) * cosine.signum() * t.normal;
            } else if walls.len() < MOST_WALLS {
                walls.push(t);
            }
        }
        // Of all ways round the walls the first that stays on the point's own surface, and of these one not inside things.
        let mut best: Option<((bool, bool), Place)> = None;
        for way in 0..1u32 << walls.len() {
            let push = walls.iter().enumerate().fold(DVec3::ZERO, |sum, (k, wall)| {
                // First the front; or the side on which the point clearly is.
                let first = if wall.height < -self.touch / 4.0 { -1.0 } else { 1.0 };
                let side = if way >> k & 1 == 0 { first } else { -first };
                sum + (side * self.touch - wall.height) * wall.normal
            });
            let place = Place { point: place.point + push, ..place };
            let leaves = own.as_ref().is_some_and(|own| {
                let facet = &self.mesh().facets[own.facet as usize];
                (closest_on_facet(facet, place.point).1 - place.point).length() > self.touch / 2.0
            });
            let worth = (leaves, self.is_inside(inquiry, &place).await);
            if best.is_none_or(|(best, _)| worth < best) {
                best = Some((worth, place));
            }
        }
        best.filter(|((_, inside), _)| !inside).map(|(_, place)| place)
    }

    /// The surfaces on which a point lies, nearest first, one for each plane.
    fn touched(&self, point: DVec3) -> Vec<Touched> {
        let mut found = Vec::new();
        self.places.visit(point, self.touch, &mut |number| {
            let facet = &self.mesh().facets[number as usize];
            let (normal, closest) = closest_on_facet(facet, point);
            let distance = (closest - point).length();
            if distance <= self.touch {
                let height = normal.dot(point - closest);
                found.push(Touched { facet: number, plane: facet.plane, normal, distance, height });
            }
        });
        found.sort_by(|a, b| a.distance.total_cmp(&b.distance).then(a.facet.cmp(&b.facet)));
        let mut planes = Vec::new();
        found.retain(|t| {
            !planes.contains(&t.plane) && {
                planes.push(t.plane);
                true
            }
        });
        found
    }

    /// Whether nearly all that a place sees, weighted by cosine, are unlit backs, covered surfaces, or surfaces without
    /// light.
    pub async fn is_inside(&self, inquiry: &Inquiry<'_>, place: &Place) -> bool {
        let n = place.normal;
        let (t, b) = n.any_orthonormal_pair();
        let mut open = 0;
        // Most places are open: as many rays as may be enough are asked for together.
        for first in (0..RAYS).step_by(ENOUGH as usize) {
            let directions: [DVec3; ENOUGH as usize] = std::array::from_fn(|k| {
                // Malley's method on a golden spiral.
                let i = f64::from(first + k as u32);
                let share = (i + 0.5) / f64::from(RAYS);
                let (s, c) = sine_cosine((i * 0.618_033_988_749_894_9).fract());
                share.sqrt() * (c * t + s * b) + (1.0 - share).sqrt() * n
            });
            let hits = inquiry.nearest_hits(&directions.map(|direction| sight(place, direction))).await;
            let seen = directions.iter().zip(hits).filter(|(direction, hit)| self.is_lit(place, **direction, *hit));
            open += seen.count() as u32;
            if open >= ENOUGH {
                return false;
            }
        }
        true
    }

    /// Whether what a ray from a place meets is lit, if it meets anything.
    fn is_lit(&self, place: &Place, direction: DVec3, hit: Option<Hit>) -> bool {
        let Some(hit) = hit else { return true };
        let number = hit.triangle >> 1;
        let facet = &self.mesh().facets[number as usize];
        if !hit.front && !facet.double_sided() {
            return false;
        }
        let spot = self.spot(facet, !hit.front, place.point + f64::from(hit.distance) * direction);
        let patch = self.mesh().patch(spot.patch);
        let light = self.solution.light(spot.element);
        let exitance = self.mesh().colour(&patch, spot.element).exitance;
        // Boxes that stand on a floor without a bottom of their own get some light through elements of the floor that
        // are covered in part.
        let least = if hit.front { 0.0 } else { self.dim };
        !spot.covered && (sum(light.mean()) > least || sum(exitance) > 0.0)
    }

    /// The place on a facet's side that is nearest to `point`.
    pub fn spot(&self, facet: &Facet, back: bool, point: DVec3) -> Spot {
        let at = facet.frame().parameters(point).clamp(DVec2::ZERO, DVec2::ONE);
        let (patch, element, within) = self.mesh().find_element(facet, back, at);
        let within = within.clamp(DVec2::ZERO, DVec2::ONE);
        let sample = Tile::find(facet.layout(), [4, 4], within).0;
        let covered = self.mesh().valid[element as usize] >> sample & 1 == 0;
        Spot { element, patch, within, covered }
    }
}

/// What a place sees in a direction.
fn sight(place: &Place, direction: DVec3) -> Query {
    let (origin, direction) = (place.point.as_vec3().to_array(), direction.as_vec3().to_array());
    Query { ray: Ray { origin, direction, near: 0.0, far: f32::INFINITY, plane: place.plane }, rule: Rule::All }
}

fn sum(rgb: Rgb) -> f64 {
    rgb.iter().map(|&x| f64::from(x)).sum()
}

/// Median irradiance of the elements that have any, summed over channels; 0 if none has.
fn median_irradiance(solution: &Solution) -> f64 {
    let mut lit: Vec<f64> = solution.light.elements.iter().map(|e| sum(e.mean())).filter(|&e| e > 0.0).collect();
    if lit.is_empty() {
        return 0.0;
    }
    let middle = lit.len() / 2;
    *lit.select_nth_unstable_by(middle, f64::total_cmp).1
}
