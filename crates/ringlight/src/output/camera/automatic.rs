//! A view that shows much of a scene: inside of a room, in front of anything else.
//!
//! Candidates are judged by rays of sight. Everything is a function of the solution alone.

use super::{Projection, View, sight};
use crate::mesh::Mesh;
use crate::output::seen::{Seen, look};
use crate::quantity::photometric;
use crate::solution::Solution;
use glam::DVec3;
use rayon::prelude::*;
use ringlight_visibility::Hierarchy;
use std::collections::BTreeSet;
use std::f64::consts::{PI, TAU};

/// Rays by which a candidate for the eye is judged.
const RAYS_ABOUT: usize = 96;

/// Rays by which a view is judged: columns and rows.
const RAYS_WITHIN: [u32; 2] = [20, 14];

/// An eye is inside when at least this share of its rays meets lit sides.
const CLOSED: f64 = 0.9;

/// Places of an eye along the sides of the scene's box.
const PLACES: [f64; 7] = [0.06, 0.2, 0.35, 0.5, 0.65, 0.8, 0.94];

/// Heights from which the floor below is looked for, as shares of the box.
const HEIGHTS: [f64; 4] = [0.12, 0.38, 0.62, 0.88];

/// Eyes for which directions are tried.
const FINALISTS: usize = 12;

/// Share of the lit elements that are darker than what counts as half bright: enough light to see by is enough.
const DIM: f64 = 0.2;

/// What is nearer than this share of the reference distance is in the way.
const IN_THE_WAY: f64 = 0.3;

/// Horizontal directions tried.
const AZIMUTHS: u32 = 16;

/// Vertical field of view inside, radians.
const WIDE: f64 = PI / 3.0;

/// Vertical field of view from outside, radians.
const NARROW: f64 = PI / 4.0;

impl View {
    /// A view for a picture of this `aspect` (width over height).
    pub fn automatic(solution: &Solution, hierarchy: &Hierarchy, aspect: f64) -> View {
        let judge = Judge::new(solution, hierarchy, aspect);
        judge.inside().unwrap_or_else(|| judge.in_front())
    }
}

struct Judge<'a> {
    solution: &'a Solution,
    mesh: &'a Mesh,
    hierarchy: &'a Hierarchy,
    aspect: f64,
    /// Box of the scene, mesh coordinates, metres.
    low: DVec3,
    high: DVec3,
    /// Illuminance that counts half.
    dim: f32,
}

/// How rays of sight fare.
#[derive(Default)]
struct Tally {
    /// Rays that meet lit sides.
    met: u32,
    /// Sum over these of the distance, metres.
    distance: f64,
    /// Sum over these of how bright it is there, 0 to 1.
    brightness: f64,
    /// Sum over these of brightness times how far it is, 0 to 1.
    worth: f64,
    /// Planes met.
    planes: BTreeSet<u32>,
}

impl Tally {
    /// Many things are worth more than one.
    fn variety(&self) -> f64 {
        (self.planes.len() as f64).sqrt()
    }
}

