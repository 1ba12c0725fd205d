//! A pair of polygons, made ready: in a fixed order, near the origin, each cut to what lies in front of the other.

use super::Polygon;
use super::clip::{area_vector, keep_above};
use super::unobstructed::Face;
use glam::DVec3;
use std::cmp::Ordering;

/// Heights below this share of the pair's size, and below some roundings of the coordinates, count as 0.
const FLAT: f64 = 1e-13;

/// A pair whose sides see each other, lengths in `unit`, relative to `origin`.
#[derive(Debug, Default)]
pub(crate) struct Pair {
    corners: [Vec<DVec3>; 2],
    normals: [DVec3; 2],
    /// Plane ids.
    pub planes: [u32; 2],
    /// Metres.
    pub origin: DVec3,
    /// Metres; a power of two, so that scaling rounds nothing.
    pub unit: f64,
    /// What counts as 0 in heights, in the unit.
    pub flat: f64,
    spare: Vec<DVec3>,
}

impl Pair {
    /// Fills this with the pair; false if no part of one faces a part of the other. Gives the same bits for (a, b) and (b, a).
    pub fn prepare(&mut self, a: &Polygon, b: &Polygon) -> bool {
        let (first, second) = if order(a, b).is_gt() { (b, a) } else { (a, b) };
        self.origin = first.corners[0];
        self.normals = [first.normal, second.normal];
        self.planes = [first.plane, second.plane];
        let all = || first.corners.iter().chain(&second.corners);
        let size = all().map(|&c| (c - self.origin).abs().max_element()).fold(0.0, f64::max);
        let reach = all().map(|c| c.abs().max_element()).fold(0.0, f64::max);
        self.unit = power_of_two(size);
        self.flat = FLAT + 4.0 * f64::EPSILON * reach / self.unit;
        for (local, polygon) in self.corners.iter_mut().zip([first, second]) {
            local.clear();
            local.extend(polygon.corners.iter().map(|&c| (c - self.origin) / self.unit));
        }
        let base = self.corners[0][0];
        self.cut(1, base, 0) && self.cut(0, self.corners[1][0], 1)
    }

    /// Leaves of polygon `which` what lies in front of the plane of polygon `other`; false if nothing does.
    fn cut(&mut self, which: usize, base: DVec3, other: usize) -> bool {
        let (normal, flat) = (self.normals[other], self.flat);
        let height = |p: DVec3| {
            let h = (p - base).dot(normal);
            if h.abs() <= flat { 0.0 } else { h }
        };
        if self.corners[which].iter().any(|&p| height(p) < 0.0) {
            keep_above(&self.corners[which], height, &mut self.spare);
            std::mem::swap(&mut self.corners[which], &mut self.spare);
            let corners = &self.corners[which];
            return !corners.is_empty() && area_vector(corners).length_squared() > 0.0;
        }
        self.corners[which].iter().any(|&p| height(p) > 0.0)
    }

    /// The two sides.
    pub fn face(&self, which: usize) -> Face<'_> {
        Face { corners: &self.corners[which], normal: self.normals[which] }
    }
}

/// The largest power of two that is not larger; 1 for 0.
fn power_of_two(x: f64) -> f64 {
    if x.is_normal() { f64::from_bits(x.to_bits() & 0x7ff0_0000_0000_0000) } else { 1.0 }
}

/// The smaller polygon first; equal ones by their corners.
fn order(a: &Polygon, b: &Polygon) -> Ordering {
    let coordinates = |p: &Polygon| p.corners.iter().flat_map(|c| c.to_array()).collect::<Vec<_>>();
    a.area.total_cmp(&b.area).then_with(|| {
        let (a, b) = (coordinates(a), coordinates(b));
        a.iter().zip(&b).map(|(x, y)| x.total_cmp(y)).find(|o| o.is_ne()).unwrap_or(a.len().cmp(&b.len()))
    })
}
