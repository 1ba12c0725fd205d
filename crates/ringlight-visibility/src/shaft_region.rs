//! Where occluders may lie.

use crate::build::Bounds;
use crate::shaft::{Shaft, extend};
use crate::{Points, PreparedShooter};

/// A region that holds all triangles that can hide a shooter from points: what lies outside need not be asked. Holders of
/// a part of a scene's triangles, of whom only a box is known, can so be passed by; the masks are the same.
pub struct Region(Option<Shaft>);

impl Region {
    /// Around the points that still see a cell, and the cells that any of them sees. `scene` are the least and greatest
    /// coordinates of all the scene's triangles.
    pub fn new(shooter: &PreparedShooter, points: Points<'_>, masks: &[u64], scene: [[f32; 3]; 2]) -> Region {
        let union = masks.iter().fold(0, |union, mask| union | mask);
        let Some(plan) = shooter.plan().filter(|_| union != 0) else { return Region(None) };
        let mut around = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        (0..points.len()).filter(|&i| masks[i] != 0).for_each(|i| extend(&mut around, points.at(i)));
        // No point of the box is farther from the cells than the corner on the other side.
        let farthest = std::array::from_fn(|axis| {
            let (low, high) = (around.0[axis], around.1[axis]);
            if (plan.anchor[axis] - low).abs() > (plan.anchor[axis] - high).abs() { low } else { high }
        });
        let reach = plan.reach(farthest);
        let scene = Bounds { low: scene[0], high: scene[1] };
        Region(Some(Shaft::between(plan, around, reach, union & plan.all, &scene)))
    }

    /// None where nothing is left to be hidden.
    pub(crate) fn shaft(&self) -> Option<&Shaft> {
        self.0.as_ref()
    }

    /// Whether triangles in the box from `low` to `high` may hide anything.
    pub fn meets(&self, low: [f32; 3], high: [f32; 3]) -> bool {
        self.0.as_ref().is_some_and(|shaft| shaft.meets(low, high))
    }
}
