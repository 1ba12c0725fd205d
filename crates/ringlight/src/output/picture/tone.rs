//! From radiance to what a screen shows.

use super::paint::Sample;
use crate::output::Exposure;
use crate::quantity::{Rgb, photometric};

/// How bright parts are shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tone {
    /// Compressed as on film, so that lamps and what they shine on are seen together: the curve fitted to the ACES reference
    /// by Narkowicz, "ACES Filmic Tone Mapping Curve" (2015), for each channel.
    #[default]
    Filmic,
    /// Clipped at white.
    None,
}

/// Display value that the logarithmic mean of a picture gets: middle grey.
const MIDDLE: f64 = 0.18;

/// Share of the pixels that are not brighter than the bright end.
const BRIGHT_END: f64 = 0.98;

impl Tone {
    /// Display value, linear, 0 to 1.
    pub fn display(self, radiance: Rgb, exposure: Exposure) -> Rgb {
        radiance.map(|l| {
            let x = (l * exposure.scale).max(0.0);
            match self {
                Tone::Filmic if x > 1e4 => 1.0,
                Tone::Filmic => (x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)).min(1.0),
                Tone::None => x.min(1.0),
            }
        })
    }

    /// The exposure for a picture: middle grey for the logarithmic mean of what is lit and does not emit (Reinhard et al.
    /// 2002), but with the bright end neither burnt out nor dull.
    pub fn expose(self, samples: &[Sample]) -> Exposure {
        let luminance = |s: &Sample| f64::from(photometric(s.radiance));
        let mut lit: Vec<f64> = samples.iter().filter(|s| !s.emits).map(luminance).filter(|&l| l > 0.0).collect();
        if lit.is_empty() {
            // Nothing but lamps.
            lit = samples.iter().map(luminance).filter(|&l| l > 0.0).collect();
        }
        if lit.is_empty() {
            return Exposure { scale: 1.0 };
        }
        lit.sort_by(f64::total_cmp);
        let bright = lit[((lit.len() - 1) as f64 * BRIGHT_END) as usize];
        // What is a thousand times darker than the bright end does not count as darker still.
        let mean = lit.iter().map(|&l| libm::log(l.max(bright / 1e3))).sum::<f64>() / lit.len() as f64;
        let (dull, burnt) = match self {
            Tone::Filmic => (0.5, 2.0),
            Tone::None => (0.5, 1.0),
        };
        let scale = (MIDDLE / libm::exp(mean)).clamp(dull / bright, burnt / bright);
        Exposure { scale: (scale as f32).clamp(f32::MIN_POSITIVE, f32::MAX) }
    }
}

/// The sRGB bytes of linear display values (IEC 61966-2-1).
pub fn encode(linear: Rgb) -> [u8; 3] {
    linear.map(|x| {
        let x = f64::from(x.clamp(0.0, 1.0));
        let encoded = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * libm::pow(x, 1.0 / 2.4) - 0.055 };
        (encoded * 255.0 + 0.5) as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(l: f32) -> Sample {
        Sample { radiance: [l; 3], illuminance: Some(l), emits: false }
    }

    #[test]
    fn bytes_of_srgb_are_those_of_its_standard() {
        assert_eq!(encode([0.0, 1.0, 2.0]), [0, 255, 255]);
        // Middle grey, and the end of the straight part.
        assert_eq!(encode([0.18, 0.003_130_8, 0.5]), [118, 10, 188]);
        assert_eq!(encode([f32::NAN, -1.0, f32::INFINITY]), [0, 0, 255]);
    }

    #[test]
    fn tones_rise_with_the_light_and_stay_below_white() {
        for tone in [Tone::Filmic, Tone::None] {
            let values: Vec<f32> =
                (0..2000).map(|k| tone.display([1.01f32.powi(k - 1000); 3], Exposure { scale: 1.0 })[0]).collect();
            assert!(values.windows(2).all(|w| w[0] <= w[1]) && values.iter().all(|v| (0.0..=1.0).contains(v)));
        }
        assert_eq!(Tone::Filmic.display([f32::MAX; 3], Exposure { scale: 10.0 }), [1.0; 3]);
    }

    #[test]
    fn exposure_follows_the_light_and_does_not_look_at_lamps() {
        let samples: Vec<Sample> = (1..100).map(|k| grey(k as f32)).collect();
        let brighter: Vec<Sample> = (1..100).map(|k| grey(k as f32 * 8.0)).collect();
        let mut lamp = samples.clone();
        lamp.push(Sample { emits: true, ..grey(1e6) });
        for tone in [Tone::Filmic, Tone::None] {
            let scale = tone.expose(&samples).scale;
            assert!((tone.expose(&brighter).scale * 8.0 / scale - 1.0).abs() < 1e-6);
            assert_eq!(tone.expose(&lamp).scale, scale);
        }
        assert_eq!(Tone::Filmic.expose(&[]).scale, 1.0);
    }
}
