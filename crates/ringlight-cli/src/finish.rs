//! The end of a run: outputs, report, exit code.

use crate::arguments::{DisplayArguments, Targets};
use crate::failure::{End, Failure};
use crate::files;
use crate::host::Host;
use crate::launch::COMMAND;
use crate::machine;
use crate::outputs::{self, Content, Kind, Output, Written};
use crate::progress::Stage;
use crate::reading;
use crate::run::{self, Baked, Made, Run, Settings};
use crate::spread;
use anyhow::Context;
use ringlight::output::report::{self, PictureReport, RankReport, Report, SceneReport, SolveReport, Units};
use ringlight::solution::{self, Snapshot, Solution, SolvedLight};
use ringlight::solve::{Ledger, Progress, StopReason};
use ringlight_visibility::Hierarchy;
use std::sync::Arc;

impl Run<'_, '_> {
    /// Writes the outputs, the last checkpoint and the report, says in a line what was done, and tells how the command ends.
    /// Every rank calls it.
    pub fn finish(
        mut self,
        baked: Baked,
        (targets, display): (&Targets, &DisplayArguments),
        host: &Host,
        hierarchy: Option<Arc<Hierarchy>>,
        settings: Settings,
    ) -> Result<End, Failure> {
        let mut outcome = Outcome::default();
        let end = (baked.solved.progress, baked.solved.reason);
        self.write_solutions(&baked, targets, &mut outcome)?;
        let report = self.begin_report(&baked, settings)?;
        let solution = self.write_others(baked, targets, (display, host, hierarchy), &mut outcome)?;
        self.seconds.total = self.start.elapsed().as_secs_f64();
        self.write_report(report, &mut outcome)?;
        // All but the last are said here, the last by whoever takes the failure.
        let mut errors = outcome.errors;
        if let Some(last) = errors.pop() {
            errors.iter().for_each(|error| self.reporter.say(&format!("error: {error:#}")));
            return Err(last.into());
        }
        let (progress, reason) = end;
        self.say(&summary(&progress, reason, self.seconds.total));
        let signal = match &mut self.showing {
            Some(showing) if self.arguments.view.stay => {
                Some(showing.stay(solution.as_ref(), &self.signals, self.ranks)?)
            }
            Some(showing) => {
                showing.done();
                self.signals.reason()
            }
            None => self.signals.reason(),
        };
        // A signal that came while outputs were written counts as well.
        Ok(match signal.unwrap_or(reason) {
            StopReason::Converged | StopReason::NothingLeft | StopReason::MaxShots => End::Done,
            StopReason::Memory | StopReason::Stopped | StopReason::TimeLimit => End::StoppedEarly,
            StopReason::Interrupted => End::Interrupted,
            StopReason::Terminated => End::Terminated,
        })
    }

    /// Writes the last checkpoint and the solutions asked for, from where the light is.
    fn write_solutions(&mut self, baked: &Baked, targets: &Targets, outcome: &mut Outcome) -> Result<(), Failure> {
        let Baked { made, settings, solved } = baked;
        let snapshot = Snapshot {
            description: &made.description,
            mesh: &made.mesh,
            settings,
            ledger: &Ledger::of(&solved.state),
            energy: &solved.energy,
        };
        let solutions = targets.output.iter().filter(|output| output.kind == Kind::Solution);
        let checkpoint = self.arguments.checkpoint.as_ref().map(|choice| &choice.file);
        self.stage(Stage::Write, |run| {
            for path in checkpoint.into_iter().chain(solutions.map(|output| &output.path)) {
                outcome.note(files::write_over_ranks(path, run.ranks, |ranks, out| {
                    solution::write_over_ranks(&snapshot, solved.light(), ranks, out)
                })?);
                run.detail(&format!("wrote {}", path.display()));
            }
            Ok(())
        })
    }

    /// Writes all other outputs, from light that is kept with the mesh: on the first rank, but for pictures, which all draw
    /// together. Gives the first rank the solution, if it is still needed.
    fn write_others(
        &mut self,
        baked: Baked,
        targets: &Targets,
        (display, host, hierarchy): (&DisplayArguments, &Host, Option<Arc<Hierarchy>>),
        outcome: &mut Outcome,
    ) -> Result<Option<Solution>, Failure> {
        let others: Vec<&Output> = targets.output.iter().filter(|output| output.kind != Kind::Solution).collect();
        let stay = self.arguments.view.stay;
        if others.is_empty() && !stay {
            return Ok(None);
        }
        let Baked { made: Made { mesh, description, images }, settings, solved } = baked;
        let (ledger, energy) = (Ledger::of(&solved.state), solved.energy);
        let light = match self.ranks.size() {
            1 => Some(SolvedLight::of(solved.state.clusters, host.store()).context("the light cannot be kept")?),
            _ => solved.light().gather(&mesh, host.store(), self.ranks)?,
        };
        let pictures = others.iter().any(|output| output.kind.is_picture());
        if !pictures && light.is_none() {
            return Ok(None);
        }
        let light = light.unwrap_or_default();
        let mut solution = Solution { description, mesh, settings, ledger, light, energy, images };
        if pictures {
            solution = reading::everywhere(self.ranks, host, solution)?;
        }
        self.write(&others, &Content { solution: &solution, display }, hierarchy, outcome)?;
        Ok((stay && self.is_first()).then_some(solution))
    }

