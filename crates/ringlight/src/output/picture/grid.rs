//! Pictures of calculation grids in false colours.

use super::{FalseColour, Picture, Scale, legend, paint::Sample};
use crate::output::Exposure;

/// Longest side of the grid in a picture, pixels, unless it has more cells.
const LONGEST: f64 = 1200.0;

/// Pixels between neighbouring cells' numbers at least.
const GAP: usize = 2;

/// A picture of the values of a grid: `columns` cells in a row, row by row, the first row at the bottom; cells of `cell` metres
/// get the picture's proportions. Cells without a value are dark. Numbers are written where they fit, and a legend stands
/// beside the grid.
pub fn grid_picture(columns: u32, cell: [f64; 2], values: &[Option<f32>], wanted: FalseColour) -> Picture {
    let columns = columns.max(1);
    let rows = (values.len() as u32).div_ceil(columns).max(1);
    let samples: Vec<Sample> = values.iter().map(|&v| Sample { illuminance: v, ..Sample::default() }).collect();
    let scale = Scale::new(wanted, &samples);
    let extent = [cell[0] * f64::from(columns), cell[1] * f64::from(rows)];
    let per_metre = LONGEST / extent[0].max(extent[1]);
    // Whole pixels for each cell, so that all are equal.
    let size = cell.map(|c| ((c * per_metre).round() as u32).max(1));
    let (width, height) = (columns * size[0], (rows * size[1]).max(legend::LEAST_ROWS));
    let strip = legend::width(&scale, height);
    let count = ((width + strip) * height) as usize;
    let mut picture = Picture {
        width: width + strip,
        height,
        linear: vec![[0.0; 3]; count],
        shown: vec![[0; 3]; count],
        exposure: Exposure { scale: 1.0 },
        scale: Some(scale),
    };
    let top = height - rows * size[1];
    for (k, &value) in values.iter().enumerate() {
        let (column, row) = (k as u32 % columns, rows - 1 - k as u32 / columns);
        let [left, above] = [column * size[0], top + row * size[1]];
        let colour = scale.colour(value);
        let shown = colour.map(|c| (c + 0.5) as u8);
        for y in above..above + size[1] {
            let first = (y * picture.width + left) as usize;
            picture.shown[first..first + size[0] as usize].fill(shown);
            picture.linear[first..first + size[0] as usize].fill([value.unwrap_or(0.0); 3]);
        }
        if let Some(value) = value {
            number(&mut picture, [left, above], size, value, colour);
        }
    }
    legend::draw(&mut picture, &scale);
    picture
}

/// Writes a value into the middle of its cell, if all numbers of its length fit there.
fn number(picture: &mut Picture, [left, top]: [u32; 2], size: [u32; 2], value: f32, colour: [f32; 3]) {
    let text = short(value);
    let (wide, high) = (legend::LETTER as usize * (text.len().max(4)) + GAP, legend::LETTER as usize + GAP);
    if (size[0] as usize) < wide || (size[1] as usize) < high {
        return;
    }
    // Black on light colours, white on dark ones (Rec. 709 weights of encoded values are good enough to choose).
    let bright = 0.2126 * colour[0] + 0.7152 * colour[1] + 0.0722 * colour[2] > 110.0;
    let enlargement = (i64::from(size[0]) / wide as i64).min(i64::from(size[1]) / high as i64).clamp(1, 2);
    let [x, y] = [
        i64::from(left) + (i64::from(size[0]) - legend::LETTER * enlargement * text.len() as i64) / 2,
        i64::from(top) + (i64::from(size[1]) - legend::LETTER * enlargement) / 2,
    ];
    legend::text(picture, [x, y], enlargement, &text, if bright { [0; 3] } else { [255; 3] });
}

/// Three digits: 1234, 123, 12.3, 1.23, 0.12.
fn short(value: f32) -> String {
    match value {
        v if v >= 99_999.5 => format!("{v:.1e}"),
        v if v >= 99.95 => format!("{v:.0}"),
        v if v >= 9.995 => format!("{v:.1}"),
        v => format!("{v:.2}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_have_the_colours_of_their_values_and_the_first_row_is_below() {
        let values: Vec<Option<f32>> = (0..12).map(|k| (k != 5).then_some(10.0 * (k + 1) as f32)).collect();
        let picture = grid_picture(4, [0.5, 0.5], &values, FalseColour::default());
        let scale = picture.scale.unwrap();
        assert_eq!((picture.height, scale.low, scale.high), (900, 0.0, 200.0));
        let at = |column: u32, row: u32| {
            picture.shown[((900 - row * 300 - 290) * picture.width + column * 300 + 10) as usize]
        };
        for (k, &value) in values.iter().enumerate() {
            let expected = scale.colour(value).map(|c| (c + 0.5) as u8);
            assert_eq!(at(k as u32 % 4, k as u32 / 4), expected, "{k}");
        }
        assert_eq!(at(1, 1), [0; 3]);
    }

    #[test]
    fn numbers_stand_in_large_cells_only() {
        let written = |columns: u32| {
            let values = vec![Some(100.0); (columns * columns) as usize];
            let range = Some([0.0, 100.0]);
            let picture = grid_picture(columns, [1.0, 1.0], &values, FalseColour { range, ..FalseColour::default() });
            let plain = picture.scale.unwrap().colour(Some(100.0)).map(|c| (c + 0.5) as u8);
            let grid = |k: &usize| (*k as u32 % picture.width) < 600;
            (0..picture.shown.len()).filter(grid).any(|k| picture.shown[k] != plain)
        };
        assert!(written(4) && written(30) && !written(60));
    }

    #[test]
    fn values_are_short() {
        for (value, text) in [(0.0, "0.00"), (0.123, "0.12"), (12.34, "12.3"), (532.4, "532"), (12_345.0, "12345")] {
            assert_eq!(short(value), text);
        }
    }
}
