//! Walks: rays that are followed one after the other, because where one goes depends on what the one before has met.
//!
//! A walk asks for one nearest hit at a time and is told. Who finds the hits is not its business: on one rank a walk is
//! run to its end at once; over a ring many are under way together.

use super::{Mesh, look};
use glam::DVec3;
use ringlight_visibility::{Hierarchy, Hit, Ray, Triangle};

/// A question: what a ray hits first, of the triangles that a rule admits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Query {
    /// The ray.
    pub ray: Ray,
    /// What it may hit.
    pub rule: Rule,
}

/// Which triangles a ray may hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// All.
    All,
    /// Those in the plane of this patch that look the same way and have the light where both lie in each other.
    Overlaying(u32),
    /// Those in the plane of this patch that face it.
    Facing(u32),
    /// Those of which the ray meets a lit side: unlit backs of single-sided surfaces are not seen.
    Lit,
}

/// Rays of which each depends on the hits before.
pub trait Walk {
    /// What it asks now; none once it is over.
    fn query(&self) -> Option<Query>;
    /// Takes the nearest hit, if there is one, of what it asks now.
    fn answer(&mut self, hit: Option<Hit>);
}

impl<W: Walk> Walk for &mut W {
    fn query(&self) -> Option<Query> {
        W::query(self)
    }

    fn answer(&mut self, hit: Option<Hit>) {
        W::answer(self, hit);
    }
}

/// The nearest hit among the triangles held here. Whoever knows the mesh can tell what a rule admits.
pub fn nearest_hit(mesh: &Mesh, hierarchy: &Hierarchy, Query { ray, rule }: &Query) -> Option<Hit> {
    let in_plane_of = |patch: u32, admits: fn(&Mesh, u32, u32) -> bool| {
        let facet = mesh.patch_facets[patch as usize] >> 1;
        let plane = mesh.facets[facet as usize].plane;
        let admitted = |t: &Triangle| t.plane == plane && t.id >> 1 != facet && admits(mesh, patch, t.id >> 1);
        hierarchy.nearest_hit_where(ray, admitted)
    };
    match *rule {
        Rule::All => hierarchy.nearest_hit(ray),
        Rule::Overlaying(patch) => in_plane_of(patch, look::overlays),
        Rule::Facing(patch) => in_plane_of(patch, look::faces),
        Rule::Lit => {
            let direction = DVec3::from(ray.direction.map(f64::from));
            hierarchy.nearest_hit_where(ray, |triangle| {
                let [a, b, c] = triangle.corners.map(|corner| DVec3::from(corner.map(f64::from)));
                mesh.facets[(triangle.id >> 1) as usize].double_sided() || (b - a).cross(c - a).dot(direction) < 0.0
            })
        }
    }
}

/// The same for several: quick where those that follow each other are parallel and start near each other, and may hit all.
pub fn nearest_hits(mesh: &Mesh, hierarchy: &Hierarchy, queries: &[Query]) -> Vec<Option<Hit>> {
    let mut hits = Vec::with_capacity(queries.len());
    for some in queries.chunk_by(|a, b| a.rule == Rule::All && b.rule == Rule::All) {
        if some[0].rule == Rule::All {
            let rays: Vec<Ray> = some.iter().map(|query| query.ray).collect();
            hits.extend(hierarchy.nearest_hits(&rays));
        } else {
            hits.extend(some.iter().map(|query| nearest_hit(mesh, hierarchy, query)));
        }
    }
    hits
}

/// Runs a walk to its end where all triangles are held.
pub fn run<W: Walk>(mesh: &Mesh, hierarchy: &Hierarchy, mut walk: W) -> W {
    while let Some(query) = walk.query() {
        walk.answer(nearest_hit(mesh, hierarchy, &query));
    }
    walk
}

impl Rule {
    /// The rule in two words, for those who pass it on without knowing what it means.
    pub fn to_words(self) -> [u32; 2] {
        match self {
            Rule::All => [0, 0],
            Rule::Overlaying(patch) => [1, patch],
            Rule::Facing(patch) => [2, patch],
            Rule::Lit => [3, 0],
        }
    }

    /// The inverse of [`Rule::to_words`].
    pub fn from_words([kind, patch]: [u32; 2]) -> Rule {
        match kind {
            0 => Rule::All,
            1 => Rule::Overlaying(patch),
            2 => Rule::Facing(patch),
            _ => Rule::Lit,
        }
    }
}
