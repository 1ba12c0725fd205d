//! Edges of facets, and which facets meet there.

use crate::mesh::Facet;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Inward directions of two facets whose cosine is below minus this go on in one plane.
const STRAIGHT: f64 = 0.999_99;

/// An edge at which a surface ends or turns.
#[derive(Clone, Copy, Debug)]
pub struct Edge {
    /// Its ends, metres.
    pub ends: [DVec3; 2],
    /// The facet on one of its sides.
    pub facet: u32,
    /// From its middle into two of the facets that end there, unit vectors across the edge; the same twice where there is one.
    pub inward: [DVec3; 2],
}

/// An edge of one facet.
struct Half {
    key: [[u32; 3]; 2],
    ends: [Vec3; 2],
    facet: u32,
    inward: DVec3,
}

/// The edges, at least `shortest` metres long, of those facets that are `wanted`; without those between facets that go on in one
/// plane. In an order that depends on the geometry alone.
pub fn edges(facets: &[Facet], shortest: f64, wanted: impl Fn(u32) -> bool + Sync) -> Vec<Edge> {
    let numbers = (0..facets.len() as u32).into_par_iter().filter(|&f| wanted(f));
    let mut halves: Vec<Half> = numbers.flat_map_iter(|f| halves(f, &facets[f as usize], shortest)).collect();
    halves.par_sort_unstable_by_key(|h| (h.key, h.facet));
    let joined = |halves: &[Half]| {
        // What goes on beyond the edge does not end there.
        let goes_on = |half: &Half| halves.iter().any(|other| half.inward.dot(other.inward) < -STRAIGHT);
        let mut ending = halves.iter().filter(|half| !goes_on(half));
        let first = ending.next()?;
        let inward = [first.inward, ending.next_back().unwrap_or(first).inward];
        Some(Edge { ends: first.ends.map(|end| end.as_dvec3()), facet: first.facet, inward })
    };
    halves.chunk_by(|a, b| a.key == b.key).filter_map(joined).collect()
}

fn halves(number: u32, facet: &Facet, shortest: f64) -> impl Iterator<Item = Half> + use<> {
    let corners = facet.outline();
    let middle = corners.iter().sum::<Vec3>().as_dvec3() / corners.len() as f64;
    let count = corners.len();
    (0..count).filter_map(move |i| {
        let ends = [corners[i], corners[(i + 1) % count]];
        let [a, b] = ends.map(|end| end.as_dvec3());
        let along = (b - a).normalize_or_zero();
        let inward = (middle - a).reject_from_normalized(along).normalize_or_zero();
        // The two zeros are one place.
        let mut key = ends.map(|end| (end + Vec3::ZERO).to_array().map(f32::to_bits));
        key.sort_unstable();
        ((b - a).length() >= shortest && along != DVec3::ZERO).then_some(Half { key, ends, facet: number, inward })
    })
}
