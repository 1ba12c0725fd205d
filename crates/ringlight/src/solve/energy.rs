//! Where the energy went.

use crate::quantity::ExactSum;
use crate::transport::{Communicator, Failure};
use serde::{Deserialize, Serialize};

/// Tag of the messages that join sums.
const SUM: u32 = 6;

impl ExactSum {
    /// That of all ranks; each calls it.
    pub fn of_all(self, ranks: &mut Communicator<'_>) -> Result<ExactSum, Failure> {
        let join = |a, b| ExactSum(i128::from_le_bytes(a)).join(ExactSum(i128::from_le_bytes(b))).0.to_le_bytes();
        Ok(ExactSum(i128::from_le_bytes(ranks.all_reduce(SUM, self.0.to_le_bytes(), join)?)))
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
