//! Elements that know no light of their own take it from their neighbours.

use super::field::{Field, UNKNOWN, Work};
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
            gaps.iter().for_each(|gap| field.fill(gap.index, [0.0; 3]));
            return;
        }
        let mut found = found.into_iter();
        gaps.retain(|gap| {
            let light = found.next().flatten();
            field.fill(gap.index, light.unwrap_or(UNKNOWN));
            light.is_none()
        });
    }
}

fn find_gaps(field: &Field<'_>) -> Vec<Gap> {
    (0..field.sheets().len())
        .into_par_iter()
        .filter(|&sheet| field.holds(sheet))
        .map_init(Work::default, |work, sheet| {
            let count = field.sheets().get(sheet).lattice.cell_count();
            let unknown = (0..count).filter(|&cell| !field.known(field.index(sheet, cell)));
            unknown.map(|cell| gap(field, sheet, cell, work)).collect::<Vec<_>>()
        })
        .flatten_iter()
        .collect()
}

fn gap(field: &Field<'_>, sheet: u32, cell: u32, work: &mut Work) -> Gap {
    let index = field.index(sheet, cell);
    let mut neighbours = Vec::new();
    for vertex in field.sheets().get(sheet).lattice.corners(cell) {
        field.collect(sheet, vertex, true, work);
        neighbours.extend(work.parts.iter().map(|p| field.index(p.sheet, p.cell)).filter(|&i| i != index));
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
