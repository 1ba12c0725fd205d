//! Convex solids among a scene's triangles: boxes, houses on a ground, prisms.

use super::hull::Side;
use super::joining::{Part, find, normal, number_vertices};
use glam::DVec3;

/// A side of a screen.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wall {
    /// The half-space behind it.
    pub side: Side,
    /// Plane id of the parts that it is made of; none if it is open.
    pub plane: Option<u32>,
}

/// A convex solid whose surface is made of parts, but for at most one side that is open.
#[derive(Clone, Debug)]
pub(super) struct Solid {
    /// Sides; the open one is the last.
    pub sides: Vec<Wall>,
    /// Numbers of its parts.
    pub parts: Vec<usize>,
}

/// Finds the solids: parts that follow each other over edges that bulge outwards, closed but for one flat opening. Corners
/// may stand over a side by `slack` metres. Solids with more than `most_sides` sides are left out.
pub(super) fn solids(parts: &[Part], slack: f64, most_sides: usize) -> Vec<Solid> {
    let (vertices, loops) = number_vertices(parts);
    let mut edges: Vec<([u32; 2], usize, bool)> = Vec::with_capacity(3 * parts.len());
    for (part, corners) in loops.iter().enumerate() {
        for i in 0..3 {
            let (from, to) = (corners[i], corners[(i + 1) % 3]);
            edges.push(([from.min(to), from.max(to)], part, from < to));
        }
    }
    edges.sort_unstable();
    let mut root: Vec<usize> = (0..parts.len()).collect();
    for run in edges.chunk_by(|a, b| a.0 == b.0) {
        if let [(_, a, forwards), (_, b, backwards)] = *run
            && forwards != backwards
            && bulges(&parts[a], &parts[b], slack)
        {
            let (a, b) = (find(&mut root, a), find(&mut root, b));
            root[a.max(b)] = a.min(b);
        }
    }
    let mut members = vec![Vec::new(); parts.len()];
    (0..parts.len()).for_each(|part| members[find(&mut root, part)].push(part));
    // Edges that a set has only once are its rim.
    let mut rims: Vec<Vec<u32>> = vec![Vec::new(); parts.len()];
    for run in edges.chunk_by(|a, b| a.0 == b.0) {
        for &(ends, part, _) in run {
            let set = find(&mut root, part);
            let count = run.iter().filter(|(_, other, _)| find(&mut root, *other) == set).count();
            if count != 2 {
                rims[set].extend(ends);
            }
        }
    }
    members
        .into_iter()
        .zip(rims)
        .filter(|(members, _)| members.len() > 2)
        .filter_map(|(members, rim)| {
            let corners: Vec<DVec3> =
                members.iter().flat_map(|&part| &loops[part]).map(|&vertex| vertices[vertex as usize]).collect();
            let rim: Vec<DVec3> = rim.into_iter().map(|vertex| vertices[vertex as usize]).collect();
            let mut sides = sides(parts, &members, most_sides)?;
            sides.extend(opening(&rim, &corners)?);
            let inside = |wall: &Wall| corners.iter().all(|c| wall.side.normal.dot(*c) <= wall.side.offset + slack);
            let is_solid = sides.len() > 3 && sides.iter().all(inside) && !any_coincide(&sides, &corners, 2.0 * slack);
            is_solid.then_some(Solid { sides, parts: members })
        })
        .collect()
}

/// Whether two parts with a common edge lie behind each other's front, or nearly so.
fn bulges(a: &Part, b: &Part, slack: f64) -> bool {
    let behind = |a: &Part, b: &Part| {
        let normal = normal(a).normalize();
        b.corners.iter().all(|&c| normal.dot(c - a.corners[0]) <= slack)
    };
    behind(a, b) && behind(b, a)
}

/// Whether two sides lie in one plane: then a side is not wholly what it says it is, but has a hole, as a wall with a window
/// whose rim makes the opening, or belongs to two planes. All corners on one of the two lie on the other as well.
fn any_coincide(sides: &[Wall], corners: &[DVec3], slack: f64) -> bool {
    let is_on = |wall: &Wall, c: DVec3| (wall.side.normal.dot(c) - wall.side.offset).abs() <= slack;
    sides.iter().enumerate().skip(1).any(|(number, wall)| {
        let on: Vec<DVec3> = corners.iter().copied().filter(|&c| is_on(wall, c)).collect();
        sides[..number].iter().any(|other| on.iter().all(|&c| is_on(other, c)))
    })
}

/// A side for each plane and front among the members, from the largest of them; none if there are too many.
fn sides(parts: &[Part], members: &[usize], most: usize) -> Option<Vec<Wall>> {
    let mut sides: Vec<(u32, f64, Side)> = Vec::new();
    for part in members.iter().map(|&part| &parts[part]) {
        let vector = normal(part);
        let area = vector.length();
        let unit = vector / area;
        let side = Side { normal: unit, offset: unit.dot(part.corners[0]) };
        match sides.iter().position(|(plane, _, known)| *plane == part.plane && known.normal.dot(unit) > 0.0) {
            Some(known) if sides[known].1 < area => sides[known] = (part.plane, area, side),
            Some(_) => {}
            None if sides.len() == most => return None,
            None => sides.push((part.plane, area, side)),
        }
    }
    Some(sides.into_iter().map(|(plane, _, side)| Wall { side, plane: Some(plane) }).collect())
}

