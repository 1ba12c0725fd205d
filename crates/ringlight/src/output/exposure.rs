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

/// Share of the light on textured surfaces that is not to be clipped.
const TEXTURE_QUANTILE: f64 = 0.8;

/// Least display value of what is bright.
const DULL: f64 = 0.35;

/// Steps per doubling in which radiances are counted.
const STEPS: f64 = 16.0;

/// Radiances from 2^-64 to 2^64 are told apart.
const RANGE: f64 = 64.0;

impl Exposure {
    /// From an exposure value at ISO 100: luminance 1.2 · 2^EV is white.
    pub fn from_ev(ev: f32) -> Exposure {
        Exposure { scale: (1.0 / (1.2 * exp2(f64::from(ev)))) as f32 }
    }

    /// From the light of a solution, so that the logarithmic mean of its radiance becomes middle grey. Where that would
    /// burn out what is bright (its 95 % quantile), or clip the light on more than a fifth of the textured surfaces (a
    /// lit model can hold no more than 1 there, and white texels would burn out), it meets that half-way: a bright room
    /// next door does not leave this one black. Emitters do not count. Elements count by their area, but none by more
    /// than a square of the element size: a field outside, cut coarsely, does not decide over the room inside. 1 if
    /// nothing is lit.
    pub fn automatic(solution: &Solution) -> Exposure {
        let (radiance, on_textures) = count(solution);
        let Some(mean) = radiance.mean() else { return Exposure { scale: 1.0 } };
        let bright = radiance.quantile(BRIGHT_QUANTILE).unwrap_or(mean);
        let limit = on_textures.quantile(TEXTURE_QUANTILE).map_or(bright, |light| light.max(bright));
        let (wanted, most) = (MIDDLE_GREY / mean, 1.0 / limit);
        let scale = if wanted > most { (wanted * most).sqrt() } else { wanted };
        Exposure { scale: scale.max(DULL / bright) as f32 }
    }
}

/// Weights of elements by the logarithm of their radiance.
struct Histogram(Vec<f64>);

impl Histogram {
    fn new() -> Histogram {
        Histogram(vec![0.0; (2.0 * RANGE * STEPS) as usize])
    }

    fn add(&mut self, radiance: f64, weight: f64) {
        if radiance > 0.0 && radiance.is_finite() {
            let bin = ((log2(radiance) + RANGE) * STEPS).clamp(0.0, (self.0.len() - 1) as f64);
            self.0[bin as usize] += weight;
        }
    }

    fn total(&self) -> Option<f64> {
        let total = self.0.iter().sum();
        (total > 0.0).then_some(total)
    }

    /// Binary logarithm of the radiance in the middle of a bin.
    fn exponent(bin: usize) -> f64 {
        (bin as f64 + 0.5) / STEPS - RANGE
    }

    /// Logarithmic mean.
    fn mean(&self) -> Option<f64> {
        let total = self.total()?;
        Some(exp2(self.0.iter().enumerate().map(|(bin, weight)| weight / total * Self::exponent(bin)).sum()))
    }

    /// The radiance below which `share` of the weight lies.
    fn quantile(&self, share: f64) -> Option<f64> {
        let total = self.total()?;
        let mut darker = 0.0;
        let bin = self.0.iter().position(|weight| {
            darker += weight;
            darker >= share * total
        });
        Some(exp2(Self::exponent(bin.unwrap_or(self.0.len() - 1))))
    }
}

/// Radiance of all elements, and what white texels of the textured ones would have.
fn count(solution: &Solution) -> (Histogram, Histogram) {
    let (mesh, description) = (&solution.mesh, &solution.description);
    let largest = if mesh.sizes.element > 0.0 { mesh.sizes.element * mesh.sizes.element } else { f64::INFINITY };
    let (mut radiance, mut on_textures) = (Histogram::new(), Histogram::new());
    for id in 0..mesh.patch_count() as u32 {
        let patch = mesh.patch(id);
        let surface = mesh.facets[patch.facet as usize].surface as usize;
        let textured = description.materials[description.surfaces[surface].material as usize].base_texture.is_some();
        for k in 0..patch.element_count() {
            let element = patch.first_element + k;
            if mesh.valid[element as usize] == 0 || mesh.colour(&patch, element).emits() {
                continue;
            }
            let weight = patch.element_area(k).min(largest);
            let of = |rgb| f64::from(photometric(rgb)) / std::f64::consts::PI;
            radiance.add(of(solution.radiosity(&patch, element)), weight);
            if textured {
                on_textures.add(of(solution.irradiance(element)), weight);
            }
        }
    }
    (radiance, on_textures)
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
    use crate::output::fixture::{closed_box, paint, read, solve};

    #[test]
    fn even_light_becomes_middle_grey_and_bright_light_is_held_within_limits() {
        // Grey 0.5 under irradiance E has radiance E / 2π.
        let mut solution = solve(read(&closed_box("grey")), 0.25, 1.0);
        let radiance = |irradiance: f64| irradiance / (2.0 * std::f64::consts::PI);
        paint(&mut solution, |_, _| 1e-3);
        // Even light is its own bright part: 0.35 instead of 0.18. Bins are 1/16 of a doubling wide: 2.2 %.
        let scale = f64::from(Exposure::automatic(&solution).scale);
        assert!((scale * radiance(1e-3) / 0.35 - 1.0).abs() < 0.025);
        // A third of the surface is 3000 times brighter: half-way between its white and the grey of the mean.
        paint(&mut solution, |p, _| if p.x < 0.3 { 3.0 } else { 1e-3 });
        let mean = radiance(3f64.powf(1.0 / 3.0) * 1e-3f64.powf(2.0 / 3.0));
        let expected = (0.18 / mean / radiance(3.0)).sqrt();
        assert!((f64::from(Exposure::automatic(&solution).scale) / expected - 1.0).abs() < 0.025);
        paint(&mut solution, |_, _| 0.0);
        assert_eq!(Exposure::automatic(&solution).scale, 1.0);
    }

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
