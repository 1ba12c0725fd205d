//! Choosing a shooter, its weighted cells, and what the receivers get from it.

mod audit;
mod cells;
mod emitter;
mod field;
mod gather;
mod light;
mod packet;
mod receive;
mod shot;

pub use audit::{Audit, Fate, FateShares, Following};
pub(crate) use emitter::sine_cosine;
pub use emitter::{Emitter, emitters, skies};
pub use field::{Field, WHOLE};
pub use light::{ClusterLight, ElementLight, PatchLight, radiosity, unshot_power, unshot_radiosity};
pub use packet::Packet;
pub use receive::{Work, add_received, collect, receive};
pub use shot::{CellLight, FAR, PatchSource, Shoot, Shot, Source, patch_shot};
