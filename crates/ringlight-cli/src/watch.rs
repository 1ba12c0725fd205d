//! What happens while a solve goes on: it is shown, saved and stopped.

use crate::arguments::StopArguments;
use crate::files;
use crate::progress::Reporter;
use crate::showing::{Showing, Subject};
use crate::signals::Signals;
use crate::values::CheckpointChoice;
use ringlight::solution::{self, OwnLight, Snapshot};
use ringlight::solve::{Control, Ledger, Observer, Progress, Ring, State, StopReason, World};
use ringlight::transport::{Communicator, Failure};
use std::time::Instant;

/// Watches the solver, on every rank.
pub struct Watch<'a> {
    /// Shows how far it is.
    pub reporter: &'a mut Reporter,
    /// Tell when it has to stop.
    pub signals: &'a Signals,
    /// When the command began.
    pub start: Instant,
    /// When to stop.
    pub stop: &'a StopArguments,
    /// What is saved and shown beside the light.
    pub subject: Subject<'a>,
    /// What is solved.
    pub world: &'a World<'a>,
    /// Where to save.
    pub checkpoint: Option<Checkpoint<'a>>,
    /// Where it is watched.
    pub showing: Option<&'a mut Showing>,
}

impl Observer for Watch<'_> {
    fn control(&mut self) -> Control {
        let late = self.stop.time_limit.is_some_and(|limit| self.start.elapsed().as_secs_f64() >= limit);
        let mut control = Control {
            stop: self.signals.reason().or(late.then_some(StopReason::TimeLimit)),
            checkpoint: self.checkpoint.as_ref().is_some_and(Checkpoint::is_due),
            ..Control::default()
        };
        if let Some(showing) = &self.showing {
            showing.wish(&mut control);
        }
        control
    }

    fn observe(&mut self, progress: &Progress) {
        self.reporter.shot(progress, self.stop, false);
        if let Some(showing) = &mut self.showing {
            showing.note(progress, self.stop, self.start);
        }
    }

    fn show(&mut self, state: &State, ring: &Ring<'_>, ranks: &mut Communicator<'_>) -> Result<(), Failure> {
        let Some(showing) = &mut self.showing else { return Ok(()) };
        showing.show(&self.subject, (self.world, state), ring, ranks)
    }

    fn checkpoint(&mut self, state: &State, ranks: &mut Communicator<'_>) -> Result<(), Failure> {
        let energy = state.energy(self.world, ranks)?;
        let (description, World { mesh, settings, share, .. }) = (self.subject.description, self.world);
        let snapshot = Snapshot { description, mesh, settings, ledger: &Ledger::of(state), energy: &energy };
        let light = OwnLight { own: &share.own, clusters: &state.clusters };
        self.checkpoint.as_mut().map_or(Ok(()), |checkpoint| checkpoint.write(&snapshot, light, ranks))
    }
}

/// Saves the solution as it goes.
pub struct Checkpoint<'a> {
    choice: &'a CheckpointChoice,
    last: Instant,
    /// What went wrong the last time.
    pub failed: Option<String>,
}

impl<'a> Checkpoint<'a> {
    /// None has been written yet.
    pub fn new(choice: &'a CheckpointChoice) -> Checkpoint<'a> {
        Checkpoint { choice, last: Instant::now(), failed: None }
    }

    fn is_due(&self) -> bool {
        self.last.elapsed().as_secs_f64() >= self.choice.seconds
    }

    /// A failed write is kept to be told, and tried again when the next one is due: the disk may have room by then.
    fn write(
        &mut self,
        snapshot: &Snapshot<'_>,
        light: OwnLight<'_>,
        ranks: &mut Communicator<'_>,
    ) -> Result<(), Failure> {
        let written = files::write_over_ranks(&self.choice.file, ranks, |ranks, out| {
            solution::write_over_ranks(snapshot, light, ranks, out)
        })?;
        self.failed = written.err().map(|error| format!("{error:#}")).or(self.failed.take());
        self.last = Instant::now();
        Ok(())
    }
}
