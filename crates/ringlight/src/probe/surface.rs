//! The stored light of the nearest surface.

use super::dealt_out::dealt_out;
use super::nearest::closest_on_facet;
use super::place::{Place, Spot, Surroundings};
use super::{Point, Reading, Status};
use crate::mesh::Inquiry;
use crate::smooth::SurfaceLight;
use crate::solution::Solution;
use crate::solve::Ring;
use crate::transport::{Communicator, Failure};
use glam::DVec3;

/// How stored light is looked up.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfaceOptions {
    /// How far from a point its surface may be, metres; the size of elements if none.
    pub reach: Option<f64>,
}

/// Points that are read one after the other.
const CHUNK: usize = 4;

/// A surface faces the same way as a point if their normals are less than 60° apart.
const FACING: f64 = 0.5;

/// A surface near a point.
struct Candidate {
    distance: f64,
    cosine: f64,
    number: u32,
    place: Place,
    spot: Spot,
}

/// The irradiance of the surface nearest to each point, of those whose lit side faces the same way (less than 60° between
/// the normals), interpolated as it is displayed, but not from behind what stands on the surface. Of surfaces equally near,
/// within 2·10⁻⁵ of the scene's diagonal, one that is not covered by another counts, then the one that is aligned best.
///
/// Every rank calls it with the same points; the readings are on rank 0.
pub fn surface<'a, 'p>(
    solution: &'a Solution,
    points: &'p [Point],
    options: &SurfaceOptions,
    ring: &mut Ring<'a>,
    ranks: &mut Communicator<'_>,
) -> Result<Option<Vec<Reading>>, Failure> {
    let around = Surroundings::new(solution);
    let light = SurfaceLight::new(solution);
    let reach = options.reach.unwrap_or(solution.mesh.sizes.element).max(around.touch);
    let read = async |point: &Point, inquiry: &Inquiry<'a>| {
        let position = DVec3::from(point.position) - DVec3::from(solution.mesh.origin);
        let Some(found) = nearest(&around, position, DVec3::from(point.normal).normalize(), reach) else {
            return Reading::without_light(Status::Far);
        };
        if around.is_inside(inquiry, &found.place).await {
            return Reading::without_light(Status::Inside);
        }
        match light.at(inquiry, found.spot.element, found.spot.within).await {
            None => Reading::without_light(Status::Inside),
            Some(irradiance) => Reading { irradiance, status: Status::Ok },
        }
    };
    let read = &read;
    let task = |points: &'p [Point], inquiry: Inquiry<'a>| async move {
        let mut readings = Vec::with_capacity(points.len());
        for point in points {
            readings.push(read(point, &inquiry).await);
        }
        readings
    };
    dealt_out(points, CHUNK, task, ring, ranks)
}

fn nearest(around: &Surroundings<'_>, point: DVec3, normal: DVec3, reach: f64) -> Option<Candidate> {
    let mut candidates: Vec<Candidate> = Vec::new();
    let mut least = reach;
    around.places.visit(point, reach, &mut |number| {
        let facet = &around.solution.mesh.facets[number as usize];
        let (front, closest) = closest_on_facet(facet, point);
        let distance = (closest - point).length();
        let back = front.dot(normal) < 0.0;
        let cosine = front.dot(normal).abs();
        if distance > least + around.touch || distance > reach || cosine <= FACING || back && !facet.double_sided() {
            return;
        }
        least = least.min(distance);
        let place = Place { point: closest, normal: if back { -front } else { front }, plane: facet.plane };
        let spot = around.spot(facet, back, closest);
        candidates.push(Candidate { distance, cosine, number, place, spot });
    });
    candidates.retain(|c| c.distance <= least + around.touch);
    candidates.into_iter().min_by(|a, b| {
        a.spot
            .covered
            .cmp(&b.spot.covered)
            .then(b.cosine.total_cmp(&a.cosine))
            .then(a.distance.total_cmp(&b.distance))
            .then(a.number.cmp(&b.number))
    })
}
