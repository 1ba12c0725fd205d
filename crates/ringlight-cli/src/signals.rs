//! SIGINT and SIGTERM: the first one stops the solver after the shot under way, and what is there is written; a second one
//! ends the program at once, and a file being written stays behind under its temporary name.

use ringlight::solve::StopReason;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Which signals have come.
#[derive(Clone, Debug, Default)]
pub struct Signals {
    interrupted: Arc<AtomicBool>,
    terminated: Arc<AtomicBool>,
}

impl Signals {
    /// Listens from now on.
    pub fn listen() -> io::Result<Signals> {
        let signals = Signals::default();
        for (signal, code, flag) in [(SIGINT, 130, &signals.interrupted), (SIGTERM, 143, &signals.terminated)] {
            // In this order: the flag of the first signal arms the exit by the second.
            flag::register_conditional_shutdown(signal, code, Arc::clone(flag))?;
            flag::register(signal, Arc::clone(flag))?;
        }
        Ok(signals)
    }

    /// What the solver should stop for.
    pub fn reason(&self) -> Option<StopReason> {
        if self.interrupted.load(Ordering::Relaxed) {
            Some(StopReason::Interrupted)
        } else if self.terminated.load(Ordering::Relaxed) {
            Some(StopReason::Terminated)
        } else {
            None
        }
    }
}
