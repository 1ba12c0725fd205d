//! Threads as ranks in one process.

use super::{Communicator, Failure, Message, Transport};
use std::fmt::Display;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;

/// One of the ranks.
struct Rank {
    rank: usize,
    /// To every rank, this one included.
    outgoing: Vec<Sender<Message>>,
    incoming: Receiver<Message>,
}

/// Runs `body` on `size` ranks, each a thread with a communicator of its own; gives their results in the order of ranks.
///
/// The body has to end on all ranks if it ends on one: [`Communicator::run`] sees to that. An error says that a thread
/// could not be started; then the body has run nowhere.
pub fn start<T: Send>(
    size: usize,
    body: impl Fn(&mut Communicator<'_>) -> T + Sync,
) -> Result<Vec<thread::Result<T>>, Failure> {
    let (outgoing, incoming): (Vec<_>, Vec<_>) = (0..size).map(|_| channel()).unzip();
    thread::scope(|scope| {
        let body = &body;
        let mut ranks = Vec::new();
        for rank in 0..size {
            // A thread begins when it is given its transport, which happens when all threads are there.
            let (give, take) = channel::<Rank>();
            let name = format!("rank {rank}");
            let started = thread::Builder::new()
                .name(name)
                .spawn_scoped(scope, move || Some(body(&mut Communicator::new(take.recv().ok()?))));
            let thread = started.map_err(|error| Failure { rank, message: format!("cannot be started: {error}") })?;
            ranks.push((give, thread));
        }
        for ((rank, incoming), (give, _)) in incoming.into_iter().enumerate().zip(&ranks) {
            give.send(Rank { rank, outgoing: outgoing.clone(), incoming }).ok();
        }
        Ok(ranks.into_iter().filter_map(|(_, thread)| thread.join().transpose()).collect())
    })
}

/// Runs `body` on `size` ranks as one run of the world, see [`Communicator::run`]. If it fails, the error is that of the
/// lowest rank that failed.
pub fn run<T, E>(size: usize, body: impl Fn(&mut Communicator<'_>) -> Result<T, E> + Sync) -> Result<Vec<T>, E>
where
    T: Send,
    E: Send + Display + From<Failure>,
{
    let results = start(size, |communicator| {
        let result = communicator.run(&body);
        (communicator.failed_here(), result)
    })?;
    let mut values = Vec::new();
    let mut echo = None;
    for (rank, result) in results.into_iter().enumerate() {
        match result {
            Ok((_, Ok(value))) => values.push(value),
            Ok((true, Err(error))) => return Err(error),
            Ok((false, Err(error))) => echo = Some(error),
            Err(_) => return Err(Failure { rank, message: "panicked".into() }.into()),
        }
    }
    echo.map_or(Ok(values), Err)
}

impl Transport for Rank {
    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        self.outgoing.len()
    }

    fn send(&mut self, to: usize, tag: u32, bytes: Vec<u8>) {
        // A rank that takes no messages any more has ended; whoever waits for it has been told.
        self.outgoing[to].send(Message { from: self.rank, tag, bytes }).ok();
    }

    fn receive(&mut self) -> Option<Message> {
        self.incoming.try_recv().ok()
    }

    fn wait(&mut self) -> Message {
        // Ranks that share a core let each other go on before they sleep: by then there is more to do at once, and nobody has to be woken.
        thread::yield_now();
        if let Some(message) = self.receive() {
            return message;
        }
        self.incoming.recv().expect("a rank's own sender keeps its channel open")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::conformance;

    #[test]
    fn threads_conform() {
        for size in [1, 2, 3, 4, 6, 8] {
            for result in start(size, conformance::check).expect("threads start") {
                result.expect("no panic leaves the suite").expect("the suite passes");
            }
        }
    }

    #[test]
    fn the_error_of_the_rank_that_failed_is_returned() {
        #[derive(Debug)]
        enum Error {
            Own(usize),
            Heard(Failure),
        }
        impl Display for Error {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                write!(f, "{self:?}")
            }
        }
        impl From<Failure> for Error {
            fn from(failure: Failure) -> Error {
                Error::Heard(failure)
            }
        }
        let result = run(4, |communicator| {
            if communicator.rank() == 2 {
                return Err(Error::Own(2));
            }
            communicator.wait_for(2, 0)?;
            Ok(())
        });
        assert!(matches!(result, Err(Error::Own(2))), "{result:?}");
        let panicked: Result<Vec<()>, Error> = run(3, |communicator| {
            assert_ne!(communicator.rank(), 1, "rank 1 dislikes its number");
            communicator.wait()?;
            Ok(())
        });
        let Err(Error::Heard(failure)) = panicked else { panic!("{panicked:?}") };
        assert_eq!(failure.rank, 1);
        assert!(failure.message.contains("dislikes its number"), "{failure}");
    }
}
