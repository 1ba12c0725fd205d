use super::*;
use crate::form_factor;
use crate::mesh;
use crate::output::fixture::{closed_box, elements, paint, read, solve};
use crate::smooth::Smooth;
use crate::solution::Solution;
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
    gather(solution, &mesh::hierarchy(&solution.mesh), points, &GatherOptions::default())
}

fn read_surface(solution: &Solution, points: &[Point]) -> Vec<Reading> {
    surface(solution, &mesh::hierarchy(&solution.mesh), points, &SurfaceOptions::default())
}

/// Irradiance of the lamp (radiance 10) by its contour.
fn lamp_light(point: &Point) -> f64 {
    let corners = [(1.5, 1.5), (2.5, 1.5), (2.5, 2.5), (1.5, 2.5)].map(|(x, z)| DVec3::new(x, 2.75, z));
    10.0 * std::f64::consts::PI * form_factor::contour(point.position.into(), DVec3::from(point.normal), &corners)
}

#[test]
fn light_of_an_open_lamp_is_its_contour() {
    let solution = solve(&read(&(room("black") + LAMP)), 0.5, 0.01);
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
    let mut solution = solve(&read(&closed_box("glow")), 0.25, 0.5);
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
    let solution = solve(&read(&(room("grey") + LAMP + TABLE)), 0.25, 0.001);
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
fn gathered_light_equals_the_solvers_own() {
    let solution = solve(&read(&(room("grey") + LAMP + TABLE)), 0.2, 0.001);
    let mut points = Vec::new();
    let mut expected = Vec::new();
    for (element, corners, normal) in elements(&solution) {
        let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
        points.push(at(middle.to_array(), normal.to_array()));
        expected.push(solution.irradiance(element)[0]);
    }
    let readings = gathered(&solution, &points);
    let (mut squares, mut count, mut worst) = (0.0, 0, (0.0, 0));
    for (k, (reading, &e)) in readings.iter().zip(&expected).enumerate() {
        if reading.status == Status::Ok && e > 0.1 {
            let error = f64::from(reading.irradiance[0] / e - 1.0);
            squares += error * error;
            count += 1;
            if error.abs() > worst.0 {
                worst = (error.abs(), k)
            }
        }
    }
    let rms = (squares / f64::from(count)).sqrt();
    println!("{count} rms {rms} worst {worst:?} {:?} {:?} {}", points[worst.1], readings[worst.1], expected[worst.1]);
    assert!(rms < 0.02);
}

#[test]
fn surfaces_show_what_is_displayed() {
    let solution = solve(&read(&(room("grey") + LAMP)), 0.25, 0.01);
    let smooth = Smooth::new(&solution);
    for (element, corners, normal) in elements(&solution).into_iter().step_by(7) {
        let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
        let reading = read_surface(&solution, &[at((middle + 0.01 * normal).to_array(), normal.to_array())])[0];
        if reading.status == Status::Ok {
            assert_eq!(reading.irradiance, smooth.at(element, glam::DVec2::splat(0.5)), "{middle} {normal}");
        }
    }
}
