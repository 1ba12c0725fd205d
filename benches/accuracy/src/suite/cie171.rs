//! CIE 171:2006, test cases to assess the accuracy of lighting computer programs: 5.3, 5.6 and 5.8.

use crate::scene::{Builder, Meshed, Place, meshed, solve};
use crate::{Bound, Row, Section};
use ringlight::scene::{Light, LightKind};
use std::f64::consts::PI;

/// Points on the wall y = 0 (normal +y), by their height z above the floor of cases 5.3 and 5.6.
const WALL: [f64; 6] = [0.25, 0.75, 1.25, 1.75, 2.25, 2.75];

/// Points on the floor of 5.3 and the ceiling of 5.6, by y; their x is 2.
const FLOOR: [f64; 8] = [0.25, 0.75, 1.25, 1.75, 2.25, 2.75, 3.25, 3.75];

/// 5.3: direct illuminance, lux, points A to N: the wall from the ceiling down, then the floor.
const AREA_SOURCE: [f64; 14] = [
    32.6769, 75.1939, 81.3232, 69.0606, 53.4035, 40.0019, 61.4241, 79.2552, 95.6673, 105.7782, 105.7782, 95.6673,
    79.2552, 61.4241,
];

/// 5.6: form factor to the ground S1, S2, S3 times 100, points A to N: the wall upwards, then the ceiling.
const GROUND: [(&str, f64, [f64; 14]); 3] = [
    (
        "S1, 0.5 m",
        0.5,
        [
            0.2458, 0.5799, 0.6444, 0.5564, 0.4333, 0.3251, 0.4914, 0.6391, 0.7776, 0.8643, 0.8643, 0.7776, 0.6391,
            0.4914,
        ],
    ),
    (
        "S2, 4 m",
        4.0,
        [
            45.1226, 35.9005, 27.9916, 21.6385, 16.7163, 12.9674, 26.7952, 30.9387, 33.9757, 35.5666, 35.5666, 33.9757,
            30.9387, 26.7952,
        ],
    ),
    (
        "S3, 500 m",
        500.0,
        [
            49.9435, 49.8305, 49.7175, 49.6045, 49.4915, 49.3785, 99.9882, 99.9882, 99.9882, 99.9882, 99.9882, 99.9882,
            99.9882, 99.9882,
        ],
    ),
];

/// 5.3: luminous area source.
pub fn area_source() -> Section {
    let mut section = Section {
        title: "CIE 171:2006, case 5.3: an area source".into(),
        text: "A black room of 4 × 4 × 3 m with a square of 1 m and 1000 cd/m² in the middle of its ceiling: direct illuminance, \
               lux, at points A to F on a wall and G to N on the floor. The exact values are a recomputation of those of \
               the standard to 1e-4, which allows 5 %. Gathered at the points; then as the model displays it, from elements of 0.125 m."
            .into(),
        ..Section::default()
    };
    let room = lit_room();
    let world = room.world(16);
    let (state, ..) = solve(&world, 1e-3);
    let solution = room.solution(&world, state);
    let wall = WALL.iter().rev().map(|&z| ([2.0, 0.0, z], [0.0, 1.0, 0.0]));
    let floor = FLOOR.iter().map(|&y| ([2.0, y, 0.0], [0.0, 0.0, 1.0]));
    let points: Vec<Place> = wall.chain(floor).collect();
    for (how, found, bound) in
        [("gathered", room.gathered(&solution, &points), 1e-4), ("displayed", room.displayed(&solution, &points), 0.01)]
    {
        for (k, (expected, found)) in AREA_SOURCE.into_iter().zip(found).enumerate() {
            let case = format!("{}, {how}", letter(k));
            section.rows.push(Row { case, expected, found: found[0], bound: Bound::Relative(bound) });
        }
    }
    section
}

/// The letter of a point.
fn letter(k: usize) -> char {
    char::from(b'A' + k as u8)
}

/// The black room of case 5.3: the source is set into the ceiling.
fn lit_room() -> Meshed {
    let mut builder = Builder::default();
    let black = builder.material([0.0; 3], [0.0; 3]);
    let light = builder.material([0.0; 3], [(1000.0 * PI) as f32; 3]);
    // Five faces of a cuboid; the ceiling has a hole.
    builder.face(&black, &[[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 4.0, 0.0], [0.0, 4.0, 0.0]]);
    let corners = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]];
    for (k, [ax, ay]) in corners.into_iter().enumerate() {
        let [bx, by] = corners[(k + 1) % 4];
        builder.face(&black, &[[ax, ay, 3.0], [bx, by, 3.0], [bx, by, 0.0], [ax, ay, 0.0]]);
    }
    let lines = [0.0, 1.5, 2.5, 4.0];
    for (i, x) in lines.windows(2).enumerate() {
        for (j, y) in lines.windows(2).enumerate() {
            let material = if (i, j) == (1, 1) { &light } else { &black };
            builder.face(material, &[[x[0], y[0], 3.0], [x[0], y[1], 3.0], [x[1], y[1], 3.0], [x[1], y[0], 3.0]]);
        }
    }
    meshed(builder.scene(true), 0.5, 0.125)
}

