//! The seam between ranks. Messages are bytes; this module knows no light.
//!
//! Today there is one implementation, [`Alone`]: a world of one rank. The solver is written against the trait.

mod alone;

pub use alone::Alone;

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

/// Carries messages between the ranks of a world. Messages from one rank to another with one tag arrive in order; sending
/// never blocks.
pub trait Transport {
    /// This rank.
    fn rank(&self) -> usize;
    /// Number of ranks.
    fn size(&self) -> usize;
    /// Sends to a rank, maybe to itself.
    fn send(&mut self, to: usize, tag: u32, bytes: Vec<u8>);
    /// The next message that has arrived, if any.
    fn receive(&mut self) -> Option<Message>;
}

/// Joins one value of each rank into the same result on all; `join` must be commutative and associative. Every rank must
/// call it, with the same `tag`, and no other messages may be under way.
pub fn all_reduce<const N: usize>(
    transport: &mut dyn Transport,
    tag: u32,
    value: [u8; N],
    join: impl Fn([u8; N], [u8; N]) -> [u8; N],
) -> [u8; N] {
    let this = transport.rank();
    for to in (0..transport.size()).filter(|&to| to != this) {
        transport.send(to, tag, value.to_vec());
    }
    let mut joined = value;
    let mut missing = transport.size() - 1;
    while missing > 0 {
        if let Some(message) = transport.receive()
            && message.tag == tag
            && let Ok(other) = <[u8; N]>::try_from(message.bytes.as_slice())
        {
            joined = join(joined, other);
            missing -= 1;
        }
    }
    joined
}
