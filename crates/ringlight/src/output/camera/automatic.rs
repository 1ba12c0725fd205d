//! A view that shows much of a scene: inside of a room, in front of anything else.
//!
//! Candidates are judged by rays of sight. Everything is a function of the solution alone.

use super::{Projection, View, sight};
use crate::mesh::{Inquiry, Mesh};
use crate::output::seen::{self, Seen};
use crate::quantity::photometric;
use crate::solution::Solution;
use crate::solve::Ring;
use crate::transport::{Communicator, Failure};
use glam::DVec3;
use ringlight_visibility::Ray;
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

/// Tag of the view that rank 0 tells the others.
const VIEW: u32 = 62;

impl View {
    /// A view for a picture of this `aspect` (width over height), the same on all ranks. Every rank calls it: the first
    /// one looks, the others help it.
    pub fn automatic<'a>(
        solution: &'a Solution,
        aspect: f64,
        ring: &mut Ring<'a>,
        ranks: &mut Communicator<'_>,
    ) -> Result<View, Failure> {
        let judge = (ranks.rank() == 0).then(|| Judge::new(solution, aspect));
        let look = |judge: Judge<'a>, inquiry: Inquiry<'a>| async move {
            match judge.inside(&inquiry).await {
                Some(view) => view,
                None => judge.in_front(&inquiry).await,
            }
        };
        let mut words = Vec::new();
        ring.ask(ranks, judge.into_iter(), look, |view| words = bytemuck::cast_slice(&view.to_words()).to_vec())?;
        let words = ranks.broadcast(0, VIEW, words)?;
        Ok(View::from_words(&bytemuck::pod_collect_to_vec(&words)))
    }

    fn to_words(self) -> [f64; 14] {
        let [eye, forward, up, right] = [self.eye, self.forward, self.up, self.right].map(|v| v.to_array());
        let projection = match self.projection {
            Projection::Perspective { vertical_field_of_view } => [1.0, vertical_field_of_view],
            Projection::Orthographic { half_height } => [0.0, half_height],
        };
        let mut words = [0.0; 14];
        [eye, forward, up, right]
            .concat()
            .into_iter()
            .chain(projection)
            .zip(&mut words)
            .for_each(|(x, word)| *word = x);
        words
    }

    fn from_words(words: &[f64]) -> View {
        let vector = |k: usize| DVec3::from_slice(&words[3 * k..]);
        let projection = match words[12] {
            0.0 => Projection::Orthographic { half_height: words[13] },
            _ => Projection::Perspective { vertical_field_of_view: words[13] },
        };
        View { eye: vector(0), forward: vector(1), up: vector(2), right: vector(3), projection }
    }
}

