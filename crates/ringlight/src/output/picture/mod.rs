//! Pictures by ray casting.
//!
//! A sample of a pixel follows a ray of sight to what it meets, and shows there the light of the solution, interpolated
//! between elements, with the full textures. There is no randomness: equal solutions give equal pictures.

mod casting;
mod false_colour;
mod file;
mod grid;
mod legend;
mod load;
mod paint;
mod split;
#[cfg(test)]
mod tests;
mod texture;
mod tone;

pub use false_colour::{FalseColour, Scale, Unit};
pub use file::{write_exr, write_png};
pub use grid::grid_picture;
pub use load::{PictureLoad, max_over_mean};
pub use split::Split;
pub use tone::Tone;

use super::{Exposure, View};
use crate::quantity::Rgb;
use crate::smooth::Divided;
use crate::solution::Solution;
use crate::solve::Ring;
use crate::transport::{Communicator, Failure};
use casting::{Casting, Cost};
use paint::{Painter, Sample};
use split::Part;

/// What picture to make.
#[derive(Clone, Debug, PartialEq)]
pub struct PictureOptions {
    /// From where.
    pub view: View,
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Display value of radiance; from the picture itself if none.
    pub exposure: Option<Exposure>,
    /// How bright parts are shown.
    pub tone: Tone,
    /// Shows the illuminance by colours instead of the radiance.
    pub false_colour: Option<FalseColour>,
    /// Samples along each side of a pixel, 1 to 16.
    pub samples_per_axis: u32,
    /// Irradiance to add everywhere, W/m² or lux: an estimate of the light not yet shot (Cohen 1988).
    pub ambient: Rgb,
    /// Who draws what. It never changes the picture.
    pub split: Split,
}

impl PictureOptions {
    /// A picture with automatic exposure, filmic tones and 16 samples a pixel.
    pub fn new(view: View, width: u32, height: u32) -> PictureOptions {
        PictureOptions {
            view,
            width,
            height,
            exposure: None,
            tone: Tone::Filmic,
            false_colour: None,
            samples_per_axis: 4,
            ambient: [0.0; 3],
            split: Split::default(),
        }
    }
}

/// A picture; pixels row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Mean radiance of each pixel, linear RGB, W/(m²·sr) or cd/m².
    pub linear: Vec<Rgb>,
    /// What is shown of each pixel: sRGB.
    pub shown: Vec<[u8; 3]>,
    /// The exposure used.
    pub exposure: Exposure,
    /// The scale of a picture in false colours.
    pub scale: Option<Scale>,
}

/// Pixels of the rough picture that decides exposure and scale, along its longer side.
const ROUGH_SIDE: u32 = 192;

/// Tags of samples and pixels on their way.
const SAMPLES: u32 = 60;
const PIXELS: u32 = 61;

/// Bytes of a pixel on its way: radiance, and what is shown.
const PIXEL: usize = 12 + 3;

/// Pixels that a rank sends at a time.
const BATCH: usize = 1 << 16;

/// What was drawn, as rank 0 has it.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawn {
    /// The picture.
    pub picture: Picture,
    /// How it was divided.
    pub split: Split,
    /// What each rank did for it.
    pub loads: Vec<PictureLoad>,
}

/// Draws a picture.
///
/// Surfaces that let light through are laid over what is behind them, unrefracted; unlit backs of single-sided surfaces are
/// not seen. Behind everything is the sky, if the solution has one, above the horizon, and else black.
///
/// Every rank calls it and draws its part, see [`Split`], with light that the ranks have divided among them. The picture is on
/// rank 0.
pub fn render<'a>(
    solution: &'a Solution,
    options: &PictureOptions,
    ring: &mut Ring<'a>,
    ranks: &mut Communicator<'_>,
) -> Result<Option<Drawn>, Failure> {
    let size = [options.width.max(1), options.height.max(1)];
    let light = Divided::new(solution, ring, ranks)?;
    let painter = Painter::new(solution, options.ambient);
    let places = places(options.samples_per_axis.clamp(1, 16));
    let (view, split) = (&options.view, options.split);
    let casting = Casting { painter: &painter, light: &light, view, size, step: 1.0, grid: size, split, places };
    let before = ring.searched();
    let (rough, rough_cost) = rough(&casting, ring, ranks)?;
    let exposure = options.exposure.unwrap_or_else(|| options.tone.expose(&rough));
    let scale = options.false_colour.map(|wanted| Scale::new(wanted, &rough));
    let pixel = |samples: &[Sample]| {
        let linear = mean(samples.iter().map(|s| s.radiance));
        // Tones come before the mean, lest a lamp's edge be as jagged as if there were one sample.
        let shown = match &scale {
            None => tone::encode(mean(samples.iter().map(|s| options.tone.display(s.radiance, exposure)))),
            Some(scale) => mean(samples.iter().map(|s| scale.colour(s.illuminance))).map(|x| (x + 0.5) as u8),
        };
        (linear, shown)
    };
    let (own, cost) = casting.cast(pixel, ring, ranks)?;
    let load = PictureLoad {
        pixels: own.len() as u64,
        rays: rough_cost.rays + cost.rays,
        searched: ring.searched() - before,
        elements_asked: rough_cost.elements + cost.elements,
        light_bytes: light.bytes() as u64,
        light_bytes_while_found: light.bytes_while_found() as u64,
    };
    let count = if ranks.rank() == 0 { size[0] as usize * size[1] as usize } else { 0 };
    let (linear, shown) = (vec![[0.0; 3]; count], vec![[0; 3]; count]);
    let mut picture = Picture { width: size[0], height: size[1], linear, shown, exposure, scale };
    put_together(&mut picture, split, &own, ranks)?;
    let Some(loads) = load.gather(ranks)? else { return Ok(None) };
    if let Some(scale) = scale {
        legend::draw(&mut picture, &scale);
    }
    Ok(Some(Drawn { picture, split, loads }))
}