/// The side that is open: an empty list if the rim is empty, none if the rim does not lie in one plane behind which all
/// corners are. Whether the corners are behind it is for the caller to see; here its front is chosen.
fn opening(rim: &[DVec3], corners: &[DVec3]) -> Option<Vec<Wall>> {
    let Some(&first) = rim.first() else { return Some(Vec::new()) };
    let farthest = |height: &dyn Fn(DVec3) -> f64| {
        rim.iter().copied().fold(first, |best, p| if height(p) > height(best) { p } else { best })
    };
    let second = farthest(&|p| p.distance_squared(first));
    let third = farthest(&|p| (p - first).cross(second - first).length_squared());
    let normal = (second - first).cross(third - first).try_normalize()?;
    let centre = corners.iter().sum::<DVec3>() / corners.len() as f64;
    let normal = if normal.dot(centre - first) > 0.0 { -normal } else { normal };
    let lowest = rim.iter().map(|p| normal.dot(*p)).fold(f64::INFINITY, f64::min);
    let size = second.distance(first);
    let is_flat = rim.iter().all(|p| (normal.dot(*p) - lowest).abs() <= FLAT * size);
    is_flat.then(|| vec![Wall { side: Side { normal, offset: lowest }, plane: None }])
}

/// Rims may be off their plane by this share of their size.
const FLAT: f64 = 1e-6;

#[cfg(test)]
mod tests {
    use super::*;

    /// A box without what `open` says of (axis, side); every face has the plane id 2·axis + side.
    fn cuboid(open: impl Fn(usize, usize) -> bool) -> Vec<Part> {
        let mut parts = Vec::new();
        for (axis, side) in (0..3).flat_map(|axis| [(axis, 0), (axis, 1)]).filter(|&(axis, side)| !open(axis, side)) {
            let mut corners = [(0., 0.), (1., 0.), (1., 1.), (0., 1.)].map(|(a, b)| {
                let mut p = [0.0; 3];
                (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (side as f64, a, b);
                DVec3::from(p)
            });
            if side == 0 {
                corners.reverse();
            }
            let [a, b, c, d] = corners;
            let plane = (2 * axis + side) as u32;
            parts.extend([[a, b, c], [a, c, d]].map(|corners| Part { corners, plane, unit: 0 }));
        }
        parts
    }

    #[test]
    fn boxes_are_solids_with_at_most_one_side_open() {
        let closed = solids(&cuboid(|_, _| false), 1e-9, 64);
        assert!(closed.len() == 1 && closed[0].sides.len() == 6 && closed[0].parts.len() == 12);
        let open = solids(&cuboid(|axis, side| (axis, side) == (2, 0)), 1e-9, 64);
        assert!(open.len() == 1 && open[0].sides.len() == 6 && open[0].parts.len() == 10, "{open:?}");
        assert!(
            open[0].sides.iter().any(|w| w.plane.is_none() && w.side.normal == DVec3::NEG_Z && w.side.offset == 0.0)
        );
        assert!(solids(&cuboid(|axis, _| axis == 2), 1e-9, 64).is_empty(), "a tube is no solid");
        assert!(solids(&cuboid(|_, side| side == 0), 1e-9, 64).is_empty(), "three walls are no solid");
        assert!(solids(&cuboid(|_, _| false), 1e-9, 5).is_empty());
    }

    #[test]
    fn what_is_seen_from_inside_or_has_a_hole_in_its_side_and_bottom_is_no_solid() {
        let room: Vec<Part> = cuboid(|_, _| false)
            .into_iter()
            .map(|p| Part { corners: [p.corners[0], p.corners[2], p.corners[1]], ..p })
            .collect();
        assert!(solids(&room, 1e-9, 64).is_empty());
        let mut holes = cuboid(|axis, side| (axis, side) == (2, 0));
        holes.remove(0);
        assert!(solids(&holes, 1e-9, 64).is_empty());
    }

    #[test]
    fn a_closed_box_with_a_window_is_no_solid() {
        let mut parts = cuboid(|axis, side| (axis, side) == (0, 1));
        let at = |y: f64, z: f64| DVec3::new(1.0, y, z);
        let outer = [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)];
        let rim = [at(0.4, 0.4), at(0.6, 0.4), at(0.6, 0.6), at(0.4, 0.6)];
        for k in 0..4 {
            let next = (k + 1) % 4;
            parts.extend([[outer[k], outer[next], rim[next]], [outer[k], rim[next], rim[k]]].map(|corners| Part {
                corners,
                plane: 1,
                unit: 0,
            }));
        }
        assert!(solids(&parts, 1e-9, 64).is_empty());
        parts.extend([[rim[0], rim[1], rim[2]], [rim[0], rim[2], rim[3]]].map(|corners| Part {
            corners,
            plane: 1,
            unit: 0,
        }));
        assert_eq!(solids(&parts, 1e-9, 64).len(), 1, "with the window shut");
    }
}
