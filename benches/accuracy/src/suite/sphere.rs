//! The integrating sphere.

use crate::scene::{Builder, Meshed, meshed, solve};
use crate::{Bound, Row, Section};
use glam::DVec3;
use ringlight::mesh::Patch;
use std::collections::BTreeMap;

/// Spheres of 320 and 1280 triangles, lit by a cap, by a band and by a spot on the side.
pub fn measure() -> Section {
    let mut section = Section {
        title: "The integrating sphere".into(),
        text: "Inside a sphere every point sees every other with the same form factor, so the irradiance is the same everywhere, \
               whatever shines: the mean exitance over 1 − ρ. Spheres of triangles, ρ = 0.5; a cap, a band and a spot shine, \
               each in a channel of its own. Irradiance as a share of that: mean over all elements, and root of the mean \
               square of deviations, which falls with the size of the triangles: they are no sphere."
            .into(),
        ..Section::default()
    };
    let mut last = [f64::INFINITY; 3];
    for (halvings, spread) in [(2, 0.015), (3, 0.005)] {
        let sphere = sphere(halvings);
        let triangles = 20 * 4usize.pow(halvings);
        let world = sphere.world(1);
        let (state, ..) = solve(&world, 1e-4);
        let (mut mean_exitance, mut total) = ([0.0; 3], 0.0);
        for (patch, e, area, _) in sphere.elements(&state) {
            let exitance = sphere.mesh.colour(&patch, e).exitance;
            (0..3).for_each(|c| mean_exitance[c] += area * f64::from(exitance[c]));
            total += area;
        }
        let expected = mean_exitance.map(|m| m / total / (1.0 - RHO));
        let mean = sphere.mean_irradiance(&state, |_: &Patch| true);
        for (c, name) in ["cap", "band", "spot"].into_iter().enumerate() {
            let squares: f64 = sphere
                .elements(&state)
                .map(|(_, _, area, light)| {
                    let deviation = f64::from(light.mean()[c]) / expected[c] - 1.0;
                    area / total * deviation * deviation
                })
                .sum();
            let rms = squares.sqrt();
            let mut row = |what: &str, expected: f64, found: f64, bound: Bound| {
                let case = format!("{triangles} triangles, {name}: {what}");
                section.rows.push(Row { case, expected, found, bound });
            };
            row("mean", 1.0, mean[c] / expected[c], Bound::Relative(0.002));
            row("rms deviation", spread, rms, Bound::AtMost);
            if last[c].is_finite() {
                row("rms deviation, less than 0.6 of that of larger triangles", 0.6 * last[c], rms, Bound::AtMost);
            }
            last[c] = rms;
        }
    }
    section
}

/// Reflectance of the sphere.
const RHO: f64 = 0.5;

/// A sphere of radius 1 seen from inside: an icosahedron, each triangle cut in four as often as `halvings`.
fn sphere(halvings: u32) -> Meshed {
    let mut builder = Builder::default();
    let mut materials: BTreeMap<[bool; 3], String> = BTreeMap::new();
    for [a, b, c] in (0..halvings).fold(icosahedron(), |triangles, _| halved(&triangles)) {
        let middle = ((a + b + c) / 3.0).normalize();
        let shines = [middle.y > 0.7, middle.y.abs() < 0.3, middle.dot(DVec3::new(0.6, -0.64, 0.48)) > 0.9];
        let material = materials
            .entry(shines)
            .or_insert_with(|| builder.material([RHO as f32; 3], shines.map(|s| f32::from(u8::from(s)))));
        builder.face(material, &[a, c, b].map(|p| p.to_array()));
    }
    // One patch and one element for each triangle.
    meshed(builder.scene(true), 10.0, 10.0)
}

/// Triangles of an icosahedron, counter-clockwise seen from outside.
fn icosahedron() -> Vec<[DVec3; 3]> {
    let golden = (1.0 + 5f64.sqrt()) / 2.0;
    let mut corners = Vec::new();
    for (a, b) in [(-1.0, -golden), (1.0, -golden), (-1.0, golden), (1.0, golden)] {
        corners.extend([DVec3::new(a, b, 0.0), DVec3::new(0.0, a, b), DVec3::new(b, 0.0, a)]);
    }
    let neighbours = |a: DVec3, b: DVec3| ((a - b).length() - 2.0).abs() < 1e-9;
    let mut triangles = Vec::new();
    for (i, &a) in corners.iter().enumerate() {
        for (j, &b) in corners.iter().enumerate().skip(i + 1) {
            for &c in corners.iter().skip(j + 1) {
                if neighbours(a, b) && neighbours(b, c) && neighbours(c, a) {
                    let outwards = (b - a).cross(c - a).dot(a) > 0.0;
                    triangles.push(if outwards { [a, b, c] } else { [a, c, b] }.map(DVec3::normalize));
                }
            }
        }
    }
    triangles
}

/// Every triangle cut in four, the new corners on the sphere.
fn halved(triangles: &[[DVec3; 3]]) -> Vec<[DVec3; 3]> {
    let middle = |a: DVec3, b: DVec3| (a + b).normalize();
    let quarters = |&[a, b, c]: &[DVec3; 3]| {
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    };
    triangles.iter().flat_map(quarters).collect()
}
