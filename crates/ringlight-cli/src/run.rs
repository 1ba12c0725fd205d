//! A run: scene or solution → light → files, stage by stage, timed.

use crate::arguments::{RunArguments, StopArguments, Targets};
use crate::failure::{End, Failure};
use crate::files;
use crate::machine;
use crate::outputs::{self, Content, Others, Written};
use crate::progress::{Reporter, Stage};
use crate::signals::Signals;
use crate::values::CheckpointChoice;
use anyhow::Context;
use ringlight::mesh::Mesh;
use ringlight::output::report::{self, RankReport, Report, SceneReport, Seconds, SolveReport, Units};
use ringlight::scene::{Place, Warnings};
use ringlight::solution::{self, Description, Snapshot, Solution};
use ringlight::solve::{
    self, Control, Energy, Observer, Progress, Ring, SolveSettings, State, StopReason, StopRule, World,
};
use ringlight::transport::{Communicator, Failure as RankFailure};
use std::io::Write;
use std::time::Instant;

/// What lasts from the start of a command to its end.
pub struct Run<'a> {
    arguments: &'a RunArguments,
    start: Instant,
    signals: Signals,
    reporter: Reporter,
    seconds: Seconds,
    warnings: Warnings,
}

/// What the solver left.
pub struct Solved {
    /// The light.
    pub state: State,
    /// Its audit.
    pub energy: Energy,
    /// What was done in this run.
    pub progress: Progress,
    /// Why it ended.
    pub reason: StopReason,
}

impl<'a> Run<'a> {
    /// Begins.
    pub fn begin(arguments: &'a RunArguments) -> Result<Run<'a>, Failure> {
        let start = Instant::now();
        let signals = Signals::listen().context("signals cannot be listened to")?;
        let reporter = Reporter::new(arguments.progress, arguments.quiet, arguments.verbose, start);
        let (seconds, warnings) = (Seconds::default(), Warnings::default());
        Ok(Run { arguments, start, signals, reporter, seconds, warnings })
    }

    /// Files besides the outputs that will be written.
    pub fn others(&self) -> Others<'a> {
        let RunArguments { report, checkpoint, .. } = self.arguments;
        let checkpoint = checkpoint.as_ref().map(|c| c.file.as_path());
        Others { report: report.as_deref(), checkpoint, ..Others::default() }
    }

    /// Does a stage's work and takes its time.
    pub fn stage<T>(&mut self, stage: Stage, work: impl FnOnce(&mut Self) -> T) -> T {
        self.reporter.stage(stage);
        let start = Instant::now();
        let result = work(self);
        let spent = start.elapsed().as_secs_f64();
        *match stage {
            Stage::Load => &mut self.seconds.load,
            Stage::Mesh => &mut self.seconds.mesh,
            Stage::Build => &mut self.seconds.build,
            Stage::Solve => &mut self.seconds.solve,
            Stage::Write => &mut self.seconds.write,
        } += spent;
        result
    }

    /// Says a line, unless the user wants silence.
    pub fn say(&self, text: &str) {
        if !self.arguments.quiet {
            self.reporter.say(text);
        }
    }

    /// Says a line to those who asked for more.
    pub fn detail(&self, text: &str) {
        if self.arguments.verbose {
            self.reporter.say(text);
        }
    }

    /// Says warnings, once each, and keeps them for the report.
    pub fn warn(&mut self, warnings: &Warnings) {
        for w in &warnings.0 {
            let words = warning(&w.message, w.count, &w.first_place.to_string());
            self.say(&format!("warning: {words}"));
        }
        self.remember(warnings);
    }

    /// Keeps warnings for the report that were said by an earlier run.
    pub fn remember(&mut self, warnings: &Warnings) {
        self.warnings.0.extend(warnings.0.iter().cloned());
    }

