//! The energy audit, and sums that do not depend on order.

use crate::transport::{Communicator, Failure};
use serde::{Deserialize, Serialize};

/// Tag of the messages that join sums.
const SUM: u32 = 6;

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

    /// That of all ranks; each calls it.
    pub fn of_all(self, ranks: &mut Communicator<'_>) -> Result<ExactSum, Failure> {
        let join = |a, b| ExactSum(i128::from_le_bytes(a)).join(ExactSum(i128::from_le_bytes(b))).0.to_le_bytes();
        Ok(ExactSum(i128::from_le_bytes(ranks.all_reduce(SUM, self.0.to_le_bytes(), join)?)))
    }

    /// The sum.
    pub fn value(self) -> f64 {
        self.0 as f64 / SCALE
    }
}

/// Where the emitted power went; W or lm, summed over channels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Energy {
    /// Sent out by emitters; of light from infinity, what meets the scene.
    pub emitted: f64,
    /// Absorbed by lit sides.
    pub absorbed: f64,
    /// Absorbed by unlit backs.
    pub absorbed_by_backs: f64,
    /// Left the scene, or was cut off by its lamp's range.
    pub escaped: f64,
    /// Still to be shot.
    pub unshot: f64,
    /// (emitted − all others) / emitted.
    pub closure_error: f64,
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
