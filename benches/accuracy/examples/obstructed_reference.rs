//! Computes `src/view_factor/references.rs`: the factors of the cases with occluders, by plain ray casting.
//!
//! ```text
//! cargo run --release -p ringlight-accuracy --example obstructed_reference [STRATA] > references.rs
//! ```
//!
//! Slow and obvious: rays that are stratified in four dimensions, every one tested against every triangle. Polygons that are apart
//! are joined point to point, and the seen share is taken of the factor with nothing between, which has tests of its own; of polygons that touch, rays leave the first by the cosine law. Eight runs give the standard error.

use glam::DVec3;
use ringlight::view_factor::{Polygon, Tolerance, Work, exchange};
use ringlight_accuracy::view_factor::cases::{Case, cases};
use ringlight_visibility::NO_PLANE;
use std::f64::consts::TAU;

/// Independent runs.
const RUNS: u64 = 8;

fn main() {
    let strata = std::env::args().nth(1).map_or(48, |n| n.parse().expect("STRATA is a number"));
    println!("//! Written by the example `obstructed_reference` with {strata} strata: do not edit.\n");
    println!("/// Name of the case, F from its first polygon, and the standard error of that.");
    println!("pub const REFERENCES: &[(&str, f64, f64)] = &[");
    for case in cases() {
        let runs: Vec<f64> = (0..RUNS).map(|seed| factor(&case, strata, seed)).collect();
        let mean = runs.iter().sum::<f64>() / RUNS as f64;
        let variance = runs.iter().map(|f| (f - mean).powi(2)).sum::<f64>() / (RUNS * (RUNS - 1)) as f64;
        println!("    ({:?}, {mean:.7}, {:.1e}),", case.name, variance.sqrt());
    }
    println!("];");
}

/// F from the first polygon, by strata⁴ rays.
fn factor(case: &Case, strata: u32, seed: u64) -> f64 {
    let [a, b] = case.pair.clone().map(|corners| Polygon::new(corners, NO_PLANE).expect("polygons have an area"));
    let apart = a.corners.iter().all(|&p| (p - b.corners[0]).dot(b.normal) > 0.3)
        && b.corners.iter().all(|&p| (p - a.corners[0]).dot(a.normal) > 0.3);
    let mut state = seed;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let clear = |p: DVec3, q: DVec3| !case.occluders.iter().any(|t| blocks(p, q, t));
    let (mut seen, mut all) = (0.0, 0.0);
    for number in 0..u64::from(strata).pow(4) {
        let [i, j, k, l] = [0, 1, 2, 3].map(|d| (number / u64::from(strata).pow(d) % u64::from(strata)) as f64);
        let [s, t, u, v] = [i, j, k, l].map(|stratum| (stratum + random()) / f64::from(strata));
        let (p, weight) = place(&a, s, t);
        if apart {
            let (q, other) = place(&b, u, v);
            let r = q - p;
            let weight = weight * other * r.dot(a.normal) * -r.dot(b.normal) / r.length_squared().powi(2);
            all += weight;
            seen += if clear(p, q) { weight } else { 0.0 };
        } else {
            // By the cosine law: a point of the unit disc, lifted to the hemisphere.
            let (x, y) = a.normal.any_orthonormal_pair();
            let (sine, angle) = (u.sqrt(), TAU * v);
            let direction = sine * angle.cos() * x + sine * angle.sin() * y + (1.0 - u).sqrt() * a.normal;
            all += weight;
            let distance = (b.corners[0] - p).dot(b.normal) / direction.dot(b.normal);
            let q = p + distance * direction;
            let inside = (0..b.corners.len()).all(|k| {
                let (from, to) = (b.corners[k], b.corners[(k + 1) % b.corners.len()]);
                b.normal.cross(to - from).dot(q - from) >= 0.0
            });
            if distance > 0.0 && direction.dot(b.normal) < 0.0 && inside && clear(p, q) {
                seen += weight;
            }
        }
    }
    let open = exchange(&a, &b, None, &Tolerance::default(), &mut Work::default()).area / a.area;
    if apart { open * seen / all } else { seen / all }
}

/// A point of a parallelogram or a triangle, and its weight.
fn place(polygon: &Polygon, s: f64, t: f64) -> (DVec3, f64) {
    let c = &polygon.corners;
    match c.len() {
        3 => (c[0] + s * ((1.0 - t) * (c[1] - c[0]) + t * (c[2] - c[0])), 2.0 * s),
        _ => (c[0] + s * (c[1] - c[0]) + t * (c[3] - c[0]), 1.0),
    }
}

/// Whether a triangle blocks the way between two points (Möller & Trumbore 1997).
fn blocks(p: DVec3, q: DVec3, t: &[DVec3; 3]) -> bool {
    let (way, u_edge, v_edge) = (q - p, t[1] - t[0], t[2] - t[0]);
    let h = way.cross(v_edge);
    let volume = u_edge.dot(h);
    let from = p - t[0];
    let u = from.dot(h) / volume;
    let k = from.cross(u_edge);
    let v = way.dot(k) / volume;
    let at = v_edge.dot(k) / volume;
    u >= 0.0 && v >= 0.0 && u + v <= 1.0 && at > 1e-9 && at < 1.0 - 1e-9
}
