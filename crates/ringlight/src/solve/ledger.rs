//! How far a solver has come.

use super::State;
use crate::shooting::ClusterLight;
use serde::{Deserialize, Serialize};

/// How far the solver has come, beside the light itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Ledger {
    /// Shots done.
    pub shots: u64,
    /// How many of the world's emitters have shot.
    pub emitters_shot: u64,
    /// Rounds of group shooting done.
    #[serde(default)]
    pub rounds: u64,
    /// Power sent out by all emitters, W or lm.
    pub emitted: f64,
    /// Power that left the scene.
    pub escaped: f64,
    /// Power that met unlit backs.
    pub absorbed_by_backs: f64,
}

impl Ledger {
    /// Of a state.
    pub fn of(state: &State) -> Ledger {
        let &State { shots, emitters_shot, rounds, emitted, escaped, absorbed_by_backs, .. } = state;
        Ledger { shots, emitters_shot, rounds, emitted, escaped, absorbed_by_backs }
    }

    /// The state with this light.
    pub fn with(self, clusters: Vec<ClusterLight>) -> State {
        let Ledger { shots, emitters_shot, rounds, emitted, escaped, absorbed_by_backs } = self;
        State { clusters, shots, emitters_shot, rounds, emitted, escaped, absorbed_by_backs }
    }
}
