//! View factors with nothing between, beside closed forms.

use crate::view_factor::shapes::{cylinder, disc, extrapolated, leaning, level, open, polygon, sphere};
use crate::{Bound, Row, Section};
use glam::DVec3;
use ringlight::form_factor;
use ringlight::view_factor::Polygon;

/// What closed forms with 16 digits are held to; what is needed is 1e-7.
const EXACT: Bound = Bound::Relative(1e-10);
/// Where the reference itself has ten to twelve digits.
const TEN_DIGITS: Bound = Bound::Relative(1e-9);
/// Curved shapes and endless ones, extrapolated.
const EXTRAPOLATED: Bound = Bound::Relative(1e-4);

/// Polygons, then refined polygons.
pub fn measure() -> Section {
    let mut section = Section {
        title: "View factors of polygons".into(),
        text: "The kernel of `ringlight viewfactors` with nothing in the way, at the default tolerance. C and B are the numbers of \
               J. R. Howell's *Catalog of Radiation Heat Transfer Configuration Factors*, evaluated with 30 digits; angles: closed \
               form and adaptive contour agree to 1e-9. Curved shapes are polygons with ever more corners, endless strips ever longer \
               ones, extrapolated from two sizes."
            .into(),
        ..Section::default()
    };
    let mut row = |case: &str, expected: f64, found: f64, bound: Bound| {
        section.rows.push(Row { case: case.into(), expected, found, bound });
    };
    polygons(&mut row);
    extremes(&mut row);
    elements(&mut row);
    curved(&mut row);
    section
}

fn polygons(row: &mut impl FnMut(&str, f64, f64, Bound)) {
    let unit = [0.0, 1.0];
    let square = level(unit, unit, 0.0, true);
    let above = |d: f64| level(unit, unit, d, false);
    row("C-11 unit squares, distance 1", 0.1998248956983874, open(&square, &above(1.0)), EXACT);
    let long = open(&level([0.0, 2.0], unit, 0.0, true), &level([0.0, 2.0], unit, 1.0, false)) / 2.0;
    row("C-11 rectangles 2 × 1, distance 1", 0.2858753848507147, long, EXACT);
    row("C-11 unit squares, distance 10", 0.003162056838757602, open(&square, &above(10.0)), EXACT);
    row(
        "unit squares, distance 1, offset by 1",
        0.08605048915232734,
        open(&square, &level([1.0, 2.0], unit, 1.0, false)),
        EXACT,
    );
    row("C-14 unit squares with a common edge", 0.2000437760754032, open(&square, &leaning(1.0, 1.0, 90.0)), EXACT);
    let floor = level([0.0, 2.0], unit, 0.0, true);
    row("C-14 l = 1, w = 2, h = 3", 0.1616940143330276, open(&floor, &leaning(1.0, 3.0, 90.0)) / 2.0, EXACT);
    for (degrees, expected) in [
        (30.0, 0.619028323091),
        (60.0, 0.370905321150),
        (90.0, 0.200043776075),
        (120.0, 0.086615001118),
        (150.0, 0.021345325413),
    ] {
        let case = format!("C-16-type unit squares with a common edge at {degrees}°");
        row(&case, expected, open(&square, &leaning(1.0, 1.0, degrees)), TEN_DIGITS);
    }
    // Three faces of a closed body share all that leaves the fourth.
    let corners = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
    let [a, b] = [[0, 1, 2], [0, 2, 3]].map(|face| polygon(face.map(|k: usize| corners[k])));
    let (a, b) = if (a.corners[0].dot(a.normal)) > 0.0 { (back(&a), back(&b)) } else { (a, b) };
    row("regular tetrahedron, inside", 1.0 / 3.0, open(&a, &b) / a.area, EXACT);
    let faces = inside_of_a_box([1.0, 2.0, 3.0]);
    row("box 1 × 2 × 3: from 1 × 2 to 1 × 3", 0.1616940143330276, open(&faces[4], &faces[2]) / faces[4].area, EXACT);
    for (k, from) in faces.iter().enumerate() {
        let sum: f64 = faces.iter().map(|to| open(from, to)).sum::<f64>() / from.area;
        row(&format!("box 1 × 2 × 3: sum of row {}", k + 1), 1.0, sum, TEN_DIGITS);
    }
}

