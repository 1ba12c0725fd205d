//! The seam between ranks. Messages are bytes; this module knows no light.
//!
//! A [`Transport`] carries messages: [`Alone`] for a world of one rank, [`threads`] for ranks in one process, and MPI in a
//! crate of its own. A [`Communicator`] is what the solver speaks to: messages sorted by sender and tag, collective
//! operations, and an end that all ranks share. [`conformance`] holds what every transport must pass.

mod alone;
mod batches;
mod collective;
mod communicator;
pub mod conformance;
pub mod threads;

pub use alone::Alone;
pub use collective::Serve;
pub use communicator::{Communicator, Traffic};

/// A message between ranks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// Rank that sent it.
    pub from: usize,
    /// What kind of message it is, for the receiver to sort by.
    pub tag: u32,
    /// Content.
    pub bytes: Vec<u8>,
}

/// The largest tag that may be sent: MPI promises no more than 2¹⁵ tags, and some are kept for the transports' own use.
pub const MAX_TAG: u32 = 32_000;

/// Carries messages between the ranks of a world.
///
/// Messages from one rank to another arrive complete and in the order in which they were sent. Nothing is said of
/// messages from different ranks.
pub trait Transport {
    /// This rank.
    fn rank(&self) -> usize;
    /// Number of ranks.
    fn size(&self) -> usize;
    /// Sends to a rank, maybe to itself. Never waits for the receiver, however much is under way.
    fn send(&mut self, to: usize, tag: u32, bytes: Vec<u8>);
    /// The next message, if one has arrived.
    fn receive(&mut self) -> Option<Message>;
    /// Waits for the next message, asleep for most of the time.
    fn wait(&mut self) -> Message;
    /// Told that a rank has failed, so that all others are about to end; and, with `None`, that all have ended. In between, a
    /// transport that can end ranks from outside may do so when they do not answer, and says then why.
    fn hurry(&mut self, _failure: Option<&Failure>) {}
}

/// A rank has failed, and with it the world.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("rank {rank}: {message}")]
pub struct Failure {
    /// The rank that failed; the lowest, if several did.
    pub rank: usize,
    /// What it said.
    pub message: String,
}
