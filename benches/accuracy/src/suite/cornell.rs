//! The Cornell box: irradiance at points.

use crate::page::number;
use crate::scene::{Builder, Meshed, Place, meshed, solve};
use crate::{Bound, Row, Section};

/// A point on a named surface, millimetres, and the irradiance there for a light of exitance 1: direct, and in all at
/// 500, 560, 600 and 700 nm.
struct Measured {
    surface: &'static str,
    position: [f64; 3],
    direct: f64,
    total: [f64; 4],
}

const fn point(surface: &'static str, position: [f64; 3], direct: f64, total: [f64; 4]) -> Measured {
    Measured { surface, position, direct, total }
}

/// Path traced, independently of Ringlight: errors 0.1 % in the mean, 0.45 % at most.
#[rustfmt::skip]
const POINTS: [Measured; 20] = [
    point("floor", [60.0, 0.0, 40.0], 0.002246, [0.003912, 0.004094, 0.003558, 0.003829]),
    point("floor", [60.0, 0.0, 279.6], 0.010689, [0.016023, 0.016326, 0.015046, 0.015338]),
    point("floor", [180.0, 0.0, 40.0], 0.000000, [0.000753, 0.000807, 0.000898, 0.001420]),
    point("floor", [180.0, 0.0, 480.0], 0.010504, [0.017065, 0.017221, 0.016444, 0.017043]),
    point("floor", [278.0, 0.0, 279.6], 0.010476, [0.014790, 0.014805, 0.014804, 0.015661]),
    point("floor", [376.0, 0.0, 40.0], 0.009590, [0.011178, 0.011206, 0.011713, 0.012928]),
    point("floor", [376.0, 0.0, 480.0], 0.000000, [0.004248, 0.004242, 0.004598, 0.006088]),
    point("floor", [500.0, 0.0, 150.0], 0.009491, [0.011114, 0.011168, 0.012156, 0.014365]),
    point("floor", [500.0, 0.0, 480.0], 0.000000, [0.002633, 0.002627, 0.003305, 0.005116]),
    point("back", [60.0, 274.4, 559.2], 0.008246, [0.013064, 0.013418, 0.012169, 0.012637]),
    point("back", [278.0, 60.0, 559.2], 0.004548, [0.010528, 0.010590, 0.010179, 0.010930]),
    point("back", [278.0, 500.0, 559.2], 0.009385, [0.016024, 0.016071, 0.016213, 0.017654]),
    point("back", [500.0, 274.4, 559.2], 0.008107, [0.010899, 0.010942, 0.012453, 0.015738]),
    point("right(green)", [0.0, 60.0, 60.0], 0.004383, [0.006430, 0.006506, 0.006244, 0.006514]),
    point("right(green)", [0.0, 500.0, 60.0], 0.003730, [0.006986, 0.007004, 0.007366, 0.008496]),
    point("right(green)", [0.0, 274.4, 279.6], 0.014063, [0.020230, 0.020228, 0.020426, 0.021624]),
    point("right(green)", [0.0, 60.0, 500.0], 0.004372, [0.012217, 0.012212, 0.011830, 0.012445]),
    point("right(green)", [0.0, 500.0, 500.0], 0.003704, [0.009968, 0.009987, 0.010092, 0.011335]),
    point("tall-top", [368.0, 330.0, 351.0], 0.054298, [0.060030, 0.060026, 0.060811, 0.062959]),
    point("ceiling", [150.0, 548.8, 100.0], 0.000000, [0.004961, 0.005125, 0.004732, 0.005473]),
];

/// Wavelengths, nm.
const WAVELENGTHS: [u32; 4] = [500, 560, 600, 700];

/// Measured reflectance of the white, green and red paint at those wavelengths (Cornell Program of Computer Graphics).
const WHITE: [f32; 4] = [0.747, 0.733, 0.740, 0.737];
const GREEN: [f32; 4] = [0.285, 0.337, 0.160, 0.159];
const RED: [f32; 4] = [0.058, 0.067, 0.287, 0.642];