/// The polygon from behind.
fn back(p: &Polygon) -> Polygon {
    Polygon::new(p.corners.iter().rev().copied().collect(), p.plane).expect("it has an area")
}

/// Pairs of opposite faces, normals inward, along x, y and z.
fn inside_of_a_box(size: [f64; 3]) -> Vec<Polygon> {
    let mut faces = Vec::new();
    for axis in 0..3 {
        let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
        for high in [false, true] {
            let corner = |u: f64, v: f64| {
                let mut p = [0.0; 3];
                (p[axis], p[i], p[j]) = (if high { size[axis] } else { 0.0 }, u * size[i], v * size[j]);
                p
            };
            let face = polygon([corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)]);
            faces.push(if high { back(&face) } else { face });
        }
    }
    faces
}

/// Moved far, scaled, thin.
fn extremes(row: &mut impl FnMut(&str, f64, f64, Bound)) {
    let place = |p: &Polygon, scale: f64, offset: DVec3| {
        Polygon::new(p.corners.iter().map(|&c| scale * c + offset).collect(), p.plane).expect("it has an area")
    };
    let (floor, wall) = (level([0.0, 1.0], [0.0, 1.0], 0.0, true), leaning(1.0, 1.0, 90.0));
    for scale in [1e-3, 1e5] {
        let found = open(&place(&floor, scale, DVec3::ZERO), &place(&wall, scale, DVec3::ZERO)) / (scale * scale);
        row(&format!("C-14 unit squares with a common edge, times {scale:e}"), 0.2000437760754032, found, EXACT);
    }
    // The corners themselves are rounded to 1e-12 of the size there.
    let offset = DVec3::new(10_000.1, -10_000.2, 10_000.3);
    let found = open(&place(&floor, 1.0, offset), &place(&wall, 1.0, offset));
    row("C-14 unit squares with a common edge, 10 km away", 0.2000437760754032, found, TEN_DIGITS);
    // F of a wall with a gap below: the difference of two closed forms, of which nine digits are left.
    for gap in [1e-3, 1e-6] {
        let gone = open(&floor, &leaning(1.0, gap, 90.0));
        let rest = open(&floor, &polygon([[0.0, 0.0, gap], [0.0, 1.0, gap], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]]));
        row(&format!("C-14 unit squares, cut at {gap:e}: the parts' sum"), 0.2000437760754032, gone + rest, EXACT);
    }
    for width in [1e-3, 1e-6] {
        let needle = level([0.0, 1.0], [0.0, width], 0.0, true);
        let whole = open(&needle, &level([0.0, 1.0], [0.0, 1.0], width, false));
        let parts: f64 = (0..8)
            .map(|k| {
                let y = [f64::from(k) / 8.0, f64::from(k + 1) / 8.0];
                open(&needle, &level([0.0, 1.0], y, width, false))
            })
            .sum();
        row(
            &format!("needle 1 × {width:e} under a square at its width: share of its parts"),
            1.0,
            parts / whole,
            TEN_DIGITS,
        );
    }
}

