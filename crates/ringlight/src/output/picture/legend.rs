//! The legend of a picture in false colours.

use super::{Picture, Scale};
use font8x8::UnicodeFonts;

/// Side of a letter before enlargement, pixels.
pub const LETTER: i64 = 8;

/// Pictures get letters one times larger for every so many rows.
const ROWS_PER_ENLARGEMENT: u32 = 400;

/// A picture needs this many rows for a legend of several numbers.
pub const LEAST_ROWS: u32 = 120;

const WHITE: [u8; 3] = [255; 3];

/// Columns that the legend of a picture with `height` rows takes.
pub fn width(scale: &Scale, height: u32) -> u32 {
    let labels = scale.marks().into_iter().map(label);
    let longest = labels.chain([scale.unit.sign().into()]).map(|l| l.chars().count()).max().unwrap_or(0);
    (LETTER * enlargement(height)) as u32 * (longest as u32 + 4)
}

fn enlargement(height: u32) -> i64 {
    i64::from((height / ROWS_PER_ENLARGEMENT).max(1))
}

/// Draws a bar of the scale's colours with numbers and the unit on a dark strip along the right edge.
pub fn draw(picture: &mut Picture, scale: &Scale) {
    let enlargement = enlargement(picture.height);
    let letter = LETTER * enlargement;
    let labels: Vec<(f64, String)> = scale.marks().into_iter().map(|m| (scale.position(m), label(m))).collect();
    let unit = scale.unit.sign();
    let strip = i64::from(width(scale, picture.height));
    let (left, rows) = (i64::from(picture.width) - strip, i64::from(picture.height));
    for (x, y) in (0..rows).flat_map(|y| (left..left + strip).map(move |x| (x, y))) {
        darken(picture, x, y);
    }
    text(picture, [left + letter, letter], enlargement, unit, WHITE);
    // Room for the unit above and half a letter at both ends.
    let (top, bottom) = (3 * letter, rows - 1 - letter);
    if bottom <= top {
        return;
    }
    for y in top..=bottom {
        let position = (bottom - y) as f64 / (bottom - top) as f64;
        let colour = Scale::colour_at(position).map(|x| x as u8);
        (left + letter..left + 2 * letter).for_each(|x| set(picture, x, y, colour));
    }
    let mut free = i64::MAX;
    for (position, label) in labels {
        let y = bottom - (position * (bottom - top) as f64 + 0.5) as i64;
        (left + 2 * letter..left + 2 * letter + letter / 2).for_each(|x| set(picture, x, y, WHITE));
        // Numbers that would touch the one below are left out.
        if y + letter / 2 <= free {
            text(picture, [left + 3 * letter, y - letter / 2], enlargement, &label, WHITE);
            free = y - letter / 2;
        }
    }
}

/// A number as people write it: at most four digits, no zeros at its end.
fn label(value: f64) -> String {
    let rounded: f64 = format!("{value:.3e}").parse().unwrap_or(value);
    let plain = rounded.to_string();
    if plain.len() <= 7 { plain } else { format!("{rounded:e}") }
}

/// Writes text, its upper left corner at a pixel.
pub fn text(picture: &mut Picture, [left, top]: [i64; 2], enlargement: i64, text: &str, colour: [u8; 3]) {
    for (k, letter) in text.chars().enumerate() {
        let glyph = font8x8::BASIC_FONTS.get(letter).or_else(|| font8x8::LATIN_FONTS.get(letter)).unwrap_or_default();
        let side = LETTER * enlargement;
        for (x, y) in (0..side).flat_map(|y| (0..side).map(move |x| (x, y))) {
            if glyph[(y / enlargement) as usize] >> (x / enlargement) & 1 == 1 {
                set(picture, left + k as i64 * side + x, top + y, colour);
            }
        }
    }
}

fn set(picture: &mut Picture, x: i64, y: i64, colour: [u8; 3]) {
    if let Some(pixel) = pixel(picture, x, y) {
        *pixel = colour;
    }
}

fn darken(picture: &mut Picture, x: i64, y: i64) {
    if let Some(pixel) = pixel(picture, x, y) {
        *pixel = pixel.map(|c| c / 4);
    }
}

fn pixel(picture: &mut Picture, x: i64, y: i64) -> Option<&mut [u8; 3]> {
    let within = (0..i64::from(picture.width)).contains(&x) && (0..i64::from(picture.height)).contains(&y);
    if within { picture.shown.get_mut(y as usize * picture.width as usize + x as usize) } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::Exposure;
    use crate::output::picture::Unit;

    fn drawn(width: u32, height: u32) -> Picture {
        let count = (width * height) as usize;
        let mut picture = Picture {
            width,
            height,
            linear: vec![[0.0; 3]; count],
            shown: vec![[100; 3]; count],
            exposure: Exposure { scale: 1.0 },
            scale: None,
        };
        draw(&mut picture, &Scale { low: 0.0, high: 500.0, logarithmic: false, unit: Unit::WattsPerSquareMetre });
        picture
    }

    #[test]
    fn numbers_are_short() {
        for (value, text) in [(0.0, "0"), (500.0, "500"), (0.2, "0.2"), (1e5, "100000"), (1e9, "1e9"), (2e-7, "2e-7")] {
            assert_eq!(label(value), text);
        }
        assert_eq!(label(333.333_333), "333.3");
    }

    #[test]
    fn the_bar_runs_from_the_lowest_colour_to_the_highest() {
        let picture = drawn(200, 120);
        let strip = 8 * (4 + 4);
        let at = |x: usize, y: usize| picture.shown[y * 200 + x];
        let bar = 200 - strip + 8 + 4;
        assert_eq!(at(bar, 120 - 1 - 8).map(f32::from), Scale::colour_at(0.0));
        assert_eq!(at(bar, 24).map(f32::from), Scale::colour_at(1.0));
        assert_eq!(at(100, 60), [100; 3]);
        let white = |rows: std::ops::Range<usize>| {
            rows.flat_map(|y| (0..200).map(move |x| (x, y))).any(|(x, y)| at(x, y) == WHITE)
        };
        assert!(white(8..16) && white(20..28) && white(107..115));
    }

    #[test]
    fn a_picture_too_small_for_it_is_no_trouble() {
        for (width, height) in [(1, 1), (10, 300), (300, 10), (40, 33)] {
            assert_eq!(drawn(width, height).shown.len(), (width * height) as usize);
        }
    }
}
