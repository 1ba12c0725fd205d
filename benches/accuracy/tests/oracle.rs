//! The progressive solution beside the solution of all equations at once.

use ringlight_accuracy::oracle::{Dense, Solution, scenes};
use ringlight_accuracy::scene::solve;

#[test]
fn progressive_refinement_solves_the_radiosity_equation() {
    for case in scenes::all() {
        let world = case.world();
        let dense = Dense::new(&world);
        let exact = dense.solve();
        let (state, reason, progress) = solve(&world, 1e-9);
        let elements = || state.clusters.iter().flat_map(|c| &c.elements);
        let found = Solution {
            mean: elements().map(|e| e.mean().map(f64::from)).collect(),
            point: elements().map(|e| e.at_point().map(f64::from)).collect(),
        };
        println!(
            "{}: {} patches {} elements, {} shots, {reason:?}, {:.1e}: {:.2e} {:.2e}",
            case.name,
            case.scene.mesh.patch_count(),
            case.scene.mesh.element_count(),
            progress.shots,
            progress.unshot_share,
            worst(&exact.mean, &found.mean),
            worst(&exact.point, &found.point)
        );
    }
}

/// The largest difference, relative to the expected value or to their mean, whichever is larger.
fn worst(expected: &[[f64; 3]], found: &[[f64; 3]]) -> f64 {
    assert_eq!(expected.len(), found.len());
    let mean: [f64; 3] = std::array::from_fn(|c| expected.iter().map(|e| e[c]).sum::<f64>() / expected.len() as f64);
    let differences =
        expected.iter().zip(found).flat_map(|(e, f)| (0..3).map(|c| (f[c] - e[c]).abs() / e[c].max(mean[c])));
    differences.fold(0.0, f64::max)
}
