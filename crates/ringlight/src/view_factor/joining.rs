//! Coplanar triangles that touch become convex polygons, so that a quadrilateral of the file is one polygon again.

use glam::DVec3;

/// A triangle, and what decides which others it may join.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part {
    /// Corners, counter-clockwise seen from the front.
    pub corners: [DVec3; 3],
    /// Plane id: only triangles of one plane join.
    pub plane: u32,
    /// Only triangles of one unit join.
    pub unit: u64,
}

/// A convex polygon made of parts of one plane and one unit.
#[derive(Clone, Debug)]
pub(super) struct Joined {
    /// Corners, counter-clockwise seen from the front.
    pub corners: Vec<DVec3>,
    /// Plane id of its parts.
    pub plane: u32,
    /// Unit of its parts.
    pub unit: u64,
    /// Numbers of its parts, rising.
    pub parts: Vec<usize>,
}

/// More corners are never joined to one polygon: this bounds the work.
const MOST_CORNERS: usize = 128;

/// Sine of the angle by which a corner may turn inwards and the polygon still counts as convex: rounding.
const CONCAVE: f64 = 1e-9;

/// Corners nearer to the line through their neighbours than this share of the neighbours' distance are no corners.
const STRAIGHT: f64 = 1e-10;

/// Joins greedily over shared edges, the longest first (the diagonals of quadrilaterals). The polygons come in the order
/// of their first parts.
pub(super) fn join(parts: &[Part]) -> Vec<Joined> {
    let (vertices, mut loops) = number_vertices(parts);
    let mut root: Vec<usize> = (0..parts.len()).collect();
    for edge in inner_edges(parts, &vertices, &loops) {
        let (a, b) = (find(&mut root, edge.parts[0]), find(&mut root, edge.parts[1]));
        if a == b {
            continue;
        }
        let Some(joined) = splice(&loops[a], &loops[b], edge.ends) else { continue };
        if is_convex(&joined, &vertices, normal(&parts[edge.parts[0]])) {
            let (first, other) = (a.min(b), a.max(b));
            root[other] = first;
            loops[first] = joined;
            loops[other] = Vec::new();
        }
    }
    let mut members = vec![Vec::new(); parts.len()];
    (0..parts.len()).for_each(|part| members[find(&mut root, part)].push(part));
    let kept = loops.iter().enumerate().filter(|(_, corners)| !corners.is_empty());
    kept.map(|(first, corners)| Joined {
        corners: without_straight_corners(corners.iter().map(|&v| vertices[v as usize]).collect()),
        plane: parts[first].plane,
        unit: parts[first].unit,
        parts: std::mem::take(&mut members[first]),
    })
    .collect()
}

/// Area vector of a triangle, doubled.
pub(super) fn normal(part: &Part) -> DVec3 {
    let [a, b, c] = part.corners;
    (b - a).cross(c - a)
}

/// Corners at one place, to the bit, become one vertex; each part becomes a loop of vertices.
pub(super) fn number_vertices(parts: &[Part]) -> (Vec<DVec3>, Vec<Vec<u32>>) {
    // Adding 0 makes −0 and 0 the same place.
    let key = |p: DVec3| p.to_array().map(|x| (x + 0.0).to_bits());
    let mut vertices: Vec<DVec3> = parts.iter().flat_map(|part| part.corners).collect();
    vertices.sort_unstable_by_key(|&p| key(p));
    vertices.dedup_by_key(|p| key(*p));
    let find = |p: DVec3| vertices.partition_point(|&q| key(q) < key(p)) as u32;
    let loops = parts.iter().map(|part| part.corners.map(find).to_vec()).collect();
    (vertices, loops)
}

/// An edge between two parts that may join.
struct InnerEdge {
    parts: [usize; 2],
    /// Vertices in the order of the first part.
    ends: [u32; 2],
    length_squared: f64,
}

/// The edges with exactly one part of the same plane, unit and front on either side, the longest first.
fn inner_edges(parts: &[Part], vertices: &[DVec3], loops: &[Vec<u32>]) -> Vec<InnerEdge> {
    let mut all = Vec::with_capacity(3 * parts.len());
    for (number, (part, corners)) in parts.iter().zip(loops).enumerate() {
        let normal = normal(part);
        let side = normal.to_array().into_iter().fold(0.0f64, |a, x| if x.abs() > a.abs() { x } else { a }) > 0.0;
        for i in 0..3 {
            let (from, to) = (corners[i], corners[(i + 1) % 3]);
            all.push(((from.min(to), from.max(to), part.plane, part.unit, side), number, [from, to]));
        }
    }
    all.sort_unstable();
    let mut inner: Vec<InnerEdge> = all
        .chunk_by(|a, b| a.0 == b.0)
        .filter_map(|run| match run {
            [(_, a, ends), (_, b, other)] if ends[0] == other[1] && ends[0] != ends[1] => Some(InnerEdge {
                parts: [*a, *b],
                ends: *ends,
                length_squared: vertices[ends[0] as usize].distance_squared(vertices[ends[1] as usize]),
            }),
            _ => None,
        })
        .collect();
    inner.sort_by(|a, b| b.length_squared.total_cmp(&a.length_squared).then(a.parts.cmp(&b.parts)));
    inner
}

