//! Furnaces: closed scenes whose radiosity is known everywhere.

use crate::scene::{Builder, Meshed, energy, meshed, solve};
use crate::{Bound, Row, Section};
use ringlight::solve::State;

/// White furnaces: one reflectance and one exitance everywhere, without and with things in the way.
pub fn white() -> Section {
    let mut section = Section {
        title: "White furnaces".into(),
        text: "A closed room, one reflectance ρ and the exitance 1 everywhere: B = 1/(1 − ρ) at every element, here times 1 − ρ; three \
               reflectances as the channels of one solve. Elements of 0.4 m, until 0.00001 of the power is unshot. The \
               empty room (M = 16 cells) shows how well form factors close. With boxes in it (M = 64) the share of a shooter \
               that is seen is known to one of its cells; at ρ = 0.8 that counts five-fold."
            .into(),
        ..Section::default()
    };
    let empty = |material: &mut dyn FnMut(&mut Builder) -> String| {
        let mut builder = Builder::default();
        builder.cuboid([0.0; 3], ROOM, true, material);
        meshed(builder.scene(true), 0.8, 0.4)
    };
    let with_boxes = |rho| room(0.4, |b| b.material(rho, [1.0; 3]));
    rows_of_white(&mut section, "empty", &|rho| empty(&mut |b| b.material(rho, [1.0; 3])), [0.5, 0.8, 0.95], 16);
    rows_of_white(&mut section, "boxes", &with_boxes, [0.3, 0.5, 0.8], 64);
    section
}

/// Adds the mean and the rms deviation of B (1 − ρ) for three reflectances.
fn rows_of_white(
    section: &mut Section,
    name: &str,
    scene: &dyn Fn([f32; 3]) -> Meshed,
    reflectances: [f32; 3],
    cells: u32,
) {
    let scene = scene(reflectances);
    let world = scene.world(cells);
    let (state, ..) = solve(&world, 1e-5);
    for (c, rho) in reflectances.into_iter().enumerate() {
        let (mut squares, mut sum, mut total) = (0.0, 0.0, 0.0);
        for (_, _, area, light) in scene.elements(&state) {
            let radiosity = (1.0 + f64::from(rho * light.at_point()[c])) * f64::from(1.0 - rho);
            squares += area * (radiosity - 1.0) * (radiosity - 1.0);
            sum += area * radiosity;
            total += area;
        }
        let mut row = |what: &str, expected: f64, found: f64, bound: Bound| {
            section.rows.push(Row { case: format!("{name}, ρ = {rho}: {what}"), expected, found, bound });
        };
        row("mean", 1.0, sum / total, Bound::Relative(0.002));
        row("rms deviation", 0.002, (squares / total).sqrt(), Bound::AtMost);
    }
}

/// Edges of the rooms, metres.
const ROOM: [f64; 3] = [4.0, 3.0, 3.0];

/// Manufactured furnace, at two element sizes.
pub fn measure() -> Section {
    let mut section = Section {
        title: "Manufactured furnaces".into(),
        text: "Closed rooms with boxes in them, any reflectance ρ and exitance 1 − ρ: B = 1 everywhere, whatever the geometry. \
               M = 64 cells, until 0.0001 of the power is unshot. Deviations of B from 1 over all elements and channels."
            .into(),
        ..Section::default()
    };
    let mut last = f64::INFINITY;
    for element in [0.4, 0.2] {
        let scene = manufactured(element);
        let world = scene.world(64);
        let (state, _, _) = solve(&world, 1e-4);
        let d = deviations(&scene, &state);
        let rms = (d.iter().map(|x| x * x).sum::<f64>() / d.len() as f64).sqrt();
        let energy = energy(&state, &world);
        let mut row = |case: &str, expected: f64, found: f64, bound: Bound| {
            section.rows.push(Row { case: format!("elements {element} m: {case}"), expected, found, bound });
        };
        row("rms", 0.003, rms, Bound::AtMost);
        if last.is_finite() {
            row("rms, no larger than with larger elements", last, rms, Bound::AtMost);
        }
        row("99.9 % of the elements within", 0.01, d[d.len() * 999 / 1000].abs(), Bound::AtMost);
        row("worst", 0.04, d[d.len() - 1].abs(), Bound::AtMost);
        row("closure error", 0.0, energy.closure_error, Bound::Absolute(0.005));
        row("escaped", 0.0, energy.escaped, Bound::Absolute(0.0));
        last = rms;
    }
    section
}

/// Random numbers in 0…1, always the same.
fn random(seed: &mut u64) -> f32 {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 40) as f32 / (1u64 << 24) as f32
}

/// Manufactured furnace: any reflectance ρ and exitance 1 − ρ, so that B = ρ·1 + (1 − ρ) = 1 solves the radiosity equation
/// for any closed geometry: every point then sees B = 1 in all directions, E = 1.
pub(super) fn manufactured(element: f64) -> Meshed {
    let mut seed = 7;
    room(element, |b| {
        let rho = [0; 3].map(|_| 0.2 + 0.6 * random(&mut seed));
        b.material(rho, rho.map(|r| 1.0 - r))
    })
}

/// A closed room with a box that stands on its floor and one that floats, each face of its own material.
fn room(element: f64, mut material: impl FnMut(&mut Builder) -> String) -> Meshed {
    let mut builder = Builder::default();
    builder.cuboid([0.0; 3], ROOM, true, &mut material);
    builder.cuboid([0.7, 0.0, 0.8], [1.4, 1.1, 1.5], false, &mut material);
    builder.cuboid([2.1, 0.9, 1.2], [3.0, 1.3, 2.4], false, &mut material);
    meshed(builder.scene(true), 2.0 * element, element)
}

/// Deviations of B from 1 over all elements that are not wholly covered, all channels.
pub(super) fn deviations(scene: &Meshed, state: &State) -> Vec<f64> {
    let mut found = Vec::new();
    for (cluster, light) in scene.mesh.clusters.iter().zip(&state.clusters) {
        for id in cluster.patches.clone() {
            let patch = scene.mesh.patch(id);
            for e in patch.elements().filter(|&e| scene.mesh.valid[e as usize] != 0) {
                let colour = scene.mesh.colour(&patch, e);
                let light = light.elements[(e - cluster.elements.start) as usize].at_point();
                let radiosity = |c: usize| colour.exitance[c] + colour.reflectance[c] * light[c];
                found.extend((0..3).map(|c| f64::from(radiosity(c)) - 1.0));
            }
        }
    }
    found.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    found
}
