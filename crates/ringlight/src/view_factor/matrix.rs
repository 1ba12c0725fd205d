//! All factors of a scene, row by row: every pair of polygons once, on all threads, in bounded memory.

use super::facing::Stance;
use super::screens::{Memory, Screens};
use super::spill::{Entry, Spill, Storage};
use super::{Exchange, Faces, Occluders, Tolerance, Work, exchange};
use rayon::prelude::*;
use serde::Serialize;
use std::io;

/// How good, and how small factors may be and still count.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MatrixSettings {
    /// Of every pair of polygons.
    pub tolerance: Tolerance,
    /// Pairs of single polygons whose factors are surely below this, from either side, are passed over; 0 for none.
    pub least: f64,
}

/// How far it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Pairs {
    /// Pairs of polygons, each counted once.
    pub total: u64,
    /// Pairs dealt with, those passed over included.
    pub done: u64,
    /// Pairs that cannot face each other: nothing to compute.
    pub turned_away: u64,
    /// Pairs passed over because their factors are below the least.
    pub below_least: u64,
    /// Pairs that a wall or a convex solid hides from each other.
    pub screened: u64,
    /// Pairs that were integrated.
    pub integrated: u64,
    /// Those of them that see each other.
    pub seeing: u64,
}

impl Pairs {
    fn add(&mut self, other: &Pairs) {
        self.done += other.done;
        self.turned_away += other.turned_away;
        self.below_least += other.below_least;
        self.screened += other.screened;
        self.integrated += other.integrated;
        self.seeing += other.seeing;
    }
}

/// A row of the matrix.
#[derive(Clone, Copy, Debug)]
pub struct Row<'a> {
    /// Number of its group.
    pub number: usize,
    /// What is not 0, columns rising.
    pub entries: &'a [Entry],
    /// Sum of what was computed and is not among the entries, because it is below the least from either side.
    pub left_out: Exchange,
}

/// What [`compute`] did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Computed {
    /// Counts.
    pub pairs: Pairs,
    /// Pairs of polygons that see each other, chosen by their numbers, for tests of what was computed.
    pub sample: Vec<[usize; 2]>,
}

/// Numbers held at once, about; bounds memory and changes nothing else.
const HELD: usize = 1 << 21;

/// Rows of polygons between two signs of life. Within a row pairs are shared out to the threads, too.
const BATCH: usize = 16;

/// Most rows that give a pair to the sample.
const SAMPLED_ROWS: usize = 64;

/// Computes all factors and hands over the rows in order.
///
/// Rows are blocked, so that memory stays bounded; what later blocks need waits in `storage`. `progress` is called now and
/// then, `stops` before every pair; when that says yes, the result is none. The numbers do not depend on the number of threads or on the blocks.
pub fn compute(
    faces: &Faces,
    occluders: &Occluders,
    settings: &MatrixSettings,
    storage: &mut dyn Storage,
    rows: &mut dyn FnMut(Row<'_>) -> io::Result<()>,
    progress: &mut dyn FnMut(&Pairs),
    stops: &(dyn Fn() -> bool + Sync),
) -> io::Result<Option<Computed>> {
    let matrix = Matrix::new(faces, occluders, settings, stops);
    let (groups, polygons) = (faces.groups.len(), faces.polygons.len());
    let in_block = (HELD / groups.max(1)).clamp(1, groups.max(1));
    let mut spill = Spill::new(storage, groups.div_ceil(in_block));
    let mut computed = Computed::default();
    computed.pairs.total = (polygons as u64 * polygons.saturating_sub(1) as u64) / 2;
    let mut sums = vec![Exchange::default(); groups];
    let mut left_out = sums.clone();
    let mut later: Vec<Vec<(u32, Entry)>> = vec![Vec::new(); groups.div_ceil(in_block)];
    for (block, first) in (0..groups).step_by(in_block).enumerate() {
        let block_groups = first..(first + in_block).min(groups);
        let mut entries: Vec<Vec<Entry>> = vec![Vec::new(); block_groups.len()];
        spill.take(block, |row, entry| entries[row as usize - first].push(entry))?;
        for number in block_groups {
            for start in faces.groups[number].polygons.clone().step_by(BATCH) {
                let end = (start + BATCH).min(faces.groups[number].polygons.end);
                progress(&computed.pairs);
                let parts: Vec<PolygonRow> = (start..end).into_par_iter().map(|p| matrix.polygon_row(p)).collect();
                if stops() {
                    return Ok(None);
                }
                for part in parts {
                    computed.pairs.add(&part.pairs);
                    computed.sample.extend(part.sample);
                    part.entries.iter().for_each(|entry| sums[entry.column as usize].add(entry.exchange));
                }
            }
            // Within the group every pair counts from both of its ends.
            sums[number] = Exchange { area: 2.0 * sums[number].area, error: 2.0 * sums[number].error };
            for (column, sum) in sums.iter_mut().enumerate().skip(number) {
                let exchange = std::mem::take(sum);
                if exchange == Exchange::default() {
                    continue;
                }
                if exchange.area < settings.least * faces.groups[number].area.min(faces.groups[column].area) {
                    left_out[number].add(exchange);
                    if column > number {
                        left_out[column].add(exchange);
                    }
                    continue;
                }
                entries[number - first].push(Entry { column: column as u32, exchange });
                let transposed = Entry { column: number as u32, exchange };
                if column > number && column / in_block == block {
                    entries[column - first].push(transposed);
                } else if column > number {
                    later[column / in_block].push((column as u32, transposed));
                }
            }
            let entries = std::mem::take(&mut entries[number - first]);
            rows(Row { number, entries: &entries, left_out: left_out[number] })?;
        }
        for (block, waiting) in later.iter_mut().enumerate().filter(|(_, waiting)| !waiting.is_empty()) {
            spill.keep(block, waiting)?;
            waiting.clear();
        }
    }
    Ok(Some(computed))
}

/// What all rows share.
struct Matrix<'a> {
    faces: &'a Faces,
    occluders: &'a Occluders,
    settings: &'a MatrixSettings,
    stops: &'a (dyn Fn() -> bool + Sync),
    stances: Vec<Stance>,
    screens: Screens,
    /// Group of each polygon.
    group_of: Vec<u32>,
    /// Every how many polygons one gives a pair to the sample.
    sample_step: usize,
}

