//! The convex hull of two flat polygons that face each other: only what reaches into it can stand between them.

use super::clip::keep_above;
use super::unobstructed::Face;
use glam::DVec3;

/// Keeps the points p with normal · p ≤ offset; unit normal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Side {
    pub normal: DVec3,
    pub offset: f64,
}

impl Side {
    /// Depth inside; what is within `flat` counts as 0.
    pub fn depth(&self, p: DVec3, flat: f64) -> f64 {
        let depth = self.offset - self.normal.dot(p);
        if depth.abs() <= flat { 0.0 } else { depth }
    }
}

/// Fills `sides` with the hull's: the two planes, and those that touch an edge of one polygon and a corner of the other.
pub(crate) fn hull(a: Face, b: Face, flat: f64, sides: &mut Vec<Side>) {
    sides.clear();
    sides.extend([a, b].map(|f| Side { normal: -f.normal, offset: -f.normal.dot(f.corners[0]) }));
    for (of, other) in [(a, b), (b, a)] {
        for (k, &corner) in of.corners.iter().enumerate() {
            let edge = of.corners[if k + 1 == of.corners.len() { 0 } else { k + 1 }] - corner;
            // Turned outward from corner to corner, until all of the other polygon lies inside.
            let mut outward = DVec3::ZERO;
            for &q in other.corners {
                let r = q - corner;
                let turned = edge.cross(r);
                let on_the_edge = turned.length() <= flat * edge.length();
                if !on_the_edge && (outward == DVec3::ZERO || outward.dot(r) > 0.0) {
                    outward = turned;
                }
            }
            if let Some(normal) = outward.try_normalize() {
                sides.push(Side { normal, offset: normal.dot(corner) });
            }
        }
    }
}

/// Whether more than the rim of a convex polygon lies inside of all sides.
pub(crate) fn reaches_into(polygon: &[DVec3], sides: &[Side], flat: f64, spare: &mut [Vec<DVec3>; 2]) -> bool {
    if sides.iter().any(|side| polygon.iter().all(|&p| side.depth(p, flat) <= 0.0)) {
        return false;
    }
    if polygon.iter().any(|&p| sides.iter().all(|side| side.depth(p, flat) > 0.0)) {
        return true;
    }
    let [left, cut] = spare;
    left.clear();
    left.extend_from_slice(polygon);
    for side in sides {
        keep_above(left, |p| side.depth(p, flat), cut);
        std::mem::swap(left, cut);
        if left.is_empty() {
            return false;
        }
    }
    true
}
