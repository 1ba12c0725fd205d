//! A world of one rank.

use super::{Message, Transport};
use std::collections::VecDeque;

/// One rank; messages to itself come back in order.
#[derive(Debug, Default)]
pub struct Alone(VecDeque<Message>);

impl Transport for Alone {
    fn rank(&self) -> usize {
        0
    }

    fn size(&self) -> usize {
        1
    }

    fn send(&mut self, to: usize, tag: u32, bytes: Vec<u8>) {
        assert_eq!(to, 0, "there is one rank");
        self.0.push_back(Message { from: 0, tag, bytes });
    }

    fn receive(&mut self) -> Option<Message> {
        self.0.pop_front()
    }

    fn wait(&mut self) -> Message {
        self.receive().expect("a rank that is alone waits only for what it has sent")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::{Communicator, conformance};

    #[test]
    fn one_rank_conforms() {
        conformance::check(&mut Communicator::new(Alone::default())).expect("the suite passes");
    }
}