/// What a polygon exchanges with the polygons after it, summed by group.
struct PolygonRow {
    entries: Vec<Entry>,
    pairs: Pairs,
    sample: Option<[usize; 2]>,
}

impl<'a> Matrix<'a> {
    fn new(
        faces: &'a Faces,
        occluders: &'a Occluders,
        settings: &'a MatrixSettings,
        stops: &'a (dyn Fn() -> bool + Sync),
    ) -> Matrix<'a> {
        let numbered = faces.groups.iter().enumerate();
        Matrix {
            faces,
            occluders,
            settings,
            stops,
            stances: faces.polygons.iter().map(Stance::of).collect(),
            screens: Screens::new(occluders),
            group_of: numbered.flat_map(|(number, group)| group.polygons.clone().map(move |_| number as u32)).collect(),
            sample_step: faces.polygons.len().div_ceil(SAMPLED_ROWS).max(1),
        }
    }

    fn polygon_row(&self, p: usize) -> PolygonRow {
        let mut pairs = Pairs { done: (self.stances.len() - p - 1) as u64, ..Pairs::default() };
        let polygons = &self.faces.polygons;
        let mut candidates: Vec<usize> = Vec::new();
        let mut memory = Memory::default();
        for q in p + 1..self.stances.len() {
            let most = self.stances[p].most(&self.stances[q]);
            if most == 0.0 {
                pairs.turned_away += 1;
            } else if most < self.least(p, q) {
                pairs.below_least += 1;
            } else if self.screens.hide(&polygons[p], &polygons[q], self.occluders, &mut memory) {
                pairs.screened += 1;
            } else {
                candidates.push(q);
            }
        }
        let one = |work: &mut Work, &q: &usize| {
            if (self.stops)() {
                return (q, Exchange::default());
            }
            let exchange = exchange(&polygons[p], &polygons[q], Some(self.occluders), &self.settings.tolerance, work);
            (q, exchange)
        };
        let seen: Vec<(usize, Exchange)> = candidates.par_iter().map_init(Work::default, one).collect();
        pairs.integrated = seen.len() as u64;
        let seeing = || seen.iter().filter(|(_, exchange)| exchange.area > 0.0).map(|(q, _)| *q);
        pairs.seeing = seeing().count() as u64;
        let sample = (p.is_multiple_of(self.sample_step) && pairs.seeing > 0)
            .then(|| seeing().nth(scatter(p) % pairs.seeing as usize).map(|q| [p, q]))
            .flatten();
        let mut entries: Vec<Entry> = Vec::new();
        for (q, exchange) in seen.into_iter().filter(|(_, exchange)| *exchange != Exchange::default()) {
            let column = self.group_of[q];
            match entries.last_mut() {
                Some(last) if last.column == column => last.exchange.add(exchange),
                _ => entries.push(Entry { column, exchange }),
            }
        }
        PolygonRow { entries, pairs, sample }
    }

    /// The exchange area below which the pair's factors are too small from either side. Where a factor is a sum over
    /// several polygons, its parts may be small and it may not.
    fn least(&self, p: usize, q: usize) -> f64 {
        let single = |p: usize| self.faces.groups[self.group_of[p] as usize].polygons.len() == 1;
        let area = |p: usize| self.faces.polygons[p].area;
        if single(p) && single(q) { self.settings.least * area(p).min(area(q)) } else { 0.0 }
    }
}

/// A number that has nothing to do with `p` (Knuth's multiplicative hash), always the same.
fn scatter(p: usize) -> usize {
    ((p as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 33) as usize
}

impl Exchange {
    /// Adds another pair's exchange; errors add up as if all had one sign.
    pub(super) fn add(&mut self, other: Exchange) {
        self.area += other.area;
        self.error += other.error;
    }
}