    /// Writes outputs on the first rank. One that fails does not keep the others from being written.
    fn write(
        &mut self,
        outputs: &[&Output],
        content: &Content<'_>,
        hierarchy: Option<Arc<Hierarchy>>,
        outcome: &mut Outcome,
    ) -> Result<(), Failure> {
        self.stage(Stage::Write, |run| {
            let pictures = outputs.iter().any(|output| output.kind.is_picture());
            let drawn = match pictures {
                true => content.picture(&mut run.ring(&content.solution.mesh, hierarchy), run.ranks)?,
                false => Ok(None),
            };
            if !run.is_first() {
                return Ok(());
            }
            let drawn = drawn.unwrap_or_else(|error| {
                outcome.note(Err(error));
                None
            });
            outcome.picture = drawn.as_ref().map(PictureReport::new);
            outcome.picture.iter().flat_map(outputs::loads).for_each(|line| run.detail(&line));
            let can_write = |output: &&&Output| drawn.is_some() || !output.kind.is_picture();
            for output in outputs.iter().filter(can_write) {
                match outputs::write(output, content, drawn.as_ref().map(|drawn| &drawn.picture)) {
                    Ok(Written { clipped }) => {
                        outcome.clipped = outcome.clipped.max(clipped);
                        run.detail(&format!("wrote {}", output.path.display()));
                    }
                    Err(error) => outcome.note(Err(error)),
                }
            }
            Ok(())
        })
    }

    /// The report, as far as it is known before outputs are written; on the first rank, if one is asked for.
    fn begin_report(&mut self, baked: &Baked, mut settings: Settings) -> Result<Option<Report>, Failure> {
        let Baked { made: Made { mesh, description, .. }, solved, .. } = baked;
        let digest = solved.light().digest(mesh, solved.state.shots, self.ranks)?;
        settings.extend(spread::settings(self.spread, self.rings));
        Ok(digest.filter(|_| self.arguments.report.is_some()).map(|solution_digest| Report {
            schema: report::SCHEMA,
            version: env!("CARGO_PKG_VERSION"),
            command: run::command_line(),
            units: Units::of(description),
            warnings: Vec::new(),
            scene: SceneReport::new(description, mesh),
            settings: settings.into(),
            solve: SolveReport::new(&solved.progress, baked.settings.solver, solved.reason),
            seconds: self.seconds,
            energy: solved.energy,
            clipped: 0.0,
            peak_memory_bytes: 0,
            solution_digest,
            ranks: Vec::new(),
            picture: None,
            balance: std::mem::take(&mut self.balance),
        }))
    }

    /// Writes the report with what all ranks have to say.
    fn write_report(&mut self, report: Option<Report>, outcome: &mut Outcome) -> Result<(), Failure> {
        let ranks = self.rank_reports()?;
        let (Some(path), Some(report), Some(ranks)) = (&self.arguments.report, report, ranks) else { return Ok(()) };
        let report = Report {
            warnings: report::warnings(&self.warnings),
            seconds: self.seconds,
            clipped: outcome.clipped,
            peak_memory_bytes: ranks.iter().map(|rank| rank.peak_memory_bytes).max().unwrap_or(0),
            ranks,
            picture: outcome.picture.take(),
            ..report
        };
        outcome.note(files::write_json(path, &report));
        Ok(())
    }

    /// What every rank has to report, on the first one.
    fn rank_reports(&mut self) -> Result<Option<Vec<RankReport>>, Failure> {
        let own = RankReport {
            busy_seconds: machine::busy_seconds(),
            wait_seconds: self.ranks.waited_seconds(),
            bytes_sent: self.ranks.traffic().values().map(|traffic| traffic.bytes).sum(),
            peak_memory_bytes: machine::peak_private_memory(),
            ..self.own
        };
        let all = self.ranks.gather(0, COMMAND, serde_json::to_vec(&own).map_err(anyhow::Error::new)?)?;
        let read = |bytes: Vec<u8>| serde_json::from_slice(&bytes).map_err(|error| anyhow::Error::new(error).into());
        all.map(|all| all.into_iter().map(read).collect()).transpose()
    }
}

/// What writing came to.
#[derive(Default)]
pub struct Outcome {
    errors: Vec<anyhow::Error>,
    clipped: f64,
    picture: Option<PictureReport>,
}

impl Outcome {
    fn note(&mut self, result: anyhow::Result<()>) {
        self.errors.extend(result.err());
    }
}

fn summary(progress: &Progress, reason: StopReason, seconds: f64) -> String {
    let reason = match reason {
        StopReason::Converged => "converged",
        StopReason::NothingLeft => "converged: nothing is left to shoot",
        StopReason::MaxShots => "stopped by --max-shots",
        StopReason::Memory => "stopped for want of memory",
        StopReason::Stopped => "stopped from the page",
        StopReason::TimeLimit => "stopped by --time-limit",
        StopReason::Interrupted => "interrupted",
        StopReason::Terminated => "terminated",
    };
    if let Some(done) = progress.done {
        return format!(
            "{reason}: {:.0} % done, {:.1} M rays, {seconds:.1} s",
            100.0 * done,
            progress.rays as f64 / 1e6
        );
    }
    let (shots, unshot) = (progress.shots, 100.0 * progress.unshot_share);
    format!("{reason}: {shots} shots, unshot {unshot:.2} %, {seconds:.1} s")
}
