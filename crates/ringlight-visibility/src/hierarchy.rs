//! The bounding volume hierarchy and the two primitives over it.

use std::sync::atomic::{AtomicU64, Ordering};

use crate::beam::Beam;
use crate::build::{Bounds, Node, build};
use crate::items::SINGLE;
use crate::packet::PACKET;
use crate::plan::Plan;
use crate::predicate::is_sliver;
use crate::{Filter, InstructionSet, OPAQUE, Points, PreparedShooter, Shooter, Triangle, mask, nearest};

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

impl Tally {
    /// Both counts.
    pub fn join(self, other: Tally) -> Tally {
        Tally {
            rays: self.rays + other.rays,
            masks: self.masks + other.masks,
            masks_without_rays: self.masks_without_rays + other.masks_without_rays,
        }
    }
}

/// A ray for [`Hierarchy::nearest_hit`].
#[derive(Clone, Copy, Debug, PartialEq)]
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

impl Hit {
    /// Whether it is to be reported rather than `other`: the nearer, then the lower id. The nearest hits of several
    /// hierarchies that share a scene's triangles, joined by this, are that of one hierarchy over all, in any order.
    #[inline(always)]
    pub fn is_nearer(&self, other: &Option<Hit>) -> bool {
        other.is_none_or(|o| self.distance < o.distance || self.distance == o.distance && self.triangle < o.triangle)
    }
}

/// Occluders, ordered for search.
#[derive(Debug)]
pub struct Hierarchy {
    /// Unlike that of any other one.
    pub(crate) number: u64,
    pub(crate) triangles: Vec<Triangle>,
    pub(crate) filters: Vec<Filter>,
    /// [`Filter::cells`] of every filter for the usual numbers of cells, see [`Hierarchy::blocked_cells`].
    screens: Vec<[u64; USUAL_COUNTS.len()]>,
    pub(crate) nodes: Vec<Node>,
    /// Of each triangle, whether it makes a parallelogram with the next one.
    pub(crate) facets: Vec<u8>,
    pub(crate) bounds: Bounds,
    slivers: usize,
    instruction_set: InstructionSet,
}

/// Fewer parallel rays are quicker one by one.
const LEAST_BEAM: usize = 3;

/// Cells of the shooters that screens are made ready for.
const USUAL_COUNTS: [usize; 4] = [1, 4, 16, 64];

impl Hierarchy {
    /// Orders `triangles`; `filters` are what [`Triangle::filter`] points into.
    ///
    /// Slivers (doubled area below 2⁻¹⁷ of the longest edge squared) and triangles that are not finite are left out. The
    /// result does not depend on the number of threads. Coordinates and extents are to stay below 1e9.
    pub fn build(mut triangles: Vec<Triangle>, filters: Vec<Filter>) -> Hierarchy {
        let given = triangles.len();
        triangles.retain(|t| !is_sliver(t));
        let slivers = given - triangles.len();
        let screens = filters.iter().map(|f| USUAL_COUNTS.map(|count| f.cells(count))).collect();
        let (nodes, bounds, facets) = build(&mut triangles);
        let instruction_set = InstructionSet::best();
        static NEXT: AtomicU64 = AtomicU64::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        Hierarchy { number, triangles, filters, screens, nodes, facets, bounds, slivers, instruction_set }
    }

    /// Uses the given vector instructions instead of the best ones; the results are the same.
    pub fn with_instruction_set(mut self, set: InstructionSet) -> Hierarchy {
        self.instruction_set = set;
        self
    }

    /// Clears in `masks[i]` the bits of the cells that occluders hide from `points` i.
    ///
    /// Runs on the calling thread, and fastest when points that follow each other are near each other.
    pub fn clear_blocked(&self, shooter: &Shooter, points: Points<'_>, masks: &mut [u64]) -> Tally {
        self.clear_blocked_of(&PreparedShooter::new(shooter), points, masks)
    }

    /// The same for a shooter that is asked about again and again.
    pub fn clear_blocked_of(&self, shooter: &PreparedShooter, points: Points<'_>, masks: &mut [u64]) -> Tally {
        assert!(
            [points.y.len(), points.z.len(), points.plane.len(), masks.len()].iter().all(|&n| n == points.len()),
            "coordinates, planes and masks must be as many as the points"
        );
        let Some(plan) = shooter.plan() else {
            let masks = masks.len() as u64;
            return Tally { rays: 0, masks, masks_without_rays: masks };
        };
        self.instruction_set.run(mask::Clear { hierarchy: self, plan, points, masks })
    }

    /// The nearest hit of `ray`; cutouts let it through their holes, screens are hit.
    pub fn nearest_hit(&self, ray: &Ray) -> Option<Hit> {
        self.nearest_hit_where(ray, |_| true)
    }

    /// The nearest hit among the triangles that `accept` takes.
    pub fn nearest_hit_where(&self, ray: &Ray, accept: impl Fn(&Triangle) -> bool) -> Option<Hit> {
        self.instruction_set.run(nearest::Nearest { hierarchy: self, ray, accept })
    }

    /// The nearest hits of several rays. Fastest where those that follow each other have the same direction and start near
    /// each other.
    pub fn nearest_hits(&self, rays: &[Ray]) -> Vec<Option<Hit>> {
        let mut found = vec![None; rays.len()];
        let mut hits = found.as_mut_slice();
        for beam in rays.chunk_by(|a, b| a.direction == b.direction).flat_map(|parallel| parallel.chunks(PACKET)) {
            let (of_beam, rest) = hits.split_at_mut(beam.len());
            hits = rest;
            if beam.len() < LEAST_BEAM {
                of_beam.iter_mut().zip(beam).for_each(|(hit, ray)| *hit = self.nearest_hit(ray));
            } else {
                self.instruction_set.run(Beam { hierarchy: self, rays: beam, hits: of_beam });
            }
        }
        found
    }

    /// The triangles, in the hierarchy's order, without the slivers.
    pub fn triangles(&self) -> &[Triangle] {
        &self.triangles
    }

    /// Number of triangles left out by [`Hierarchy::build`].
    pub fn slivers(&self) -> usize {
        self.slivers
    }

    /// Memory held, in bytes, triangles included and bitmaps not.
    pub fn hierarchy_bytes(&self) -> usize {
        self.triangles.capacity() * size_of::<Triangle>()
            + self.nodes.capacity() * size_of::<Node>()
            + self.facets.capacity()
            + self.filters.capacity() * size_of::<Filter>()
            + self.screens.capacity() * size_of::<[u64; USUAL_COUNTS.len()]>()
    }

    /// The triangle with this number, and the next one if they are one facet.
    #[inline(always)]
    pub(crate) fn facet(&self, index: usize) -> (&Triangle, Option<&Triangle>) {
        let other = if self.facets[index] == SINGLE { None } else { self.triangles.get(index + 1) };
        (&self.triangles[index], other)
    }

    /// The cells of a shooter that a triangle with this filter may block.
    #[inline(always)]
    pub(crate) fn blocked_cells(&self, plan: &Plan, filter: u32) -> u64 {
        if filter == OPAQUE {
            return plan.all;
        }
        match USUAL_COUNTS.iter().position(|&count| count == plan.count) {
            Some(i) => self.screens[filter as usize][i],
            None => self.filters[filter as usize].cells(plan.count),
        }
    }
}
