//! Decoded images: samples for pictures, honest averages for elements. All light is linear.
//!
//! Bits are the same on every machine: the sRGB table comes from `libm`, everything else is plain arithmetic.

use super::{Image, Place, SceneError, Wrap};
use image::{ImageReader, Limits};
use std::io::Cursor;
use std::sync::{LazyLock, OnceLock};

/// Images wider or higher than this are refused.
pub const LARGEST_SIDE: u32 = 32768;

/// Images that need more memory than this to decode are refused.
const MOST_BYTES: u64 = 1 << 30;

/// Samples per element in [`TextureImage::average`], at most.
const MOST_SAMPLES: f64 = 1024.0;

/// Linear light of each 8-bit sRGB value (IEC 61966-2-1).
static LINEAR: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|value| {
        let encoded = value as f64 / 255.0;
        let linear = if encoded <= 0.04045 { encoded / 12.92 } else { libm::pow((encoded + 0.055) / 1.055, 2.4) };
        linear as f32
    })
});

/// Linear light of an 8-bit sRGB value.
pub fn linear_from_srgb(value: u8) -> f32 {
    LINEAR[usize::from(value)]
}

/// A decoded image: 8 bits per channel, sRGB colour, linear alpha, rows from the top.
#[derive(Debug)]
pub struct TextureImage {
    width: usize,
    height: usize,
    texels: Vec<u8>,
    has_alpha: bool,
    /// Halved images for averages, made when first needed.
    plain: OnceLock<Vec<Level>>,
    /// The same with colour weighted by alpha.
    weighted: OnceLock<Vec<Level>>,
}

/// One step of the pyramid: each texel is the exact mean of its part of the whole image.
#[derive(Debug)]
struct Level {
    width: usize,
    height: usize,
    texels: Vec<[f32; 4]>,
}

impl TextureImage {
    /// Decodes PNG, JPEG or WebP.
    pub fn decode(image: &Image) -> Result<TextureImage, SceneError> {
        let error = |cause: &dyn std::fmt::Display| {
            let expected = format!("a PNG, JPEG or WebP image of at most {LARGEST_SIDE} texels a side");
            SceneError::new(
                Place::new(image.name.as_str(), ""),
                format!("an image that cannot be decoded: {cause}"),
                expected,
            )
        };
        let mut limits = Limits::default();
        limits.max_image_width = Some(LARGEST_SIDE);
        limits.max_image_height = Some(LARGEST_SIDE);
        limits.max_alloc = Some(MOST_BYTES);
        let mut reader =
            ImageReader::new(Cursor::new(&*image.bytes)).with_guessed_format().map_err(|cause| error(&cause))?;
        reader.limits(limits);
        let decoded = reader.decode().map_err(|cause| error(&cause))?.into_rgba8();
        let (width, height) = decoded.dimensions();
        TextureImage::from_texels(width, height, decoded.into_raw()).ok_or_else(|| error(&"it is empty"))
    }

    /// An image from its texels: four bytes each, rows from the top. None if they are not `width` × `height` or none.
    pub fn from_texels(width: u32, height: u32, texels: Vec<u8>) -> Option<TextureImage> {
        let (width, height) = (width as usize, height as usize);
        let expected = width.checked_mul(height)?.checked_mul(4)?;
        (expected > 0 && texels.len() == expected).then(|| TextureImage {
            has_alpha: texels.chunks_exact(4).any(|texel| texel[3] < 255),
            width,
            height,
            texels,
            plain: OnceLock::new(),
            weighted: OnceLock::new(),
        })
    }

    /// Width in texels.
    pub fn width(&self) -> u32 {
        self.width as u32
    }

    /// Height in texels.
    pub fn height(&self) -> u32 {
        self.height as u32
    }

    /// Four bytes per texel, rows from the top.
    pub fn texels(&self) -> &[u8] {
        &self.texels
    }

    /// Whether any texel is not opaque.
    pub fn has_alpha(&self) -> bool {
        self.has_alpha
    }

