//! Gauss–Legendre quadrature, and how many points it needs.

use std::f64::consts::PI;
use std::sync::LazyLock;

/// Most points of a rule.
pub(crate) const MOST: usize = 16;

/// What an integral may be off by where nothing is said otherwise, as a share of the integrand's size.
const PRECISION: f64 = 1e-11;

/// A point and its weight on [-1, 1].
pub(crate) type Node = (f64, f64);

/// The rule with `n` points, 1 ≤ n ≤ [`MOST`].
pub(crate) fn rule(n: usize) -> &'static [Node] {
    static RULES: LazyLock<Vec<Vec<Node>>> = LazyLock::new(|| (0..=MOST).map(nodes).collect());
    &RULES[n]
}

/// Zeros of the Legendre polynomial Pₙ by Newton's method from Tricomi's first guess (Abramowitz & Stegun 25.4.29).
fn nodes(n: usize) -> Vec<Node> {
    let order = n as f64;
    (0..n)
        .map(|k| {
            let mut x = libm::cos(PI * (k as f64 + 0.75) / (order + 0.5));
            let mut slope = 1.0;
            for _ in 0..8 {
                let (mut last, mut value) = (1.0, x);
                for j in 2..=n {
                    let j = j as f64;
                    (last, value) = (value, ((2.0 * j - 1.0) * x * value - (j - 1.0) * last) / j);
                }
                slope = order * (x * value - last) / (x * x - 1.0);
                x -= value / slope;
            }
            (x, 2.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}

/// Points that an integrand needs whose nearest singularity in the complex plane lies where the distances to the two ends
/// of the interval, in half-lengths of it, add up to `sum`: n points err by ϱ^(−2n), where ϱ + 1/ϱ = `sum` (Trefethen 2008,
/// theorem 4.5). More than [`MOST`] where it is too near.
pub(crate) fn points_needed(sum: f64) -> usize {
    static SUMS: LazyLock<[f64; MOST + 1]> = LazyLock::new(|| {
        std::array::from_fn(|n| {
            let ellipse = libm::exp(-0.5 * libm::log(PRECISION) / n as f64);
            ellipse + 1.0 / ellipse
        })
    });
    (2..=MOST).find(|&n| sum >= SUMS[n]).unwrap_or(MOST + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integrates_polynomials_of_degree_two_n_less_one_exactly() {
        for n in 1..=MOST {
            for degree in 0..2 * n {
                let sum: f64 = rule(n).iter().map(|&(x, w)| w * x.powi(degree as i32)).sum();
                let exact = if degree % 2 == 1 { 0.0 } else { 2.0 / (degree as f64 + 1.0) };
                assert!((sum - exact).abs() < 1e-14, "{n} points, degree {degree}: {sum}");
            }
        }
    }

    #[test]
    fn a_pole_is_integrated_as_well_as_its_distance_says() {
        // ∫ 1/(x² + h²) over [-1, 1], poles at ±ih.
        for h in [1.0, 2.0, 5.0, 20.0f64] {
            let n = points_needed(2.0 * (1.0 + h * h).sqrt());
            assert!(n <= MOST, "{h}");
            let sum: f64 = rule(n).iter().map(|&(x, w)| w / (x * x + h * h)).sum();
            let exact = 2.0 * (1.0 / h).atan() / h;
            assert!((sum / exact - 1.0).abs() < 10.0 * PRECISION, "{h}: {n} points, {}", sum / exact - 1.0);
        }
        assert_eq!(points_needed(2.0001), MOST + 1);
    }
}
