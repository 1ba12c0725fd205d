//! What the matrix says about itself: row sums, estimates, and whether factors computed both ways round agree.

use super::clip::keep_above;
use super::{Computed, Exchange, Faces, Occluders, Polygon, Row, Tolerance, Work, exchange};
use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;

/// Row sums Σⱼ Fᵢⱼ: 1 in closed scenes, below 1 where something sees out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct RowSums {
    /// The smallest.
    pub least: f64,
    /// Their mean.
    pub mean: f64,
    /// Their mean, each counted with its area.
    pub area_weighted_mean: f64,
    /// The largest. Above 1 by more than the estimate, surfaces overlap.
    pub most: f64,
    /// The largest distance from 1: of meaning for closed scenes.
    pub farthest_from_1: f64,
    /// Rows of which nothing is seen and that see nothing.
    pub empty: u64,
    /// The largest sum of a row's estimated errors.
    pub largest_error: f64,
    /// Sum of all factors' estimated errors.
    pub total_error: f64,
}

/// The audit as the rows go by.
#[derive(Clone, Debug)]
pub struct Auditor<'a> {
    faces: &'a Faces,
    sums: RowSums,
    rows: u64,
    area: f64,
    /// Values in the matrix that are not 0.
    pub values: u64,
}

impl<'a> Auditor<'a> {
    /// Before the first row.
    pub fn new(faces: &'a Faces) -> Auditor<'a> {
        let sums = RowSums { least: f64::INFINITY, ..RowSums::default() };
        Auditor { faces, sums, rows: 0, area: 0.0, values: 0 }
    }

    /// Takes a row into account.
    pub fn row(&mut self, row: &Row<'_>) {
        let mut whole = row.left_out;
        row.entries.iter().for_each(|entry| whole.add(entry.exchange));
        let area = self.faces.groups[row.number].area;
        let (sum, error) = (whole.area / area, whole.error / area);
        let s = &mut self.sums;
        (s.least, s.most) = (s.least.min(sum), s.most.max(sum));
        s.mean += sum;
        s.area_weighted_mean += whole.area;
        s.farthest_from_1 = s.farthest_from_1.max((sum - 1.0).abs());
        s.empty += u64::from(whole.area == 0.0);
        s.largest_error = s.largest_error.max(error);
        s.total_error += error;
        self.rows += 1;
        self.area += area;
        self.values += row.entries.iter().filter(|entry| entry.exchange.area > 0.0).count() as u64;
    }

    /// What the rows came to.
    pub fn sums(&self) -> RowSums {
        let RowSums { mean, area_weighted_mean, .. } = self.sums;
        RowSums { mean: mean / self.rows as f64, area_weighted_mean: area_weighted_mean / self.area, ..self.sums }
    }
}

/// Reciprocity A₁F₁₂ = A₂F₂₁ of a sample of pairs of polygons that see each other.
///
/// The matrix itself is reciprocal to the bit, because every pair is integrated once. So each pair of the sample is
/// integrated twice more: A₁F₁₂ with polygon 2 cut in two, A₂F₂₁ with polygon 1 cut in two. The two look at
/// different places of different pieces; their difference measures the integration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Reciprocity {
    /// Pairs in the sample.
    pub pairs: u64,
    /// Pairs whose factor, seen from the smaller polygon, is so large that the relative tolerance is in force.
    pub large: u64,
    /// Root mean square over those of |A₁F₁₂ − A₂F₂₁| as a share of the larger.
    pub relative_rms: f64,
    /// The largest share over those.
    pub relative_largest: f64,
    /// The largest difference as a factor seen from the smaller polygon.
    pub factor_largest: f64,
    /// Pairs whose difference is within the sum of the two estimates, or below the absolute tolerance.
    pub within_estimate: u64,
}

/// Integrates the pairs of the sample both ways round.
pub fn reciprocity(faces: &Faces, occluders: &Occluders, tolerance: &Tolerance, computed: &Computed) -> Reciprocity {
    let both_ways = |work: &mut Work, &[p, q]: &[usize; 2]| {
        let (a, b) = (&faces.polygons[p], &faces.polygons[q]);
        let mut in_two = |whole: &Polygon, cut: &Polygon, share: f64| {
            let mut sum = Exchange::default();
            cut_in_two(cut, share)
                .iter()
                .for_each(|part| sum.add(exchange(whole, part, Some(occluders), tolerance, work)));
            sum
        };
        // Different shares, because symmetric pairs cut alike would agree for that reason alone.
        (in_two(a, b, 0.5), in_two(b, a, 0.375), a.area.min(b.area))
    };
    let found: Vec<_> = computed.sample.par_iter().map_init(Work::default, both_ways).collect();
    let mut audit = Reciprocity { pairs: found.len() as u64, ..Reciprocity::default() };
    for (there, back, area) in &found {
        let (difference, larger) = ((there.area - back.area).abs(), there.area.max(back.area));
        let floor = tolerance.absolute * area;
        if tolerance.relative * larger >= floor {
            let share = difference / larger;
            audit.large += 1;
            audit.relative_rms += share * share;
            audit.relative_largest = audit.relative_largest.max(share);
        }
        audit.factor_largest = audit.factor_largest.max(difference / area);
        audit.within_estimate += u64::from(difference <= floor.max(there.error + back.error));
    }
    Reciprocity { relative_rms: (audit.relative_rms / audit.large.max(1) as f64).sqrt(), ..audit }
}

/// A polygon cut across its longest edge, this share of it from its start.
fn cut_in_two(polygon: &Polygon, share: f64) -> Vec<Polygon> {
    let corners = &polygon.corners;
    let edges = corners.iter().zip(corners.iter().cycle().skip(1)).map(|(&from, &to)| (from, to - from));
    let longer = |a: (DVec3, DVec3), b: (DVec3, DVec3)| if b.1.length_squared() > a.1.length_squared() { b } else { a };
    let Some((from, edge)) = edges.reduce(longer) else { return Vec::new() };
    let at = from + share * edge;
    let mut parts = Vec::new();
    for direction in [edge, -edge] {
        let mut kept = Vec::new();
        keep_above(corners, |p| (p - at).dot(direction), &mut kept);
        parts.extend(Polygon::new(kept, polygon.plane));
    }
    parts
}