/// 5.6: light reflected by a diffuse ground.
pub fn ground() -> Section {
    let mut section = Section {
        title: "CIE 171:2006, case 5.6: light reflected by a diffuse surface".into(),
        text: "A horizontal diffuse square of exitance 100 and 0.5 m, 4 m or 500 m: irradiance at points A to F on a wall over its \
               middle and G to N on a ceiling 3 m above, which is 100 times the form factor. The exact values are a \
               recomputation of those of the standard to 1e-4. Gathered at the points."
            .into(),
        ..Section::default()
    };
    let wall = WALL.iter().map(|&z| ([2.0, 0.0, z], [0.0, 1.0, 0.0]));
    let ceiling = FLOOR.iter().map(|&y| ([2.0, y, 3.0], [0.0, 0.0, -1.0]));
    let points: Vec<Place> = wall.chain(ceiling).collect();
    for (name, side, values) in GROUND {
        let mut builder = Builder::default();
        let bright = builder.material([0.0; 3], [100.0; 3]);
        let (low, high) = (2.0 - side / 2.0, 2.0 + side / 2.0);
        builder.face(&bright, &[[low, low, 0.0], [high, low, 0.0], [high, high, 0.0], [low, high, 0.0]]);
        let scene = meshed(builder.scene(true), side, side);
        let world = scene.world(16);
        let (state, ..) = solve(&world, 1e-3);
        let solution = scene.solution(&world, state);
        for (k, (expected, found)) in values.into_iter().zip(scene.gathered(&solution, &points)).enumerate() {
            let case = format!("{name}: {}", letter(k));
            // The values have four decimals.
            let bound = Bound::Larger { relative: 1e-4, absolute: 5e-5 };
            section.rows.push(Row { case, expected, found: found[0], bound });
        }
    }
    section
}

/// Luminous flux of the lamp of case 5.8, lm.
const FLUX: f64 = 10_000.0;

/// 5.8: a closed diffuse room with a lamp in its middle.
pub fn interreflection() -> Section {
    let mut section = Section {
        title: "CIE 171:2006, case 5.8: interreflection".into(),
        text: "A closed room of 4 × 4 × 4 m with an isotropic lamp of 10,000 lm in its middle: mean indirect illuminance, lux, over \
               all surfaces, which is Φ/S · ρ/(1 − ρ) with S = 96 m². Patches of 2 m, elements of 0.5 m, M = 16 cells, until \
               0.00001 of the power is unshot, three reflectances as the channels of one solve. At ρ = 0.95 what the rows of \
               form factors lack or have too much counts twenty-fold."
            .into(),
        ..Section::default()
    };
    let mut direct = 0.0;
    for reflectances in [[0.0, 0.05, 0.1], [0.2, 0.3, 0.4], [0.5, 0.6, 0.7], [0.8, 0.9, 0.95]] {
        let mut builder = Builder::default();
        builder.cuboid([0.0; 3], [4.0; 3], true, |b| b.material(reflectances.map(|r| r as f32), [0.0; 3]));
        let mut scene = builder.scene(true);
        let kind = LightKind::Point { position: [2.0; 3], range: f64::INFINITY };
        let intensity = [(FLUX / (4.0 * PI)) as f32; 3];
        scene.lights.push(Light { name: "lamp".into(), intensity, kind, node: 0 });
        let room = meshed(scene, 2.0, 0.5);
        let world = room.world(16);
        let (state, ..) = solve(&world, 1e-5);
        let found = room.mean_irradiance(&state, |_| true);
        for (rho, found) in reflectances.into_iter().zip(found) {
            let mut row = |case: String, expected: f64, found: f64, bound: f64| {
                section.rows.push(Row { case, expected, found, bound: Bound::Relative(bound) });
            };
            let exact = FLUX / 96.0;
            if rho == 0.0 {
                direct = found;
                row("ρ = 0: all, which is direct".into(), exact, found, 5e-4);
            } else {
                row(format!("ρ = {rho}: all less direct"), exact * rho / (1.0 - rho), found - direct, 0.001);
            }
        }
    }
    section
}
