//! Polygons, and curved shapes as refined polygons.

use glam::DVec3;
use ringlight::view_factor::{Polygon, Tolerance, Work, exchange};
use ringlight_visibility::NO_PLANE;
use std::f64::consts::{PI, TAU};

/// Polygon of these corners.
pub fn polygon(corners: impl IntoIterator<Item = [f64; 3]>) -> Polygon {
    Polygon::new(corners.into_iter().map(DVec3::from).collect(), NO_PLANE).expect("the corners enclose an area")
}

/// Rectangle at height z over the origin's plane that faces up, or down.
pub fn level([x0, x1]: [f64; 2], [y0, y1]: [f64; 2], z: f64, up: bool) -> Polygon {
    let mut corners = [[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]];
    if !up {
        corners.reverse();
    }
    polygon(corners)
}

/// Rectangle of length `l` from the y axis upward, leaning away from the plane z = 0 by `degrees` from its part with x > 0.
pub fn leaning(l: f64, h: f64, degrees: f64) -> Polygon {
    let (s, c) = degrees.to_radians().sin_cos();
    let (s, c) = if degrees == 90.0 { (1.0, 0.0) } else { (s, c) };
    polygon([[0.0; 3], [0.0, l, 0.0], [h * c, l, h * s], [h * c, 0.0, h * s]])
}

/// A·F with nothing between.
pub fn open(a: &Polygon, b: &Polygon) -> f64 {
    exchange(a, b, None, &Tolerance::default(), &mut Work::default()).area
}

/// Regular polygon with `n` corners on a circle about the z axis.
pub fn disc(radius: f64, z: f64, up: bool, n: u32) -> Polygon {
    let corner = |k: u32| {
        let angle = TAU * f64::from(if up { k } else { n - k }) / f64::from(n);
        [radius * angle.cos(), radius * angle.sin(), z]
    };
    polygon((0..n).map(corner))
}

/// Inside of a cylinder about the z axis as `n` rectangles.
pub fn cylinder(radius: f64, height: f64, n: u32) -> Vec<Polygon> {
    let at = |k: u32, z: f64| {
        let angle = TAU * f64::from(k % n) / f64::from(n);
        [radius * angle.cos(), radius * angle.sin(), z]
    };
    (0..n).map(|k| polygon([at(k + 1, 0.0), at(k, 0.0), at(k, height), at(k + 1, height)])).collect()
}

/// Sphere about the origin, `rows` from pole to pole and `columns` around.
pub fn sphere(radius: f64, outward: bool, rows: u32, columns: u32) -> Vec<Polygon> {
    let at = |i: u32, j: u32| {
        let (polar, around) = (PI * f64::from(i) / f64::from(rows), TAU * f64::from(j % columns) / f64::from(columns));
        // The poles are one corner each, to the bit.
        let (sine, cosine) = match i {
            0 => (0.0, 1.0),
            i if i == rows => (0.0, -1.0),
            _ => polar.sin_cos(),
        };
        [radius * sine * around.cos(), radius * sine * around.sin(), radius * cosine]
    };
    (0..rows)
        .flat_map(|i| (0..columns).map(move |j| (i, j)))
        .map(|(i, j)| {
            let mut corners = vec![at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            corners.dedup();
            if corners.first() == corners.last() {
                corners.pop();
            }
            if !outward {
                corners.reverse();
            }
            polygon(corners)
        })
        .collect()
}

/// The limit of `value` for ever larger n, its error going as n^(−order): from n and 2n (Richardson 1911).
pub fn extrapolated(n: u32, order: i32, value: impl Fn(u32) -> f64) -> f64 {
    let power = 2f64.powi(order);
    (power * value(2 * n) - value(n)) / (power - 1.0)
}
