//! Illuminance by colours.

use super::paint::Sample;
use crate::quantity::Rgb;

/// How illuminance is shown by colours.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FalseColour {
    /// Unit that the legend names.
    pub unit: Unit,
    /// Ends of the scale; from the picture itself if none.
    pub range: Option<[f32; 2]>,
    /// Whether equal ratios get equal distances; by the range if none.
    pub logarithmic: Option<bool>,
}

/// Unit of the illuminance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Unit {
    /// Lux: scenes in photometric units, as glTF.
    #[default]
    Lux,
    /// W/m²: scenes in radiometric units, as OBJ.
    WattsPerSquareMetre,
}

impl Unit {
    /// The unit's sign.
    pub fn sign(self) -> &'static str {
        match self {
            Unit::Lux => "lx",
            Unit::WattsPerSquareMetre => "W/m²",
        }
    }
}

/// A scale of colours: from `low` to `high` along "turbo" (Mikhailov 2019), which rises in hue from blue over green to red.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Lower end, lx or W/m²; above 0 if logarithmic.
    pub low: f64,
    /// Upper end, lx or W/m².
    pub high: f64,
    /// Whether equal ratios have equal distances.
    pub logarithmic: bool,
    /// Unit.
    pub unit: Unit,
}

/// Values that differ by more than this ratio are shown on a logarithmic scale.
const WIDE: f64 = 100.0;

/// A logarithmic scale goes no further down than this share of its upper end.
const DEEPEST: f64 = 1e-4;

/// Colour of places without illuminance: unlit ones, and nothing.
const NOTHING: Rgb = [0.0; 3];

impl Scale {
    /// As wanted; what is left open comes from the samples.
    pub fn new(wanted: FalseColour, samples: &[Sample]) -> Scale {
        let mut values: Vec<f64> = samples.iter().filter_map(|s| s.illuminance).map(f64::from).collect();
        values.retain(|&v| v > 0.0 && v.is_finite());
        values.sort_by(f64::total_cmp);
        let at = |share: f64| match values.len() {
            0 => 1.0,
            n => values[((n - 1) as f64 * share) as usize],
        };
        let asked = wanted.range.map(|r| r.map(f64::from)).filter(|r| 0.0 <= r[0] && r[0] < r[1] && r[1].is_finite());
        // A few specks do not stretch the scale.
        let [low, high] = asked.unwrap_or([at(0.05), at(0.995)]);
        let logarithmic = wanted.logarithmic.unwrap_or(high > WIDE * low && (low > 0.0 || asked.is_none()));
        let (low, high) = match asked {
            Some(_) if logarithmic => (low.max(high * DEEPEST), high),
            Some(_) => (low, high),
            None if logarithmic => (round(low.max(high * DEEPEST), false), round(high, true)),
            None => (0.0, round(high, true)),
        };
        Scale { low, high, logarithmic, unit: wanted.unit }
    }

    /// Where a value lies: 0 at the lower end, 1 at the upper end.
    pub fn position(&self, value: f64) -> f64 {
        let position = if self.logarithmic {
            libm::log(value.max(self.low) / self.low) / libm::log(self.high / self.low)
        } else {
            (value - self.low) / (self.high - self.low)
        };
        position.clamp(0.0, 1.0)
    }

    /// The colour at a position, sRGB, 0 to 255.
    pub fn colour_at(position: f64) -> Rgb {
        let colour = colorous::TURBO.eval_continuous(position.clamp(0.0, 1.0));
        [colour.r, colour.g, colour.b].map(f32::from)
    }

    /// The colour of an illuminance, sRGB, 0 to 255; black for none.
    pub fn colour(&self, illuminance: Option<f32>) -> Rgb {
        illuminance.map_or(NOTHING, |e| Scale::colour_at(self.position(f64::from(e))))
    }

