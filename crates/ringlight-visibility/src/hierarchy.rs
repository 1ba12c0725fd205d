//! The bounding volume hierarchy and the two primitives over it.

use crate::{Cells, Filter, Points, Shooter, Triangle};

/// Counts of work done, for reports.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Rays answered: mask bits that were set on entry.
    pub rays: u64,
    /// Masks asked for.
    pub masks: u64,
    /// Masks answered without testing any triangle.
    pub masks_without_rays: u64,
}

/// A ray for [`Hierarchy::nearest_hit`].
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Start, metres.
    pub origin: [f32; 3],
    /// Direction, any length.
    pub direction: [f32; 3],
    /// Hits nearer than this (in units of `direction`) do not count.
    pub near: f32,
    /// Hits farther than this do not count.
    pub far: f32,
    /// Triangles with this plane id are not hit; [`crate::NO_PLANE`] if none.
    pub plane: u32,
}

/// The nearest hit of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance in units of the ray's direction.
    pub distance: f32,
    /// The triangle's `id`; the lowest among equally near ones.
    pub triangle: u32,
    /// Barycentric weights of the corners 1 and 2.
    pub barycentric: [f32; 2],
    /// Whether the ray came from the side from which the corners run counter-clockwise.
    pub front: bool,
}

/// Occluders, ordered for search.
#[derive(Debug)]
pub struct Hierarchy {
    triangles: Vec<Triangle>,
    filters: Vec<Filter>,
}

impl Hierarchy {
    /// Orders `triangles`; `filters` are what [`Triangle::filter`] points into.
    pub fn build(triangles: Vec<Triangle>, filters: Vec<Filter>) -> Hierarchy {
        Hierarchy { triangles, filters }
    }

    /// Clears in `masks[i]` the bits of the cells that occluders hide from `points` i.
    pub fn clear_blocked(&self, shooter: &Shooter, points: Points<'_>, masks: &mut [u64]) -> Tally {
        let cells: Vec<[f32; 3]> = match &shooter.cells {
            Cells::Grid(grid) => (0..grid.len()).map(|k| grid.point(k)).collect(),
            Cells::Points(p) | Cells::Directions(p) => p.clone(),
        };
        let infinite = matches!(shooter.cells, Cells::Directions(_));
        let mut tally = Tally::default();
        for (i, mask) in masks.iter_mut().enumerate() {
            tally.masks += 1;
            tally.rays += u64::from(mask.count_ones());
            for (k, cell) in cells.iter().enumerate() {
                if *mask >> k & 1 == 0 {
                    continue;
                }
                let x = points.at(i);
                let direction = if infinite { *cell } else { std::array::from_fn(|a| cell[a] - x[a]) };
                let far = if infinite { f32::INFINITY } else { shooter.far };
                let blocked = self.triangles.iter().any(|t| {
                    t.plane != shooter.plane
                        && t.plane != points.plane[i]
                        && (t.filter == crate::OPAQUE
                            || self.filters[t.filter as usize].cells(cells.len()) >> k & 1 == 1)
                        && hit(t, x, direction).is_some_and(|h| h.distance > 0.0 && h.distance <= far)
                });
                if blocked {
                    *mask &= !(1 << k);
                }
            }
        }
        tally
    }

    /// The nearest hit of `ray`; cutouts let it through their holes, screens are hit.
    pub fn nearest_hit(&self, ray: &Ray) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        for t in &self.triangles {
            if t.plane == ray.plane && ray.plane != crate::NO_PLANE {
                continue;
            }
            if let Some(h) = hit(t, ray.origin, ray.direction)
                && h.distance > ray.near
                && h.distance <= ray.far
                && best.is_none_or(|b| (h.distance, h.triangle) < (b.distance, b.triangle))
            {
                best = Some(h);
            }
        }
        best
    }
}

fn hit(t: &Triangle, x: [f32; 3], d: [f32; 3]) -> Option<Hit> {
    let sub = |a: [f32; 3], b: [f32; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let cross =
        |a: [f32; 3], b: [f32; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let [a, b, c] = t.corners;
    let n = cross(sub(b, a), sub(c, a));
    let den = dot(n, d);
    if den == 0.0 {
        return None;
    }
    let edge = |p: [f32; 3], q: [f32; 3]| dot(cross(sub(p, x), sub(q, p)), d);
    let e = [edge(b, c), edge(c, a), edge(a, b)];
    if !(e.iter().all(|&e| e >= 0.0) || e.iter().all(|&e| e <= 0.0)) {
        return None;
    }
    let sum = e[0] + e[1] + e[2];
    let barycentric = if sum == 0.0 { [0.0, 0.0] } else { [e[1] / sum, e[2] / sum] };
    Some(Hit { distance: dot(n, sub(a, x)) / den, triangle: t.id, barycentric, front: den < 0.0 })
}
