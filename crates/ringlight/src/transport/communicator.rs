//! What ranks speak through: messages by sender and tag, and an end that all ranks share.

use super::{Alone, Failure, MAX_TAG, Message, Transport};
use std::collections::{BTreeMap, VecDeque};
use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// A rank has nothing more to say in this run.
const ENDED: u32 = MAX_TAG + 1;

/// A rank has failed and has nothing more to say in this run; the message says why.
const FAILED: u32 = MAX_TAG + 2;

/// Messages sent to other ranks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Number of messages.
    pub messages: u64,
    /// Their content, bytes.
    pub bytes: u64,
}

/// A rank's way to the others.
pub struct Communicator<'a> {
    transport: Box<dyn Transport + 'a>,
    /// Messages that came while another one was waited for.
    aside: VecDeque<Message>,
    /// Messages of ranks that are already in their next run.
    early: VecDeque<Message>,
    /// Which ranks have ended this run; this rank never waits for itself.
    ended: Vec<bool>,
    /// The failure of the lowest rank known to have failed in this run.
    failure: Option<Failure>,
    /// Whether this rank's work has been told of that failure.
    told: bool,
    failed_here: bool,
    traffic: BTreeMap<u32, Traffic>,
    clock: Option<Box<dyn Fn() -> f64>>,
    waited_seconds: f64,
}

impl<'a> Communicator<'a> {
    /// Speaks through a transport.
    pub fn new(transport: impl Transport + 'a) -> Communicator<'a> {
        let mut ended = vec![false; transport.size()];
        ended[transport.rank()] = true;
        Communicator {
            transport: Box::new(transport),
            aside: VecDeque::new(),
            early: VecDeque::new(),
            ended,
            failure: None,
            told: false,
            failed_here: false,
            traffic: BTreeMap::new(),
            clock: None,
            waited_seconds: 0.0,
        }
    }

    /// A world of one rank.
    pub fn alone() -> Communicator<'static> {
        Communicator::new(Alone::default())
    }

    /// This rank.
    pub fn rank(&self) -> usize {
        self.transport.rank()
    }

    /// Number of ranks.
    pub fn size(&self) -> usize {
        self.transport.size()
    }

    /// What was sent to other ranks, by tag.
    pub fn traffic(&self) -> &BTreeMap<u32, Traffic> {
        &self.traffic
    }

    /// From now on takes the time of waiting for messages, by a clock that tells seconds.
    pub fn time_waits(&mut self, clock: Box<dyn Fn() -> f64>) {
        self.clock = Some(clock);
    }

    /// Time spent waiting for messages, as far as it was taken.
    pub fn waited_seconds(&self) -> f64 {
        self.waited_seconds
    }

    /// Whether this rank failed in its last run, rather than heard of another's failure.
    pub fn failed_here(&self) -> bool {
        self.failed_here
    }

    /// Sends to a rank, maybe to itself; never waits.
    pub fn send(&mut self, to: usize, tag: u32, bytes: Vec<u8>) {
        assert!(tag <= MAX_TAG, "tag {tag} is kept for the communicator");
        if to != self.rank() {
            let traffic = self.traffic.entry(tag).or_default();
            traffic.messages += 1;
            traffic.bytes += bytes.len() as u64;
        }
        self.transport.send(to, tag, bytes);
    }

    /// The next message that has arrived, if any; an error once any rank has failed.
    pub fn receive(&mut self) -> Result<Option<Message>, Failure> {
        self.receive_where(|_| true)
    }

    /// Waits for the next message; an error once any rank has failed.
    pub fn wait(&mut self) -> Result<Message, Failure> {
        self.wait_where(|_| true)
    }

    /// Waits for the next message of one rank with one tag. Others stay for later.
    pub fn wait_for(&mut self, from: usize, tag: u32) -> Result<Vec<u8>, Failure> {
        Ok(self.wait_where(|message| message.from == from && message.tag == tag)?.bytes)
    }

    /// The first message that has arrived and fits, if any. Others stay for later.
    pub fn receive_where(&mut self, fits: impl Fn(&Message) -> bool) -> Result<Option<Message>, Failure> {
        while let Some(message) = self.transport.receive() {
            self.sort(message);
        }
        self.check()?;
        let place = self.aside.iter().position(fits);
        Ok(place.and_then(|place| self.aside.remove(place)))
    }

