use super::*;

const REPEAT: [Wrap; 2] = [Wrap::Repeat; 2];
const BLACK: [u8; 4] = [0, 0, 0, 255];
const WHITE: [u8; 4] = [255, 255, 255, 255];

fn image(width: u32, height: u32, texel: impl Fn(u32, u32) -> [u8; 4]) -> TextureImage {
    let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).flat_map(|(x, y)| texel(x, y)).collect();
    TextureImage::from_texels(width, height, texels).expect("texels fit")
}

fn checker(width: u32, height: u32) -> TextureImage {
    image(width, height, |x, y| if (x + y) % 2 == 0 { WHITE } else { BLACK })
}

fn rectangle(u: [f32; 2], v: [f32; 2]) -> [[f32; 2]; 4] {
    [[u[0], v[0]], [u[1], v[0]], [u[1], v[1]], [u[0], v[1]]]
}

#[test]
fn srgb_values_decode_to_the_standards_light() {
    assert_eq!(linear_from_srgb(0), 0.0);
    assert_eq!(linear_from_srgb(255), 1.0);
    // IEC 61966-2-1: 10/255 is just below the end of the straight part, 128 is 0.2158605.
    assert!((linear_from_srgb(10) - 10.0 / 255.0 / 12.92).abs() < 1e-8);
    assert!((linear_from_srgb(128) - 0.215_860_5).abs() < 1e-7);
}

#[test]
fn an_even_checkerboard_is_half_light_at_any_size() {
    for side in [2, 8, 64, 256, 1024] {
        let [r, _, _, a] = checker(side, side).average(&rectangle([0.0, 1.0], [0.0, 1.0]), REPEAT);
        assert!((r - 0.5).abs() < 1e-6, "{side}: {r}");
        assert!((a - 1.0).abs() < 1e-6);
    }
}

#[test]
fn an_odd_checkerboard_keeps_its_exact_mean() {
    // 5 × 7 texels, 18 of them white; 601 × 403 goes through halved images with odd sides.
    for (width, height) in [(5_u32, 7_u32), (601, 403)] {
        let white = (width * height).div_ceil(2) as f32 / (width * height) as f32;
        let [r, ..] = checker(width, height).average(&rectangle([0.0, 1.0], [0.0, 1.0]), REPEAT);
        assert!((r - white).abs() < 1e-5, "{width} × {height}: {r}, expected {white}");
    }
}

#[test]
fn an_element_on_one_texel_has_its_colour() {
    let checker = checker(4, 4);
    for (column, expected) in [(0, 1.0), (1, 0.0), (2, 1.0), (3, 0.0)] {
        let u = column as f32 / 4.0;
        let [r, ..] = checker.average(&rectangle([u, u + 0.25], [0.0, 0.25]), REPEAT);
        assert_eq!(r, expected, "column {column}");
    }
}

#[test]
fn a_single_bright_texel_is_never_missed() {
    // One white texel in a large black image: any partition of the image into elements sums up to it.
    let bright = image(512, 512, |x, y| if (x, y) == (301, 77) { WHITE } else { BLACK });
    for parts in [1, 2, 8, 64] {
        let mut sum = 0.0;
        for row in 0..parts {
            for column in 0..parts {
                let range = |part: u32| [part as f32 / parts as f32, (part + 1) as f32 / parts as f32];
                sum += bright.average(&rectangle(range(column), range(row)), REPEAT)[0];
            }
        }
        let expected = (parts * parts) as f32 / (512.0 * 512.0);
        assert!((sum / expected - 1.0).abs() < 1e-3, "{parts}: {sum}, expected {expected}");
    }
}

#[test]
fn the_two_triangles_of_a_square_share_its_light() {
    let gradient = image(64, 64, |x, _| [x as u8 * 4, 0, 0, 255]);
    let square = gradient.average(&rectangle([0.0, 1.0], [0.0, 1.0]), REPEAT)[0];
    let lower = gradient.average(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], REPEAT)[0];
    let upper = gradient.average(&[[0.0, 0.0], [1.0, 1.0], [0.0, 1.0]], REPEAT)[0];
    assert!(lower > square && upper < square);
    assert!(((lower + upper) / 2.0 - square).abs() < 2e-3 * square);
}

#[test]
fn a_long_thin_element_is_not_blurred_across() {
    // Rows alternate; an element one row high sees only its own row.
    let rows = image(256, 256, |_, y| if y % 2 == 0 { WHITE } else { BLACK });
    let [r, ..] = rows.average(&rectangle([0.0, 1.0], [0.0, 1.0 / 256.0]), REPEAT);
    assert_eq!(r, 1.0);
}

