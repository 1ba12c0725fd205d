//! The progressive solver beside the solution of all equations at once.

use crate::oracle::{Dense, scenes};
use crate::scene::solve;
use crate::{Bound, Row, Section};

/// Every scene of [`scenes`], solved both ways.
pub fn measure() -> Section {
    let mut section = Section {
        title: "Progressive refinement and the whole equation".into(),
        text: "B = E + ρFB (paper, equation 1) for all elements at once: every form factor with every triangle tested one by one, \
               Gauss–Seidel in double precision; and progressive refinement on the same patches, elements and cells, until 1e-9 \
               of the power is unshot. The largest difference over all elements and channels, relative to the element's \
               irradiance or the scene's mean, whichever is larger."
            .into(),
        ..Section::default()
    };
    let mut table = Vec::new();
    for case in scenes::all() {
        let world = case.world();
        let exact = Dense::new(&world).solve();
        let (state, _, progress) = solve(&world, 1e-9);
        let elements = || state.clusters.iter().flat_map(|cluster| &cluster.elements);
        let mean: Vec<[f64; 3]> = elements().map(|e| e.mean().map(f64::from)).collect();
        let point: Vec<[f64; 3]> = elements().map(|e| e.at_point().map(f64::from)).collect();
        for (what, exact, found) in [("area averages", exact.mean, mean), ("at sample points", exact.point, point)] {
            let case = format!("{}: {what}", case.name);
            section.rows.push(Row { case, expected: 1e-6, found: worst(&exact, &found), bound: Bound::AtMost });
        }
        let mesh = &case.scene.mesh;
        let counts =
            [mesh.patch_count() as u64, mesh.element_count() as u64, case.settings.cells.into(), progress.shots];
        table.push([vec![case.name.into()], counts.map(|n| n.to_string()).to_vec()].concat());
    }
    section.table = Some((["scene", "patches", "elements", "cells", "shots"].map(String::from).to_vec(), table));
    section
}

/// The largest difference, relative to the expected value or to their mean, whichever is larger.
fn worst(expected: &[[f64; 3]], found: &[[f64; 3]]) -> f64 {
    assert_eq!(expected.len(), found.len());
    let mean = |c: usize| expected.iter().map(|e| e[c]).sum::<f64>() / expected.len() as f64;
    let mean = [mean(0), mean(1), mean(2)];
    let differences =
        expected.iter().zip(found).flat_map(|(e, f)| (0..3).map(move |c| (f[c] - e[c]).abs() / e[c].max(mean[c])));
    differences.inspect(|d| assert!(d.is_finite())).fold(0.0, f64::max)
}