    /// Values to be marked, from the lower end up.
    pub fn marks(&self) -> Vec<f64> {
        let mut marks = vec![self.low];
        if self.logarithmic {
            let mut inner: Vec<f64> = numbers(self.low, self.high, &[1, 2, 5]);
            if inner.len() > 8 {
                inner = numbers(self.low, self.high, &[1]);
            }
            marks.extend(inner);
        } else {
            // Four or five equal steps, so that round ends give round numbers.
            let steps = if format!("{:e}", self.high).starts_with('2') { 4 } else { 5 };
            marks.extend((1..steps).map(|k| self.low + (self.high - self.low) * f64::from(k) / f64::from(steps)));
        }
        marks.push(self.high);
        marks
    }
}

/// The nearest of 1, 2, 5 × 10ⁿ that is not below (or, if not `up`, not above) a positive value.
fn round(value: f64, up: bool) -> f64 {
    let power = libm::floor(libm::log10(value)) as i32;
    let candidates = (power - 1..=power + 1).flat_map(|p| [1, 2, 5].map(|digit| number(digit, p)));
    if up {
        candidates.fold(f64::INFINITY, |best, c| if c >= value { best.min(c) } else { best })
    } else {
        candidates.fold(0.0, |best, c| if c <= value { best.max(c) } else { best })
    }
}

/// The numbers digit × 10ⁿ strictly between two positive ones.
fn numbers(low: f64, high: f64, digits: &[u32]) -> Vec<f64> {
    let [first, last] = [low, high].map(|x| libm::floor(libm::log10(x)) as i32);
    let all = (first..=last).flat_map(|p| digits.iter().map(move |&digit| number(digit, p)));
    all.filter(|&x| low * 1.001 < x && x < high * 0.999).collect()
}

/// digit × 10ⁿ to the last bit: as a reader of decimals has it.
fn number(digit: u32, power: i32) -> f64 {
    format!("{digit}e{power}").parse().unwrap_or(f64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(values: &[f32]) -> Vec<Sample> {
        values.iter().map(|&e| Sample { illuminance: Some(e), ..Sample::default() }).collect()
    }

    fn automatic(values: &[f32]) -> Scale {
        Scale::new(FalseColour::default(), &samples(values))
    }

    #[test]
    fn a_narrow_range_starts_at_zero_and_ends_at_a_round_number() {
        let scale = automatic(&[120.0, 300.0, 430.0, 430.0]);
        assert_eq!((scale.low, scale.high, scale.logarithmic), (0.0, 500.0, false));
        assert_eq!(scale.marks(), [0.0, 100.0, 200.0, 300.0, 400.0, 500.0]);
        assert_eq!(automatic(&[150.0, 151.0]).marks(), [0.0, 50.0, 100.0, 150.0, 200.0]);
    }

    #[test]
    fn a_wide_range_is_logarithmic_between_round_numbers() {
        let scale = automatic(&[0.3, 3.0, 700.0, 700.0]);
        assert_eq!((scale.low, scale.high, scale.logarithmic), (0.2, 1000.0, true));
        assert_eq!(scale.marks(), [0.2, 1.0, 10.0, 100.0, 1000.0]);
        assert!((scale.position(f64::sqrt(200.0)) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn a_range_that_is_asked_for_is_kept() {
        let wanted = FalseColour { range: Some([0.0, 750.0]), ..FalseColour::default() };
        let scale = Scale::new(wanted, &samples(&[1e6]));
        assert_eq!((scale.low, scale.high, scale.logarithmic), (0.0, 750.0, false));
        let scale = Scale::new(FalseColour { logarithmic: Some(true), ..wanted }, &[]);
        assert!(scale.low > 0.0 && scale.high == 750.0);
    }

    #[test]
    fn darkness_and_nonsense_still_give_a_scale() {
        for scale in [
            automatic(&[]),
            automatic(&[0.0, f32::INFINITY]),
            automatic(&[f32::MIN_POSITIVE]),
            automatic(&[f32::MAX, 1e-30]),
            Scale::new(FalseColour { range: Some([5.0, 1.0]), ..FalseColour::default() }, &[]),
        ] {
            assert!(scale.low < scale.high && scale.high.is_finite(), "{scale:?}");
            assert!(scale.marks().is_sorted());
        }
    }
}
