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
use crate::quantity::Rgb;
use crate::solution::Solution;
use paint::{Painter, Sample};
use rayon::prelude::*;
use ringlight_visibility::Hierarchy;

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

/// Makes a picture.
///
/// Surfaces that let light through are laid over what is behind them, unrefracted; unlit backs of single-sided surfaces are
/// not seen. Behind everything is the sky, if the solution has one, above the horizon, and else black.
pub fn render(solution: &Solution, hierarchy: &Hierarchy, options: &PictureOptions) -> Picture {
    let (width, height) = (options.width.max(1), options.height.max(1));
    let painter = Painter::new(solution, hierarchy, options.ambient);
    let rough = rough(&painter, &options.view, width, height);
    let exposure = options.exposure.unwrap_or_else(|| options.tone.expose(&rough));
    let scale = options.false_colour.map(|wanted| Scale::new(wanted, &rough));
    let side = options.samples_per_axis.clamp(1, 16);
    let places = places(side);
    let count = width as usize * height as usize;
    let (mut linear, mut shown) = (vec![[0.0; 3]; count], vec![[0; 3]; count]);
    let rows = linear.par_chunks_mut(width as usize).zip(shown.par_chunks_mut(width as usize));
    rows.enumerate().for_each(|(row, (linear, shown))| {
        let mut samples = Vec::with_capacity(places.len());
        for (column, (linear, shown)) in linear.iter_mut().zip(shown).enumerate() {
            samples.clear();
            samples.extend(places.iter().map(|place| {
                let [x, y] = [column as f64 + place[0], row as f64 + place[1]];
                painter.sample(pixel_ray(&options.view, [x, y], [width, height]))
            }));
            *linear = mean(samples.iter().map(|s| s.radiance));
            // Tones come before the mean, lest a lamp's edge be as jagged as if there were one sample.
            *shown = match &scale {
                None => tone::encode(mean(samples.iter().map(|s| options.tone.display(s.radiance, exposure)))),
                Some(scale) => mean(samples.iter().map(|s| scale.colour(s.illuminance))).map(|x| (x + 0.5) as u8),
            };
        }
    });
    let mut picture = Picture { width, height, linear, shown, exposure, scale: None };
    if let Some(scale) = scale {
        legend::draw(&mut picture, &scale);
        picture.scale = Some(scale);
    }
    picture
}

/// Samples of a rough picture, row by row.
fn rough(painter: &Painter<'_>, view: &View, width: u32, height: u32) -> Vec<Sample> {
    let step = f64::from(width.max(height)) / f64::from(ROUGH_SIDE);
    let step = step.max(1.0);
    let [columns, rows] = [width, height].map(|n| (f64::from(n) / step).ceil() as u32);
    (0..columns * rows)
        .into_par_iter()
        .map(|k| {
            let at = [k % columns, k / columns].map(|n| (f64::from(n) + 0.5) * step);
            painter.sample(pixel_ray(view, at, [width, height]))
        })
        .collect()
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
