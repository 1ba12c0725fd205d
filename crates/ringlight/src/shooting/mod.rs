//! Choosing a shooter, its weighted cells, and what the receivers get from it.

mod audit;
mod cells;
mod emitter;
mod faces;
mod far;
mod field;
mod gather;
mod hemisphere;
mod light;
mod packet;
mod receive;
mod receivers;
mod shot;
mod tree;
mod tree_light;

pub use audit::{Audit, Fate, FateShares, Following};
pub(crate) use emitter::sine_cosine;
pub use emitter::{Emitter, emitters, skies};
pub use faces::{Between, Faces};
pub use far::{FarCells, FarReceivers, FarWork, Share};
pub use field::{Field, WHOLE, has_free_cell};
pub use hemisphere::{Glance, spiral};
pub use light::{ClusterLight, ElementLight, PatchLight, radiosity, unshot_power, unshot_radiosity};
pub use packet::Packet;
pub use receive::{Work, add_received, collect, receive};
pub use receivers::Receivers;
pub use shot::{CellLight, FAR, PatchSource, Shoot, Shot, Source, patch_shot};
pub use tree::{Kind, Node, Piece, ShooterTree, direction, distance, most_facing};
pub use tree_light::{Radiosity, TreeLight, strength};
