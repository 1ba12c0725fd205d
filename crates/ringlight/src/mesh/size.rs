//! Patch and element sizes: asked for, or chosen from the scene.

use super::Facet;
use crate::column::Store;
use serde::{Deserialize, Serialize};
use std::io;

/// How fine the defaults are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Quality {
    /// About 6 thousand elements.
    Draft,
    /// About 25 thousand elements.
    #[default]
    Normal,
    /// About 100 thousand elements.
    High,
}

impl Quality {
    /// Elements that a scene of few large faces is cut into.
    pub fn target_elements(self) -> f64 {
        match self {
            Quality::Draft => 6_000.0,
            Quality::Normal => 25_000.0,
            Quality::High => 100_000.0,
        }
    }
}

/// Sizes in force, metres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sizes {
    /// Largest edge of a patch.
    pub patch: f64,
    /// Largest edge of an element.
    pub element: f64,
    /// No side of a facet is cut into more elements than this; larger facets get larger elements.
    pub facet_limit: u32,
}

/// Patches are this many elements wide by default: as many as a shooter of 16 cells has cells.
const ELEMENTS_PER_PATCH: f64 = 4.0;

/// What decides a facet's grid: edge lengths along u and v (for triangles both the effective length), metres.
pub fn lengths(facet: &Facet) -> [f64; 2] {
    let c = facet.corners.map(|c| c.as_dvec3());
    if c[3] == c[0] {
        // Long thin triangles are cut by their area, lest they fall into square numbers of slivers.
        let longest = (c[1] - c[0]).length().max((c[2] - c[1]).length()).max((c[0] - c[2]).length());
        let area = (c[1] - c[0]).cross(c[2] - c[0]).length() / 2.0;
        [longest.min(3.0 * (2.0 * area).sqrt()); 2]
    } else {
        [(c[1] - c[0]).length().max((c[2] - c[3]).length()), (c[3] - c[0]).length().max((c[2] - c[1]).length())]
    }
}

/// Parts of a length, none larger than `size`; a relative 1e-6 is forgiven.
fn parts(length: f64, size: f64) -> f64 {
    (length / size - 1e-6).ceil().max(1.0)
}

/// Columns and rows of patches, and of elements in each, for a facet of these [`lengths`], where sizes are `scale` times as large.
pub fn grids(lengths: [f64; 2], sizes: &Sizes, scale: f64) -> ([u16; 2], [u16; 2]) {
    let (patches, elements) = counts(lengths, sizes, scale);
    (patches.map(|n| n as u16), elements.map(|n| n as u16))
}

fn counts(lengths: [f64; 2], sizes: &Sizes, scale: f64) -> ([f64; 2], [f64; 2]) {
    let patches = lengths.map(|l| parts(l, sizes.patch * scale));
    let elements = [0, 1].map(|i| parts(lengths[i] / patches[i], sizes.element * scale));
    (patches, elements)
}

/// How much larger than asked patches and elements of a facet of these [`lengths`] are, lest there are too many.
pub fn scale(lengths: [f64; 2], sizes: &Sizes) -> f64 {
    let too_many = |scale: f64| {
        let (patches, elements) = counts(lengths, sizes, scale);
        let all = patches.iter().chain(&elements);
        all.clone().product::<f64>() > f64::from(sizes.facet_limit.max(1)) || all.clone().any(|&n| n > 65_535.0)
    };
    let mut scale = 1.0;
    while too_many(scale) {
        scale *= 1.25;
    }
    scale
}

/// Sizes for the facets of a scene: those asked for, else by quality. The element size is the one at which the facets'
/// area would give the quality's number of elements, no facet counting for much more of it than a twelfth (or its equal share
/// among fewer facets), so that a field outside does not coarsen the room inside.
pub fn choose(
    facets: &[Facet],
    quality: Quality,
    [patch, element]: [Option<f64>; 2],
    store: Store<'_>,
) -> io::Result<Sizes> {
    let target = quality.target_elements();
    let asked = patch.is_some() || element.is_some();
    // Half as much again as an equal share, so that the target can be reached.
    let limit = 1.5 * target / (facets.len() as f64).clamp(1.0, 12.0);
    let facet_limit = if asked { u32::MAX } else { limit as u32 };
    let element = match element.or(patch.map(|p| p / ELEMENTS_PER_PATCH)) {
        Some(element) => element,
        None => {
            let mut areas = store.column()?;
            let sides = |f: &Facet| if f.double_sided() { 2.0 } else { 1.0 };
            areas.extend(facets.iter().map(|f| f.frame().area_vector().length() * sides(f)))?;
            round_size(size_of_elements(&areas, target, limit))
        }
    };
    let patch = patch.unwrap_or(ELEMENTS_PER_PATCH * element).max(element);
    Ok(Sizes { patch, element, facet_limit })
}

/// Bisection for the size; elements that a facet has anyway (one) do not count.
fn size_of_elements(areas: &[f64], target: f64, limit: f64) -> f64 {
    let (mut low, mut high) = (1e-9, 1e9);
    for _ in 0..100 {
        let middle = f64::sqrt(low * high);
        let count: f64 = areas.iter().map(|a| (a / (middle * middle) - 1.0).clamp(0.0, limit)).sum();
        if count > target { low = middle } else { high = middle }
    }
    f64::sqrt(low * high)
}

/// Two significant digits: sizes that people can say, and that do not depend on the last bit of an area.
fn round_size(size: f64) -> f64 {
    let mut unit = 1e-9;
    while unit * 99.5 < size {
        unit *= 10.0;
    }
    (size / unit).round() * unit
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_are_cut_into_equal_parts_no_larger_than_asked() {
        let sizes = Sizes { patch: 1.0, element: 0.25, facet_limit: u32::MAX };
        assert_eq!(grids([3.0, 2.1], &sizes, 1.0), ([3, 3], [4, 3]));
        assert_eq!(grids([0.1, 0.1], &sizes, 1.0), ([1, 1], [1, 1]));
        assert_eq!(grids([1.000_000_1, 0.3], &sizes, 1.0), ([1, 1], [4, 2]));
    }

    #[test]
    fn scenes_of_few_facets_get_sensible_sizes() {
        use glam::Vec3;
        let corners = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 0.0, -1.0), Vec3::NEG_Z];
        let facet = Facet { corners, first_back_patch: crate::mesh::NONE, ..bytemuck::Zeroable::zeroed() };
        for count in 1..20 {
            let sizes = choose(&vec![facet; count], Quality::Draft, [None; 2], Store::Heap).unwrap();
            assert!(sizes.element > 0.005 && sizes.element < 0.1, "{count} facets: {sizes:?}");
        }
    }

    #[test]
    fn a_limit_coarsens_a_single_facet() {
        let sizes = Sizes { patch: 1.0, element: 0.25, facet_limit: 1000 };
        let lengths = [100.0, 100.0];
        let (patches, elements) = grids(lengths, &sizes, scale(lengths, &sizes));
        let count = u32::from(patches[0]) * u32::from(patches[1]) * u32::from(elements[0]) * u32::from(elements[1]);
        assert!(count <= 1000 && count > 400);
    }
}
