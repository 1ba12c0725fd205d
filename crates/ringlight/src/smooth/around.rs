//! Which elements' light decides that at the vertices of some facets.

use super::field::known;
use super::places::Places;
use crate::mesh::Facet;
use crate::solution::Solution;
use rayon::prelude::*;
use std::ops::Range;

/// The facets whose light decides that at the vertices of `facets`: these, those that touch them, and as elements that know no
/// light take it from their neighbours ([`fill`](super::fill)), those that touch a facet with such elements, and so on.
pub fn deciding(solution: &Solution, places: &Places<'_>, facets: Range<u32>, tolerance: f64) -> Vec<bool> {
    let all = &solution.mesh.facets;
    let mut deciding = vec![false; all.len()];
    deciding[facets.start as usize..facets.end as usize].fill(true);
    let mut open: Vec<u32> = if facets.len() < all.len() { facets.collect() } else { Vec::new() };
    while !open.is_empty() {
        let neighbours = |&facet: &u32| {
            let mut found = Vec::new();
            // Twice, for points that rounding puts outside of their facet's box.
            places.visit_neighbours(facet, 2.0 * tolerance, &mut |other| found.push(other));
            found
        };
        let mut found: Vec<u32> = open.par_iter().flat_map_iter(neighbours).collect();
        found.sort_unstable();
        found.dedup();
        found.retain(|&f| !std::mem::replace(&mut deciding[f as usize], true));
        open = found.into_par_iter().filter(|&f| has_gap(solution, &all[f as usize])).collect();
    }
    deciding
}

/// Whether the light of an element of a facet is to be taken from its neighbours.
fn has_gap(solution: &Solution, facet: &Facet) -> bool {
    let elements = facet.sides().flat_map(|back| solution.mesh.side_elements(facet, back));
    elements.into_iter().any(|element| known(solution, element).is_none())
}
