//! Ranks as MPI processes: a [`Transport`] over the `mpi` crate, for Open MPI and MPICH.
//!
//! MPI is used by one thread only. Sends are nonblocking and keep their buffers; what arrives is found by probing and then
//! received, so that no size has to be agreed on. Messages larger than MPI's counts go in pieces. Waiting backs off to
//! sleep: a rank that waits leaves its core to others.

mod sending;

use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator as _, Equivalence, Source};
use mpi::{Rank, Threading};
use ringlight::transport::{Communicator, Failure, MAX_TAG, Message, Transport};
use sending::Sending;
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Tag of a piece of a message that goes on.
const CONTINUES: u32 = MAX_TAG + 3;

/// MPI counts in `i32`.
const LARGEST_PIECE: usize = 1 << 30;

/// How long a rank that has been told of a failure may take to end before the world is aborted.
const PATIENCE: Duration = Duration::from_secs(8);

/// A rank in the world that `mpirun` has started.
struct Mpi {
    world: SimpleCommunicator,
    sending: Vec<Sending>,
    /// Pieces received so far, per rank.
    partial: Vec<Vec<u8>>,
    received: VecDeque<Message>,
    largest_piece: usize,
    /// What some rank has failed of, and when the world is aborted if it has not ended by then.
    failed: Option<(Failure, Instant)>,
}

/// MPI could not be initialised: it already is, or lacks the support for threads beside the one that uses it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("MPI cannot be initialised with threads beside the one that uses it (MPI_THREAD_FUNNELED)")]
pub struct Unavailable;

/// Initialises MPI, lets `body` speak with the other ranks, and finalises MPI. To be called once, from the main thread.
pub fn start<T>(body: impl FnOnce(&mut Communicator<'_>) -> T) -> Result<T, Unavailable> {
    start_with_pieces(LARGEST_PIECE, body)
}

/// As [`start`], with messages in pieces of at most so many bytes.
pub fn start_with_pieces<T>(
    largest_piece: usize,
    body: impl FnOnce(&mut Communicator<'_>) -> T,
) -> Result<T, Unavailable> {
    let (universe, threading) = mpi::initialize_with_threading(Threading::Funneled).ok_or(Unavailable)?;
    if threading < Threading::Funneled {
        return Err(Unavailable);
    }
    let world = universe.world();
    let ranks = world.size() as usize;
    let largest_piece = largest_piece.clamp(1, LARGEST_PIECE);
    // Dropped before the universe, which finalises MPI.
    let mut communicator = Communicator::new(Mpi {
        world,
        sending: Vec::new(),
        partial: vec![Vec::new(); ranks],
        received: VecDeque::new(),
        largest_piece,
        failed: None,
    });
    Ok(body(&mut communicator))
}

impl Mpi {
    /// Lets go of buffers that MPI has read, and takes in one message or piece, if there is any.
    fn progress(&mut self) -> bool {
        self.sending = std::mem::take(&mut self.sending).into_iter().filter_map(Sending::test).collect();
        let Some((message, status)) = self.world.any_process().immediate_matched_probe() else { return false };
        let from = status.source_rank() as usize;
        let len = status.count(u8::equivalent_datatype()) as usize;
        let whole = &mut self.partial[from];
        let start = whole.len();
        whole.resize(start + len, 0);
        message.matched_receive_into(&mut whole[start..]);
        let tag = status.tag() as u32;
        if tag != CONTINUES {
            self.received.push_back(Message { from, tag, bytes: std::mem::take(whole) });
        }
        true
    }

    fn rest(&self, idle: &mut u32) {
        if let Some((failure, time)) = &self.failed
            && Instant::now() > *time
        {
            eprintln!("error: {failure} (rank {} waits for others that do not end; aborting)", self.rank());
            self.world.abort(1);
        }
        *idle += 1;
        match *idle {
            ..50 => std::hint::spin_loop(),
            50..200 => std::thread::yield_now(),
            n => std::thread::sleep(Duration::from_micros(u64::from(n - 190).min(500))),
        }
    }
}

impl Transport for Mpi {
    fn rank(&self) -> usize {
        self.world.rank() as usize
    }

    fn size(&self) -> usize {
        self.world.size() as usize
    }

    fn send(&mut self, to: usize, tag: u32, bytes: Vec<u8>) {
        if to == self.rank() {
            self.received.push_back(Message { from: to, tag, bytes });
            return;
        }
        let receiver = self.world.process_at_rank(to as Rank);
        if bytes.len() <= self.largest_piece {
            self.sending.push(Sending::start(&receiver, tag, bytes));
            return;
        }
        let mut pieces = bytes.chunks(self.largest_piece).peekable();
        while let Some(piece) = pieces.next() {
            let tag = if pieces.peek().is_some() { CONTINUES } else { tag };
            self.sending.push(Sending::start(&receiver, tag, piece.to_vec()));
        }
    }

    fn receive(&mut self) -> Option<Message> {
        while self.received.is_empty() && self.progress() {}
        self.received.pop_front()
    }

    fn wait(&mut self) -> Message {
        let mut idle = 0;
        loop {
            if let Some(message) = self.receive() {
                return message;
            }
            self.rest(&mut idle);
        }
    }

    fn hurry(&mut self, failure: Option<&Failure>) {
        match failure {
            None => self.failed = None,
            Some(failure) if self.failed.is_none() => self.failed = Some((failure.clone(), Instant::now() + PATIENCE)),
            Some(_) => {}
        }
    }
}

impl Drop for Mpi {
    /// The others have received everything before they ended; MPI has yet to notice.
    fn drop(&mut self) {
        let mut idle = 0;
        while !self.sending.is_empty() {
            self.progress();
            self.rest(&mut idle);
        }
    }
}