    /// Whether a message that fits has come while another one was waited for.
    pub(super) fn has_set_aside(&self, fits: impl Fn(&Message) -> bool) -> bool {
        self.aside.iter().any(fits)
    }

    /// Waits for a message that fits. Others stay for later.
    pub fn wait_where(&mut self, fits: impl Fn(&Message) -> bool) -> Result<Message, Failure> {
        loop {
            if let Some(message) = self.receive_where(&fits)? {
                return Ok(message);
            }
            self.wait_for_more()?;
        }
    }

    /// Runs `body` as this rank's part of the world's work. Every rank has to call it as often as the others.
    ///
    /// It returns when the bodies of all ranks have returned. If one fails or panics, all others that wait for a message
    /// get its failure, and every rank returns an error: the one that failed its own, the others what it said.
    pub fn run<T, E>(&mut self, body: impl FnOnce(&mut Self) -> Result<T, E>) -> Result<T, E>
    where
        E: Display + From<Failure>,
    {
        let result = catch_unwind(AssertUnwindSafe(|| body(self)))
            .unwrap_or_else(|panic| Err(Failure { rank: self.rank(), message: panic_message(&*panic) }.into()));
        self.failed_here = result.is_err() && !self.told;
        let (tag, words) = match &result {
            Err(error) if self.failed_here => {
                let words = error.to_string();
                // Whoever hears it adds the rank.
                let own = format!("rank {}: ", self.rank());
                (FAILED, words.strip_prefix(&own).unwrap_or(&words).as_bytes().to_vec())
            }
            _ => (ENDED, Vec::new()),
        };
        let this = self.rank();
        if self.failed_here {
            let message = String::from_utf8_lossy(&words).into_owned();
            self.transport.hurry(Some(&Failure { rank: this, message }));
        }
        for to in (0..self.size()).filter(|&to| to != this) {
            self.transport.send(to, tag, words.clone());
        }
        while self.ended.contains(&false) {
            self.take_next();
        }
        // What this rank has sent to itself and not taken ends with the run.
        while let Some(message) = self.transport.receive() {
            self.sort(message);
        }
        let failure = self.begin_next();
        match (result, failure) {
            (Err(error), _) if self.failed_here => Err(error),
            (_, Some(failure)) => Err(failure.into()),
            (result, None) => result,
        }
    }

    /// Files a message that the transport has brought.
    fn sort(&mut self, message: Message) {
        let from = message.from;
        if from != self.rank() && self.ended[from] {
            self.early.push_back(message);
            return;
        }
        match message.tag {
            ENDED => self.ended[from] = true,
            FAILED => {
                self.ended[from] = true;
                let message = String::from_utf8_lossy(&message.bytes).into_owned();
                let failure = Failure { rank: from, message };
                self.transport.hurry(Some(&failure));
                if self.failure.as_ref().is_none_or(|known| from < known.rank) {
                    self.failure = Some(failure);
                }
            }
            _ => self.aside.push_back(message),
        }
    }

    /// Forgets this run; gives the failure that ended it.
    fn begin_next(&mut self) -> Option<Failure> {
        let this = self.rank();
        self.aside.clear();
        self.told = false;
        self.transport.hurry(None);
        self.ended.iter_mut().enumerate().for_each(|(rank, ended)| *ended = rank == this);
        let failure = self.failure.take();
        for message in std::mem::take(&mut self.early) {
            self.sort(message);
        }
        failure
    }

    fn check(&mut self) -> Result<(), Failure> {
        self.told |= self.failure.is_some();
        self.failure.clone().map_or(Ok(()), Err)
    }

    pub(super) fn wait_for_more(&mut self) -> Result<(), Failure> {
        if !self.ended.contains(&false) {
            let message = "this rank waits for a message, but all others have ended".into();
            return Err(Failure { rank: self.rank(), message });
        }
        self.take_next();
        Ok(())
    }

    /// Waits for the transport's next message and files it.
    fn take_next(&mut self) {
        let now = |clock: &Option<Box<dyn Fn() -> f64>>| clock.as_ref().map_or(0.0, |clock| clock());
        let start = now(&self.clock);
        let message = self.transport.wait();
        self.waited_seconds += now(&self.clock) - start;
        self.sort(message);
    }
}

/// What a panic said.
fn panic_message(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied().or(panic.downcast_ref::<String>().map(String::as_str));
    format!("panicked: {}", text.unwrap_or("without words"))
}