#[test]
fn colour_can_be_weighted_by_alpha() {
    let leaf = image(2, 2, |x, _| if x == 0 { [255, 255, 255, 255] } else { [0, 0, 0, 0] });
    let everywhere = rectangle([0.0, 1.0], [0.0, 1.0]);
    assert_eq!(leaf.average(&everywhere, REPEAT), [0.5, 0.5, 0.5, 0.5]);
    assert_eq!(leaf.average_weighted(&everywhere, REPEAT), [1.0, 1.0, 1.0, 0.5]);
    assert_eq!(leaf.average_weighted(&rectangle([0.5, 1.0], [0.0, 1.0]), REPEAT), [0.0; 4]);
}

#[test]
fn wrapping_follows_the_sampler() {
    let pair = image(2, 1, |x, _| if x == 0 { WHITE } else { BLACK });
    let red = |u: f32, wrap: Wrap| pair.sample([u, 0.5], [wrap; 2], true)[0];
    assert_eq!([-0.25, 0.25, 0.75, 1.25, 1.75].map(|u| red(u, Wrap::Repeat)), [0.0, 1.0, 0.0, 1.0, 0.0]);
    assert_eq!([-0.25, 0.25, 0.75, 1.25, 1.75].map(|u| red(u, Wrap::Mirror)), [1.0, 1.0, 0.0, 0.0, 1.0]);
    assert_eq!([-0.25, 0.25, 0.75, 1.25, 1.75].map(|u| red(u, Wrap::Clamp)), [1.0, 1.0, 0.0, 0.0, 0.0]);
}

#[test]
fn samples_are_interpolated_in_linear_light() {
    let pair = image(2, 1, |x, _| if x == 0 { WHITE } else { BLACK });
    assert_eq!(pair.sample([0.5, 0.5], [Wrap::Clamp; 2], false)[0], 0.5);
    assert_eq!(pair.sample([0.25, 0.5], [Wrap::Clamp; 2], false)[0], 1.0);
    // Repeated, the left edge lies half-way between black and white.
    assert_eq!(pair.sample([0.0, 0.5], REPEAT, false)[0], 0.5);
}

#[test]
fn many_repetitions_give_the_mean_and_odd_numbers_do_no_harm() {
    let checker = checker(8, 8);
    let [r, ..] = checker.average(&rectangle([0.0, 1e6], [0.0, 1e6]), REPEAT);
    assert!((r - 0.5).abs() < 1e-6);
    for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
        for odd in [f32::NAN, f32::INFINITY, f32::MAX, -f32::MAX] {
            let _ = checker.sample([odd, odd], [wrap; 2], false);
            let _ = checker.average(&rectangle([0.0, odd], [odd, 1.0]), [wrap; 2]);
        }
    }
}

#[test]
fn an_image_larger_than_its_bytes_is_refused() {
    // A PNG header that claims 40 000 × 40 000 texels.
    let mut png = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR".to_vec();
    png.extend([0, 0, 0x9c, 0x40, 0, 0, 0x9c, 0x40, 8, 6, 0, 0, 0, 0, 0, 0, 0]);
    let image =
        Image { name: "x.png".into(), media_type: "image/png".into(), bytes: crate::resources::Bytes::new(png) };
    let error = TextureImage::decode(&image).expect_err("too large");
    assert_eq!(&*error.place.file, "x.png");
}

#[test]
fn png_webp_and_jpeg_are_decoded() {
    let plain = image::RgbImage::from_fn(16, 8, |x, _| image::Rgb(if x < 8 { [255, 0, 0] } else { [0, 0, 255] }));
    for format in [image::ImageFormat::Png, image::ImageFormat::WebP, image::ImageFormat::Jpeg] {
        let mut bytes = Vec::new();
        plain.write_to(&mut Cursor::new(&mut bytes), format).expect("written");
        let encoded = Image { name: "x".into(), media_type: String::new(), bytes: crate::resources::Bytes::new(bytes) };
        let decoded = TextureImage::decode(&encoded).unwrap_or_else(|error| panic!("{format:?}: {error}"));
        assert_eq!((decoded.width(), decoded.height(), decoded.has_alpha()), (16, 8, false));
        // JPEG is lossy: a few steps of 255.
        for (x, expected) in [(0, [255, 0, 0, 255]), (15, [0, 0, 255, 255])] {
            let texel = &decoded.texels()[4 * x..4 * x + 4];
            assert!(texel.iter().zip(expected).all(|(a, b): (&u8, u8)| a.abs_diff(b) < 8), "{format:?}: {texel:?}");
        }
    }
}