    /// Solves from `state`, or from the dark, until a stop rule, the time limit or a signal ends it.
    pub fn solve(
        &mut self,
        description: &Description,
        world: &World<'_>,
        ring: &mut Ring<'_>,
        mut state: State,
        stop: &StopArguments,
        ranks: &mut Communicator<'_>,
    ) -> Result<Solved, Failure> {
        let rule = StopRule { until: stop.until, max_shots: stop.max_shots };
        let checkpoint = self.arguments.checkpoint.as_ref().map(Checkpoint::new);
        let (result, checkpoint) = self.stage(Stage::Solve, |run| {
            let mut watch = Watch { run, stop, description, world, checkpoint };
            let result = solve::plain(world, ring, &mut state, &rule, ranks, &mut watch);
            let checkpoint = watch.checkpoint;
            if let Ok((_, progress)) = &result {
                run.reporter.shot(progress, stop, true);
            }
            (result, checkpoint)
        });
        let (reason, progress) = result?;
        if let Some(Checkpoint { failed: Some(error), .. }) = checkpoint {
            let mut warnings = Warnings::default();
            warnings.add("checkpoint-failed", format!("a checkpoint failed: {error}"), Place::default());
            self.warn(&warnings);
        }
        let energy = state.energy(world, ranks)?;
        Ok(Solved { state, energy, progress, reason })
    }

    fn reason_to_stop(&self, stop: &StopArguments) -> Option<StopReason> {
        let late = stop.time_limit.is_some_and(|limit| self.start.elapsed().as_secs_f64() >= limit);
        self.signals.reason().or(late.then_some(StopReason::TimeLimit))
    }

    /// Writes the outputs and the last checkpoint. One that fails does not keep the others from being written.
    pub fn write(&mut self, content: &Content<'_>, targets: &Targets) -> Outcome {
        self.stage(Stage::Write, |run| {
            let mut outcome = Outcome::default();
            if let Some(choice) = &run.arguments.checkpoint {
                outcome.note(files::write(&choice.file, |out| solution::write(content.solution, out)));
            }
            for output in &targets.output {
                match outputs::write(output, content) {
                    Ok(Written { clipped }) => {
                        outcome.clipped = outcome.clipped.max(clipped);
                        run.detail(&format!("wrote {}", output.path.display()));
                    }
                    Err(error) => outcome.note(Err(error)),
                }
            }
            outcome
        })
    }

    /// Writes the report, says in a line what was done, and tells how the command ends.
    pub fn end(
        mut self,
        solution: &Solution,
        (progress, reason): (Progress, StopReason),
        settings: serde_json::Value,
        outcome: Outcome,
    ) -> Result<End, Failure> {
        self.seconds.total = self.start.elapsed().as_secs_f64();
        let mut errors = outcome.errors;
        if let Some(path) = &self.arguments.report {
            let report = self.report(solution, (&progress, reason), settings, outcome.clipped);
            let written = files::write(path, |out| {
                serde_json::to_writer_pretty(&mut *out, &report)?;
                out.write_all(b"\n")
            });
            errors.extend(written.err());
        }
        // All but the last are said here, the last by whoever takes the failure.
        if let Some(last) = errors.pop() {
            errors.iter().for_each(|error| self.reporter.say(&format!("error: {error:#}")));
            return Err(last.into());
        }
        self.say(&summary(&progress, reason, &self.seconds));
        // A signal that came while outputs were written counts as well.
        Ok(match self.signals.reason().unwrap_or(reason) {
            StopReason::Converged | StopReason::NothingLeft | StopReason::MaxShots => End::Done,
            StopReason::TimeLimit => End::StoppedEarly,
            StopReason::Interrupted => End::Interrupted,
            StopReason::Terminated => End::Terminated,
        })
    }

    fn report(
        &self,
        solution: &Solution,
        (progress, reason): (&Progress, StopReason),
        settings: serde_json::Value,
        clipped: f64,
    ) -> Report {
        let (mesh, description) = (&solution.mesh, &solution.description);
        let peak_memory_bytes = machine::peak_private_memory();
        Report {
            schema: report::SCHEMA,
            version: env!("CARGO_PKG_VERSION"),
            command: std::env::args_os().map(|a| a.to_string_lossy().into_owned()).collect(),
            units: Units::of(description),
            warnings: report::warnings(&self.warnings),
            scene: SceneReport::new(description, mesh),
            settings,
            solve: SolveReport::new(progress, reason),
            seconds: self.seconds,
            energy: solution.energy,
            clipped,
            peak_memory_bytes,
            solution_digest: solution::digest(&solution.state),
            ranks: vec![RankReport {
                patches: mesh.patch_count() as u64,
                elements: mesh.element_count() as u64,
                shard_triangles: occluding_triangles(mesh),
                busy_seconds: machine::cpu_seconds(),
                peak_memory_bytes,
                ..RankReport::default()
            }],
        }
    }
}