/// Reflectance of the light.
const LIGHT: [f32; 4] = [0.78; 4];

/// Three of the four wavelengths, as the channels of one solve.
const CHANNELS: [[usize; 3]; 2] = [[0, 1, 2], [1, 2, 3]];

/// Largest edges of patches and elements, metres.
const SIZES: [f64; 2] = [0.06, 0.03];

/// Share of the power that is left unshot.
const UNTIL: f64 = 3e-4;

/// All points, direct and in all, at four wavelengths.
pub fn measure() -> Section {
    let places: Vec<Place> = POINTS.iter().map(|p| (p.position.map(|x| x / 1000.0), normal(p.surface))).collect();
    let mut total = vec![[0.0; 4]; POINTS.len()];
    for channels in CHANNELS {
        let lit = solved(|paint| channels.map(|k| paint[k]), &places);
        for (total, lit) in total.iter_mut().zip(lit) {
            channels.iter().zip(lit).for_each(|(&k, e)| total[k] = e);
        }
    }
    let direct: Vec<f64> = solved(|_| [0.0; 3], &places).into_iter().map(|e| e[0]).collect();
    section(&direct, &total)
}

/// What was found at the points beside what was measured.
fn section(direct: &[f64], total: &[[f64; 4]]) -> Section {
    let mut section = Section {
        title: "The Cornell box".into(),
        text: format!(
            "The Cornell box as published (blocks, measured reflectances, light of reflectance 0.78, front open, the left wall \
             bilinear between its corners): irradiance at 20 points for a light of exitance 1, direct and in all at four \
             wavelengths, beside path-traced values whose own error is 0.1 % in the mean and 0.45 % at most. Patches of \
             {} mm, elements of {} mm, M = 16 cells, until {UNTIL} of the power is unshot; gathered at the points.",
            1000.0 * SIZES[0],
            1000.0 * SIZES[1],
        ),
        ..Section::default()
    };
    let mut rows = |name: &str, pairs: &[(f64, f64)]| {
        // Where no light is expected, there must be none.
        let deviation = |&(e, f): &(f64, f64)| if e == 0.0 { f64::from(f.abs() > 1e-6) } else { (f / e - 1.0).abs() };
        let worst = pairs.iter().map(deviation).fold(0.0, |a, d| if d > a || d.is_nan() { d } else { a });
        let mean = pairs.iter().map(deviation).sum::<f64>() / pairs.len() as f64;
        let bias = pairs.iter().map(|(e, f)| f - e).sum::<f64>() / pairs.iter().map(|(e, _)| e).sum::<f64>();
        for (what, value, bound) in [("largest deviation", worst, 0.01), ("mean deviation", mean, 0.003)] {
            section.rows.push(Row {
                case: format!("{name}: {what}"),
                expected: bound,
                found: value,
                bound: Bound::AtMost,
            });
        }
        let case = format!("{name}: mean of all, over that of the references");
        section.rows.push(Row { case, expected: 1.0, found: 1.0 + bias, bound: Bound::Relative(0.003) });
    };
    let of = |found: &[f64], expected: &dyn Fn(&Measured) -> f64| -> Vec<(f64, f64)> {
        POINTS.iter().map(expected).zip(found.iter().copied()).collect()
    };
    rows("direct", &of(direct, &|p| p.direct));
    for (k, wavelength) in WAVELENGTHS.into_iter().enumerate() {
        let found: Vec<f64> = total.iter().map(|t| t[k]).collect();
        rows(&format!("{wavelength} nm"), &of(&found, &|p| p.total[k]));
    }
    let headings =
        ["surface", "x, y, z (mm)", "direct", "500 nm", "560 nm", "600 nm", "700 nm"].map(String::from).to_vec();
    let cells = POINTS.iter().zip(direct).zip(total).map(|((p, &direct), total)| {
        let [x, y, z] = p.position;
        let cell = |(expected, found): (f64, f64)| match expected {
            0.0 => number(found),
            _ => format!("{} ({:+.2} %)", number(found), 100.0 * (found / expected - 1.0)),
        };
        let mut cells = vec![p.surface.to_string(), format!("{x}, {y}, {z}"), cell((p.direct, direct))];
        cells.extend(p.total.into_iter().zip(*total).map(cell));
        cells
    });
    section.table = Some((headings, cells.collect()));
    section
}

