//! What blocks light: the facets' triangles and what they let through.

use super::{Facet, Mesh, NONE};
use crate::column::Column;
use bytemuck::{Pod, Zeroable};
use ringlight_visibility::{Bitmap, Filter, Hierarchy, Layout, OPAQUE, Triangle};
use std::sync::Arc;

/// Cut-out bitmaps, and how facets are covered.
#[derive(Clone, Debug, Default)]
pub struct Occluder {
    /// Share of light that each surface blocks where it is not textured: 1 for opaque ones.
    pub coverage: Vec<f32>,
    /// Which texels of a surface block: index into `bitmaps`, for materials in alpha mode MASK.
    pub cutout: Vec<Option<u32>>,
    /// Cut-out bitmaps.
    pub bitmaps: Vec<Arc<Bitmap>>,
    /// Share of light blocked by facets of textured see-through surfaces, sorted by facet.
    pub facet_coverage: Column<FacetCoverage>,
}

/// How a textured see-through facet is covered.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct FacetCoverage {
    /// Number of the facet.
    pub facet: u32,
    /// Share of light that it blocks.
    pub share: f32,
}

/// A see-through surface that blocks at least this much is opaque.
pub const OPAQUE_COVERAGE: f32 = 0.99;

/// A surface that blocks less than this does not block.
pub const CLEAR_COVERAGE: f32 = 0.01;

impl Occluder {
    /// Share of light that facet number `f` blocks.
    pub fn coverage(&self, f: u32, facet: &Facet) -> f32 {
        match self.facet_coverage.binary_search_by_key(&f, |c| c.facet) {
            Ok(i) => self.facet_coverage[i].share,
            Err(_) => self.coverage[facet.surface as usize],
        }
    }
}

/// The hierarchy over all facets.
pub fn hierarchy(mesh: &Mesh) -> Hierarchy {
    hierarchy_of(mesh, 0..mesh.facets.len() as u32)
}

/// The hierarchy over some facets: triangle ids are twice the facet's number, plus 1 for a quadrilateral's second half.
pub fn hierarchy_of(mesh: &Mesh, numbers: impl Iterator<Item = u32> + Clone) -> Hierarchy {
    let facets: &[Facet] = &mesh.facets;
    let blocking = || {
        let facets = numbers.clone().map(|f| (f, &facets[f as usize]));
        facets.map(|(f, facet)| (f, facet, mesh.occluder.coverage(f, facet))).filter(|b| b.2 >= CLEAR_COVERAGE)
    };
    let halves = |facet: &Facet| if facet.layout() == Layout::Quad { 2 } else { 1 };
    // Counted first: what is reserved and not used would count where memory is limited.
    let mut triangles = Vec::with_capacity(blocking().map(|(_, facet, _)| halves(facet)).sum());
    let mut filters = Vec::new();
    for (f, facet, coverage) in blocking() {
        let c = facet.corners.map(|c| c.to_array());
        let cutout = mesh.occluder.cutout[facet.surface as usize].filter(|_| facet.base_uv != NONE);
        for (half, [i, j, k]) in [[0, 1, 2], [0, 2, 3]].into_iter().enumerate().take(halves(facet)) {
            let filter = if let Some(bitmap) = cutout {
                let uv = mesh.base_uv[facet.base_uv as usize];
                filters.push(Filter::Cutout {
                    bitmap: mesh.occluder.bitmaps[bitmap as usize].clone(),
                    uv: [uv[i], uv[j], uv[k]],
                });
                filters.len() as u32 - 1
            } else if coverage < OPAQUE_COVERAGE {
                // The halves of a facet screen the same cells.
                if half == 0 {
                    filters.push(Filter::Screen { share: coverage, seed: facet.plane.wrapping_mul(0x9e37_79b9) >> 26 });
                }
                filters.len() as u32 - 1
            } else {
                OPAQUE
            };
            let id = 2 * f + half as u32;
            triangles.push(Triangle { corners: [c[i], c[j], c[k]], plane: facet.plane, id, filter });
        }
    }
    Hierarchy::build(triangles, filters)
}
