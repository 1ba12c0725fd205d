//! Whole matrices by the way that `ringlight viewfactors` goes: scene → faces → rows.

use crate::scene::Material;
use crate::view_factor::view3d::{Example, FACET, GUNTER};
use crate::{Bound, Row, Section};
use ringlight::resources::{Bytes, Resources};
use ringlight::scene::{self, ReadOptions, Scene};
use ringlight::transport::Communicator;
use ringlight::view_factor::{self, Auditor, Faces, MatrixSettings, Occluders, Per, Reciprocity, RowSums, Sides};
use ringlight::view_factor::{Tolerance, Watch};
use std::fmt::Write;
use std::io::{self, Cursor};
use std::path::Path;

/// A scene's factors, and what they say about themselves.
struct Matrix {
    names: Vec<String>,
    factors: Vec<Vec<f64>>,
    errors: Vec<Vec<f64>>,
    sums: RowSums,
    reciprocity: Reciprocity,
}

/// View3D's examples, and our own scenes.
pub fn measure() -> Section {
    let mut section = Section {
        title: "Matrices of view factors".into(),
        text: "Scene → faces → rows, as `ringlight viewfactors` does it. *View3D*: its examples as OBJ text, objects by name, at the \
               default tolerance; the value that is farthest off in each, and `so` (two squares, a quarter as large a one halfway) \
               beside closed forms. *Own scenes*, objects and a tolerance of 1 %: sums of the rows of closed scenes; reciprocity of \
               pairs that are integrated twice more, once with each of the two cut in two."
            .into(),
        ..Section::default()
    };
    for example in [FACET, GUNTER] {
        compare(&example, &mut section);
    }
    square_obstruction(&mut section);
    for (file, closed) in [("furnace.glb", true), ("gallery.glb", false), ("cornell_box.obj", false)] {
        own_scene(file, closed, &mut section);
    }
    section
}

/// Within 0.2 % or 0.00001, as everything obstructed.
const BOUND: Bound = Bound::Larger { relative: 2e-3, absolute: 1e-5 };

fn compare(example: &Example, section: &mut Section) {
    let mut obj = String::new();
    for [x, y, z] in example.vertices {
        writeln!(obj, "v {x} {y} {z}").unwrap();
    }
    for (_, corners, counted_with) in example.surfaces {
        let [a, b, c, d] = corners.map(|k| k + 1);
        writeln!(obj, "g {}\nf {a} {b} {c} {d}", example.surfaces[*counted_with].0).unwrap();
    }
    let scene = read_text(obj);
    let [matrix, open] = [true, false].map(|obstructed| matrix(&scene, Tolerance::default(), obstructed));
    assert_eq!(matrix.names.len(), example.factors.len());
    let mut worst: Option<Row> = None;
    let (mut all, mut wrong) = (0, 0);
    for (i, table) in example.factors.iter().enumerate() {
        for (j, &expected) in table.iter().enumerate() {
            let case = format!("{}: {} to {}", example.name, matrix.names[i], matrix.names[j]);
            let row = Row { case, expected, found: matrix.factors[i][j], bound: BOUND };
            let off = |row: &Row| (row.found - row.expected).abs() / (2e-3 * row.expected).max(1e-5);
            // Once for both directions of what sees each other past something: unobstructed pairs are exact whatever is estimated.
            if i < j && expected > 0.0 && row.found != open.factors[i][j] {
                all += 1;
                wrong += u32::from((row.found - expected).abs() > matrix.errors[i][j] + 1e-5);
            }
            if worst.as_ref().is_none_or(|w| off(&row) > off(w)) {
                worst = Some(row);
            }
        }
    }
    section.rows.extend(worst);
    let (case, found) =
        (format!("{}: share of {all} estimates too small", example.name), f64::from(wrong) / f64::from(all));
    section.rows.push(Row { case, expected: 0.05, found, bound: Bound::AtMost });
    self_consistent(example.name, &matrix, Some(1e-3), section);
}

