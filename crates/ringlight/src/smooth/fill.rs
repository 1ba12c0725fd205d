//! Elements that know no light of their own take it from their neighbours.

use super::field::{Field, Side, UNKNOWN, Work, sides};
use super::lattice::Lattice;
use crate::quantity::Rgb;
use rayon::prelude::*;

/// An element to fill and its neighbours, as places in the field.
struct Gap {
    index: usize,
    neighbours: Vec<usize>,
}

/// Fills unknown elements round by round, each with the mean of those neighbours that were known before the round, so
/// that light grows under tables' feet and into walls. What is connected to no known element stays dark.
pub fn fill(field: &mut Field<'_>) {
    let mut gaps = find_gaps(field);
    while !gaps.is_empty() {
        let found: Vec<Option<Rgb>> = gaps.par_iter().map(|gap| mean(field, gap)).collect();
        if found.iter().all(|f| f.is_none()) {
            gaps.iter().for_each(|gap| field.set(gap.index, [0.0; 3]));
            return;
        }
        let mut found = found.into_iter();
        gaps.retain(|gap| {
            let light = found.next().flatten();
            field.set(gap.index, light.unwrap_or(UNKNOWN));
            light.is_none()
        });
    }
}

fn find_gaps(field: &Field<'_>) -> Vec<Gap> {
    let mesh = field.mesh();
    (0..mesh.facets.len() as u32)
        .into_par_iter()
        .filter(|&f| field.holds(f))
        .map_init(Work::default, |work, f| {
            let count = mesh.facets[f as usize].element_count();
            let mut gaps = Vec::new();
            for side in sides(mesh, f) {
                for cell in (0..count).filter(|&cell| !field.known(field.index(side, cell))) {
                    gaps.push(gap(field, side, cell, work));
                }
            }
            gaps
        })
        .flatten_iter()
        .collect()
}

fn gap(field: &Field<'_>, side: Side, cell: u32, work: &mut Work) -> Gap {
    let index = field.index(side, cell);
    let mut neighbours = Vec::new();
    for vertex in Lattice::of(&field.mesh().facets[side.facet as usize]).corners(cell) {
        field.collect(side, vertex, true, work);
        neighbours.extend(work.parts.iter().map(|p| field.index(p.side, p.cell)).filter(|&i| i != index));
    }
    neighbours.sort_unstable();
    neighbours.dedup();
    neighbours.shrink_to_fit();
    Gap { index, neighbours }
}

fn mean(field: &Field<'_>, gap: &Gap) -> Option<Rgb> {
    let (mut sum, mut count) = ([0.0f64; 3], 0u32);
    for &n in gap.neighbours.iter().filter(|&&n| field.known(n)) {
        let light = field.at(n);
        (0..3).for_each(|c| sum[c] += f64::from(light[c]));
        count += 1;
    }
    (count > 0).then(|| sum.map(|s| (s / f64::from(count)) as f32))
}