/// Triangles of the mesh: two for each quadrilateral.
pub fn occluding_triangles(mesh: &Mesh) -> u64 {
    mesh.facets.iter().map(|f| if f.corners[3] == f.corners[0] { 1 } else { 2 }).sum()
}

/// What writing came to.
#[derive(Default)]
pub struct Outcome {
    errors: Vec<anyhow::Error>,
    clipped: f64,
}

impl Outcome {
    fn note(&mut self, result: anyhow::Result<()>) {
        self.errors.extend(result.err());
    }
}

/// A warning in words.
pub fn warning(message: &str, count: u64, first_place: &str) -> String {
    match (count, first_place) {
        (1, "") => message.to_owned(),
        (1, place) => format!("{message} ({place})"),
        (n, "") => format!("{message} ({n} times)"),
        (n, place) => format!("{message} ({n} times, first at {place})"),
    }
}

fn summary(progress: &Progress, reason: StopReason, seconds: &Seconds) -> String {
    let reason = match reason {
        StopReason::Converged => "converged",
        StopReason::NothingLeft => "converged: nothing is left to shoot",
        StopReason::MaxShots => "stopped by --max-shots",
        StopReason::TimeLimit => "stopped by --time-limit",
        StopReason::Interrupted => "interrupted",
        StopReason::Terminated => "terminated",
    };
    let (shots, unshot) = (progress.shots, 100.0 * progress.unshot_share);
    format!("{reason}: {shots} shots, unshot {unshot:.2} %, {:.1} s", seconds.total)
}

/// Settings as the report shows them, whatever verb set them.
pub fn settings(
    settings: &SolveSettings,
    mesh: &Mesh,
    stop: &StopArguments,
) -> serde_json::Map<String, serde_json::Value> {
    let shoot = match settings.shoot {
        ringlight::shooting::Shoot::Elements => "elements",
        ringlight::shooting::Shoot::Average => "average",
    };
    let value = serde_json::json!({
        "solver": "plain",
        "patch_size": mesh.sizes.patch,
        "element_size": mesh.sizes.element,
        "cells": settings.cells,
        "shoot": shoot,
        "sky": settings.sky,
        "until": stop.until,
        "max_shots": stop.max_shots,
        "time_limit": stop.time_limit,
        "threads": rayon::current_num_threads(),
    });
    match value {
        serde_json::Value::Object(map) => map,
        _ => serde_json::Map::new(),
    }
}

/// Saves the solution as it goes.
struct Checkpoint<'a> {
    choice: &'a CheckpointChoice,
    last: Instant,
    failed: Option<String>,
}

impl<'a> Checkpoint<'a> {
    fn new(choice: &'a CheckpointChoice) -> Checkpoint<'a> {
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

/// Watches the solver: shows how far it is, saves what it has, ends it.
struct Watch<'a, 'b> {
    run: &'a mut Run<'b>,
    stop: &'a StopArguments,
    description: &'a Description,
    world: &'a World<'a>,
    checkpoint: Option<Checkpoint<'b>>,
}

impl Observer for Watch<'_, '_> {
    fn control(&mut self) -> Control {
        match self.run.reason_to_stop(self.stop) {
            Some(reason) => Control::Stop(reason),
            None if self.checkpoint.as_ref().is_some_and(Checkpoint::is_due) => Control::Checkpoint,
            None => Control::Continue,
        }
    }

    fn observe(&mut self, progress: &Progress) {
        self.run.reporter.shot(progress, self.stop, false);
    }

    fn checkpoint(&mut self, state: &State, ranks: &mut Communicator<'_>) -> Result<(), RankFailure> {
        let energy = state.energy(self.world, ranks)?;
        let (description, World { mesh, settings, .. }) = (self.description, self.world);
        if let Some(checkpoint) = &mut self.checkpoint {
            checkpoint.write(&Snapshot { description, mesh, settings, state, energy: &energy });
        }
        Ok(())
    }
}
