//! Streams written by meshoptimizer 1.1's own encoders; the decoder was also compared with it on thousands of random ones.

use super::*;

fn decoded(data: &[u8], mode: &str, stride: u64, count: u64, filter: Option<&str>) -> Result<Vec<u8>, String> {
    let view = Meshopt {
        buffer: 0,
        byte_offset: 0,
        byte_length: data.len() as u64,
        byte_stride: stride,
        count,
        mode: mode.to_owned(),
        filter: filter.map(str::to_owned),
    };
    decode(data, &view)
}

/// 20 rows of two rising 16-bit numbers and a float, in bit stream version 0.
const ROWS_0: &[u8] = &[
    160, 7, 0, 88, 88, 88, 88, 88, 88, 88, 88, 88, 88, 88, 88, 88, 88, 88, 255, 0, 0, 0, 88, 88, 88, 88, 5, 58, 171,
    170, 186, 4, 4, 4, 174, 0, 0, 0, 4, 10, 10, 170, 170, 170, 170, 170, 170, 170, 170, 170, 0, 0, 0, 0, 0, 0, 0, 0, 0,
    7, 0, 32, 32, 32, 32, 32, 32, 32, 32, 16, 16, 16, 16, 16, 16, 16, 255, 0, 0, 0, 16, 16, 16, 16, 1, 0, 0, 128, 0, 0,
    0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 232, 3, 0, 0, 0, 0, 128, 63,
];

/// The same in version 1, which predicts 16-bit numbers and the bits of floats as such.
const ROWS_1: &[u8] = &[
    161, 151, 104, 0, 88, 88, 88, 88, 88, 88, 88, 88, 88, 88, 88, 88, 88, 88, 88, 88, 88, 88, 88, 5, 42, 170, 170, 170,
    170, 0, 0, 0, 2, 10, 170, 170, 170, 170, 170, 170, 170, 15, 0, 10, 10, 10, 10, 1, 0, 1, 15, 2, 2, 98, 226, 98, 241,
    49, 113, 49, 254, 15, 0, 15, 1, 3, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 232, 3, 0, 0, 0, 0, 128, 63, 1, 82,
];

/// A grid of nine squares and a triangle with free vertices, in versions 0 and 1.
const GRID_0: &[u8] = &[
    224, 254, 31, 16, 15, 16, 15, 143, 31, 20, 15, 19, 15, 143, 31, 19, 15, 19, 15, 255, 15, 8, 2, 2, 2, 2, 2, 2, 2, 2,
    2, 2, 2, 31, 29, 136, 14, 0, 118, 135, 86, 103, 120, 169, 134, 101, 137, 104, 152, 1, 105, 0, 0,
];
const GRID_1: &[u8] = &[
    225, 254, 30, 16, 14, 16, 14, 142, 30, 20, 14, 19, 14, 142, 30, 19, 14, 19, 14, 255, 15, 8, 31, 29, 136, 14, 0,
    118, 135, 86, 103, 120, 169, 134, 101, 137, 104, 152, 1, 105, 0, 0,
];

const SEQUENCE: &[u8] = &[209, 28, 4, 2, 177, 9, 5, 164, 139, 17, 0, 0, 0, 0];

#[test]
fn attributes_of_both_versions() {
    let row = |number: u16| {
        let integers = [(1000 + 300 * number).to_le_bytes(), (5 * number).to_le_bytes()].concat();
        [integers, (1.0 + f32::from(number) / 8.0).to_le_bytes().to_vec()].concat()
    };
    let expected: Vec<u8> = (0..20).flat_map(row).collect();
    assert_eq!(decoded(ROWS_0, "ATTRIBUTES", 8, 20, None).as_ref(), Ok(&expected));
    assert_eq!(decoded(ROWS_1, "ATTRIBUTES", 8, 20, Some("NONE")).as_ref(), Ok(&expected));
}

#[test]
fn triangles_of_both_versions() {
    // The encoder turns triangles so that they start with an edge of the one before.
    let row = |a: u16| {
        let (b, c, d) = (a + 4, a + 1, a + 2);
        [a, c, b, b, c, b + 1, b + 1, c, d, b + 1, d, b + 2, b + 2, d, d + 1, b + 2, d + 1, b + 3]
    };
    let mut expected: Vec<u16> = [0, 4, 8].into_iter().flat_map(row).collect();
    expected.extend([0, 15, 900]);
    let bytes: Vec<u8> = expected.iter().flat_map(|index| index.to_le_bytes()).collect();
    for data in [GRID_0, GRID_1] {
        assert_eq!(decoded(data, "TRIANGLES", 2, 57, None).as_ref(), Ok(&bytes));
    }
}

#[test]
fn index_sequences() {
    let expected: Vec<u8> = [7_u32, 8, 7, 300, 301, 70000].iter().flat_map(|index| index.to_le_bytes()).collect();
    assert_eq!(decoded(SEQUENCE, "INDICES", 4, 6, None), Ok(expected));
}

#[test]
fn filters_are_undone() {
    let mut floats = [0, 48, 0, 243, 128, 193, 255, 252, 0, 0, 0, 242];
    exponential(&mut floats);
    assert_eq!(
        floats.as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect::<Vec<_>>(),
        [1.5, -1000.0, 0.0]
    );

    let mut rotations = [89, 250, 167, 5, 167, 5, 252, 7, 0, 0, 55, 249, 0, 0, 255, 7];
    quaternion(&mut rotations);
    let components: Vec<f32> =
        rotations.as_chunks().0.iter().map(|bytes| f32::from(i16::from_le_bytes(*bytes)) / 32767.0).collect();
    // A rotation and its negative are the same; twelve bits per component.
    for (found, expected) in components.chunks(4).zip([[0.5, -0.5, 0.5, 0.5], [0.0, 0.6, 0.0, -0.8_f32]]) {
        let cosine: f32 = found.iter().zip(expected).map(|(a, b)| a * b).sum();
        assert!((cosine.abs() - 1.0).abs() < 1e-3, "{found:?}, expected {expected:?}");
    }

    let mut colours = [144, 95, 241, 255, 64, 129, 192, 192];
    colour::<1>(&mut colours);
    assert_eq!(colours, [254, 129, 64, 255, 1, 0, 255, 128]);
}

#[test]
fn damaged_streams_are_refused() {
    for (data, mode, stride, count) in [
        (ROWS_0, "ATTRIBUTES", 8, 20),
        (ROWS_1, "ATTRIBUTES", 8, 20),
        (GRID_0, "TRIANGLES", 2, 57),
        (GRID_1, "TRIANGLES", 4, 57),
        (SEQUENCE, "INDICES", 4, 6),
    ] {
        for length in 0..data.len() {
            assert!(decoded(&data[..length], mode, stride, count, None).is_err(), "{mode} of {length} bytes");
        }
        for wrong in [count + 300, 1 << 31, u64::MAX / 3 * 3] {
            assert!(decoded(data, mode, stride, wrong, None).is_err(), "{mode} of {wrong} rows");
        }
        assert!(decoded(data, "POINTS", stride, count, None).is_err());
        assert!(decoded(data, mode, 3, count, None).is_err());
        assert!(decoded(data, mode, u64::MAX, count, None).is_err());
        assert!(decoded(data, mode, stride, count, Some("SEPIA")).is_err());
    }
}
