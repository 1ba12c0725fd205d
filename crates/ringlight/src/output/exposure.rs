//! From radiance to display values.

use crate::quantity::photometric;
use crate::solution::Solution;

/// Display value = radiance × `scale`; 1 is white.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposure {
    /// Display value of radiance 1 W/(m²·sr) or luminance 1 cd/m².
    pub scale: f32,
}

/// Display value that the logarithmic mean of the radiance gets: the photographer's middle grey.
const MIDDLE_GREY: f64 = 0.18;

/// Share of the weight that is darker than what counts as bright.
const BRIGHT_QUANTILE: f64 = 0.95;

/// Limits of the display value of what is bright: neither burnt out nor dull.
const BRIGHT: [f64; 2] = [0.35, 1.0];

/// Steps per doubling in which radiances are counted.
const STEPS: f64 = 16.0;

/// Radiances from 2^-64 to 2^64 are told apart.
const RANGE: f64 = 64.0;

impl Exposure {
    /// From an exposure value at ISO 100: luminance 1.2 · 2^EV is white.
    pub fn from_ev(ev: f32) -> Exposure {
        Exposure { scale: (1.0 / (1.2 * exp2(f64::from(ev)))) as f32 }
    }

    /// From the light of a solution, so that the logarithmic mean of its radiance becomes middle grey, unless that would
    /// burn out or dull what is bright (its 95 % quantile). Emitters do not count. Elements count by their area, but
    /// none by more than a square of the element size: a field outside, cut coarsely, does not decide over the room
    /// inside. 1 if nothing is lit.
    pub fn automatic(solution: &Solution) -> Exposure {
        let counts = count(solution);
        let total: f64 = counts.iter().sum();
        if total <= 0.0 {
            return Exposure { scale: 1.0 };
        }
        let exponent = |bin: usize| (bin as f64 + 0.5) / STEPS - RANGE;
        let mean = counts.iter().enumerate().map(|(bin, &c)| c / total * exponent(bin)).sum();
        let mut darker = 0.0;
        let bright = counts.iter().position(|&c| {
            darker += c;
            darker >= BRIGHT_QUANTILE * total
        });
        let bright = exp2(exponent(bright.unwrap_or(counts.len() - 1)));
        let scale = (MIDDLE_GREY / exp2(mean)).clamp(BRIGHT[0] / bright, BRIGHT[1] / bright);
        Exposure { scale: scale as f32 }
    }
}

/// Weight of the elements by the logarithm of their radiance.
fn count(solution: &Solution) -> Vec<f64> {
    let mesh = &solution.mesh;
    let largest = if mesh.sizes.element > 0.0 { mesh.sizes.element * mesh.sizes.element } else { f64::INFINITY };
    let mut counts = vec![0.0; (2.0 * RANGE * STEPS) as usize];
    for id in 0..mesh.patch_count() as u32 {
        let patch = mesh.patch(id);
        for k in 0..patch.element_count() {
            let element = patch.first_element + k;
            if mesh.valid[element as usize] == 0 || mesh.colour(&patch, element).emits() {
                continue;
            }
            let radiance = f64::from(photometric(solution.radiosity(&patch, element))) / std::f64::consts::PI;
            if radiance > 0.0 && radiance.is_finite() {
                let bin = ((log2(radiance) + RANGE) * STEPS).clamp(0.0, (counts.len() - 1) as f64);
                counts[bin as usize] += patch.element_area(k).min(largest);
            }
        }
    }
    counts
}

/// Binary logarithm of a normal positive number, in plain arithmetic, so that every machine gives the same bits; error
/// below 1e-14.
fn log2(x: f64) -> f64 {
    let bits = x.max(f64::MIN_POSITIVE).to_bits();
    let exponent = (bits >> 52) as f64 - 1023.0;
    let mantissa = f64::from_bits(bits & ((1 << 52) - 1) | 1023 << 52);
    // ln m = 2 artanh t about m = √2, where |t| ≤ 0.172.
    let t = (mantissa - std::f64::consts::SQRT_2) / (mantissa + std::f64::consts::SQRT_2);
    let mut sum = 0.0;
    for k in (0..10).rev() {
        sum = 1.0 / f64::from(2 * k + 1) + t * t * sum;
    }
    exponent + 0.5 + 2.0 * t * sum * std::f64::consts::LOG2_E
}

/// Power of 2, in plain arithmetic; relative error below 1e-14. Exponents beyond ±1000 are cut off there.
fn exp2(x: f64) -> f64 {
    let x = if x.is_nan() { 0.0 } else { x.clamp(-1000.0, 1000.0) };
    let whole = (x + 0.5).floor();
    let rest = (x - whole) * std::f64::consts::LN_2;
    let mut sum = 1.0;
    for k in (1..=14).rev() {
        sum = 1.0 + rest / f64::from(k) * sum;
    }
    sum * f64::from_bits(((whole + 1023.0) as u64) << 52)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithm_and_power_equal_the_standard_library() {
        for i in -4000..4000 {
            let x = f64::from(i) * 0.0237;
            assert!((exp2(x) / x.exp2() - 1.0).abs() < 1e-14, "{x}");
            assert!((log2(x.exp2()) - x).abs() < 1e-13, "{x}");
        }
        assert_eq!((log2(1.0).abs() < 1e-15, exp2(3.0)), (true, 8.0));
    }

    #[test]
    fn one_stop_halves_the_scale() {
        let scale = |ev| Exposure::from_ev(ev).scale;
        assert!((scale(0.0) - 1.0 / 1.2).abs() < 1e-7);
        assert!((scale(4.0) / scale(5.0) - 2.0).abs() < 1e-6);
        assert!(scale(f32::INFINITY) > 0.0 || scale(f32::INFINITY) == 0.0);
    }
}
