//! What happens while a solve goes on: it is shown, saved and stopped.

use crate::arguments::StopArguments;
use crate::files;
use crate::launch::COMMAND;
use crate::progress::Reporter;
use crate::signals::Signals;
use crate::values::CheckpointChoice;
use ringlight::shooting::{ClusterLight, ElementLight, PatchLight};
use ringlight::solution::{self, Description, Snapshot};
use ringlight::solve::{Control, Observer, Progress, State, StopReason, World};
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
    /// What a saved solution says beside the light.
    pub description: &'a Description,
    /// What is solved.
    pub world: &'a World<'a>,
    /// Where to save; on the first rank only.
    pub checkpoint: Option<Checkpoint<'a>>,
}

impl Observer for Watch<'_> {
    fn control(&mut self) -> Control {
        let late = self.stop.time_limit.is_some_and(|limit| self.start.elapsed().as_secs_f64() >= limit);
        match self.signals.reason().or(late.then_some(StopReason::TimeLimit)) {
            Some(reason) => Control::Stop(reason),
            None if self.checkpoint.as_ref().is_some_and(Checkpoint::is_due) => Control::Checkpoint,
            None => Control::Continue,
        }
    }

    fn observe(&mut self, progress: &Progress) {
        self.reporter.shot(progress, self.stop, false);
    }

    fn checkpoint(&mut self, state: &State, ranks: &mut Communicator<'_>) -> Result<(), Failure> {
        let energy = state.energy(self.world, ranks)?;
        let state = &whole_state(state, self.world, ranks)?;
        let (description, World { mesh, settings, .. }) = (self.description, self.world);
        if let Some(checkpoint) = &mut self.checkpoint {
            checkpoint.write(&Snapshot { description, mesh, settings, state, energy: &energy });
        }
        Ok(())
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
    fn write(&mut self, snapshot: &Snapshot<'_>) {
        if let Err(error) = files::write(&self.choice.file, |out| solution::write_snapshot(snapshot, out)) {
            self.failed = Some(format!("{error:#}"));
        }
        self.last = Instant::now();
    }
}

/// TEMPORARY, until solutions are written from where the light is: the light of all ranks on the first one, none elsewhere.
pub fn whole_state(state: &State, world: &World<'_>, ranks: &mut Communicator<'_>) -> Result<State, Failure> {
    let mut bytes = Vec::new();
    for light in &state.clusters {
        for element in &light.elements {
            let numbers = [element.shot, element.unshot, element.correction];
            numbers.iter().flatten().for_each(|x| bytes.extend_from_slice(&x.to_le_bytes()));
        }
        for patch in &light.patches {
            bytes.extend_from_slice(&patch.unshot_power.to_le_bytes());
            bytes.push(u8::from(patch.emission_waits));
        }
    }
    let mut whole = State { clusters: Vec::new(), ..*state };
    let Some(parts) = ranks.gather(0, COMMAND, bytes)? else { return Ok(whole) };
    let mut parts: Vec<&[u8]> = parts.iter().map(Vec::as_slice).collect();
    fn take<const N: usize>(part: &mut &[u8]) -> [u8; N] {
        let (taken, rest) = part.split_first_chunk().expect("every rank sends the light of all its clusters");
        *part = rest;
        *taken
    }
    for (cluster, &owner) in world.mesh.clusters.iter().zip(&world.share.owners) {
        let part = &mut parts[owner as usize];
        let mut rgb = || std::array::from_fn(|_| f32::from_le_bytes(take(part)));
        let elements = cluster.elements.clone();
        let elements = elements.map(|_| ElementLight { shot: rgb(), unshot: rgb(), correction: rgb() }).collect();
        let patches = cluster.patches.clone().map(|_| PatchLight {
            unshot_power: f64::from_le_bytes(take(part)),
            emission_waits: take::<1>(part) != [0],
        });
        whole.clusters.push(ClusterLight { elements, patches: patches.collect() });
    }
    Ok(whole)
}
