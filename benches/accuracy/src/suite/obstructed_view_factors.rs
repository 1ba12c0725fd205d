//! View factors with something between.

use crate::view_factor::cases::cases;
use crate::view_factor::references::REFERENCES;
use crate::view_factor::view3d::{Example, FACET, GUNTER};
use crate::{Bound, Row, Section};
use glam::DVec3;
use ringlight::view_factor::{Exchange, Occluder, Occluders, Polygon, Tolerance, Work, exchange};
use ringlight_visibility::NO_PLANE;
use std::f64::consts::PI;

/// What is asked of every value.
const BOUND: Bound = Bound::Larger { relative: 2e-3, absolute: 1e-5 };

/// How often the estimate of the error held, among pairs that see each other past something.
#[derive(Default)]
struct Estimates {
    all: u32,
    wrong: u32,
}

impl Estimates {
    /// Counts one; `doubt` is how far off the reference may be.
    fn count(&mut self, found: f64, estimate: f64, expected: f64, doubt: f64) {
        self.all += 1;
        self.wrong += u32::from((found - expected).abs() > estimate + doubt);
    }

    fn row(&self, which: &str) -> Row {
        Row {
            case: format!("share of the {} error estimates that are too small, {which}", self.all),
            expected: 0.05,
            found: f64::from(self.wrong) / f64::from(self.all),
            bound: Bound::AtMost,
        }
    }
}

/// Cases of all kinds, published tables, enclosures.
pub fn measure() -> Section {
    let mut section = Section {
        title: "View factors with occluders".into(),
        text: "The kernel of `ringlight viewfactors` at the default tolerance. *Cases*: beside plain ray casting by the example \
               `obstructed_reference`. *Exact*: for the half screen half of the closed form, \
               by symmetry; for the screen from plane to plane two closed forms; for the square obstruction exact clipping with \
               adaptive quadrature, 1e-6. `facet` and `gunter`: example inputs of NIST's View3D, their factors computed independently \
               with exact visibility, 1e-5; the worst value of each row is shown, and what the rows add up to. *Error estimates* are counted once for a pair, and only \
               where something stands between two that see each other."
            .into(),
        ..Section::default()
    };
    let (mut estimates, mut work) = (Estimates::default(), Work::default());
    let cases = cases();
    assert!(cases.iter().map(|c| c.name.as_str()).eq(REFERENCES.iter().map(|r| r.0)), "references are of other cases");
    for (case, &(_, expected, doubt)) in cases.iter().zip(REFERENCES) {
        let [a, b] = case.pair.clone().map(|corners| Polygon::new(corners, NO_PLANE).expect("it has an area"));
        let found = obstructed(&a, &b, &case.occluders, &mut work);
        let (factor, estimate) = (found.area / a.area, found.error / a.area);
        let open = exchange(&a, &b, None, &Tolerance::default(), &mut work);
        if expected > 0.0 && found.area != open.area {
            estimates.count(factor, estimate, expected, 2.0 * doubt);
        }
        section.rows.push(Row { case: case.name.clone(), expected, found: factor, bound: BOUND });
        let exact = match case.name.as_str() {
            "half screen, halfway" => 0.1998248956983874 / 2.0,
            "quarter screen of View3D's square obstruction" => 0.149869,
            // Each part of the floor sees the part of the ceiling on its side.
            "upright screen from plane to plane" => parallel(0.4, 1.0, 1.0) * 0.4 + parallel(0.6, 1.0, 1.0) * 0.6,
            _ => continue,
        };
        section.rows.push(Row { case: format!("{}: exact", case.name), expected: exact, found: factor, bound: BOUND });
    }
    section.rows.push(estimates.row("cases"));
    for example in [FACET, GUNTER] {
        enclosure(&example, &mut section, &mut estimates, &mut work);
    }
    section.rows.push(estimates.row("cases and tables"));
    section
}

/// Howell C-11: aligned parallel rectangles a × b at distance c.
fn parallel(a: f64, b: f64, c: f64) -> f64 {
    let (x, y) = (a / c, b / c);
    let (p, q) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
    let log = (p * p * q * q / (1.0 + x * x + y * y)).sqrt().ln();
    2.0 / (PI * x * y) * (log + x * q * (x / q).atan() + y * p * (y / p).atan() - x * x.atan() - y * y.atan())
}

fn obstructed(a: &Polygon, b: &Polygon, triangles: &[[DVec3; 3]], work: &mut Work) -> Exchange {
    let occluders = triangles.iter().map(|&corners| Occluder { corners, plane: NO_PLANE }).collect();
    exchange(a, b, Some(&Occluders::new(occluders)), &Tolerance::default(), work)
}

/// A row for each surface of an enclosure: the value that is farthest from the table's, in units of what is allowed.
fn enclosure(example: &Example, section: &mut Section, estimates: &mut Estimates, work: &mut Work) {
    let polygons: Vec<Polygon> = example
        .surfaces
        .iter()
        .map(|(_, corners, _)| {
            Polygon::new(corners.map(|k| DVec3::from(example.vertices[k])).into(), NO_PLANE).expect("it has an area")
        })
        .collect();
    let triangles = |p: &Polygon| {
        [[0, 1, 2], [0, 2, 3]].map(|t| Occluder { corners: t.map(|k: usize| p.corners[k]), plane: NO_PLANE })
    };
    let occluders = Occluders::new(polygons.iter().flat_map(triangles).collect());
    // Surfaces that are counted with another one share its row and column.
    let counted: Vec<usize> = (0..polygons.len()).filter(|&k| example.surfaces[k].2 == k).collect();
    let parts = |of: usize| (0..polygons.len()).filter(move |&k| example.surfaces[k].2 == of);
    for (&from, table) in counted.iter().zip(example.factors) {
        let area: f64 = parts(from).map(|k| polygons[k].area).sum();
        let mut worst: Option<Row> = None;
        let mut row_sum = 0.0;
        for (&to, &expected) in counted.iter().zip(*table) {
            let (mut sum, mut error, mut open) = (0.0, 0.0, 0.0);
            for (i, j) in parts(from).flat_map(|i| parts(to).map(move |j| (i, j))).filter(|(i, j)| i != j) {
                let found = exchange(&polygons[i], &polygons[j], Some(&occluders), &Tolerance::default(), work);
                (sum, error) = (sum + found.area / area, error + found.error / area);
                open += exchange(&polygons[i], &polygons[j], None, &Tolerance::default(), work).area / area;
            }
            // Once for both directions; what nothing stands before has the closed form's value to the bit.
            if from < to && expected > 0.0 && sum != open {
                estimates.count(sum, error, expected, 1e-5);
            }
            row_sum += sum;
            let case = format!("{}: {} to {}", example.name, example.surfaces[from].0, example.surfaces[to].0);
            let row = Row { case, expected, found: sum, bound: BOUND };
            let off = |row: &Row| (row.found - row.expected).abs() / (2e-3 * row.expected).max(1e-5);
            if worst.as_ref().is_none_or(|w| off(&row) > off(w)) {
                worst = Some(row);
            }
        }
        section.rows.extend(worst);
        let case = format!("{}: sum of the row of {}", example.name, example.surfaces[from].0);
        section.rows.push(Row { case, expected: 1.0, found: row_sum, bound: Bound::Relative(1e-3) });
    }
}
