//! Closed forms, and what must hold for any polygons.

use super::*;
use glam::DVec3;
use ringlight_visibility::NO_PLANE;
use std::f64::consts::PI;

fn polygon(corners: &[[f64; 3]]) -> Polygon {
    Polygon::new(corners.iter().copied().map(DVec3::from).collect(), NO_PLANE).unwrap()
}

/// Exchange area with nothing between.
fn open(a: &Polygon, b: &Polygon) -> f64 {
    exchange(a, b, None, &Tolerance::default(), &mut Work::default()).area
}

/// x × y rectangle at height z that faces up or down.
fn rectangle([x0, x1]: [f64; 2], [y0, y1]: [f64; 2], z: f64, up: bool) -> Polygon {
    let mut corners = [[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]];
    if !up {
        corners.reverse();
    }
    polygon(&corners)
}

/// Rectangle in the plane x = 0 with corners (y0, z0) and (y1, z1), facing +x.
fn wall([y0, y1]: [f64; 2], [z0, z1]: [f64; 2]) -> Polygon {
    polygon(&[[0.0, y0, z0], [0.0, y1, z0], [0.0, y1, z1], [0.0, y0, z1]])
}

/// Howell C-11: aligned parallel rectangles.
fn parallel(a: f64, b: f64, c: f64) -> f64 {
    let (x, y) = (a / c, b / c);
    let (p, q) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
    let log = (p * p * q * q / (1.0 + x * x + y * y)).sqrt().ln();
    2.0 / (PI * x * y) * (log + x * q * (x / q).atan() + y * p * (y / p).atan() - x * x.atan() - y * y.atan())
}

/// Howell C-14: rectangles l × w and l × h with the common edge l, at right angles; F from w.
fn perpendicular(l: f64, w: f64, h: f64) -> f64 {
    let (w, h) = (w / l, h / l);
    let (w2, h2) = (w * w, h * h);
    let s = w2 + h2;
    let log = ((1.0 + w2) * (1.0 + h2) / (1.0 + s)).ln()
        + w2 * (w2 * (1.0 + s) / ((1.0 + w2) * s)).ln()
        + h2 * (h2 * (1.0 + s) / ((1.0 + h2) * s)).ln();
    (w * (1.0 / w).atan() + h * (1.0 / h).atan() - s.sqrt() * (1.0 / s.sqrt()).atan() + log / 4.0) / (PI * w)
}

#[test]
fn equals_the_closed_form_for_parallel_squares() {
    for d in [0.01, 0.1, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0] {
        let f = open(&rectangle([0., 1.], [0., 1.], 0., true), &rectangle([0., 1.], [0., 1.], d, false));
        let e = parallel(1.0, 1.0, d);
        println!("{d} {:e}", f / e - 1.0);
        assert!((f / e - 1.0).abs() < 1e-10, "{d}: {:e}", f / e - 1.0);
    }
}

#[test]
fn equals_the_closed_form_for_perpendicular_rectangles() {
    for (l, w, h) in [(1.0, 1.0, 1.0), (1.0, 2.0, 3.0), (1.0, 1000.0, 1.0), (1.0, 0.001, 0.001), (1.0, 0.001, 1.0)] {
        let a = polygon(&[[0., 0., 0.], [w, 0., 0.], [w, l, 0.], [0., l, 0.]]);
        let f = open(&a, &wall([0.0, l], [0.0, h])) / a.area;
        let e = perpendicular(l, w, h);
        println!("{l} {w} {h} {:e}", f / e - 1.0);
        assert!((f / e - 1.0).abs() < 1e-9, "{l} {w} {h}: {:e}", f / e - 1.0);
    }
}

#[test]
fn equals_independent_values_for_squares_that_meet_at_an_angle() {
    // Closed form and adaptive contour agree to 1e-9.
    for (degrees, e) in [
        (30.0f64, 0.619028323091),
        (60.0, 0.370905321150),
        (90.0, 0.200043776075),
        (120.0, 0.086615001118),
        (150.0, 0.021345325413),
    ] {
        let (s, c) = degrees.to_radians().sin_cos();
        let a = polygon(&[[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]]);
        let b = polygon(&[[0., 0., 0.], [0., 1., 0.], [c, 1., s], [c, 0., s]]);
        let f = open(&a, &b);
        println!("{degrees} {:e}", f / e - 1.0);
        assert!((f / e - 1.0).abs() < 1e-9, "{degrees}: {:e}", f / e - 1.0);
    }
}

/// Two triangles of a parallelogram.
fn screen(origin: [f64; 3], u: [f64; 3], v: [f64; 3]) -> Vec<Occluder> {
    let [o, u, v] = [origin, u, v].map(DVec3::from);
    [[o, o + u, o + u + v], [o, o + u + v, o + v]].map(|corners| Occluder { corners, plane: NO_PLANE }).into()
}

fn obstructed(a: &Polygon, b: &Polygon, occluders: Vec<Occluder>) -> Exchange {
    exchange(a, b, Some(&Occluders::new(occluders)), &Tolerance::default(), &mut Work::default())
}

#[test]
fn half_a_screen_hides_half() {
    let (a, b) = (rectangle([0., 1.], [0., 1.], 0., true), rectangle([0., 1.], [0., 1.], 1., false));
    let found = obstructed(&a, &b, screen([0., 0., 0.5], [0.5, 0., 0.], [0., 1., 0.]));
    println!("{found:?}");
    // By symmetry: x + x' < 1 is as likely as x + x' > 1.
    let exact = parallel(1.0, 1.0, 1.0) / 2.0;
    assert!((found.area - exact).abs() < 1e-3 * exact && (found.area - exact).abs() < found.error, "{found:?} {exact}");
}

#[test]
fn a_square_blocker_as_in_view3d() {
    // Exact clipping with adaptive quadrature, 1e-6.
    let (a, b) = (rectangle([0., 1.], [0., 1.], 0., true), rectangle([0., 1.], [0., 1.], 1., false));
    let found = obstructed(&a, &b, screen([0., 0., 0.5], [0.5, 0., 0.], [0., 0.5, 0.]));
    println!("{found:?}");
    assert!((found.area - 0.149869).abs() < 1e-3 * 0.149869, "{found:?}");
}
