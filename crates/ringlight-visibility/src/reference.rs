//! The two primitives by brute force: every triangle, every cell, the scalar predicate. Slow, and by definition right;
//! [`crate::Hierarchy`] must give the same bits.

use crate::packet::Candidate;
use crate::plan::Plan;
use crate::predicate::{Prepared, is_sliver, ray_hit};
use crate::{Filter, Hit, NO_PLANE, OPAQUE, Points, Ray, Shooter, Triangle};

/// Clears in `masks[i]` the bits of the cells that `triangles` hide from `points` i.
pub fn clear_blocked(
    triangles: &[Triangle],
    filters: &[Filter],
    shooter: &Shooter,
    points: Points<'_>,
    masks: &mut [u64],
) {
    let plan = Plan::new(shooter);
    for triangle in triangles.iter().filter(|t| !is_sliver(t)) {
        let filter = (triangle.filter != OPAQUE).then(|| &filters[triangle.filter as usize]);
        let candidate = Candidate {
            triangle,
            prepared: Prepared::new(triangle),
            cells: filter.map_or(plan.all, |f| f.cells(plan.count)),
            cutout: filter.filter(|f| matches!(f, Filter::Cutout { .. })),
        };
        let exempt = |plane: u32| plane != NO_PLANE && plane == triangle.plane;
        if exempt(shooter.plane) {
            continue;
        }
        for (i, mask) in masks.iter_mut().enumerate().filter(|&(i, _)| !exempt(points.plane[i])) {
            for k in (0..plan.count).filter(|&k| candidate.blocks(&plan, points.at(i), k)) {
                *mask &= !(1 << k);
            }
        }
    }
}

/// The nearest hit of `ray`.
pub fn nearest_hit(triangles: &[Triangle], filters: &[Filter], ray: &Ray) -> Option<Hit> {
    let mut best = None;
    for triangle in triangles.iter().filter(|t| !is_sliver(t)) {
        if ray.plane != NO_PLANE && ray.plane == triangle.plane {
            continue;
        }
        if let Some(hit) = ray_hit(triangle, &Prepared::new(triangle), filters, ray)
            && hit.is_nearer(&best)
        {
            best = Some(hit);
        }
    }
    best
}
