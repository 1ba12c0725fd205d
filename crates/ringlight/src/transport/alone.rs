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
        debug_assert_eq!(to, 0);
        self.0.push_back(Message { from: 0, tag, bytes });
    }

    fn receive(&mut self) -> Option<Message> {
        self.0.pop_front()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::all_reduce;

    #[test]
    fn one_rank_talks_to_itself_in_order_and_reduces_to_its_own_value() {
        let mut alone = Alone::default();
        alone.send(0, 1, vec![7]);
        alone.send(0, 2, vec![]);
        assert_eq!(alone.receive(), Some(Message { from: 0, tag: 1, bytes: vec![7] }));
        assert_eq!(alone.receive(), Some(Message { from: 0, tag: 2, bytes: vec![] }));
        assert_eq!(alone.receive(), None);
        assert_eq!(all_reduce(&mut alone, 3, [5], |a, b| [a[0].max(b[0])]), [5]);
    }
}
