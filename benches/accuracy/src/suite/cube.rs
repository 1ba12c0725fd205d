//! The unit cube with a glowing floor.

use crate::scene::{Builder, meshed, solve};
use crate::{Bound, Row, Section};
use ringlight::mesh::Patch;
use ringlight::shooting::Shoot;
use ringlight::solve::{SolveSettings, Solver};

/// Radiosity of floor, ceiling and walls with one patch for each face, from the closed forms of the area-averaged form
/// factors of opposite and adjacent squares (Howell C-11 and C-14).
const ONE_PATCH: [f64; 3] = [1.090909, 0.181746, 0.181836];

/// Mean radiosity of the same faces with ever finer patches.
const FINE: [f64; 3] = [1.1043, 0.1712, 0.1811];

/// Coarse and fine.
pub fn measure() -> Section {
    let mut section = Section {
        title: "The unit cube".into(),
        text: "A cube of 1 m, all reflectances 0.5, the exitance of the floor 1: mean radiosity of its faces. With one patch for \
               each face, which shoots its average everywhere, the exact values follow from the closed forms of the area-averaged form \
               factors; with ever finer patches they go to the solution of the integral equation, here to its four known digits."
            .into(),
        ..Section::default()
    };
    for (name, [patch, element], shoot, expected, bound) in [
        ("one patch for each face", [1.0, 0.125], Shoot::Average, ONE_PATCH, 1e-4),
        ("patches of 0.25 m", [0.25, 0.0625], Shoot::Elements, FINE, 5e-4),
    ] {
        let mut builder = Builder::default();
        let mut faces = 0;
        // The third face is the floor: axis y, lower side.
        builder.cuboid([0.0; 3], [1.0; 3], true, |b| {
            faces += 1;
            b.material([0.5; 3], [f32::from(u8::from(faces == 3)); 3])
        });
        let cube = meshed(builder.scene(true), patch, element);
        let settings = SolveSettings { solver: Solver::Plain, cells: 64, shoot, sky: None, shooters_in_flight: 1 };
        let world = cube.world_of(settings);
        let (state, ..) = solve(&world, 1e-6);
        let face = |y: f64| move |patch: &Patch| (patch.normal.y - y).abs() < 0.5;
        let mean = |y: f64| 0.5 * cube.mean_irradiance(&state, face(y))[0];
        let found = [1.0 + mean(1.0), mean(-1.0), mean(0.0)];
        for ((face, expected), found) in ["floor", "ceiling", "walls"].into_iter().zip(expected).zip(found) {
            let case = format!("{name}: {face}");
            section.rows.push(Row { case, expected, found, bound: Bound::Relative(bound) });
        }
    }
    section
}