    /// Linear RGB and alpha at `uv`: of the nearest texel, or interpolated between four.
    pub fn sample(&self, uv: [f32; 2], wrap: [Wrap; 2], nearest: bool) -> [f32; 4] {
        let at = |axis: usize, size: usize| f64::from(uv[axis]) * size as f64;
        let (x, y) = (at(0, self.width), at(1, self.height));
        let texel = |x: f64, y: f64| self.texel(wrapped(x, self.width, wrap[0]), wrapped(y, self.height, wrap[1]));
        if nearest {
            return texel(x.floor(), y.floor());
        }
        // Texel centres lie at half-integers.
        let (left, top) = ((x - 0.5).floor(), (y - 0.5).floor());
        let (right_share, bottom_share) = ((x - 0.5 - left) as f32, (y - 0.5 - top) as f32);
        let upper = mix(texel(left, top), texel(left + 1.0, top), right_share);
        let lower = mix(texel(left, top + 1.0), texel(left + 1.0, top + 1.0), right_share);
        mix(upper, lower, bottom_share)
    }

    /// Mean linear RGB and alpha over an element, whose three or four corners go round it in order.
    ///
    /// The element is covered by a regular grid of samples, two for each texel along each side; where that would be too many
    /// the texels come from a halved image, and again, so that every texel under the element always takes part. Points of
    /// the element weigh alike, as on a parallelogram.
    pub fn average(&self, corners: &[[f32; 2]], wrap: [Wrap; 2]) -> [f32; 4] {
        self.mean(corners, wrap, false)
    }

    /// As [`TextureImage::average`], but with each texel's colour weighted by its alpha: the colour of what is left of a
    /// leaf, not of the nothing around it. Zero where nothing is left.
    pub fn average_weighted(&self, corners: &[[f32; 2]], wrap: [Wrap; 2]) -> [f32; 4] {
        let [r, g, b, a] = self.mean(corners, wrap, self.has_alpha);
        if !self.has_alpha {
            return [r, g, b, a];
        }
        if a > 0.0 { [r / a, g / a, b / a, a] } else { [0.0; 4] }
    }

    fn mean(&self, corners: &[[f32; 2]], wrap: [Wrap; 2], is_weighted: bool) -> [f32; 4] {
        let corner = |number: usize| {
            let [u, v] = corners.get(number).copied().unwrap_or_default().map(f64::from);
            [u * self.width as f64, v * self.height as f64]
        };
        let is_quad = corners.len() > 3;
        let [a, b, c] = [corner(0), corner(1), corner(2)];
        // A triangle is half of a parallelogram.
        let d = if is_quad { corner(3) } else { c };
        let opposite = if is_quad { c } else { [b[0] + d[0] - a[0], b[1] + d[1] - a[1]] };
        // Texels along a side: the larger of the extents along the two axes.
        let length = |from: [f64; 2], to: [f64; 2]| (to[0] - from[0]).abs().max((to[1] - from[1]).abs());
        let across = length(a, b).max(length(d, opposite));
        let along = length(a, d).max(length(b, opposite));
        let (level, columns, rows) = self.grid(across, along);
        // The centre of each cell, or, for a triangle, the centres of both halves of each cell that lie in it.
        let inner: &[f64] = if is_quad { &[0.5] } else { &[1.0 / 3.0, 2.0 / 3.0] };
        let mut sum = [0.0_f64; 4];
        let mut count = 0.0;
        for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
            for offset in inner {
                let (s, t) = ((column as f64 + offset) / columns as f64, (row as f64 + offset) / rows as f64);
                if !is_quad && s + t > 1.0 {
                    continue;
                }
                let at: [f64; 2] = std::array::from_fn(|axis| {
                    let near = a[axis] + (b[axis] - a[axis]) * s;
                    let far = d[axis] + (opposite[axis] - d[axis]) * s;
                    near + (far - near) * t
                });
                for (sum, channel) in sum.iter_mut().zip(self.level_texel(level, at, wrap, is_weighted)) {
                    *sum += f64::from(channel);
                }
                count += 1.0;
            }
        }
        sum.map(|channel| (channel / count) as f32)
    }

    /// Which halving to sample for an element of so many texels, and how many samples along each side.
    fn grid(&self, across: f64, along: f64) -> (usize, usize, usize) {
        let coarsest = self.width.max(self.height).ilog2() as usize;
        let samples = |length: f64, scale: f64| (2.0 * length / scale).ceil().max(1.0);
        let mut level = 0;
        let mut scale = 1.0;
        while level < coarsest && samples(across, scale) * samples(along, scale) > MOST_SAMPLES {
            level += 1;
            scale *= 2.0;
        }
        // Beyond the coarsest level the image repeats so often that any number of samples gives its mean.
        let most = if level == coarsest { MOST_SAMPLES.sqrt() } else { MOST_SAMPLES };
        (level, samples(across, scale).min(most) as usize, samples(along, scale).min(most) as usize)
    }

    /// The texel of level `level` at `at`, which is counted in texels of the whole image.
    fn level_texel(&self, level: usize, at: [f64; 2], wrap: [Wrap; 2], is_weighted: bool) -> [f32; 4] {
        let Some(number) = level.checked_sub(1) else {
            let [x, y] = [wrapped(at[0].floor(), self.width, wrap[0]), wrapped(at[1].floor(), self.height, wrap[1])];
            return self.weighted_texel(x, y, is_weighted);
        };
        let levels = if is_weighted { &self.weighted } else { &self.plain };
        let levels = levels.get_or_init(|| self.levels(is_weighted));
        let Some(level) = levels.get(number) else { return [0.0; 4] };
        let x = (at[0] * level.width as f64 / self.width as f64).floor();
        let y = (at[1] * level.height as f64 / self.height as f64).floor();
        level.texels[wrapped(y, level.height, wrap[1]) * level.width + wrapped(x, level.width, wrap[0])]
    }

    fn levels(&self, is_weighted: bool) -> Vec<Level> {
        let mut levels: Vec<Level> = Vec::new();
        let (mut width, mut height) = (self.width, self.height);
        while width > 1 || height > 1 {
            let next = match levels.last() {
                None => Level::halved(width, height, &|x, y| self.weighted_texel(x, y, is_weighted)),
                Some(last) => Level::halved(width, height, &|x, y| last.texels[y * last.width + x]),
            };
            (width, height) = (next.width, next.height);
            levels.push(next);
        }
        levels
    }

    fn texel(&self, x: usize, y: usize) -> [f32; 4] {
        let at = (y * self.width + x) * 4;
        let [r, g, b, a] = [0, 1, 2, 3].map(|channel| self.texels[at + channel]);
        [linear_from_srgb(r), linear_from_srgb(g), linear_from_srgb(b), f32::from(a) / 255.0]
    }

    fn weighted_texel(&self, x: usize, y: usize, is_weighted: bool) -> [f32; 4] {
        let [r, g, b, a] = self.texel(x, y);
        if is_weighted { [r * a, g * a, b * a, a] } else { [r, g, b, a] }
    }
}

