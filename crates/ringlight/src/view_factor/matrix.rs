//! All factors of a scene, row by row: every pair of polygons once, on all threads, in bounded memory.

use super::assembly::Assembly;
use super::facing::Stance;
use super::screens::{Memory, Screens};
use super::spill::{Entry, Storage};
use super::{Exchange, Faces, Occluders, Tolerance, Work, exchange};
use crate::transport::{Communicator, Failure};
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

/// Who watches a rank's work.
pub struct Watch<'w> {
    /// Called now and then, on rank 0.
    pub progress: &'w mut dyn FnMut(&Pairs),
    /// Asked before every pair: whether to stop.
    pub stops: &'w (dyn Fn() -> bool + Sync),
}

/// What [`compute`] did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Computed {
    /// Counts.
    pub pairs: Pairs,
    /// Pairs of polygons that see each other, chosen by their numbers, for tests of what was computed.
    pub sample: Vec<[usize; 2]>,
}

/// Tag of rows on their way to rank 0.
const VIEW_FACTORS: u32 = 70;

/// Rows of polygons of a rank between two signs of life. Within a row pairs are shared out to the threads, too.
const BATCH: usize = 16;

/// Most rows that give a pair to the sample.
const SAMPLED_ROWS: usize = 64;

/// Computes all factors and hands over the rows in order.
///
/// Every rank calls it with the same faces, and computes rows of polygons: rank i of N those whose number is i modulo N. Rank
/// 0 puts them together, hands over the rows, and alone gets the result. What later rows need waits in its `storage`, so that
/// memory stays bounded. When any rank's watch stops, the result is none. The numbers do not depend on the number of threads
/// or ranks, or on what waits.
pub fn compute(
    faces: &Faces,
    occluders: &Occluders,
    settings: &MatrixSettings,
    storage: &mut dyn Storage,
    rows: &mut dyn FnMut(Row<'_>) -> io::Result<()>,
    watch: Watch<'_>,
    ranks: &mut Communicator<'_>,
) -> Result<io::Result<Option<Computed>>, Failure> {
    let Watch { progress, stops } = watch;
    let matrix = Matrix::new(faces, occluders, settings, stops);
    let polygons = faces.polygons.len();
    let mut computed = Computed::default();
    computed.pairs.total = (polygons as u64 * polygons.saturating_sub(1) as u64) / 2;
    let mut assembly = Assembly::new(faces, settings.least, storage, rows);
    let (rank, size) = (ranks.rank(), ranks.size());
    let in_batch = BATCH * size;
    let part = |batch: usize| {
        let end = polygons.min((batch + 1) * in_batch);
        let own: Vec<usize> = (batch * in_batch + rank..end).step_by(size).collect();
        let parts: Vec<PolygonRow> =
            if stops() { Vec::new() } else { own.into_par_iter().map(|p| matrix.polygon_row(p)).collect() };
        let mut bytes = vec![u8::from(stops())];
        parts.iter().for_each(|part| part.write(&mut bytes));
        bytes
    };
    let mut stopped = false;
    let take = |batch: usize, parts: Vec<Vec<u8>>| {
        progress(&computed.pairs);
        stopped = parts.iter().any(|part| part.first() != Some(&0));
        if stopped {
            return Err(io::ErrorKind::Interrupted.into());
        }
        let mut parts: Vec<&[u8]> = parts.iter().map(|part| &part[1..]).collect();
        for p in batch * in_batch..polygons.min((batch + 1) * in_batch) {
            let part = PolygonRow::read(&mut parts[p % size]);
            let part = part.ok_or_else(|| io::Error::other("a row from another rank is cut off"))?;
            computed.pairs.add(&part.pairs);
            computed.sample.extend(part.sample);
            assembly.add(p, &part.entries)?;
        }
        Ok(())
    };
    let taken = ranks.gather_batches(VIEW_FACTORS, polygons.div_ceil(in_batch), part, take)?;
    Ok(match taken {
        _ if rank > 0 || stopped => Ok(None),
        taken => taken.and_then(|()| assembly.finish()).map(|()| Some(computed)),
    })
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

/// Words of a row of a polygon before its entries: counts, sample, number of entries.
const HEAD: usize = 9;

/// In place of a sample: there is none.
const NO_SAMPLE: u64 = u64::MAX;

impl PolygonRow {
    /// Appends it as it travels.
    fn write(&self, bytes: &mut Vec<u8>) {
        let Pairs { total: _, done, turned_away, below_least, screened, integrated, seeing } = self.pairs;
        let [a, b] = self.sample.map_or([NO_SAMPLE; 2], |sample| sample.map(|p| p as u64));
        let head = [done, turned_away, below_least, screened, integrated, seeing, a, b, self.entries.len() as u64];
        bytes.extend_from_slice(bytemuck::cast_slice(&head));
        for Entry { column, exchange } in &self.entries {
            let words = [u64::from(*column), exchange.area.to_bits(), exchange.error.to_bits()];
            bytes.extend_from_slice(bytemuck::cast_slice(&words));
        }
    }

    /// Takes the next one off some bytes; none if they are cut off.
    fn read(bytes: &mut &[u8]) -> Option<PolygonRow> {
        let mut words = |count: usize| {
            let (words, rest) = bytes.split_at_checked(count.checked_mul(8)?)?;
            *bytes = rest;
            Some(bytemuck::pod_collect_to_vec::<u8, u64>(words))
        };
        let [done, turned_away, below_least, screened, integrated, seeing, a, b, count] = words(HEAD)?[..] else {
            return None;
        };
        let entries = words((count as usize).checked_mul(3)?)?;
        let entry = |&[column, area, error]: &[u64; 3]| {
            let exchange = Exchange { area: f64::from_bits(area), error: f64::from_bits(error) };
            Entry { column: column as u32, exchange }
        };
        let pairs = Pairs { total: 0, done, turned_away, below_least, screened, integrated, seeing };
        let sample = (a != NO_SAMPLE).then_some([a as usize, b as usize]);
        Some(PolygonRow { entries: entries.as_chunks().0.iter().map(entry).collect(), pairs, sample })
    }
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