/// Normals of the surfaces that have points.
fn normal(surface: &str) -> [f64; 3] {
    match surface {
        "floor" | "tall-top" => [0.0, 1.0, 0.0],
        "ceiling" => [0.0, -1.0, 0.0],
        "back" => [0.0, 0.0, -1.0],
        _ => [1.0, 0.0, 0.0],
    }
}

/// Irradiance at the points, the box painted as `paint` says of reflectances at the four wavelengths.
fn solved(paint: impl Fn([f32; 4]) -> [f32; 3], places: &[Place]) -> Vec<[f64; 3]> {
    let scene = cornell_box(paint);
    let world = scene.world(16);
    let (state, ..) = solve(&world, UNTIL);
    let solution = scene.solution(&world, state);
    scene.gathered(&solution, places)
}

/// Parts of the left wall along each edge, which is not quite flat.
const LEFT_WALL_PARTS: u32 = 4;

/// The box, in metres.
fn cornell_box(paint: impl Fn([f32; 4]) -> [f32; 3]) -> Meshed {
    let mut builder = Builder::default();
    let mut painted = |paint: [f32; 3], exitance: f32| builder.material(paint, [exitance; 3]);
    let [white, green, red] = [WHITE, GREEN, RED].map(|p| painted(paint(p), 0.0));
    let light = painted(paint(LIGHT), 1.0);
    let mut face = |material: &str, corners: [[f64; 3]; 4]| {
        builder.face(material, &corners.map(|c| c.map(|x| x / 1000.0)));
    };
    face(&white, [[552.8, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 559.2], [549.6, 0.0, 559.2]]);
    face(&white, [[549.6, 0.0, 559.2], [0.0, 0.0, 559.2], [0.0, 548.8, 559.2], [556.0, 548.8, 559.2]]);
    face(&green, [[0.0, 0.0, 559.2], [0.0, 0.0, 0.0], [0.0, 548.8, 0.0], [0.0, 548.8, 559.2]]);
    // The light is set into the ceiling.
    let (xs, zs) = ([0.0, 213.0, 343.0, 556.0], [0.0, 227.0, 332.0, 559.2]);
    for (i, x) in xs.windows(2).enumerate() {
        for (j, z) in zs.windows(2).enumerate() {
            let material = if (i, j) == (1, 1) { &light } else { &white };
            face(material, [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(a, b)| [x[a], 548.8, z[b]]));
        }
    }
    let left = |i: u32, j: u32| {
        let [s, t] = [i, j].map(|k| f64::from(k) / f64::from(LEFT_WALL_PARTS));
        let below = 552.8 + s * (549.6 - 552.8);
        [below + t * (556.0 - below), t * 548.8, s * 559.2]
    };
    for i in 0..LEFT_WALL_PARTS {
        for j in 0..LEFT_WALL_PARTS {
            face(&red, [left(i, j), left(i + 1, j), left(i + 1, j + 1), left(i, j + 1)]);
        }
    }
    let short = [[130.0, 65.0], [82.0, 225.0], [240.0, 272.0], [290.0, 114.0]];
    let tall = [[423.0, 247.0], [265.0, 296.0], [314.0, 456.0], [472.0, 406.0]];
    for (outline, height) in [(short, 165.0), (tall, 330.0)] {
        face(&white, outline.map(|[x, z]| [x, height, z]));
        for k in 0..4 {
            let ([ax, az], [bx, bz]) = (outline[k], outline[(k + 1) % 4]);
            face(&white, [[bx, height, bz], [ax, height, az], [ax, 0.0, az], [bx, 0.0, bz]]);
        }
    }
    meshed(builder.scene(true), SIZES[0], SIZES[1])
}