/// Factors from a point, `form_factor::contour` and `form_factor::polygon`.
fn elements(row: &mut impl FnMut(&str, f64, f64, Bound)) {
    let at =
        |corners: [[f64; 3]; 4], normal: DVec3| form_factor::contour(DVec3::ZERO, normal, &corners.map(DVec3::from));
    let rectangle = |low: f64, high: f64| [[low, low, 1.0], [high, low, 1.0], [high, high, 1.0], [low, high, 1.0]];
    row(
        "element parallel to a unit square at 1, under its corner",
        0.138531605994893,
        at(rectangle(0.0, 1.0), DVec3::Z),
        EXACT,
    );
    row(
        "element parallel to a unit square at 1, under its centre",
        0.2394564704607735,
        at(rectangle(-0.5, 0.5), DVec3::Z),
        EXACT,
    );
    row(
        "element upright to a unit square at 1, under its corner",
        0.0557341970025535,
        at(rectangle(0.0, 1.0), DVec3::X),
        EXACT,
    );
    let point = |n: u32| form_factor::polygon(&disc(1.0, 1.0, false, n).corners, DVec3::Z);
    row("B-12 element to disc, r = 1, h = 1", 0.5, extrapolated(64, 2, point), EXTRAPOLATED);
    // The rim that is seen, 60° from the axis, is a ring of corners.
    let centre = DVec3::new(0.0, 0.0, 2.0);
    let ball = |n: u32| -> f64 {
        sphere(1.0, true, 24, n)
            .iter()
            .map(|face| {
                let corners: Vec<DVec3> = face.corners.iter().map(|&c| c - centre).collect();
                let seen = corners[0].dot(face.normal) < 0.0;
                if seen { form_factor::polygon(&corners, -DVec3::Z) } else { 0.0 }
            })
            .sum()
    };
    row("element facing a sphere, R = 1, d = 2", 0.25, extrapolated(48, 2, ball), EXTRAPOLATED);
}

fn curved(row: &mut impl FnMut(&str, f64, f64, Bound)) {
    let discs = |below: f64| {
        move |n: u32| {
            let from = disc(below, 0.0, true, n);
            open(&from, &disc(1.0, 1.0, false, n)) / from.area
        }
    };
    row("C-40 discs r = 1 and 1, h = 1", 0.3819660112501052, extrapolated(32, 2, discs(1.0)), EXTRAPOLATED);
    row("C-41 discs r = 2 and 1, h = 1", 0.1909830056250526, extrapolated(32, 2, discs(2.0)), EXTRAPOLATED);
    let within = |n: u32| {
        let walls = cylinder(1.0, 2.0, n);
        walls.iter().map(|to| open(&walls[0], to)).sum::<f64>() / walls[0].area
    };
    row("cylinder r = 1, h = 2: inner wall to itself", 0.585786437626905, extrapolated(48, 2, within), EXTRAPOLATED);
    let base = |n: u32| {
        let from = disc(1.0, 0.0, true, n);
        f64::from(n) * open(&from, &cylinder(1.0, 2.0, n)[0]) / from.area
    };
    row("C-80 base to wall of a cylinder r = 1, h = 2", 0.8284271247461901, extrapolated(32, 2, base), EXTRAPOLATED);
    // Similar polyhedra have the spheres' ratio of areas, so nothing is left to extrapolate.
    let (inner, outer) = (sphere(1.0, true, 8, 12), sphere(2.0, false, 8, 12));
    let total: f64 = outer.iter().map(|face| face.area).sum();
    let sum: f64 = outer.iter().flat_map(|from| inner.iter().map(|to| open(from, to))).sum();
    row("concentric spheres r = 1 and 2: from the outer to the inner", 0.25, sum / total, EXTRAPOLATED);
    let strips = |other: fn(f64) -> Polygon| {
        extrapolated(1000, 1, |l| open(&level([0.0, 1.0], [0.0, l.into()], 0.0, true), &other(l.into())) / f64::from(l))
    };
    let parallel = strips(|l| level([0.0, 1.0], [0.0, l], 1.0, false));
    row("endless parallel strips, w = 1, h = 1", 2f64.sqrt() - 1.0, parallel, EXTRAPOLATED);
    row("endless perpendicular strips, w = h", 1.0 - 0.5f64.sqrt(), strips(|l| leaning(l, 1.0, 90.0)), EXTRAPOLATED);
    row("endless wedge of 60°, equal widths", 0.5, strips(|l| leaning(l, 1.0, 60.0)), EXTRAPOLATED);
}
