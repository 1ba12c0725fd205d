//! Rows of form factors: what elements see of all that reflects, by rays over their hemispheres.
//!
//! Light that has bounced comes from everywhere and changes slowly from place to place: a few hundred rays of equal weight find it
//! to a percent, whatever the scene is made of. A row is found once for all bounces.

use super::passes::Arrived;
use crate::mesh::{Inquiry, Mesh, Patch};
use crate::shooting::{Faces, Glance, Radiosity, Receivers, spiral, strength};
use glam::DVec3;
use ringlight_visibility::Tally;

/// Rays that find an irradiance to 1 % (root of the mean square), where what is seen differs as in a room: by [`CONTRAST`].
/// Measured in rooms, an office and a box: 0.5 to 1.1 %.
const RAYS: f32 = 320.0;

/// Fewer do not cover a hemisphere.
const LEAST: f32 = 32.0;

/// Root of the mean square of what is seen less its mean, as a share of all light of the receiver.
const CONTRAST: f32 = 0.6;

/// Rays that tell how much differs what is seen.
pub const ROUGH: u32 = 32;

/// More rays are cast where the contrast is more than so many times the usual, up to so many times as many.
const MORE: f32 = 4.0;
const MOST: f32 = 4.0;

/// Normals that differ by no more than the root of this are one: what rounding makes of them.
const PARALLEL: f64 = 1e-16;

/// Where rows are found.
#[derive(Clone, Copy)]
pub struct Around<'a> {
    /// The scene.
    pub mesh: &'a Mesh,
    /// Which elements have rows of their own.
    pub faces: &'a Faces,
    /// What elements reflect: it tells where more rays are needed. W/m² or lm/m²; empty if it is not known yet.
    pub reflected: &'a [Radiosity],
    /// Relative error of the light that may come of it.
    pub error: f32,
}

/// The rows of some receivers.
#[derive(Debug, Default)]
pub struct Rows {
    /// Elements, and how many entries of `seen` each has.
    rows: Vec<(u32, u32)>,
    /// Elements that are seen, and their shares.
    seen: Vec<(u32, f32)>,
}

/// Elements that face alike, and where they look from: they look in the same directions, so that their rays go together.
struct Outlook {
    normal: DVec3,
    elements: Vec<u32>,
    /// Their sample points and planes.
    points: Vec<(DVec3, u32)>,
}

