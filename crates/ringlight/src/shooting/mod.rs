//! Choosing a shooter, its weighted cells, and what the receivers get from it.

mod audit;
mod emitter;
mod field;
mod light;
mod packet;
mod receive;
mod shot;

pub use audit::{Fate, audit};
pub(crate) use emitter::sine_cosine;
pub use emitter::{Emitter, emitters, skies};
pub use field::{Field, WHOLE};
pub use light::{ClusterLight, ElementLight, PatchLight, radiosity, unshot_power, unshot_radiosity};
pub use packet::Packet;
pub use receive::{Work, receive};
pub use shot::{CellLight, FAR, PatchSource, Shoot, Shot, Source, patch_shot};