struct Judge<'a> {
    solution: &'a Solution,
    mesh: &'a Mesh,
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
    fn new(solution: &'a Solution, aspect: f64) -> Judge<'a> {
        let mesh = &solution.mesh;
        let low = mesh.clusters.iter().fold(DVec3::INFINITY, |a, c| a.min(c.low.as_dvec3()));
        let high = mesh.clusters.iter().fold(DVec3::NEG_INFINITY, |a, c| a.max(c.high.as_dvec3()));
        let elements = solution.light.elements.iter();
        let mut light: Vec<f32> = elements.map(|e| photometric(e.at_point())).filter(|&e| e > 0.0).collect();
        let rank = (light.len() as f64 * DIM) as usize;
        let dim = if light.is_empty() { 0.0 } else { *light.select_nth_unstable_by(rank, f32::total_cmp).1 };
        Judge { solution, mesh, aspect, low, high, dim }
    }

    /// What rays of sight meet.
    async fn look(&self, inquiry: &Inquiry<'_>, rays: &[(DVec3, DVec3)]) -> Vec<Option<Seen>> {
        let rays: Vec<Ray> = rays.iter().map(|&(origin, direction)| sight(origin, direction)).collect();
        let hits = inquiry.nearest_hits(&rays.iter().map(|&ray| seen::sight(ray)).collect::<Vec<_>>()).await;
        rays.iter().zip(hits).map(|(ray, hit)| hit.map(|hit| seen::seen(self.mesh, ray, hit))).collect()
    }

    /// How rays fare that have met `seen`; `reference` is the distance, metres, that counts half.
    fn tally(&self, rays: &[(DVec3, DVec3)], seen: &[Option<Seen>], reference: f64) -> Tally {
        let mut tally = Tally::default();
        for ((_, direction), seen) in rays.iter().zip(seen) {
            let Some(seen) = seen else { continue };
            let light = photometric(self.solution.irradiance(seen.element));
            // Lamps are to see by, not to look at.
            let brightness = if light > 0.0 && !self.emits(seen) { f64::from(light / (light + self.dim)) } else { 0.0 };
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
    async fn inside(&self, inquiry: &Inquiry<'_>) -> Option<View> {
        let size = self.high - self.low;
        let places: Vec<DVec3> = PLACES
            .iter()
            .flat_map(|&x| PLACES.iter().flat_map(move |&z| HEIGHTS.map(|y| DVec3::new(x, y, z))))
            .map(|share| self.low + share * size)
            .collect();
        let eyes = self.at_eye_height(inquiry, &places).await;
        let rays: Vec<(DVec3, DVec3)> = eyes.iter().flat_map(|&eye| about().map(move |d| (eye, d))).collect();
        let seen = self.look(inquiry, &rays).await;
        let tallies = rays.chunks(RAYS_ABOUT).zip(seen.chunks(RAYS_ABOUT));
        let tallies = tallies.map(|(rays, seen)| self.tally(rays, seen, size.length() / 8.0));
        let under_roof: Vec<(DVec3, Tally)> = eyes.iter().copied().zip(tallies).collect();
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
        let views = eyes.iter().flat_map(|&(_, _, eye)| {
            (0..AZIMUTHS).filter_map(move |k| {
                let direction = horizontal(f64::from(k) / f64::from(AZIMUTHS)) + DVec3::new(0.0, -0.1, 0.0);
                View::towards(eye, eye + direction, Projection::Perspective { vertical_field_of_view: WIDE })
            })
        });
        self.best(inquiry, views.collect(), room / 2.0).await
    }

    /// The places at eye height over the floors that are below `places`, where there is something above, too: 1.6 m where a
    /// room is as high as rooms are, a little above the middle elsewhere.
    async fn at_eye_height(&self, inquiry: &Inquiry<'_>, places: &[DVec3]) -> Vec<DVec3> {
        let rays: Vec<_> = places.iter().flat_map(|&place| [(place, DVec3::NEG_Y), (place, DVec3::Y)]).collect();
        let seen = self.look(inquiry, &rays).await;
        let eye = |(place, seen): (&DVec3, &[Option<Seen>])| {
            let [Some(below), Some(above)] = seen else { return None };
            let [below, above] = [below, above].map(|seen| f64::from(seen.distance));
            let height = below + above;
            let eye_height = if (2.2..4.5).contains(&height) { 1.6 } else { 0.55 * height };
            Some(*place + DVec3::new(0.0, eye_height - below, 0.0))
        };
        places.iter().zip(seen.chunks(2)).filter_map(eye).collect()
    }

    /// The best view from outside that holds the whole box.
    async fn in_front(&self, inquiry: &Inquiry<'_>) -> View {
        let views = (0..AZIMUTHS).flat_map(|k| {
            [0.15, 0.45].map(|slope| self.framed(horizontal(f64::from(k) / f64::from(AZIMUTHS)) - slope * DVec3::Y))
        });
        let overview = self.framed(DVec3::new(-0.5, -0.6, -1.0));
        self.best(inquiry, views.collect(), 0.0).await.unwrap_or(overview)
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
    async fn best(&self, inquiry: &Inquiry<'_>, views: Vec<View>, reference: f64) -> Option<View> {
        let rays: Vec<(DVec3, DVec3)> = views.iter().flat_map(|view| self.rays_within(view)).collect();
        let seen = self.look(inquiry, &rays).await;
        let mut best = None;
        let mut most = 0.0;
        let count = (RAYS_WITHIN[0] * RAYS_WITHIN[1]) as usize;
        for (view, (rays, seen)) in views.iter().zip(rays.chunks(count).zip(seen.chunks(count))) {
            // Bright things at good distances count, and so does variety.
            let tally = self.tally(rays, seen, reference);
            let worth = tally.variety() * if reference > 0.0 { tally.worth } else { tally.brightness };
            if worth > most {
                (best, most) = (Some(*view), worth);
            }
        }
        best
    }

    /// The rays by which a view is judged.
    fn rays_within(&self, view: &View) -> impl Iterator<Item = (DVec3, DVec3)> {
        let [columns, rows] = RAYS_WITHIN;
        let at = |k: u32, n: u32| (f64::from(k) + 0.5) / f64::from(n) * 2.0 - 1.0;
        (0..columns * rows).map(move |k| {
            let ray = view.ray(at(k % columns, columns) * self.aspect, at(k / columns, rows));
            (DVec3::from(ray.origin.map(f64::from)), DVec3::from(ray.direction.map(f64::from)))
        })
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