impl Level {
    /// Half of an image of `width` × `height`: each new texel is the mean over its area, also where sides are odd.
    fn halved(width: usize, height: usize, texel: &dyn Fn(usize, usize) -> [f32; 4]) -> Level {
        let (columns, rows) = ((width / 2).max(1), (height / 2).max(1));
        let mut texels = Vec::with_capacity(columns * rows);
        for row in 0..rows {
            for column in 0..columns {
                let mut sum = [0.0_f32; 4];
                for (y, height_share) in cover(row, rows, height) {
                    for (x, width_share) in cover(column, columns, width) {
                        let share = width_share * height_share;
                        for (sum, channel) in sum.iter_mut().zip(texel(x, y)) {
                            *sum += channel * share;
                        }
                    }
                }
                texels.push(sum);
            }
        }
        Level { width: columns, height: rows, texels }
    }
}

/// The texels of a side of `size` under new texel `index` of `count`, and the share of each; shares add up to 1.
fn cover(index: usize, count: usize, size: usize) -> impl Iterator<Item = (usize, f32)> {
    // In units of 1/count of an old texel, all borders are whole numbers.
    let (start, end) = (index * size, (index + 1) * size);
    (start / count..end.div_ceil(count)).map(move |old| {
        let covered = ((old + 1) * count).min(end) - (old * count).max(start);
        (old, covered as f32 / size as f32)
    })
}

/// The texel that coordinate `texel`, a whole number, means on a side of `size` texels.
fn wrapped(texel: f64, size: usize, wrap: Wrap) -> usize {
    let length = size as f64;
    let inside = match wrap {
        Wrap::Repeat => texel.rem_euclid(length),
        Wrap::Clamp => texel.clamp(0.0, length - 1.0),
        Wrap::Mirror => {
            let position = texel.rem_euclid(2.0 * length);
            if position < length { position } else { 2.0 * length - 1.0 - position }
        }
    };
    // Coordinates that are no numbers become 0.
    (inside as usize).min(size - 1)
}

fn mix(from: [f32; 4], to: [f32; 4], share: f32) -> [f32; 4] {
    std::array::from_fn(|channel| from[channel] + (to[channel] - from[channel]) * share)
}

#[cfg(test)]
mod tests;
