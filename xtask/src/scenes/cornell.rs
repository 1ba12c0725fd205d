//! The Cornell box, from the measurements published by the Cornell Program of Computer Graphics.

use std::fmt::Write;

/// Reflectance of the white, green and red paint, every 4 nm.
const REFLECTANCE: &str = include_str!("cornell_reflectance.csv");

/// From 400 nm to 700 nm every 10 nm: relative power of CIE illuminant D65, and the CIE 1931 colour matching functions.
const OBSERVER: [[f64; 4]; 31] = [
    [82.7549, 0.01431, 0.000396, 0.06785],
    [91.486, 0.04351, 0.00121, 0.2074],
    [93.4318, 0.13438, 0.004, 0.6456],
    [86.6823, 0.2839, 0.0116, 1.3856],
    [104.865, 0.34828, 0.023, 1.74706],
    [117.008, 0.3362, 0.038, 1.77211],
    [117.812, 0.2908, 0.06, 1.6692],
    [114.861, 0.19536, 0.09098, 1.28764],
    [115.923, 0.09564, 0.13902, 0.81295],
    [108.811, 0.03201, 0.20802, 0.46518],
    [109.354, 0.0049, 0.323, 0.272],
    [107.802, 0.0093, 0.503, 0.1582],
    [104.79, 0.06327, 0.71, 0.07825],
    [107.689, 0.1655, 0.862, 0.04216],
    [104.405, 0.2904, 0.954, 0.0203],
    [104.046, 0.43345, 0.99495, 0.00875],
    [100.0, 0.5945, 0.995, 0.0039],
    [96.3342, 0.7621, 0.952, 0.0021],
    [95.788, 0.9163, 0.87, 0.00165],
    [88.6856, 1.0263, 0.757, 0.0011],
    [90.0062, 1.0622, 0.631, 0.0008],
    [89.5991, 1.0026, 0.503, 0.00034],
    [87.6987, 0.85445, 0.381, 0.00019],
    [83.2886, 0.6424, 0.265, 0.00005],
    [83.6992, 0.4479, 0.175, 0.00002],
    [80.0268, 0.2835, 0.107, 0.0],
    [80.2146, 0.1649, 0.061, 0.0],
    [82.2778, 0.0874, 0.032, 0.0],
    [78.2842, 0.04677, 0.017, 0.0],
    [69.7213, 0.0227, 0.00821, 0.0],
    [71.6091, 0.011359, 0.004102, 0.0],
];

/// Relative emission of the light at 400, 500, 600 and 700 nm.
const EMISSION: [f64; 4] = [0.0, 8.0, 15.6, 18.4];

/// Reflectance of the light.
const LIGHT_REFLECTANCE: f64 = 0.78;

/// The `.obj` file. The published corners are in millimetres; the file is in metres.
pub fn obj() -> String {
    let mut file = String::from(
        "# The Cornell box as measured by the Cornell Program of Computer Graphics; metres\nmtllib cornell_box.mtl\n",
    );
    let (light_x, light_z) = ([0, 2130, 3430, 5560], [0, 2270, 3320, 5592]);
    let mut ceiling = Vec::new();
    for (row, z) in light_z.windows(2).enumerate() {
        for (column, x) in light_x.windows(2).enumerate() {
            if (row, column) != (1, 1) {
                ceiling.push([[x[0], 5488, z[0]], [x[1], 5488, z[0]], [x[1], 5488, z[1]], [x[0], 5488, z[1]]]);
            }
        }
    }
    let light = [[2130, 5488, 2270], [3430, 5488, 2270], [3430, 5488, 3320], [2130, 5488, 3320]];
    let floor = [[5528, 0, 0], [0, 0, 0], [0, 0, 5592], [5496, 0, 5592]];
    let back = [[5496, 0, 5592], [0, 0, 5592], [0, 5488, 5592], [5560, 5488, 5592]];
    let right = [[0, 0, 5592], [0, 0, 0], [0, 5488, 0], [0, 5488, 5592]];
    let left = [[5528, 0, 0], [5496, 0, 5592], [5560, 5488, 5592], [5560, 5488, 0]];
    let mut write = |name: &str, material: &str, faces: &[[[i32; 3]; 4]]| {
        writeln!(file, "g {name}\nusemtl {material}").expect("writing to a string");
        for face in faces {
            for corner in face {
                let [x, y, z] = corner.map(|tenths| f64::from(tenths) / 10000.0);
                writeln!(file, "v {x} {y} {z}").expect("writing to a string");
            }
            file.push_str("f -4 -3 -2 -1\n");
        }
    };
    write("floor", "white", &[floor]);
    write("ceiling", "white", &ceiling);
    write("light", "light", &[light]);
    write("back_wall", "white", &[back]);
    write("right_wall", "green", &[right]);
    write("left_wall", "red", &[left]);
    write("short_block", "white", &block([[130, 65], [82, 225], [240, 272], [290, 114]], 165));
    write("tall_block", "white", &block([[423, 247], [265, 296], [314, 456], [472, 406]], 330));
    file
}

