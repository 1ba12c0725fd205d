//! Much data from all ranks to the first, a batch at a time.

use super::{Communicator, Failure};

/// How many batches there may be between what rank 0 has taken and what another sends: one is taken while the next is
/// under way.
const WINDOW: usize = 2;

/// Rank 0 takes more.
const MORE: u8 = 1;

/// Rank 0 takes no more.
const NO_MORE: u8 = 0;

impl Communicator<'_> {
    /// Gives rank 0 a part of every rank for each of `batches` batches: there `take` gets the parts of a batch, in the
    /// order of ranks, batch by batch. What is under way or waits is never more than two batches.
    ///
    /// If `take` fails, rank 0 returns its error, and the others send no more of it; they are not told the error.
    pub fn gather_batches<E>(
        &mut self,
        tag: u32,
        batches: usize,
        mut part: impl FnMut(usize) -> Vec<u8>,
        mut take: impl FnMut(usize, Vec<Vec<u8>>) -> Result<(), E>,
    ) -> Result<Result<(), E>, Failure> {
        let size = self.size();
        if self.rank() > 0 {
            for batch in 0..batches {
                if batch >= WINDOW && self.wait_for(0, tag)? == [NO_MORE] {
                    break;
                }
                self.send(0, tag, part(batch));
            }
            return Ok(Ok(()));
        }
        for batch in 0..batches {
            let mut parts = vec![part(batch)];
            for rank in 1..size {
                parts.push(self.wait_for(rank, tag)?);
            }
            let taken = take(batch, parts);
            let under_way = batch + 1..batches.min(batch + WINDOW);
            if batch + WINDOW < batches {
                let word = if taken.is_ok() { MORE } else { NO_MORE };
                (1..size).for_each(|rank| self.send(rank, tag, vec![word]));
            }
            if taken.is_err() {
                // It would stay for ever.
                for rank in under_way.flat_map(|_| 1..size) {
                    self.wait_for(rank, tag)?;
                }
                return Ok(taken);
            }
        }
        Ok(Ok(()))
    }
}

#[cfg(test)]
mod tests {
    use crate::transport::{Failure, threads};

    /// What rank 0 takes until it has `most` batches, and the numbers of messages sent by each rank.
    fn gather(ranks: usize, batches: usize, most: usize) -> (Vec<Vec<Vec<u8>>>, Vec<u64>) {
        let results = threads::run(ranks, |ranks| {
            let rank = ranks.rank() as u8;
            let mut taken = Vec::new();
            let result = ranks.gather_batches(
                7,
                batches,
                |batch| vec![rank; batch],
                |batch, parts| {
                    assert_eq!(batch, taken.len());
                    taken.push(parts);
                    if taken.len() > most { Err("no more") } else { Ok(()) }
                },
            )?;
            assert_eq!(result.is_err(), rank == 0 && most < batches);
            let messages = ranks.traffic().get(&7).map_or(0, |traffic| traffic.messages);
            // Nothing of it is left, or this would get it.
            ranks.gather_batches(
                7,
                1,
                |_| vec![100 + rank],
                |_, parts| {
                    assert!(parts.iter().zip(100..).all(|(part, expected)| *part == [expected]));
                    Ok::<_, Failure>(())
                },
            )??;
            Ok::<_, Failure>((taken, messages))
        });
        let (mut taken, messages): (Vec<_>, Vec<_>) = results.expect("no rank fails").into_iter().unzip();
        (taken.remove(0), messages)
    }

    #[test]
    fn parts_arrive_in_the_order_of_batches_and_ranks() {
        for ranks in [1, 2, 5] {
            for batches in [0, 1, 2, 3, 9] {
                let (taken, messages) = gather(ranks, batches, usize::MAX);
                let expected: Vec<Vec<Vec<u8>>> =
                    (0..batches).map(|batch| (0..ranks as u8).map(|rank| vec![rank; batch]).collect()).collect();
                assert_eq!(taken, expected);
                assert!(messages[1..].iter().all(|&count| count == batches as u64), "{messages:?}");
            }
        }
    }

    #[test]
    fn nobody_sends_more_than_a_window_beyond_what_is_taken() {
        for batches in 1..9 {
            for most in 0..batches {
                let (taken, messages) = gather(3, batches, most);
                assert_eq!(taken.len(), most + 1);
                let sent = batches.min(most + 2) as u64;
                assert!(messages[1..].iter().all(|&count| count == sent), "{batches} {most}: {messages:?}");
            }
        }
    }
}
