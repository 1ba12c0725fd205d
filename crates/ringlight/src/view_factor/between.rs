//! Which occluders stand between the two polygons of a pair, and what of them.

use super::clip::{area_vector, keep_above};
use super::hull::{Side, hull, reaches_into};
use super::pair::Pair;
use super::shadow::Blocker;
use super::{Occluders, unobstructed::Face};
use glam::DVec3;
use ringlight_visibility::{HalfSpace, NO_PLANE};

/// Room for intermediate results, and the result.
#[derive(Debug, Default)]
pub(crate) struct Scratch {
    /// What stands between, in the pair's unit, the largest in view first.
    pub blockers: Vec<Blocker>,
    sides: Vec<Side>,
    region: Vec<HalfSpace>,
    found: Vec<u32>,
    spare: [Vec<DVec3>; 2],
    ranked: Vec<(f64, Blocker)>,
}

/// Growth of the search's region against the hierarchy's coordinates in `f32`, as a share of the coordinates.
const MARGIN: f64 = 1e-6;

/// Finds what stands between; whether anything does.
pub(crate) fn find(pair: &Pair, occluders: &Occluders, scratch: &mut Scratch) -> bool {
    let Scratch { blockers, sides, region, found, spare, ranked } = scratch;
    let (a, b) = (pair.face(0), pair.face(1));
    blockers.clear();
    hull(a, b, pair.flat, sides);
    let shift = pair.origin - occluders.origin;
    let margin = MARGIN * occluders.reach;
    let half_space = |normal: DVec3, offset: f64| HalfSpace {
        normal: normal.to_array(),
        offset: offset * pair.unit + normal.dot(shift) + margin,
    };
    region.clear();
    for axis in DVec3::AXES {
        for normal in [axis, -axis] {
            let farthest = a.corners.iter().chain(b.corners).map(|c| c.dot(normal)).fold(f64::NEG_INFINITY, f64::max);
            region.push(half_space(normal, farthest));
        }
    }
    region.extend(sides.iter().map(|side| half_space(side.normal, side.offset)));
    found.clear();
    occluders.hierarchy.visit(region, |t| {
        if t.plane == NO_PLANE || !pair.planes.contains(&t.plane) {
            found.push(t.id);
        }
    });
    found.sort_unstable();
    ranked.clear();
    for &id in found.iter() {
        let corners = occluders.triangles[id as usize].corners.map(|c| (c - pair.origin) / pair.unit);
        // Only what is in front of both: the hull's first two sides.
        let [first, second] = &mut *spare;
        keep_above(&corners, |p| sides[0].depth(p, pair.flat), first);
        keep_above(first, |p| sides[1].depth(p, pair.flat), second);
        if second.is_empty() {
            continue;
        }
        let blocker = Blocker::new(second);
        if reaches_into(blocker.corners(), sides, pair.flat, spare) {
            ranked.push((in_view(&blocker, a, b), blocker));
        }
    }
    // What hides much leaves little to be cut by the rest. The sort is stable: ties by number.
    ranked.sort_by(|x, y| y.0.total_cmp(&x.0));
    blockers.extend(ranked.iter().map(|&(_, blocker)| blocker));
    !blockers.is_empty()
}

/// About how much of the view a blocker takes, halfway between the polygons.
fn in_view(blocker: &Blocker, a: Face, b: Face) -> f64 {
    let centre = |corners: &[DVec3]| corners.iter().sum::<DVec3>() / corners.len() as f64;
    let along = centre(b.corners) - centre(a.corners);
    area_vector(blocker.corners()).dot(along).abs()
}

/// Which of the polygons to integrate over: the one whose plane the blockers keep away from, because where they stand on it, what its
/// points see jumps. Distances count up to the polygon's size. The smaller one if there is no difference.
pub(crate) fn outer(pair: &Pair, blockers: &[Blocker]) -> usize {
    let clearance = [0, 1].map(|which| {
        let face = pair.face(which);
        let size = area_vector(face.corners).length().sqrt();
        blockers
            .iter()
            .map(|blocker| {
                let corners = blocker.corners();
                let height: f64 = corners.iter().map(|&c| (c - face.corners[0]).dot(face.normal)).sum();
                area_vector(corners).length() * (height / (corners.len() as f64 * size)).min(1.0)
            })
            .sum::<f64>()
    });
    usize::from(clearance[1] > 1.01 * clearance[0])
}