impl<'a> Judge<'a> {
    fn new(solution: &'a Solution, hierarchy: &'a Hierarchy, aspect: f64) -> Judge<'a> {
        let mesh = &solution.mesh;
        let low = mesh.clusters.iter().fold(DVec3::INFINITY, |a, c| a.min(c.low.as_dvec3()));
        let high = mesh.clusters.iter().fold(DVec3::NEG_INFINITY, |a, c| a.max(c.high.as_dvec3()));
        let elements = solution.light.elements.iter();
        let mut light: Vec<f32> = elements.map(|e| photometric(e.at_point())).filter(|&e| e > 0.0).collect();
        let rank = (light.len() as f64 * DIM) as usize;
        let dim = if light.is_empty() { 0.0 } else { *light.select_nth_unstable_by(rank, f32::total_cmp).1 };
        Judge { solution, mesh, hierarchy, aspect, low, high, dim }
    }

    /// Follows rays; `reference` is the distance, metres, that counts half.
    fn tally(&self, rays: impl Iterator<Item = (DVec3, DVec3)>, reference: f64) -> Tally {
        let mut tally = Tally::default();
        for (origin, direction) in rays {
            let Some(seen) = look(self.mesh, self.hierarchy, &sight(origin, direction)) else { continue };
            let light = photometric(self.solution.irradiance(seen.element));
            // Lamps are to see by, not to look at.
            let brightness =
                if light > 0.0 && !self.emits(&seen) { f64::from(light / (light + self.dim)) } else { 0.0 };
            let distance = f64::from(seen.distance) * direction.length();
            tally.met += 1;
            tally.distance += distance;
            tally.brightness += brightness;
            tally.worth +=
                if distance < IN_THE_WAY * reference { -1.0 } else { brightness * distance / (distance + reference) };
            tally.planes.insert(self.mesh.facets[seen.facet as usize].plane);
        }
        tally
    }

    fn emits(&self, seen: &Seen) -> bool {
        self.mesh.colour(&self.mesh.patch(seen.patch), seen.element).emits()
    }

    /// The best view from inside, if there is an inside.
    fn inside(&self) -> Option<View> {
        let size = self.high - self.low;
        let places: Vec<DVec3> = PLACES
            .iter()
            .flat_map(|&x| PLACES.iter().flat_map(move |&z| HEIGHTS.map(|y| DVec3::new(x, y, z))))
            .map(|share| self.low + share * size)
            .collect();
        let under_roof: Vec<(DVec3, Tally)> = places
            .par_iter()
            .filter_map(|&place| {
                let eye = self.at_eye_height(place)?;
                Some((eye, self.tally(about().map(|d| (eye, d)), size.length() / 8.0)))
            })
            .collect();
        let closed = |tally: &Tally| f64::from(tally.met) >= CLOSED * RAYS_ABOUT as f64;
        // Far back in a box that is open in front the opening looks small.
        if 2 * under_roof.iter().filter(|(_, tally)| closed(tally)).count() < under_roof.len() {
            return None;
        }
        let mut eyes: Vec<(f64, f64, DVec3)> = under_roof
            .iter()
            .filter(|(_, tally)| closed(tally) && tally.worth > 0.0)
            .map(|(eye, tally)| (tally.worth * tally.variety(), tally.distance / f64::from(tally.met), *eye))
            .collect();
        eyes.sort_by(|a, b| b.0.total_cmp(&a.0));
        eyes.truncate(FINALISTS);
        let room = eyes.iter().map(|e| e.1).sum::<f64>() / eyes.len() as f64;
        self.best(
            eyes.iter().flat_map(|&(_, _, eye)| {
                (0..AZIMUTHS).filter_map(move |k| {
                    let direction = horizontal(f64::from(k) / f64::from(AZIMUTHS)) + DVec3::new(0.0, -0.1, 0.0);
                    View::towards(eye, eye + direction, Projection::Perspective { vertical_field_of_view: WIDE })
                })
            }),
            room / 2.0,
        )
    }

    /// The place at eye height over the floor that is below `place`: 1.6 m where a room is as high as rooms are, a little
    /// above the middle elsewhere.
    fn at_eye_height(&self, place: DVec3) -> Option<DVec3> {
        let distance =
            |direction| look(self.mesh, self.hierarchy, &sight(place, direction)).map(|s| f64::from(s.distance));
        let (below, above) = (distance(DVec3::NEG_Y)?, distance(DVec3::Y)?);
        let height = below + above;
        let eye_height = if (2.2..4.5).contains(&height) { 1.6 } else { 0.55 * height };
        Some(place + DVec3::new(0.0, eye_height - below, 0.0))
    }

    /// The best view from outside that holds the whole box.
    fn in_front(&self) -> View {
        let views = (0..AZIMUTHS).flat_map(|k| {
            [0.15, 0.45].map(|slope| self.framed(horizontal(f64::from(k) / f64::from(AZIMUTHS)) - slope * DVec3::Y))
        });
        let overview = self.framed(DVec3::new(-0.5, -0.6, -1.0));
        self.best(views, 0.0).unwrap_or(overview)
    }

    /// The view in a direction from where the whole box just fits.
    fn framed(&self, direction: DVec3) -> View {
        let centre = (self.low + self.high) / 2.0;
        let forward = direction.normalize();
        let right = forward.cross(DVec3::Y).normalize();
        let up = right.cross(forward);
        let tangent = libm::tan(NARROW / 2.0) * 0.95;
        let corners = (0..8u32).map(|k| {
            let far = [0, 1, 2].map(|axis| k >> axis & 1 == 1);
            DVec3::select(far.into(), self.high, self.low) - centre
        });
        let distance = corners
            .map(|c| (c.dot(right).abs() / self.aspect).max(c.dot(up).abs()) / tangent - c.dot(forward))
            .fold(1e-3, f64::max);
        let projection = Projection::Perspective { vertical_field_of_view: NARROW };
        View { eye: centre - distance * forward, forward, up, right, projection }
    }

    /// The view worth most; the first among equals, none if all are worth nothing.
    fn best(&self, views: impl Iterator<Item = View>, reference: f64) -> Option<View> {
        let views: Vec<View> = views.collect();
        let worth: Vec<f64> = views.par_iter().map(|view| self.worth(view, reference)).collect();
        let mut best = None;
        let mut most = 0.0;
        for (view, worth) in views.iter().zip(worth) {
            if worth > most {
                (best, most) = (Some(*view), worth);
            }
        }
        best
    }

    /// Bright things at good distances count, and so does variety.
    fn worth(&self, view: &View, reference: f64) -> f64 {
        let [columns, rows] = RAYS_WITHIN;
        let at = |k: u32, n: u32| (f64::from(k) + 0.5) / f64::from(n) * 2.0 - 1.0;
        let rays = (0..columns * rows).map(|k| {
            let ray = view.ray(at(k % columns, columns) * self.aspect, at(k / columns, rows));
            (DVec3::from(ray.origin.map(f64::from)), DVec3::from(ray.direction.map(f64::from)))
        });
        let tally = self.tally(rays, reference);
        tally.variety() * if reference > 0.0 { tally.worth } else { tally.brightness }
    }
}

/// Directions spread evenly over the sphere: a spiral of equal areas whose steps are golden angles.
fn about() -> impl Iterator<Item = DVec3> {
    const GOLDEN_TURN: f64 = 0.618_033_988_749_894_9;
    (0..RAYS_ABOUT).map(|k| {
        let y = 1.0 - (2.0 * k as f64 + 1.0) / RAYS_ABOUT as f64;
        (1.0 - y * y).sqrt() * horizontal(k as f64 * GOLDEN_TURN) + DVec3::new(0.0, y, 0.0)
    })
}

/// The horizontal direction after so many turns about the vertical.
fn horizontal(turns: f64) -> DVec3 {
    DVec3::new(libm::cos(turns * TAU), 0.0, libm::sin(turns * TAU))
}
