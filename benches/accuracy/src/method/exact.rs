//! The exact form factor from a point to a polygon behind polygons: what they hide is cut away.

use super::clip::{Corners, edge_planes, split};
use glam::DVec3;
use ringlight::form_factor::polygon;

/// Form factor from `point` with unit `normal` to the part of `shooter` that none of the `blockers` hides; all polygons are
/// flat and convex. Closed form: the visible part falls into convex pieces, each a contour integral.
pub fn form_factor(point: DVec3, normal: DVec3, shooter: &[DVec3], blockers: &[Corners]) -> f64 {
    let relative: Corners = shooter.iter().map(|corner| corner - point).collect();
    let [above, _] = split(&relative, normal, 0.0);
    let mut pieces = vec![above];
    for blocker in blockers {
        let blocker: Corners = blocker.iter().map(|corner| corner - point).collect();
        pieces = pieces.into_iter().flat_map(|piece| outside_shadow(piece, &blocker)).collect();
    }
    pieces.iter().map(|piece| polygon(piece, normal)).sum()
}

/// The pieces of a polygon that a blocker does not hide from the origin.
fn outside_shadow(polygon: Corners, blocker: &[DVec3]) -> Vec<Corners> {
    let mut normal = (blocker[1] - blocker[0]).cross(blocker[2] - blocker[0]);
    if normal.dot(blocker[0]) < 0.0 {
        normal = -normal;
    }
    let offset = normal.dot(blocker[0]);
    // Seen edge-on it hides nothing.
    if offset <= 1e-12 * normal.length() {
        return vec![polygon];
    }
    // In front of the blocker, or beside one of its edges: seen. The rest is hidden.
    let mut seen = Vec::new();
    let mut rest = polygon;
    for (plane, offset) in std::iter::once((normal, offset)).chain(edge_planes(blocker).map(|plane| (plane, 0.0))) {
        let [inside, outside] = split(&rest, plane, offset);
        seen.push(outside);
        rest = inside;
    }
    seen.retain(|piece| !piece.is_empty());
    seen
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(size: f64, height: f64) -> Corners {
        [(-1., -1.), (1., -1.), (1., 1.), (-1., 1.)].map(|(x, y)| DVec3::new(size * x, size * y, height)).to_vec()
    }

    #[test]
    fn a_blocker_half_way_hides_what_is_twice_its_size() {
        let factor = |size| form_factor(DVec3::ZERO, DVec3::Z, &square(size, 2.0), &[]);
        let behind = form_factor(DVec3::ZERO, DVec3::Z, &square(3.0, 2.0), &[square(0.7, 1.0)]);
        assert!((behind - (factor(3.0) - factor(1.4))).abs() < 1e-14);
        // Farther away it hides nothing; two of them hide no more than one.
        let beyond = form_factor(DVec3::ZERO, DVec3::Z, &square(3.0, 2.0), &[square(0.7, 2.1)]);
        assert!((beyond - factor(3.0)).abs() < 1e-14);
        let twice = form_factor(DVec3::ZERO, DVec3::Z, &square(3.0, 2.0), &[square(0.7, 1.0), square(0.35, 0.5)]);
        assert!((behind - twice).abs() < 1e-14);
    }
}
