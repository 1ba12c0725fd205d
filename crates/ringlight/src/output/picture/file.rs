//! Pictures as files.

use super::Picture;
use exr::prelude::{Encoding, SpecificChannels, Vec2, WritableImage};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use std::io::{self, Seek, Write};

/// Writes what is shown as PNG: 8 bits a channel, sRGB. Equal pictures give equal bytes.
pub fn write_png(picture: &Picture, out: &mut dyn Write) -> io::Result<()> {
    let encoder = PngEncoder::new_with_quality(out, CompressionType::Default, FilterType::Adaptive);
    encoder
        .write_image(picture.shown.as_flattened(), picture.width, picture.height, ExtendedColorType::Rgb8)
        .map_err(io::Error::other)
}

/// Writes the linear radiance as OpenEXR: channels R, G and B of 32 bits, W/(m²·sr) or cd/m², compressed without loss.
pub fn write_exr(picture: &Picture, out: impl Write + Seek) -> io::Result<()> {
    let width = picture.width as usize;
    let channels = SpecificChannels::rgb(|Vec2(x, y)| {
        let [r, g, b] = picture.linear[y * width + x];
        (r, g, b)
    });
    let size = (width, picture.height as usize);
    let image = exr::image::Image::from_encoded_channels(size, Encoding::SMALL_LOSSLESS, channels);
    image.write().to_buffered(out).map_err(io::Error::other)
}
