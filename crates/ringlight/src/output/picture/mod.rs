//! Pictures by ray casting.
//!
//! A sample of a pixel follows a ray of sight to what it meets, and shows there the light of the solution, interpolated
//! between elements, with the full textures. There is no randomness: equal solutions give equal pictures.

mod false_colour;
mod file;
mod grid;
mod legend;
mod paint;
#[cfg(test)]
mod tests;
mod texture;
mod tone;

pub use false_colour::{FalseColour, Scale, Unit};
pub use file::{write_exr, write_png};
pub use grid::grid_picture;
pub use tone::Tone;

use super::{Exposure, View};
use crate::mesh::Inquiry;
use crate::quantity::Rgb;
use crate::smooth::Smooth;
use crate::solution::Solution;
use crate::solve::Ring;
use crate::transport::{Communicator, Failure};
use paint::{Painter, Sample};

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

/// Makes a picture.
///
/// Surfaces that let light through are laid over what is behind them, unrefracted; unlit backs of single-sided surfaces are
/// not seen. Behind everything is the sky, if the solution has one, above the horizon, and else black.
///
/// Every rank calls it and draws rows: rank i of N those whose number is i modulo N. The picture is on rank 0.
pub fn render<'a>(
    solution: &'a Solution,
    options: &PictureOptions,
    ring: &mut Ring<'a>,
    ranks: &mut Communicator<'_>,
) -> Result<Option<Picture>, Failure> {
    let (width, height) = (options.width.max(1), options.height.max(1));
    let smooth = Smooth::over_ranks(solution, ring, ranks)?;
    let painter = Painter::new(solution, smooth, options.ambient);
    let rough = rough(&painter, &options.view, [width, height], ring, ranks)?;
    let exposure = options.exposure.unwrap_or_else(|| options.tone.expose(&rough));
    let scale = options.false_colour.map(|wanted| Scale::new(wanted, &rough));
    let places = places(options.samples_per_axis.clamp(1, 16));
    let pixel = |samples: &[Sample]| {
        let linear = mean(samples.iter().map(|s| s.radiance));
        // Tones come before the mean, lest a lamp's edge be as jagged as if there were one sample.
        let shown = match &scale {
            None => tone::encode(mean(samples.iter().map(|s| options.tone.display(s.radiance, exposure)))),
            Some(scale) => mean(samples.iter().map(|s| scale.colour(s.illuminance))).map(|x| (x + 0.5) as u8),
        };
        (linear, shown)
    };
    // As many pixels at a time as make a packet.
    let run = (ring.packet_size() / places.len()).clamp(1, width as usize);
    let (rank, size) = (ranks.rank(), ranks.size());
    let mut own = vec![([0.0; 3], [0; 3]); (height as usize).saturating_sub(rank).div_ceil(size) * width as usize];
    let rows = (rank..height as usize).step_by(size).enumerate();
    let runs = rows.flat_map(|(own, row)| (0..width as usize).step_by(run).map(move |column| (own, row, column)));
    let (painter, places, pixel) = (&painter, &places, &pixel);
    let task = |(own, row, first): (usize, usize, usize), inquiry: Inquiry<'a>| async move {
        let columns = first..(first + run).min(width as usize);
        let at = columns.flat_map(|column| places.iter().map(move |[x, y]| [column as f64 + x, row as f64 + y]));
        let rays = at.map(|at| painter.follow(pixel_ray(&options.view, at, [width, height])));
        let samples: Vec<Sample> =
            inquiry.follow(rays.collect::<Vec<_>>()).await.iter().map(|ray| ray.sample).collect();
        (own * width as usize + first, samples.chunks(places.len()).map(pixel).collect::<Vec<_>>())
    };
    ring.ask(ranks, runs, task, |(first, pixels)| own[first..][..pixels.len()].copy_from_slice(&pixels))?;
    let count = if rank == 0 { width as usize * height as usize } else { 0 };
    let mut picture =
        Picture { width, height, linear: Vec::with_capacity(count), shown: Vec::with_capacity(count), exposure, scale };
    let part = |batch: usize| {
        let row = own.chunks(width as usize).nth(batch).unwrap_or_default();
        row.iter().flat_map(|(linear, shown)| linear.iter().flat_map(|x| x.to_le_bytes()).chain(*shown)).collect()
    };
    let take = |_, rows: Vec<Vec<u8>>| {
        for pixel in rows.iter().flat_map(|row| row.as_chunks::<PIXEL>().0) {
            let word = |c: usize| f32::from_le_bytes(std::array::from_fn(|i| pixel[4 * c + i]));
            picture.linear.push([0, 1, 2].map(word));
            picture.shown.push([12, 13, 14].map(|i| pixel[i]));
        }
        Ok::<(), Failure>(())
    };
    ranks.gather_batches(PIXELS, (height as usize).div_ceil(size), part, take)??;
    if rank > 0 {
        return Ok(None);
    }
    if let Some(scale) = scale {
        legend::draw(&mut picture, &scale);
    }
    Ok(Some(picture))
}

/// Samples of a rough picture, row by row, on all ranks.
fn rough<'a>(
    painter: &Painter<'a>,
    view: &View,
    [width, height]: [u32; 2],
    ring: &mut Ring<'a>,
    ranks: &mut Communicator<'_>,
) -> Result<Vec<Sample>, Failure> {
    let step = f64::from(width.max(height)) / f64::from(ROUGH_SIDE);
    let step = step.max(1.0);
    let [columns, rows] = [width, height].map(|n| (f64::from(n) / step).ceil() as u32);
    let (rank, size) = (ranks.rank(), ranks.size());
    let mut own: Vec<(u32, Vec<Sample>)> = Vec::new();
    let task = |row: u32, inquiry: Inquiry<'a>| async move {
        let at = (0..columns).map(|column| [column, row].map(|n| (f64::from(n) + 0.5) * step));
        let rays = at.map(|at| painter.follow(pixel_ray(view, at, [width, height])));
        (row, inquiry.follow(rays.collect::<Vec<_>>()).await.iter().map(|ray| ray.sample).collect())
    };
    ring.ask(ranks, (rank as u32..rows).step_by(size), task, |row| own.push(row))?;
    own.sort_unstable_by_key(|(row, _)| *row);
    let words = own.iter().flat_map(|(_, row)| row).map(|sample| sample.to_words());
    let words: Vec<[u32; Sample::WORDS]> = words.collect();
    let all = ranks.all_gather(SAMPLES, bytemuck::cast_slice(&words).to_vec())?;
    let all: Vec<Vec<[u32; Sample::WORDS]>> = all.iter().map(|part| bytemuck::pod_collect_to_vec(part)).collect();
    let row = |row: usize| all[row % size].chunks(columns as usize).nth(row / size).unwrap_or_default();
    Ok((0..rows as usize).flat_map(row).map(|words| Sample::from_words(*words)).collect())
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
