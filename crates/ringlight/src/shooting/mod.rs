//! Choosing a shooter, its weighted cells, and what the receivers get from it.

mod audit;
mod emitter;
mod gather;
mod light;
mod receive;
mod shot;

pub use audit::{Fate, audit};
pub use emitter::{Emitter, emitters, skies};
pub use light::{ClusterLight, ElementLight, PatchLight, unshot_power, unshot_radiosity};
pub use receive::{Work, receive};
pub use shot::{CellLight, Shoot, Shot, Source, patch_shot};
