//! Rings: ranks that together hold the whole geometry once, and the way of packets of sample points and rays among them.
//!
//! Everything here is decided by numbers, boxes, masks and hits: what is done with a mask or a hit is not this module's business. The
//! state machines take events and give actions; they know no clock and send nothing themselves, so that a simulator
//! drives the same code as real ranks do. `README.md` beside this file explains the pipeline.

mod aimed;
mod balance;
mod memory;
mod packet;
mod parcel;
mod partition;
mod pipeline;
mod routing;
mod shard;
#[cfg(test)]
mod simulator;

pub use aimed::Aimed;
pub use balance::{Balance, Load, Moves, Window, rank_correlation};
pub use memory::Demand;
pub use packet::{Answers, Content, Packet, Parcel, Rays, Samples};
pub use parcel::Malformed;
pub use partition::{Rings, owners};
pub use pipeline::{Action, Pipeline, Visits};
pub use routing::{Outlines, Routing, Sight};
pub use shard::{Bounds, Piece, ShardBox, Shards, deal, outline};