/// `so.vs3`: unit squares a (z = 0) and b (z = 1) that face each other, and c, half their size, halfway over a corner of a.
fn square_obstruction(section: &mut Section) {
    let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n\
                v 0 0 .5\nv .5 0 .5\nv .5 .5 .5\nv 0 .5 .5\n\
                g a\nf 1 2 3 4\ng b\nf 7 6 5 8\ng c\nf 9 10 11 12\n";
    let found = matrix(&read_text(text.into()), Tolerance::default(), true).factors;
    // Of the middles of segments from a to b a quarter lies in c, whatever the segment's direction. c sees b as a quarter of
    // a would from half the height, and by symmetry that is what all of a would see: Howell C-11 for squares of sides 1, 1 apart
    // and 1/2 apart.
    let (near, far) = (0.415_253_283_5, 0.199_824_895_698_387_33);
    for (case, expected, found) in [
        ("so: a to b, 3/4 of C-11", 0.75 * far, found[0][1]),
        ("so: c to b, C-11", near, found[2][1]),
        ("so: a to c", 0.0, found[0][2]),
    ] {
        section.rows.push(Row { case: case.into(), expected, found, bound: BOUND });
    }
}

fn own_scene(file: &str, closed: bool, section: &mut Section) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes").join(file);
    let bytes = std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let scene = scene::read(file, Bytes::new(bytes), &Beside(path), &ReadOptions::default()).unwrap();
    let tolerance = Tolerance { relative: 1e-2, absolute: 5e-5 };
    self_consistent(file, &matrix(&scene, tolerance, true), closed.then_some(1e-2), section);
}

/// Rows for what holds of every scene, and for closed ones how far their rows may be off 1.
fn self_consistent(name: &str, matrix: &Matrix, closed: Option<f64>, section: &mut Section) {
    let mut row = |case: &str, expected: f64, found: f64, bound: Bound| {
        section.rows.push(Row { case: format!("{name}: {case}"), expected, found, bound });
    };
    match closed {
        Some(share) => row("farthest row sum from 1", share, matrix.sums.farthest_from_1, Bound::AtMost),
        None => row("largest row sum", 1.0 + matrix.sums.largest_error, matrix.sums.most, Bound::AtMost),
    }
    let Reciprocity { pairs, within_estimate, relative_rms, .. } = matrix.reciprocity;
    let outside = (pairs - within_estimate) as f64 / pairs as f64;
    row("share of pairs whose reciprocity is off by more than estimates and floor", 0.05, outside, Bound::AtMost);
    row("reciprocity of the larger factors, rms", 1e-2, relative_rms, Bound::AtMost);
}

/// The factors with what the scene's faces hide, or with nothing hidden.
fn matrix(scene: &Scene, tolerance: Tolerance, obstructed: bool) -> Matrix {
    let faces = Faces::new(scene, Per::Object, Sides::Front).unwrap();
    let occluders = Occluders::new(if obstructed { faces.blockers.clone() } else { Vec::new() });
    let side = faces.groups.len();
    let (mut factors, mut errors) = (vec![vec![0.0; side]; side], vec![vec![0.0; side]; side]);
    let mut auditor = Auditor::new(&faces);
    let mut rows = |row: view_factor::Row<'_>| {
        auditor.row(&row);
        for entry in row.entries {
            let area = faces.groups[row.number].area;
            factors[row.number][entry.column as usize] = entry.exchange.area / area;
            errors[row.number][entry.column as usize] = entry.exchange.error / area;
        }
        Ok(())
    };
    let settings = MatrixSettings { tolerance, least: 0.0 };
    let mut storage = Cursor::new(Vec::new());
    let watch = Watch { progress: &mut |_| {}, stops: &|| false };
    let ranks = &mut Communicator::alone();
    let computed = view_factor::compute(&faces, &occluders, &settings, &mut storage, &mut rows, watch, ranks);
    let computed = computed.expect("one rank does not fail").unwrap().unwrap();
    let reciprocity = view_factor::reciprocity(&faces, &occluders, &tolerance, &computed);
    let names = faces.groups.iter().map(|group| group.name.clone()).collect();
    Matrix { names, sums: auditor.sums(), reciprocity, factors, errors }
}

fn read_text(obj: String) -> Scene {
    scene::read("example.obj", Bytes::new(obj.into_bytes()), &Material(String::new()), &ReadOptions::default()).unwrap()
}

/// The files beside a scene of ours.
struct Beside(std::path::PathBuf);

impl Resources for Beside {
    fn read(&self, path: &str) -> io::Result<Bytes> {
        std::fs::read(self.0.with_file_name(path)).map(Bytes::new)
    }
}
