//! What a point sees of a polygon, exactly: the polygon less the shadows of the blockers.

use super::clip::keep_above;
use crate::form_factor;
use glam::DVec3;

/// Part of an occluder between the planes of the pair: convex, wholly in front of both.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Blocker {
    corners: [DVec3; 5],
    count: usize,
}

impl Blocker {
    /// From at most five corners.
    pub fn new(corners: &[DVec3]) -> Blocker {
        let mut all = [DVec3::ZERO; 5];
        all[..corners.len()].copy_from_slice(corners);
        Blocker { corners: all, count: corners.len() }
    }

    /// Its corners.
    pub fn corners(&self) -> &[DVec3] {
        &self.corners[..self.count]
    }

    /// Inward unit normals of the planes through `point` and the edges: the cone that its shadow fills. As the blocker lies
    /// in front of the polygons' planes, what of a polygon is in the cone is behind the blocker. None seen edge-on.
    fn cone(&self, point: DVec3, flat: f64) -> Option<([DVec3; 5], usize)> {
        let mut normals = [DVec3::ZERO; 5];
        let mut used = 0;
        let mut volume = 0.0;
        let first = self.corners[0] - point;
        for k in 0..self.count {
            let r = self.corners[k] - point;
            let edge = self.corners[if k + 1 == self.count { 0 } else { k + 1 }] - self.corners[k];
            let normal = r.cross(edge);
            volume += normal.dot(first);
            let length = normal.length();
            if length > flat * flat {
                normals[used] = normal / length;
                used += 1;
            }
        }
        let area = super::clip::area_vector(self.corners()).length();
        if volume.abs() <= flat * area || used < 3 {
            return None;
        }
        if volume < 0.0 {
            normals.iter_mut().for_each(|n| *n = -*n);
        }
        Some((normals, used))
    }

    /// Whether no point of one polygon sees any of the other: then the cones of all corners of one hold all of the other.
    pub fn covers(&self, from: &[DVec3], target: &[DVec3], flat: f64) -> bool {
        from.iter().all(|&x| {
            self.cone(x, flat)
                .is_some_and(|(normals, n)| normals[..n].iter().all(|m| target.iter().all(|&y| m.dot(y - x) >= -flat)))
        })
    }
}

/// Convex polygons, one after the other.
#[derive(Debug, Default)]
struct Fragments {
    corners: Vec<DVec3>,
    ends: Vec<usize>,
}

impl Fragments {
    fn clear(&mut self) {
        self.corners.clear();
        self.ends.clear();
    }

    fn push(&mut self, corners: &[DVec3]) {
        self.corners.extend_from_slice(corners);
        self.ends.push(self.corners.len());
    }

    fn iter(&self) -> impl Iterator<Item = &[DVec3]> {
        (0..self.ends.len()).map(|i| &self.corners[if i == 0 { 0 } else { self.ends[i - 1] }..self.ends[i]])
    }
}

/// Room for intermediate results.
#[derive(Debug, Default)]
pub(crate) struct Scratch {
    seen: Fragments,
    next: Fragments,
    inside: Vec<DVec3>,
    outside: Vec<DVec3>,
    rest: Vec<DVec3>,
}

/// Factors from a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seen {
    /// With nothing between.
    pub whole: f64,
    /// Behind the blockers.
    pub visible: f64,
}

/// What `point`, on a surface with this unit normal, sees of the polygon `target`.
pub(crate) fn seen<'a>(
    point: DVec3,
    normal: DVec3,
    target: &[DVec3],
    blockers: impl Iterator<Item = &'a Blocker>,
    flat: f64,
    scratch: &mut Scratch,
) -> Seen {
    let Scratch { seen, next, inside, outside, rest } = scratch;
    rest.clear();
    rest.extend(target.iter().map(|&c| c - point));
    seen.clear();
    seen.push(rest);
    let whole = form_factor::polygon(rest, normal);
    let mut untouched = true;
    for blocker in blockers {
        if seen.ends.is_empty() {
            return Seen { whole, visible: 0.0 };
        }
        let Some((normals, n)) = blocker.cone(point, flat) else { continue };
        let normals = &normals[..n];
        let height = |n: DVec3, r: DVec3| {
            let h = n.dot(r);
            if h.abs() <= flat { 0.0 } else { h }
        };
        next.clear();
        let mut cut = false;
        for fragment in seen.iter() {
            if normals.iter().any(|&n| fragment.iter().all(|&r| height(n, r) <= 0.0)) {
                next.push(fragment);
                continue;
            }
            cut = true;
            // Outside of the first plane; inside of it, but outside of the second; and so on. The rest is in shadow.
            rest.clear();
            rest.extend_from_slice(fragment);
            let before = next.ends.len();
            for &n in normals {
                keep_above(rest, |r| -height(n, r), outside);
                if !outside.is_empty() {
                    next.push(outside);
                }
                keep_above(rest, |r| height(n, r), inside);
                std::mem::swap(rest, inside);
                if rest.is_empty() {
                    break;
                }
            }
            if rest.is_empty() {
                // It only came near: the fragment stays whole.
                next.ends.truncate(before);
                next.corners.truncate(next.ends.last().copied().unwrap_or(0));
                next.push(fragment);
            }
        }
        if cut {
            std::mem::swap(seen, next);
            untouched = false;
        }
    }
    let visible =
        if untouched { whole } else { seen.iter().map(|f| form_factor::polygon(f, normal)).sum::<f64>().min(whole) };
    Seen { whole, visible }
}
