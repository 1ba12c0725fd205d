use super::*;
use crate::form_factor;
use crate::output::fixture::{alone, closed_box, elements, over_ranks, paint, read, solve, solve_by_groups};
use crate::ring::{Rings, Routing};
use crate::smooth::Smooth;
use crate::solution::Solution;
use crate::solve::Spread;
use glam::DVec3;

/// A closed box of 4 m × 3 m × 4 m (x, y up, z) of one material.
fn room(material: &str) -> String {
    format!(
        "v 0 0 0\nv 4 0 0\nv 4 0 4\nv 0 0 4\nv 0 3 0\nv 4 3 0\nv 4 3 4\nv 0 3 4\nusemtl {material}\no floor\nf 1 4 3 2\n\
         o ceiling\nf 5 6 7 8\no north\nf 1 2 6 5\no south\nf 4 8 7 3\no west\nf 1 5 8 4\no east\nf 2 3 7 6\n"
    )
}

/// A square lamp of 1 m × 1 m hanging 0.25 m below the middle of the room's ceiling, and a table of 1.6 m × 1 m 0.75 m high.
const LAMP: &str =
    "v 1.5 2.75 1.5\nv 2.5 2.75 1.5\nv 2.5 2.75 2.5\nv 1.5 2.75 2.5\nusemtl lamp\no lamp\nf -4 -3 -2 -1\n";
const TABLE: &str = "v 1 .75 2\nv 2.6 .75 2\nv 2.6 .75 3\nv 1 .75 3\nusemtl grey\no table\nf -1 -2 -3 -4\n";

fn at(position: [f64; 3], normal: [f64; 3]) -> Point {
    Point { position, normal }
}

fn gathered(solution: &Solution, points: &[Point]) -> Vec<Reading> {
    let (mut ring, mut ranks) = alone(solution);
    gather(solution, points, &GatherOptions::default(), &mut ring, &mut ranks).unwrap().unwrap()
}

fn read_surface(solution: &Solution, points: &[Point]) -> Vec<Reading> {
    let (mut ring, mut ranks) = alone(solution);
    surface(solution, points, &SurfaceOptions::default(), &mut ring, &mut ranks).unwrap().unwrap()
}

/// Irradiance of the lamp (radiance 10) by its contour.
fn lamp_light(point: &Point) -> f64 {
    let corners = [(1.5, 1.5), (2.5, 1.5), (2.5, 2.5), (1.5, 2.5)].map(|(x, z)| DVec3::new(x, 2.75, z));
    10.0 * std::f64::consts::PI * form_factor::contour(point.position.into(), DVec3::from(point.normal), &corners)
}

#[test]
fn light_of_an_open_lamp_is_its_contour() {
    let solution = solve(read(&(room("black") + LAMP)), 0.5, 0.01);
    let mut points = Vec::new();
    for k in 0..20 {
        let t = f64::from(k) / 20.0;
        points.push(at([0.1 + 3.8 * t, 0.0, 0.3 + 3.0 * t], [0.0, 1.0, 0.0]));
        points.push(at([0.0, 0.1 + 2.6 * t, 3.9 - 3.0 * t], [1.0, 0.0, 0.0]));
        // Work planes, also a centimetre below the lamp.
        points.push(at([1.3 + t, 2.74, 1.9], [0.0, 1.0, 0.0]));
        points.push(at([0.2 + 3.5 * t, 0.85, 2.0], [0.6, 0.8, 0.0]));
    }
    for (point, reading) in points.iter().zip(gathered(&solution, &points)) {
        let expected = lamp_light(point);
        assert_eq!(reading.status, Status::Ok, "{point:?}");
        // Single precision of the light and of the weights.
        assert!((f64::from(reading.irradiance[0]) / expected - 1.0).abs() < 2e-6, "{point:?} {reading:?} {expected}");
    }
}

