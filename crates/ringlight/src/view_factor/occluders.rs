//! What may stand between polygons.

use glam::DVec3;
use ringlight_visibility::Hierarchy;

/// An occluding triangle; blocks from both sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Occluder {
    /// Corners, metres.
    pub corners: [DVec3; 3],
    /// Plane id: never blocks what polygons of this plane see.
    pub plane: u32,
}

/// Occluding triangles, ordered for search.
#[derive(Debug)]
pub struct Occluders {
    pub(crate) triangles: Vec<Occluder>,
    pub(crate) hierarchy: Hierarchy,
    /// What the hierarchy's coordinates are relative to, metres.
    pub(crate) origin: DVec3,
    /// Bound on those coordinates, metres.
    pub(crate) reach: f64,
}

impl Occluders {
    /// Orders the triangles. Slivers (see [`Hierarchy::build`]) are left out.
    pub fn new(triangles: Vec<Occluder>) -> Occluders {
        let (low, high) = triangles
            .iter()
            .flat_map(|t| t.corners)
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), c| (low.min(c), high.max(c)));
        let origin = if triangles.is_empty() { DVec3::ZERO } else { low.midpoint(high) };
        let search = triangles
            .iter()
            .enumerate()
            .map(|(id, t)| ringlight_visibility::Triangle {
                corners: t.corners.map(|c| (c - origin).as_vec3().to_array()),
                plane: t.plane,
                id: id as u32,
                filter: ringlight_visibility::OPAQUE,
            })
            .collect();
        let reach = if triangles.is_empty() { 0.0 } else { (high - low).max_element() };
        Occluders { triangles, hierarchy: Hierarchy::build(search, Vec::new()), origin, reach }
    }

    /// Number of triangles left out as slivers.
    pub fn slivers(&self) -> usize {
        self.hierarchy.slivers()
    }
}