/// Top and sides of a block that stands on the floor, in tenths of millimetres; its corners come in millimetres.
fn block(corners: [[i32; 2]; 4], height: i32) -> Vec<[[i32; 3]; 4]> {
    let at = |[x, z]: [i32; 2], y: i32| [10 * x, 10 * y, 10 * z];
    let mut faces = vec![corners.map(|corner| at(corner, height))];
    for i in 0..4 {
        let (a, b) = (corners[i], corners[(i + 1) % 4]);
        faces.push([at(b, height), at(a, height), at(a, 0), at(b, 0)]);
    }
    faces
}

/// The `.mtl` file: spectra as linear sRGB, the paints' under D65, the light's scaled so that equal energy of 1 has the
/// luminance 1.
pub fn mtl() -> String {
    let mut file = String::from("# Measured spectra as linear sRGB\n");
    let paints = paints();
    for (name, column) in [("white", 1), ("green", 2), ("red", 3)] {
        let colour = linear_srgb(|nanometres, d65| d65 * interpolated(&paints, column, nanometres), true);
        writeln!(file, "\nnewmtl {name}\nKd {}", text(colour)).expect("writing to a string");
    }
    let emission = linear_srgb(
        |nanometres, _| {
            let position = (nanometres - 400.0) / 100.0;
            let below = (position as usize).min(2);
            EMISSION[below] + (EMISSION[below + 1] - EMISSION[below]) * (position - below as f64)
        },
        false,
    );
    let reflectance = text([LIGHT_REFLECTANCE; 3]);
    writeln!(file, "\nnewmtl light\nKd {reflectance}\nKe {}", text(emission)).expect("writing to a string");
    file
}

fn text(colour: [f64; 3]) -> String {
    colour.map(|channel| format!("{channel:.5}")).join(" ")
}

/// Rows of wavelength, white, green, red.
fn paints() -> Vec<[f64; 4]> {
    let rows = REFLECTANCE.lines().filter(|line| line.starts_with(|c: char| c.is_ascii_digit()));
    rows.map(|row| {
        let mut numbers = row.split(',').map(|number| number.parse().expect("a number in the table"));
        [0; 4].map(|_: u8| numbers.next().expect("four columns in the table"))
    })
    .collect()
}

fn interpolated(rows: &[[f64; 4]], column: usize, nanometres: f64) -> f64 {
    let above = rows.partition_point(|row| row[0] < nanometres).clamp(1, rows.len() - 1);
    let (low, high) = (rows[above - 1], rows[above]);
    let share = (nanometres - low[0]) / (high[0] - low[0]);
    low[column] + (high[column] - low[column]) * share
}

/// Colour of a spectrum, given at a wavelength and the power of D65 there. Relative to D65 a perfect reflector is 1, 1, 1.
fn linear_srgb(spectrum: impl Fn(f64, f64) -> f64, relative_to_d65: bool) -> [f64; 3] {
    let (mut sum, mut white) = ([0.0; 3], [0.0; 3]);
    for (step, [d65, functions @ ..]) in OBSERVER.into_iter().enumerate() {
        let value = spectrum(400.0 + 10.0 * step as f64, d65);
        for channel in 0..3 {
            sum[channel] += value * functions[channel];
            white[channel] += if relative_to_d65 { d65 } else { 1.0 } * functions[channel];
        }
    }
    let rgb = |[x, y, z]: [f64; 3]| {
        [
            3.2404542 * x - 1.5371385 * y - 0.4985314 * z,
            -0.969266 * x + 1.8760108 * y + 0.041556 * z,
            0.0556434 * x - 0.2040259 * y + 1.0572252 * z,
        ]
    };
    let scale = white[1];
    let colour = rgb(sum.map(|value| value / scale));
    if !relative_to_d65 {
        return colour.map(|channel| channel.max(0.0));
    }
    let white = rgb(white.map(|value| value / scale));
    [0, 1, 2].map(|channel| colour[channel] / white[channel])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grey_reflector_is_grey() {
        let grey = linear_srgb(|_, d65| 0.5 * d65, true);
        assert!(grey.iter().all(|channel| (channel - 0.5).abs() < 1e-12));
    }

    #[test]
    fn the_light_keeps_its_luminance() {
        let [red, green, blue] = linear_srgb(|_, _| 3.0, false);
        assert!((0.2126729 * red + 0.7151522 * green + 0.072175 * blue - 3.0).abs() < 1e-5);
    }
}
