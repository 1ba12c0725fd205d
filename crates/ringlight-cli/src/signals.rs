//! SIGINT and SIGTERM: the first one stops the solver after the shot under way, and what is there is written; a second one
//! ends the program at once, and a file being written stays behind under its temporary name.

use ringlight::solve::StopReason;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Which signals have come.
#[derive(Clone, Debug, Default)]
pub struct Signals {
    interrupted: Arc<AtomicBool>,
    terminated: Arc<AtomicBool>,
}

impl Signals {
    /// Listens from now on; ranks in one process hear the same.
    pub fn listen() -> io::Result<Signals> {
        static LISTENING: Mutex<Option<Signals>> = Mutex::new(None);
        let mut listening = LISTENING.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(signals) = &*listening {
            return Ok(signals.clone());
        }
        let signals = Signals::default();
        for (signal, code, flag) in [(SIGINT, 130, &signals.interrupted), (SIGTERM, 143, &signals.terminated)] {
            // In this order: the flag of the first signal arms the exit by the second.
            flag::register_conditional_shutdown(signal, code, Arc::clone(flag))?;
            flag::register(signal, Arc::clone(flag))?;
        }
        Ok(listening.insert(signals).clone())
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
