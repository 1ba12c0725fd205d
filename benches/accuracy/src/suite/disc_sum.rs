//! The disc sum of Wallace, Elmquist & Haines (1989) near a shooter and far from it, beside the exact contour.

use crate::method::clip::Corners;
use crate::method::disc_sum::{Cell, form_factor};
use crate::method::exact;
use crate::plot::{Plot, Series};
use crate::{Bound, Row, Section};
use glam::DVec3;

const TEXT: &str = "
From points to a square of 1 m. The disc sum takes the square's cells for discs, Σ cosθᵣ cosθₛ A/(πr² + A) over those that a ray
reaches; ours weighs the exact contour of the whole square by the visible share of the same sum. Receivers lie at
a distance from the square's plane, on a 5 × 5 grid of 1.6 m about its axis (*opposite*) or at its foot on a plane that is
perpendicular to it (*perpendicular*). The square is seen whole, or a
large screen half way hides the part of it on one side of a line, for each receiver sixteen lines of other places and slopes. Root mean
square of f − F over the F of the whole square, weighted by it.

Of a square seen whole ours is exact. Far away the two are the same; there the discs are good, and all that is left is the error of
the mask. The disc sum fails at distances below about the width of a cell.
";

/// Distances, in widths of the shooter.
const DISTANCES: [f64; 8] = [0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 20.0];

/// Cells along the side.
const SIDES: [u32; 4] = [1, 2, 4, 8];

/// A receiver.
struct Place {
    point: DVec3,
    normal: DVec3,
}

/// The shooter: a square of 1 m at z = 0, lit towards +z.
const SQUARE: [DVec3; 4] =
    [DVec3::new(-0.5, -0.5, 0.0), DVec3::new(0.5, -0.5, 0.0), DVec3::new(0.5, 0.5, 0.0), DVec3::new(-0.5, 0.5, 0.0)];

/// Both kinds of places at all distances, seen whole and in part.
pub fn measure() -> Section {
    let mut section =
        Section { title: "The disc sum near and far".into(), text: TEXT.trim().into(), ..Section::default() };
    let mut table = Vec::new();
    let kinds =
        [("opposite", opposite as fn(f64) -> Vec<Place>, OPPOSITE), ("perpendicular", perpendicular, PERPENDICULAR)];
    for (kind, places, measured) in kinds {
        for hidden in [false, true] {
            let seen = if hidden { "in part" } else { "whole" };
            let mut curves = Vec::new();
            for side in SIDES {
                let errors = DISTANCES.map(|distance| error(&places(distance), side, hidden));
                add_rows(
                    &mut section,
                    &format!("{kind}, seen {seen}, {} cells", side * side),
                    side,
                    &errors,
                    if hidden { IN_PART } else { measured[side.ilog2() as usize] },
                );
                for (method, index) in [("disc sum", 0), ("ours", 1)] {
                    // Of a square seen whole ours is exact: nothing to draw.
                    if index == 1 && !hidden {
                        continue;
                    }
                    let name = format!("{method}, {} cells", side * side);
                    let mut cells = vec![format!("{kind}, {seen}"), name.clone()];
                    cells.extend(errors.iter().map(|e| format!("{:.2} %", 100.0 * e[index])));
                    table.push(cells);
                    let points = DISTANCES.iter().zip(&errors).map(|(d, e)| [*d, e[index]]).collect();
                    curves.push(Series { name, points });
                }
            }
            section.plots.push(Plot {
                name: format!("disc_sum_{kind}_{}", if hidden { "hidden" } else { "whole" }),
                title: format!("Form factors of a square seen {seen}, {kind}"),
                axes: ["distance, widths of the square".into(), "rms error over F of the whole".into()],
                series: curves,
            });
        }
    }
    let mut headings = vec!["receivers".to_string(), "method".into()];
    headings.extend(DISTANCES.map(|d| format!("at {d}")));
    section.table = Some((headings, table));
    section
}

/// Rows for one number of cells: the square seen whole, the disc sum near and far; seen in part, both methods.
fn add_rows(section: &mut Section, case: &str, side: u32, errors: &[[f64; 2]; DISTANCES.len()], measured: [f64; 2]) {
    let at = |distance: f64| DISTANCES.iter().position(|d| *d == distance).map_or([f64::NAN; 2], |i| errors[i]);
    let mut add = |what: &str, expected: f64, found: f64, bound: Bound| {
        section.rows.push(Row { case: format!("{case}: {what}"), expected, found, bound });
    };
    let (near, far) = (at(0.1), at(5.0));
    if measured != IN_PART {
        add("disc sum at 0.1, as measured", measured[0], near[0], Bound::Relative(0.02));
        add("disc sum at 5, as measured", measured[1], far[0], Bound::Relative(0.02));
    } else {
        add("ours over the disc sum's at 0.1", 1.0, near[1] / near[0], Bound::AtMost);
        add("ours over the disc sum's at 5", 1.0, far[1] / far[0], Bound::Relative(0.02));
        // The largest error of a mask of M cells across one straight edge (DESIGN section 3).
        add("ours at 20, at most 1/(2√M)", 0.5 / f64::from(side), at(20.0)[1], Bound::AtMost);
    }
}