impl Around<'_> {
    /// The rows of some receivers, whose elements are numbered from `first`; their light is `own` at least.
    pub async fn rows(&self, receivers: &Receivers, first: u32, own: f32, inquiry: &Inquiry<'_>) -> (Rows, Tally) {
        let outlooks = self.outlooks(receivers, first);
        let usual = usual_rays(self.error);
        let mut tally = Tally::default();
        let mut share = 1.0;
        if !self.reflected.is_empty() {
            let contrast = self.contrast(&outlooks, inquiry, &mut tally).await;
            share = power(contrast / (MORE * CONTRAST * own)).clamp(1.0, MOST);
        }
        let count = (share * usual).ceil() as u32;
        let mut rows = Rows::default();
        let directions = spiral(count);
        for outlook in &outlooks {
            let glances = self.look(outlook, &directions, inquiry, &mut tally).await;
            for (place, &element) in outlook.elements.iter().enumerate() {
                rows.push(element, outlook.of_one(place, &glances), self.faces);
            }
        }
        rows.seen.shrink_to_fit();
        (rows, tally)
    }

    /// Whether some receivers, whose elements are numbered from `first`, see the open or an element that `has_light`, by a few rays of
    /// each.
    pub async fn sees(
        &self,
        receivers: &Receivers,
        first: u32,
        has_light: impl Fn(u32) -> bool,
        inquiry: &Inquiry<'_>,
        tally: &mut Tally,
    ) -> bool {
        for outlook in self.outlooks(receivers, first) {
            let glances = self.look(&outlook, &spiral(ROUGH), inquiry, tally).await;
            if glances.iter().any(|glance| glance.escapes || glance.seen.iter().any(|&(e, _)| has_light(e))) {
                return true;
            }
        }
        false
    }

    /// Where some receivers look from.
    fn outlooks(&self, receivers: &Receivers, first: u32) -> Vec<Outlook> {
        let mut outlooks: Vec<Outlook> = Vec::new();
        for (patch, numbers, name) in receivers.patches() {
            let Patch { normal, plane, .. } = *patch;
            for (&number, &element) in numbers.iter().zip(&receivers.elements[*name as usize..]) {
                let element = first + element;
                let Some(point) = patch.sample_point(number, self.mesh.valid[element as usize]) else { continue };
                let alike = |outlook: &Outlook| outlook.normal.distance_squared(normal) < PARALLEL;
                let at = outlooks.iter().position(alike).unwrap_or(outlooks.len());
                if at == outlooks.len() {
                    outlooks.push(Outlook { normal, elements: Vec::new(), points: Vec::new() });
                }
                let outlook = &mut outlooks[at];
                outlook.elements.push(element);
                outlook.points.push((point, plane));
            }
        }
        outlooks
    }

    /// How much differs what the receivers see, by a few rays of each.
    async fn contrast(&self, outlooks: &[Outlook], inquiry: &Inquiry<'_>, tally: &mut Tally) -> f32 {
        let (mut variance, mut elements) = (0.0, 0);
        let directions = spiral(ROUGH);
        for outlook in outlooks {
            let glances = self.look(outlook, &directions, inquiry, tally).await;
            let of = |glance: &Glance<'_>| {
                glance.seen.iter().map(|&(e, share)| share * strength(self.reflected[e as usize])).sum::<f32>()
            };
            for place in 0..outlook.elements.len() {
                let (mut sum, mut squares) = (0.0, 0.0);
                for light in outlook.of_one(place, &glances).map(of) {
                    sum += light;
                    squares += light * light;
                }
                let mean = sum / ROUGH as f32;
                variance += (squares / ROUGH as f32 - mean * mean).max(0.0);
            }
            elements += outlook.elements.len();
        }
        (variance / elements.max(1) as f32).sqrt()
    }

    /// What is seen from all points of an outlook in each direction.
    async fn look<'a>(
        &'a self,
        outlook: &Outlook,
        directions: &[DVec3],
        inquiry: &Inquiry<'_>,
        tally: &mut Tally,
    ) -> Vec<Glance<'a>> {
        tally.rays += (outlook.points.len() * directions.len()) as u64;
        inquiry.follow(Glance::about(self.mesh, &outlook.points, outlook.normal, directions)).await
    }
}

impl Outlook {
    /// Of what is seen from all points, that from one.
    fn of_one<'g, 'a>(&self, place: usize, glances: &'g [Glance<'a>]) -> impl ExactSizeIterator<Item = &'g Glance<'a>> {
        glances[place..].iter().step_by(self.points.len())
    }
}

/// Rays of a row where what is seen differs as it usually does.
pub fn usual_rays(error: f32) -> f32 {
    (RAYS * power(0.01 / error)).max(LEAST)
}

/// The power of the number of rays by which errors fall: N^(-4/5), measured N^(-0.75) to N^(-0.9) (by roots alone, which are the
/// same bits everywhere).
fn power(x: f32) -> f32 {
    x * x.sqrt().sqrt()
}

impl Rows {
    /// Adds what an element sees.
    fn push<'g>(&mut self, element: u32, glances: impl ExactSizeIterator<Item = &'g Glance<'g>>, faces: &Faces) {
        let count = glances.len() as f32;
        let seen = glances.flat_map(|glance| &glance.seen);
        let mut seen: Vec<(u32, f32)> = seen.map(|&(e, share)| (faces.representative(e), share)).collect();
        seen.sort_unstable_by_key(|(element, _)| *element);
        let start = self.seen.len();
        for of_one in seen.chunk_by(|a, b| a.0 == b.0) {
            let share = of_one.iter().map(|(_, share)| share).sum::<f32>();
            self.seen.push((of_one[0].0, share / count));
        }
        self.rows.push((element, (self.seen.len() - start) as u32));
    }

    /// What each receiver gets of what elements reflect.
    pub fn gather(&self, reflected: &[Radiosity]) -> impl Iterator<Item = Arrived> {
        let mut rest = self.seen.as_slice();
        self.rows.iter().map(move |&(element, count)| {
            let mut arrived = Arrived::none(element);
            for &(seen, share) in rest.split_off(..count as usize).unwrap_or_default() {
                arrived.add(reflected[seen as usize], share, 0.0);
            }
            arrived
        })
    }
}
