//! Quantities: the words of the design as types and constants; sums that do not depend on order.

/// Three channels of light: linear red, green, blue. Units by context: W/m² or lm/m² for exitance, radiosity and
/// irradiance; W or lm for power.
pub type Rgb = [f32; 3];

/// The largest reflectance: higher ones are lowered to it, so that light dies out.
pub const MAX_REFLECTANCE: f32 = 0.95;

/// Photometric sum of three channels (Rec. 709 luminance weights): lux where the scene's units are photometric.
pub fn photometric(rgb: Rgb) -> f32 {
    0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]
}

/// A sum of numbers that is the same in any order: fixed point with 2⁻⁶⁰ resolution.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ExactSum(pub i128);

/// Units per 1.
const SCALE: f64 = (1u64 << 60) as f64;

impl ExactSum {
    /// Adds a value; those beyond ±1e19 saturate.
    pub fn add(&mut self, value: f64) {
        self.0 = self.0.saturating_add((value * SCALE) as i128);
    }

    /// Both sums.
    pub fn join(self, other: ExactSum) -> ExactSum {
        ExactSum(self.0.saturating_add(other.0))
    }

    /// The sum.
    pub fn value(self) -> f64 {
        self.0 as f64 / SCALE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_do_not_depend_on_order() {
        let values: Vec<f64> = (0..1000).map(|i| 1e12 / f64::from(i * i + 1) - 1e-3 * f64::from(i)).collect();
        let (mut forth, mut back) = (ExactSum::default(), ExactSum::default());
        values.iter().for_each(|&v| forth.add(v));
        values.iter().rev().for_each(|&v| back.add(v));
        assert_eq!(forth, back);
        assert!((forth.value() / values.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }
}