/// The disc sum's errors near and far, for 1, 4, 16 and 64 cells, as measured: it is not ours to improve.
const OPPOSITE: [[f64; 2]; 4] = [[0.8956, 6.451e-4], [0.8560, 1.8095e-4], [0.4323, 4.667e-5], [0.2114, 1.1759e-5]];
const PERPENDICULAR: [[f64; 2]; 4] = [[0.7927, 0.012936], [0.5298, 3.1197e-3], [0.2046, 7.732e-4], [0.0429, 1.9287e-4]];

/// Nothing is on record for squares seen in part.
const IN_PART: [f64; 2] = [0.0; 2];

/// Errors of the disc sum and of ours.
fn error(places: &[Place], side: u32, hidden: bool) -> [f64; 2] {
    let (mut sums, mut weight) = ([0.0; 2], 0.0);
    let lines = if hidden { 16 } else { 1 };
    for (place, line) in places.iter().flat_map(|place| (0..lines).map(move |line| (place, line))) {
        let screen: Option<Corners> = hidden.then(|| screen(place.point, line));
        let blockers = screen.as_slice();
        let expected = exact::form_factor(place.point, place.normal, &SQUARE, blockers);
        let whole = exact::form_factor(place.point, place.normal, &SQUARE, &[]);
        let cells = || {
            (0..side * side).map(|k| {
                let middle = |i: u32| (f64::from(i) + 0.5) / f64::from(side) - 0.5;
                let position = DVec3::new(middle(k % side), middle(k / side), 0.0);
                let above = place.normal.dot(position - place.point) > 0.0;
                let seen = above && blockers.iter().all(|screen| !hits(place.point, position, screen));
                Cell { position, area: f64::from(side * side).recip(), seen }
            })
        };
        let discs = form_factor(place.point, place.normal, DVec3::Z, cells());
        let all = form_factor(place.point, place.normal, DVec3::Z, cells().map(|cell| Cell { seen: true, ..cell }));
        for (sum, found) in sums.iter_mut().zip([discs, whole * discs / all]) {
            *sum += (found - expected).powi(2) / whole;
        }
        weight += whole;
    }
    sums.map(|sum| (sum / weight).sqrt())
}

/// Points that look at the square's plane.
fn opposite(distance: f64) -> Vec<Place> {
    let step = |k: usize| 0.4 * k as f64 - 0.8 + 0.013;
    (0..25).map(|k| Place { point: DVec3::new(step(k % 5), step(k / 5), distance), normal: DVec3::NEG_Z }).collect()
}

/// Points on the plane at the square's lower edge, looking up along it.
fn perpendicular(distance: f64) -> Vec<Place> {
    (0..25)
        .map(|k| {
            let x = f64::from(k) * 1.6 / 24.0 - 0.8 + 0.013;
            Place { point: DVec3::new(x, -0.5, distance), normal: DVec3::Y }
        })
        .collect()
}

/// A screen half way between the receiver and the square's plane. Its edge, seen from the receiver, runs across the square,
/// `line` after line elsewhere.
fn screen(point: DVec3, line: u32) -> Corners {
    let golden = |g: f64| (0.5 + g * f64::from(line)).fract();
    let (sine, cosine) = (std::f64::consts::TAU * golden(0.754_877_666)).sin_cos();
    let (along, away) = (DVec3::new(cosine, sine, 0.0), DVec3::new(-sine, cosine, 0.0));
    let edge = 0.7 * (golden(0.569_840_291) - 0.5) * away;
    [edge - 9.0 * along, edge + 9.0 * along, edge + 9.0 * along + 9.0 * away, edge - 9.0 * along + 9.0 * away]
        .map(|corner| (corner + point) / 2.0)
        .to_vec()
}

/// Whether the way from one point to another meets a screen that [`screen`] made, which lies half way.
fn hits(from: DVec3, to: DVec3, screen: &[DVec3]) -> bool {
    let at = (from + to) / 2.0;
    (0..4).all(|k| (screen[(k + 1) % 4] - screen[k]).cross(at - screen[k]).z >= 0.0)
}
