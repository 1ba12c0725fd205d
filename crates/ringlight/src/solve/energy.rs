//! Where the energy went.

use serde::{Deserialize, Serialize};

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
