//! Occluders.

use std::sync::Arc;

/// One occluding triangle. It blocks from both sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    /// Corners, metres.
    pub corners: [[f32; 3]; 3],
    /// Plane the triangle lies in, see [`crate::Points::plane`] and [`crate::Shooter::plane`].
    pub plane: u32,
    /// The caller's number of the triangle: breaks ties between equally near hits and is returned in [`crate::Hit`].
    pub id: u32,
    /// Index into the hierarchy's filters, or [`crate::OPAQUE`].
    pub filter: u32,
}

/// What lets light through a triangle.
#[derive(Clone, Debug)]
pub enum Filter {
    /// Blocks only `share` (0 to 1) of the cells, as an ordered screen: the same cells for every receiver, so that
    /// no noise arises. Different seeds give different cells, so that two panes behind each other multiply.
    Screen {
        /// Share of cells blocked.
        share: f32,
        /// Chooses which cells.
        seed: u32,
    },
    /// Blocks where the bitmap is set.
    Cutout {
        /// Which texels block.
        bitmap: Arc<Bitmap>,
        /// Texture coordinates of the three corners, in units of the bitmap, repeating.
        uv: [[f32; 2]; 3],
    },
}

/// A repeating bit image: set texels block light.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Bitmap {
    /// Texels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Row-major bits, bit `i & 63` of word `i >> 6` for texel `i = row * width + column`.
    pub bits: Vec<u64>,
}

impl Bitmap {
    /// Whether the texel under (u, v) blocks; coordinates repeat, v grows with the row.
    pub fn blocks(&self, uv: [f32; 2]) -> bool {
        let texel = |t: f32, n: u32| (((t - t.floor()) * n as f32) as u32).min(n - 1);
        let i = texel(uv[1], self.height) as usize * self.width as usize + texel(uv[0], self.width) as usize;
        self.bits[i >> 6] >> (i & 63) & 1 == 1
    }
}

impl Filter {
    /// The cells out of `count` that a screen may block; all of them for a cutout.
    pub fn cells(&self, count: usize) -> u64 {
        let all = if count == 64 { u64::MAX } else { (1u64 << count) - 1 };
        match *self {
            Filter::Cutout { .. } => all,
            Filter::Screen { share, seed } => {
                // Bit-reversed order of the cell number spreads any share evenly over a grid whose side is a power of
                // two; the seed permutes it by exclusive or, which keeps it a permutation. Other counts take the first
                // `count` numbers of the next power of two and block by rank.
                let size = count.next_power_of_two() as u32;
                let bits = size.trailing_zeros();
                let key = |k: u32| {
                    if bits == 0 { 0 } else { (k ^ (seed % size)).reverse_bits() >> (32 - bits) }
                };
                (0..count as u32)
                    .filter(|&k| {
                        let rank = (0..count as u32).filter(|&other| key(other) < key(k)).count();
                        (rank as f32 + 0.5) / (count as f32) < share
                    })
                    .fold(0, |mask, k| mask | 1 << k)
            }
        }
    }

    /// Whether the triangle blocks at a point with these barycentric weights.
    pub(crate) fn blocks_at(&self, weights: [f32; 3]) -> bool {
        match self {
            Filter::Screen { .. } => true,
            Filter::Cutout { bitmap, uv } => {
                let at = |i: usize| (weights[0] * uv[0][i] + weights[1] * uv[1][i]) + weights[2] * uv[2][i];
                bitmap.blocks([at(0), at(1)])
            }
        }
    }
}
