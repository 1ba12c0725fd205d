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
            // Turned outward from corner to corner, until all of the other polygon lies inside. Twice, because from a corner in
            // the polygon's own plane, behind the edge, it is half a turn to one before the edge, which then seems inside.
            let mut outward = DVec3::ZERO;
            for &q in other.corners.iter().chain(other.corners) {
                let r = q - corner;
                if outward == DVec3::ZERO || outward.dot(r) > flat {
                    let turned = edge.cross(r);
                    let on_the_edge = turned.length() <= flat * edge.length();
                    outward = if on_the_edge { outward } else { turned.normalize() };
                }
            }
            // Left out if rounding has led astray: a hull that is too large only culls less.
            let side = Side { normal: outward, offset: outward.dot(corner) };
            let holds = |p: &DVec3| side.depth(*p, flat) >= 0.0;
            if outward != DVec3::ZERO && a.corners.iter().chain(b.corners).all(holds) {
                sides.push(side);
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

#[cfg(test)]
mod tests {
    use super::*;

    fn face(corners: &[DVec3]) -> Face<'_> {
        Face { corners, normal: super::super::clip::area_vector(corners).normalize() }
    }

    #[test]
    fn holds_both_polygons_and_touches_them() {
        let points = |corners: &[[f64; 3]]| corners.iter().copied().map(DVec3::from).collect::<Vec<_>>();
        let wall = points(&[[0., 0., 0.], [0., 1., 0.], [0., 1., 1.], [0., 0., 1.]]);
        let ceiling = points(&[[0.2, 0.1, 1.], [0.3, 1.7, 1.], [1.5, 1.2, 1.], [0.9, 0.1, 1.]]);
        let floors = [
            // With a common edge, apart from it, meeting it in a corner.
            points(&[[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]]),
            points(&[[1., 0., 0.], [1., 0.5, 0.], [0.5, 0.5, 0.]]),
            points(&[[0., 0.5, 0.], [0., 0., 0.], [0.5, 0.5, 0.]]),
            points(&[[0.5, 0.5, 0.], [0.25, 0.75, 0.], [0., 0.5, 0.]]),
        ];
        for floor in &floors {
            for other in [&wall, &ceiling] {
                let mut sides = Vec::new();
                hull(face(floor), face(other), 1e-13, &mut sides);
                assert!(sides.len() >= 2 + floor.len());
                for side in &sides {
                    let depths = || floor.iter().chain(other).map(|&p| side.depth(p, 1e-13));
                    assert!(depths().all(|d| d >= 0.0), "{side:?} cuts {floor:?} or {other:?}");
                    assert!(depths().filter(|&d| d == 0.0).count() >= 3, "{side:?} is off {floor:?} and {other:?}");
                }
            }
        }
    }

    #[test]
    fn holds_what_it_touches_in_any_order() {
        // The wall's foot runs through the floor's plane on both sides of a piece's edge, its corners rounded off the plane.
        let floor = [[0.4, 0.3, 0.], [0.7, 0.35, 0.], [0.5, 0.8, 0.]].map(DVec3::from);
        for (first, second) in [(1e-17, -1e-17), (-1e-17, 1e-17), (-1e-17, -1e-17), (0.0, 0.0)] {
            let mut wall = [[0.1, -1., first], [0.1, 2., second], [0.1, 2., 1.], [0.1, -1., 1.]];
            for _ in 0..4 {
                wall.rotate_left(1);
                let wall: Vec<DVec3> = wall.iter().copied().map(DVec3::from).collect();
                let mut sides = Vec::new();
                hull(face(&floor), face(&wall), 1e-13, &mut sides);
                // All edges have a side: none had to be left out.
                assert_eq!(sides.len(), 2 + 3 + 4, "{wall:?}");
            }
        }
    }

    #[test]
    fn what_reaches_into_it_is_told_from_what_touches_it() {
        let square = |z: f64| [[0., 0., z], [1., 0., z], [1., 1., z], [0., 1., z]].map(DVec3::from);
        let (low, mut high) = (square(0.0), square(1.0));
        high.reverse();
        let mut sides = Vec::new();
        hull(face(&low), face(&high), 1e-13, &mut sides);
        let reaches =
            |triangle: [[f64; 3]; 3]| reaches_into(&triangle.map(DVec3::from), &sides, 1e-13, &mut Default::default());
        // Around everything; through it with all corners outside; beside it; in its rim; with a corner in its rim.
        assert!(reaches([[-9., -9., 0.5], [9., -9., 0.5], [0., 20., 0.5]]));
        assert!(reaches([[-1., 0.5, 0.2], [2., 0.5, 0.3], [0.5, 0.5, 5.]]));
        assert!(!reaches([[2.1, 0., 0.5], [3., 0., 0.5], [2.1, 1., 0.5]]));
        assert!(!reaches([[-1., -0.2, 0.5], [0.2, -1.4, 0.5], [-1., -1., 0.5]]));
        assert!(!reaches([[0., 0., 0.], [0., 1., 0.], [0., 0., 1.]]));
        assert!(!reaches([[1., 0.5, 0.5], [2., 0.5, 0.5], [2., 0.6, 0.5]]));
    }
}