/// Samples of a rough picture, row by row, on all ranks.
fn rough<'a>(
    casting: &Casting<'_, 'a>,
    ring: &mut Ring<'a>,
    ranks: &mut Communicator<'_>,
) -> Result<(Vec<Sample>, Cost), Failure> {
    let [width, height] = casting.size;
    let step = (f64::from(width.max(height)) / f64::from(ROUGH_SIDE)).max(1.0);
    let grid = casting.size.map(|n| (f64::from(n) / step).ceil() as u32);
    let (own, cost) =
        Casting { step, grid, places: vec![[0.5; 2]], ..*casting }.cast(|s| s[0].to_words(), ring, ranks)?;
    let all = ranks.all_gather(SAMPLES, bytemuck::cast_slice(&own).to_vec())?;
    let mut samples = vec![Sample::default(); grid[0] as usize * grid[1] as usize];
    for (rank, bytes) in all.iter().enumerate() {
        let part = casting.split.part(grid, rank, ranks.size());
        let words: Vec<[u32; Sample::WORDS]> = bytemuck::pod_collect_to_vec(bytes);
        for (k, words) in words.into_iter().enumerate() {
            let [column, row] = part.place(k).map(|n| n as usize);
            samples[row * grid[0] as usize + column] = Sample::from_words(words);
        }
    }
    Ok((samples, cost))
}

/// Puts the pixels of all ranks in their places on rank 0.
fn put_together(
    picture: &mut Picture,
    split: Split,
    own: &[(Rgb, [u8; 3])],
    ranks: &mut Communicator<'_>,
) -> Result<(), Failure> {
    let (width, ranks_in_all) = (picture.width as usize, ranks.size());
    let parts: Vec<Part> =
        (0..ranks_in_all).map(|rank| split.part([picture.width, picture.height], rank, ranks_in_all)).collect();
    let batches = parts.iter().map(Part::pixels).max().unwrap_or(0).div_ceil(BATCH);
    let part = |batch: usize| {
        let pixels = own.iter().skip(batch * BATCH).take(BATCH);
        pixels.flat_map(|(linear, shown)| linear.iter().flat_map(|x| x.to_le_bytes()).chain(*shown)).collect()
    };
    let take = |batch: usize, all: Vec<Vec<u8>>| {
        for (part, bytes) in parts.iter().zip(&all) {
            for (k, pixel) in bytes.as_chunks::<PIXEL>().0.iter().enumerate() {
                let [column, row] = part.place(batch * BATCH + k).map(|n| n as usize);
                let word = |c: usize| f32::from_le_bytes(std::array::from_fn(|i| pixel[4 * c + i]));
                picture.linear[row * width + column] = [0, 1, 2].map(word);
                picture.shown[row * width + column] = [12, 13, 14].map(|i| pixel[i]);
            }
        }
        Ok::<(), Failure>(())
    };
    ranks.gather_batches(PIXELS, batches, part, take)?
}

/// The ray through a place of the picture, in pixels from its upper left corner.
fn pixel_ray(view: &View, [x, y]: [f64; 2], [width, height]: [u32; 2]) -> ringlight_visibility::Ray {
    let half = f64::from(height) / 2.0;
    view.ray((x - f64::from(width) / 2.0) / half, (half - y) / half)
}

/// Places of samples in a pixel: a regular grid, sheared so that no two are in one row or column (Chiu, Shirley and Wang
/// 1994, without the jitter); edges near the axes get as many shades as there are samples.
fn places(side: u32) -> Vec<[f64; 2]> {
    let n = f64::from(side);
    (0..side * side)
        .map(|k| (f64::from(k % side), f64::from(k / side)))
        .map(|(i, j)| [(i + (j + 0.5) / n) / n, (j + (i + 0.5) / n) / n])
        .collect()
}

fn mean(values: impl ExactSizeIterator<Item = Rgb>) -> Rgb {
    let count = values.len() as f32;
    let sum = values.fold([0.0; 3], |sum: Rgb, value| std::array::from_fn(|c| sum[c] + value[c]));
    sum.map(|x| x / count)
}
