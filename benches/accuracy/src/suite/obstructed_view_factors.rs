//! View factors with something between.

use crate::view_factor::cases::cases;
use crate::view_factor::references::REFERENCES;
use crate::view_factor::view3d::{Example, FACET, GUNTER};
use crate::{Bound, Row, Section};
use glam::DVec3;
use ringlight::view_factor::{Exchange, Occluder, Occluders, Polygon, Tolerance, Work, exchange};
use ringlight_visibility::NO_PLANE;

/// What is asked of every value.
const BOUND: Bound = Bound::Larger { relative: 2e-3, absolute: 1e-5 };

/// How often the estimate of the error held.
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
}

/// Cases of all kinds, published tables, enclosures.
pub fn measure() -> Section {
    let mut section = Section {
        title: "View factors with occluders".into(),
        text: "The kernel of `ringlight viewfactors` at the default tolerance. *Cases*: beside plain ray casting by the example \
               `obstructed_reference`. *Square obstruction*: exact clipping with adaptive quadrature, 1e-6. *Half screen*: half of the \
               closed form, by symmetry. `facet` and `gunter`: example inputs of NIST's View3D, their factors computed independently \
               with exact visibility, 1e-5; the worst value of each row is shown."
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
        estimates.count(factor, estimate, expected, 2.0 * doubt);
        section.rows.push(Row { case: case.name.clone(), expected, found: factor, bound: BOUND });
        let exact = match case.name.as_str() {
            "half screen, halfway" => ("half screen: half of the closed form", 0.1998248956983874 / 2.0),
            "quarter screen of View3D's square obstruction" => ("View3D's square obstruction, exact clipping", 0.149869),
            _ => continue,
        };
        section.rows.push(Row { case: exact.0.into(), expected: exact.1, found: factor, bound: BOUND });
    }
    for example in [FACET, GUNTER] {
        enclosure(&example, &mut section, &mut estimates, &mut work);
    }
    section.rows.push(Row {
        case: format!("share of the {} error estimates that are too small", estimates.all),
        expected: 0.05,
        found: f64::from(estimates.wrong) / f64::from(estimates.all),
        bound: Bound::AtMost,
    });
    section
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
        for (&to, &expected) in counted.iter().zip(*table) {
            let (mut sum, mut error) = (0.0, 0.0);
            for (i, j) in parts(from).flat_map(|i| parts(to).map(move |j| (i, j))).filter(|(i, j)| i != j) {
                let found = exchange(&polygons[i], &polygons[j], Some(&occluders), &Tolerance::default(), work);
                (sum, error) = (sum + found.area / area, error + found.error / area);
            }
            estimates.count(sum, error, expected, 1e-5);
            let case = format!("{}: {} to {}", example.name, example.surfaces[from].0, example.surfaces[to].0);
            let row = Row { case, expected, found: sum, bound: BOUND };
            let off = |row: &Row| (row.found - row.expected).abs() / (2e-3 * row.expected).max(1e-5);
            if worst.as_ref().is_none_or(|w| off(&row) > off(w)) {
                worst = Some(row);
            }
        }
        section.rows.extend(worst);
    }
}