/// The first member of a part's set (Tarjan's union-find, paths halved).
pub(super) fn find(root: &mut [usize], mut part: usize) -> usize {
    while root[part] != part {
        root[part] = root[root[part]];
        part = root[part];
    }
    part
}

/// The loop around `a` and `b`, which run the edge in opposite directions; none if it is not a simple one.
fn splice(a: &[u32], b: &[u32], [from, to]: [u32; 2]) -> Option<Vec<u32>> {
    let place = |corners: &[u32], [x, y]: [u32; 2]| {
        (0..corners.len()).find(|&i| corners[i] == x && corners[(i + 1) % corners.len()] == y)
    };
    let (i, j) = match (place(a, [from, to]), place(b, [to, from])) {
        (Some(i), Some(j)) => (i, j),
        _ => (place(a, [to, from])?, place(b, [from, to])?),
    };
    let mut joined: Vec<u32> = (1..=a.len()).map(|k| a[(i + k) % a.len()]).collect();
    joined.extend((2..b.len()).map(|k| b[(j + k) % b.len()]));
    // Where the two touch along more edges than one, the loop runs there and back.
    while let Some(k) = (0..joined.len()).find(|&k| joined[k] == joined[(k + 2) % joined.len()] && joined.len() > 2) {
        let n = joined.len();
        let (tip, back) = ((k + 1) % n, (k + 2) % n);
        joined.remove(tip.max(back));
        joined.remove(tip.min(back));
    }
    let mut sorted = joined.clone();
    sorted.sort_unstable();
    let is_simple = sorted.windows(2).all(|w| w[0] != w[1]);
    (is_simple && (3..=MOST_CORNERS).contains(&joined.len())).then_some(joined)
}

fn is_convex(corners: &[u32], vertices: &[DVec3], normal: DVec3) -> bool {
    let n = corners.len();
    let at = |k: usize| vertices[corners[k % n] as usize];
    let normal = normal.normalize();
    (0..n).all(|k| {
        let (before, after) = (at(k + 1) - at(k), at(k + 2) - at(k + 1));
        before.cross(after).dot(normal) >= -CONCAVE * before.length() * after.length()
    })
}

fn without_straight_corners(mut corners: Vec<DVec3>) -> Vec<DVec3> {
    let mut k = 0;
    while k < corners.len() && corners.len() > 3 {
        let n = corners.len();
        let (before, here, after) = (corners[(k + n - 1) % n], corners[k], corners[(k + 1) % n]);
        let line = after - before;
        if line.cross(here - before).length() <= STRAIGHT * line.length_squared() {
            corners.remove(k);
        } else {
            k += 1;
        }
    }
    corners
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(corners: [[f64; 3]; 3], unit: u64) -> Part {
        Part { corners: corners.map(DVec3::from), plane: 0, unit }
    }

    fn grid(columns: usize, rows: usize, unit: impl Fn(usize, usize) -> u64) -> Vec<Part> {
        let mut parts = Vec::new();
        for (x, y) in (0..columns).flat_map(|x| (0..rows).map(move |y| (x, y))) {
            let at = |i: usize, j: usize| [(x + i) as f64, (y + j) as f64, 2.0];
            parts.push(part([at(0, 0), at(1, 0), at(1, 1)], unit(x, y)));
            parts.push(part([at(0, 0), at(1, 1), at(0, 1)], unit(x, y)));
        }
        parts
    }

    #[test]
    fn a_grid_becomes_one_rectangle_or_one_for_each_unit() {
        let whole = join(&grid(5, 4, |_, _| 0));
        assert_eq!((whole.len(), whole[0].corners.len()), (1, 4), "{whole:?}");
        let squares = join(&grid(5, 4, |x, y| (x * 4 + y) as u64));
        assert!(squares.len() == 20 && squares.iter().all(|square| square.corners.len() == 4));
        assert!(squares.is_sorted_by_key(|square| square.unit));
    }

    #[test]
    fn concave_outlines_become_several_convex_polygons() {
        // A 2 × 2 grid without one square.
        let parts: Vec<Part> = grid(2, 2, |_, _| 0).into_iter().skip(2).collect();
        let joined = join(&parts);
        assert_eq!(joined.len(), 2);
        assert!(joined.iter().all(|polygon| polygon.corners.len() == 4));
    }

    #[test]
    fn front_and_back_of_a_sheet_and_different_planes_stay_apart() {
        let mut parts = grid(1, 1, |_, _| 0);
        let backs: Vec<Part> =
            parts.iter().map(|p| Part { corners: [p.corners[0], p.corners[2], p.corners[1]], ..*p }).collect();
        parts.extend(backs);
        assert_eq!(join(&parts).iter().map(|polygon| polygon.corners.len()).collect::<Vec<_>>(), [4, 4]);
        let mut bent = grid(1, 1, |_, _| 0);
        bent[1].plane = 1;
        assert_eq!(join(&bent).len(), 2);
    }
}
