//! Who draws what of a picture: a function of its size and the number of ranks alone.

use std::ops::Range;

/// How a picture is divided among ranks. It never changes the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Split {
    /// A rectangle for each rank.
    Tiles,
    /// Rank i of N has the rows whose number is i modulo N: costly rows have costly neighbours, which go to others (Feda 1991).
    #[default]
    Scanlines,
}

/// The pixels of one rank: some columns of every n-th row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    rows: Range<u32>,
    step: u32,
    columns: Range<u32>,
}

impl Split {
    /// The part of rank `rank` of `ranks` in a picture of this width and height. Parts differ by less than a row or a column.
    pub fn part(self, [width, height]: [u32; 2], rank: usize, ranks: usize) -> Part {
        match self {
            Split::Scanlines => {
                let first = u32::try_from(rank).map_or(height, |rank| rank.min(height));
                Part { rows: first..height, step: u32::try_from(ranks).unwrap_or(u32::MAX), columns: 0..width }
            }
            Split::Tiles => {
                // Bands of rows, as many as make tiles about square; each goes to as many ranks as it is high.
                let bands = (ranks as f64 * f64::from(height) / f64::from(width)).sqrt().round() as usize;
                let bands = bands.clamp(1, ranks);
                let band = ((rank + 1) * bands - 1) / ranks;
                let of_band = band * ranks / bands..(band + 1) * ranks / bands;
                let rows = [of_band.start, of_band.end].map(|rank| share(height, rank, ranks));
                let place = rank - of_band.start;
                let columns = [place, place + 1].map(|place| share(width, place, of_band.len()));
                Part { rows: rows[0]..rows[1], step: 1, columns: columns[0]..columns[1] }
            }
        }
    }

    /// The name by which it is chosen.
    pub fn name(self) -> &'static str {
        match self {
            Split::Tiles => "tiles",
            Split::Scanlines => "scanlines",
        }
    }
}

impl Part {
    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.rows.len().div_ceil(self.step as usize) * self.columns.len()
    }

    /// Column and row of the part's pixel `k`, row by row from the top.
    pub fn place(&self, k: usize) -> [u32; 2] {
        let [column, row] = [k % self.columns.len(), k / self.columns.len()].map(|n| n as u32);
        [self.columns.start + column, self.rows.start + row * self.step]
    }
}

/// The end of the first `k` of `of` equal shares of a length.
fn share(length: u32, k: usize, of: usize) -> u32 {
    (u64::from(length) * k as u64 / of as u64) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_has_one_owner_and_none_has_much_more_than_others() {
        for size in [[1, 1], [7, 5], [64, 40], [1280, 720], [100, 3], [3, 100]] {
            for ranks in [1, 2, 3, 5, 7, 8, 12, 64] {
                for split in [Split::Tiles, Split::Scanlines] {
                    let parts: Vec<Part> = (0..ranks).map(|rank| split.part(size, rank, ranks)).collect();
                    let mut owners = vec![0; (size[0] * size[1]) as usize];
                    for part in &parts {
                        for [column, row] in (0..part.pixels()).map(|k| part.place(k)) {
                            owners[(row * size[0] + column) as usize] += 1;
                        }
                    }
                    assert!(owners.iter().all(|&n| n == 1), "{size:?} {ranks} {split:?}");
                    let mean = (size[0] * size[1]) as f64 / ranks as f64;
                    let most = parts.iter().map(Part::pixels).max().unwrap_or(0) as f64;
                    let border = f64::from(match split {
                        Split::Scanlines => size[0],
                        Split::Tiles => size[0] + size[1] + 1,
                    });
                    assert!(most <= mean + border, "{size:?} {ranks} {split:?}: {most} of {mean}");
                }
            }
        }
    }

    #[test]
    fn tiles_are_about_square() {
        let tiles = |ranks| (0..ranks).map(|rank| Split::Tiles.part([1280, 720], rank, ranks)).collect::<Vec<_>>();
        let tile = |rows, columns| Part { rows, step: 1, columns };
        assert_eq!(tiles(2), [tile(0..720, 0..640), tile(0..720, 640..1280)]);
        let (high, low) = (0..288, 288..720);
        let above = [tile(high.clone(), 0..640), tile(high, 640..1280)];
        let below = [tile(low.clone(), 0..426), tile(low.clone(), 426..853), tile(low, 853..1280)];
        assert_eq!(tiles(5), [above.as_slice(), &below].concat());
        assert_eq!(tiles(8)[..2], [tile(0..360, 0..320), tile(0..360, 320..640)]);
    }
}
