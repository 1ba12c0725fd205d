//! Furnaces: closed scenes whose radiosity is known everywhere.

mod common;

use common::{Builder, Meshed, meshed, solve};
use ringlight::solve::State;

/// Random numbers in 0…1, always the same.
fn random(seed: &mut u64) -> f32 {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 40) as f32 / (1u64 << 24) as f32
}

/// Manufactured furnace: any reflectance ρ and exitance 1 − ρ, so that B = ρ·1 + (1 − ρ) = 1 solves the radiosity equation
/// for any closed geometry: every point then sees B = 1 in all directions, E = 1.
fn furnace(element: f64) -> Meshed {
    let mut seed = 7;
    let mut builder = Builder::default();
    let mut material = |b: &mut Builder| {
        let rho = [0; 3].map(|_| 0.2 + 0.6 * random(&mut seed));
        b.material(rho, rho.map(|r| 1.0 - r))
    };
    builder.cuboid([0.0; 3], [4.0, 3.0, 3.0], true, &mut material);
    builder.cuboid([0.7, 0.0, 0.8], [1.4, 1.1, 1.5], false, &mut material);
    builder.cuboid([2.1, 0.9, 1.2], [3.0, 1.3, 2.4], false, &mut material);
    meshed(builder.scene(true), 2.0 * element, element)
}

/// Deviations of B from 1 over all elements that are not wholly covered, all channels.
fn deviations(scene: &Meshed, state: &State) -> Vec<f64> {
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

#[test]
fn manufactured_furnace_with_occluders_has_radiosity_one_everywhere() {
    let mut last = f64::INFINITY;
    for element in [0.4, 0.2] {
        let scene = furnace(element);
        let world = scene.world(64);
        let (state, _, progress) = solve(&world, 1e-4);
        let d = deviations(&scene, &state);
        let rms = (d.iter().map(|x| x * x).sum::<f64>() / d.len() as f64).sqrt();
        let (most, worst) = (d[d.len() * 999 / 1000].abs(), d[d.len() - 1].abs());
        let energy = state.energy(&world);
        println!(
            "element {element}: {} elements, {} shots, {} rays, rms {rms:.5}, 99.9 % within {most:.5}, worst {worst:.5}, {energy:?}",
            scene.mesh.element_count(),
            progress.shots,
            progress.rays
        );
        assert!(rms < last, "refinement must lower the error");
        last = rms;
        assert!(rms <= 0.003 && most <= 0.01 && worst <= 0.04, "{rms} {most} {worst}");
        assert!(energy.closure_error.abs() < 0.005);
        assert_eq!(energy.escaped, 0.0);
    }
}