#[test]
fn a_furnace_gives_its_radiosity_everywhere() {
    let mut solution = solve(read(&closed_box("glow")), 0.25, 0.5);
    // Kd 0.5, Ke 1: E = B = π / (1 − 0.5).
    paint(&mut solution, |_, _| std::f64::consts::TAU);
    let mut points = Vec::new();
    for k in 0..40 {
        let t = f64::from(k);
        let inner = |f: f64| 0.02 + 0.96 * (t * f).fract();
        let normal = [(t * 0.7).sin(), (t * 1.9).cos(), (t * 0.3).sin() + 0.1];
        points.push(at([inner(0.618), inner(0.755), inner(0.57)], normal));
    }
    // On faces, at edges, in a corner, just below the surface, a centimetre above.
    points.push(at([0.3, 0.0, 0.6], [0.0, 1.0, 0.0]));
    points.push(at([0.0, 0.0, 0.6], [0.0, 1.0, 0.0]));
    points.push(at([1.0, 0.0, 1.0], [0.0, 1.0, 0.0]));
    points.push(at([0.3, -1e-6, 0.6], [0.0, 1.0, 0.0]));
    points.push(at([0.3, 0.01, 0.6], [0.0, 1.0, 0.0]));
    points.push(at([0.3, 0.01, 0.6], [0.0, -1.0, 0.0]));
    points.push(at([0.0, 0.5, 0.5], [0.3, 0.8, 0.2]));
    for (point, reading) in points.iter().zip(gathered(&solution, &points)) {
        assert_eq!(reading.status, Status::Ok, "{point:?}");
        for e in reading.irradiance {
            // What lies below the horizon's rim is cut off at the tolerance; the tilted point looks under its own wall.
            let exact = if point.normal == [0.3, 0.8, 0.2] { 0.05 } else { 2e-5 };
            assert!((f64::from(e) / std::f64::consts::TAU - 1.0).abs() < exact, "{point:?} {e}");
        }
    }
}

#[test]
fn statuses() {
    let solution = solve(read(&(room("grey") + LAMP + TABLE)), 0.25, 0.001);
    let cases = [
        (at([1.0, 0.0, 1.0], [0.0, 1.0, 0.0]), Status::Ok),
        (at([1.5, 0.4, 2.5], [0.0, 1.0, 0.0]), Status::Ok),
        (at([1.0, -0.1, 1.0], [0.0, 1.0, 0.0]), Status::Inside),
        (at([-0.1, 1.0, 1.0], [1.0, 0.0, 0.0]), Status::Inside),
    ];
    for (point, expected) in cases {
        assert_eq!(gathered(&solution, &[point])[0].status, expected, "{point:?}");
    }
}

#[test]
fn points_in_a_box_without_a_bottom_are_inside_though_its_faces_have_two_lit_sides() {
    // It stands across elements of the floor, which are lit in part.
    let cube = "v 1.1 0 1.1\nv 1.95 0 1.1\nv 1.95 0 1.95\nv 1.1 0 1.95\nv 1.1 .9 1.1\nv 1.95 .9 1.1\nv 1.95 .9 1.95\n\
        v 1.1 .9 1.95\nusemtl grey\no cube\nf -4 -1 -2 -3\nf -8 -4 -3 -7\nf -5 -6 -2 -1\nf -8 -5 -1 -4\nf -7 -3 -2 -6\n";
    let solution = solve_by_groups(read(&(room("grey") + LAMP + cube)), 0.25);
    for x in [1.13, 1.3, 1.5, 1.9] {
        for y in [0.0, 0.2, 0.6, 0.88] {
            let inner = at([x, y, 1.4], [0.0, 1.0, 0.0]);
            assert_eq!(gathered(&solution, &[inner])[0].status, Status::Inside, "{inner:?}");
        }
    }
    for outer in [[1.05, 0.0, 1.4], [1.5, 0.9, 1.4], [1.5, 0.91, 1.4], [2.0, 0.4, 1.4]] {
        assert_eq!(gathered(&solution, &[at(outer, [0.0, 1.0, 0.0])])[0].status, Status::Ok, "{outer:?}");
    }
}

/// Gathered light over the solver's own at the sample points of elements that have some, rms and greatest difference.
fn difference_from_solver(solution: &Solution, inside: impl Fn(DVec3) -> bool) -> (f64, f64) {
    let (mut points, mut expected) = (Vec::new(), Vec::new());
    for (element, corners, normal) in elements(solution) {
        let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
        if inside(middle) && solution.irradiance(element)[0] > 0.0 {
            points.push(at(middle.to_array(), normal.to_array()));
            expected.push(solution.irradiance(element)[0]);
        }
    }
    assert!(points.len() > 100);
    let readings = gathered(solution, &points);
    assert!(readings.iter().all(|r| r.status == Status::Ok));
    let errors = || readings.iter().zip(&expected).map(|(r, &e)| f64::from(r.irradiance[0] / e - 1.0).abs());
    let rms = (errors().map(|e| e * e).sum::<f64>() / points.len() as f64).sqrt();
    (rms, errors().fold(0.0, f64::max))
}

#[test]
fn gathered_light_equals_the_solvers_own() {
    // Away from the room's edges, where elements hold an average and points do not.
    let away = |p: DVec3| [p.x, p.y, p.z].iter().zip([4.0, 3.0, 4.0]).filter(|&(&x, l)| x.min(l - x) < 0.3).count() < 2;
    // Nothing stands before anything: what is left is the difference of the discretisations.
    let solution = solve(read(&(room("grey") + &LAMP.replace("2.75", "3"))), 0.25, 1e-4);
    let (rms, worst) = difference_from_solver(&solution, |p| away(p) && p.y < 2.7);
    assert!(rms < 0.003 && worst < 0.01, "{rms} {worst}");
}

#[test]
fn light_of_a_lamp_behind_a_table_is_that_of_its_visible_part() {
    let solution = solve(read(&(room("black") + LAMP + TABLE)), 0.5, 0.01);
    let points: Vec<Point> =
        (0..24).map(|k| at([0.44 + 0.015 * f64::from(k), 0.0, 2.3 + 0.05 * f64::from(k)], [0.0, 1.0, 0.0])).collect();
    let (mut partly, mut squares) = (0, 0.0f64);
    for (point, reading) in points.iter().zip(gathered(&solution, &points)) {
        // The table's shadow on the plane of the lamp is a rectangle, and so is what it takes of the lamp.
        let [x, _, z] = point.position;
        let shadow = |table: f64, x: f64| (x + 2.75 / 0.75 * (table - x)).clamp(1.5, 2.5);
        let ([west, east], [north, south]) = ([1.0, 2.6].map(|t| shadow(t, x)), [2.0, 3.0].map(|t| shadow(t, z)));
        let hidden = [(west, north), (east, north), (east, south), (west, south)].map(|(x, z)| DVec3::new(x, 2.75, z));
        let factor = form_factor::contour(point.position.into(), DVec3::Y, &hidden);
        let open = lamp_light(point);
        let expected = open - 10.0 * std::f64::consts::PI * factor;
        partly += i32::from(expected > 1e-9 && factor > 0.0);
        let found = f64::from(reading.irradiance[0]);
        // An edge along the cells is known to half a cell of 1/8 of the smallest part: 1/16 · 2⁻⁶ of the lamp. There are two.
        let bound = 2.0 / 1024.0 * open;
        assert!((found - expected).abs() < bound, "{point:?}: {found} for {expected}, {open} in the open");
        squares += ((found - expected) / open).powi(2);
    }
    assert!(partly > 8, "{partly}");
    let rms = (squares / f64::from(partly)).sqrt();
    assert!(rms < 1e-3, "{rms}");
}

#[test]
fn surfaces_give_samples_as_found_and_corners_as_displayed() {
    let solution = solve(read(&(room("grey") + LAMP)), 0.25, 0.01);
    let smooth = Smooth::new(&solution);
    let mut compared = 0;
    for (element, corners, normal) in elements(&solution).into_iter().step_by(7) {
        let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
        let beside = middle.lerp(corners[0], 0.9);
        let places = [middle, beside].map(|place| at((place + 0.01 * normal).to_array(), normal.to_array()));
        let readings = read_surface(&solution, &places);
        if readings.iter().any(|reading| reading.status != Status::Ok) {
            continue;
        }
        let (found, shown) = (solution.irradiance(element), smooth.corners(element)[0]);
        assert_eq!(readings[0].irradiance, found, "{middle} {normal}");
        for c in 0..3 {
            let expected = 0.1 * found[c] + 0.9 * shown[c];
            // Rounding of places in single precision.
            let off = (readings[1].irradiance[c] - expected).abs();
            assert!(off <= 1e-4 * expected, "{middle} {normal}: {expected} {:?}", readings[1]);
        }
        compared += 1;
    }
    assert!(compared > 20, "{compared}");
}

#[test]
fn a_point_does_not_depend_on_the_others_nor_on_threads_and_ranks() {
    let solution = solve(read(&(room("grey") + LAMP + TABLE)), 0.5, 0.01);
    let points: Vec<Point> = (0..150)
        .map(|k| f64::from(k) * 0.618_033_988_749)
        .map(|t| at([4.0 * t.fract(), 0.3 * (t * 3.0).fract(), 4.0 * (t * 7.0).fract()], [0.0, 1.0, 0.1]))
        .collect();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| (gathered(&solution, &points), read_surface(&solution, &points)))
    };
    let one = with(1);
    assert_eq!(one, with(3));
    let over = |ranks, rings| Spread::new(Rings::new(ranks, rings).unwrap());
    let small = Spread { routing: Routing::All, packet_size: 7, window: 3, ..over(4, 1) };
    for spread in [over(2, 1), over(3, 2), over(3, 3), small] {
        let many = over_ranks(&solution, &spread, |ring, ranks| {
            let gathered = gather(&solution, &points, &GatherOptions::default(), ring, ranks)?;
            Ok((gathered, surface(&solution, &points, &SurfaceOptions::default(), ring, ranks)?))
        });
        assert_eq!(many, (Some(one.0.clone()), Some(one.1.clone())), "{spread:?}");
    }
    for k in [0, 63, 64, 149] {
        assert_eq!(gathered(&solution, &points[k..=k])[0], one.0[k]);
    }
}
