//! Progress on standard error: a bar on terminals, plain lines, or one JSON object a line.

use crate::arguments::{ProgressChoice, StopArguments};
use crate::method;
use indicatif::{HumanCount, ProgressBar, ProgressStyle};
use ringlight::solve::{Progress, StopRule};
use ringlight::view_factor::Pairs;
use serde::Serialize;
use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

/// What the command is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Stage {
    /// Reading the scene.
    Load,
    /// Cutting surfaces.
    Mesh,
    /// Building the hierarchy, looking at samples.
    Build,
    /// Shooting.
    Solve,
    /// Writing outputs.
    Write,
}

impl Stage {
    fn name(self) -> &'static str {
        match self {
            Stage::Load => "load",
            Stage::Mesh => "mesh",
            Stage::Build => "build",
            Stage::Solve => "solve",
            Stage::Write => "write",
        }
    }
}

/// How progress is shown.
enum Style {
    Bar(ProgressBar),
    Plain,
    Json,
    Silent,
}

/// Shows progress.
pub struct Reporter {
    style: Style,
    verbose: bool,
    start: Instant,
    stage: Option<Stage>,
    last: Instant,
    latest: Counted,
    pace: Pace,
}

/// One line of `--progress json`.
#[derive(Serialize)]
struct Line {
    stage: Option<Stage>,
    #[serde(flatten)]
    counted: Counted,
    seconds: f64,
    time_left: Option<f64>,
}

/// What has been done.
#[derive(Clone, Copy, Serialize)]
#[serde(untagged)]
enum Counted {
    Shots { shots: u64, unshot_share: f64, done: Option<f64>, rays: u64, rays_per_second: f64 },
    Pairs { pairs: u64, pairs_total: u64, pairs_per_second: f64 },
}

impl Counted {
    fn shots(progress: &Progress, rays_per_second: f64) -> Counted {
        let Progress { shots, unshot_share, done, rays, .. } = *progress;
        Counted::Shots { shots, unshot_share, done, rays, rays_per_second }
    }
}

impl Reporter {
    /// A reporter for a command that began at `start`.
    pub fn new(choice: ProgressChoice, quiet: bool, verbose: bool, start: Instant) -> Reporter {
        let style = match choice {
            ProgressChoice::None => Style::Silent,
            ProgressChoice::Json => Style::Json,
            ProgressChoice::Plain => Style::Plain,
            ProgressChoice::Auto if quiet => Style::Silent,
            ProgressChoice::Auto if std::io::stderr().is_terminal() => Style::Bar(bar()),
            ProgressChoice::Auto => Style::Plain,
        };
        let latest = Counted::shots(&Progress::default(), 0.0);
        Reporter { style, verbose, start, stage: None, last: start, latest, pace: Pace::default() }
    }

    /// For a command that counts pairs instead of shots.
    pub fn counting_pairs(mut self) -> Reporter {
        self.latest = Counted::Pairs { pairs: 0, pairs_total: 0, pairs_per_second: 0.0 };
        self
    }

    /// Says what begins.
    pub fn stage(&mut self, stage: Stage) {
        if self.stage.replace(stage) == Some(stage) {
            return;
        }
        self.last = Instant::now();
        match &self.style {
            Style::Bar(bar) => {
                bar.set_prefix(stage.name());
                bar.tick();
            }
            Style::Plain if self.verbose => self.say(&format!("{}…", stage.name())),
            Style::Json => self.line(self.latest, None),
            Style::Plain | Style::Silent => {}
        }
    }

    /// Tells of a shot; shown now and then, and when `end` says that it was the last one.
    pub fn shot(&mut self, progress: &Progress, stop: &StopArguments, end: bool) {
        let Some(interval) = self.interval() else { return };
        self.latest = Counted::shots(progress, 0.0);
        let now = Instant::now();
        self.pace.note(now, progress);
        if !end && now - self.last < interval {
            return;
        }
        self.last = now;
        let rate = self.pace.rays_per_second(now, progress);
        let left = if end { None } else { self.pace.seconds_left(now, progress, stop, now - self.start) };
        match &self.style {
            Style::Bar(bar) => {
                bar.set_position((1000.0 * done(progress, stop)) as u64);
                bar.set_message(sentence(progress, rate, left));
            }
            Style::Plain => self.say(&format!("solve: {}", sentence(progress, rate, left))),
            Style::Json => self.line(Counted::shots(progress, rate), left),
            Style::Silent => {}
        }
    }

    /// Tells of pairs of polygons; shown now and then, and when `end` says that they are all done.
    pub fn pairs(&mut self, pairs: &Pairs, begun: Instant, end: bool) {
        let Some(interval) = self.interval() else { return };
        let now = Instant::now();
        let rate = pairs.done as f64 / (now - begun).as_secs_f64().max(1e-3);
        self.latest = Counted::Pairs { pairs: pairs.done, pairs_total: pairs.total, pairs_per_second: rate };
        if now - self.last < interval && !end {
            return;
        }
        self.last = now;
        let share = pairs.done as f64 / pairs.total.max(1) as f64;
        let left = (pairs.done > 0 && !end).then(|| (pairs.total - pairs.done) as f64 / rate);
        let in_words = left.map_or(String::new(), |left| format!(", about {} left", duration(left)));
        let (percent, total) = (100.0 * share, HumanCount(pairs.total));
        let sentence = format!("{percent:.1} % of {total} pairs, {:.2} M pairs/s{in_words}", rate / 1e6);
        match &self.style {
            Style::Bar(bar) => {
                bar.set_position((1000.0 * share) as u64);
                bar.set_message(sentence);
            }
            Style::Plain => self.say(&format!("solve: {sentence}")),
            Style::Json => self.line(self.latest, left),
            Style::Silent => {}
        }
    }

    /// How long to wait between two signs of life.
    fn interval(&self) -> Option<Duration> {
        match self.style {
            Style::Bar(_) => Some(Duration::from_millis(100)),
            Style::Plain => Some(Duration::from_secs(5)),
            Style::Json => Some(Duration::from_millis(500)),
            Style::Silent => None,
        }
    }

    /// Prints a line without disturbing the bar.
    pub fn say(&self, text: &str) {
        let print = || {
            // A closed standard error is no reason to stop baking.
            writeln!(std::io::stderr(), "{text}").ok();
        };
        match &self.style {
            Style::Bar(bar) => bar.suspend(print),
            _ => print(),
        }
    }

    fn line(&self, counted: Counted, time_left: Option<f64>) {
        let line = Line { stage: self.stage, counted, seconds: self.start.elapsed().as_secs_f64(), time_left };
        self.say(&serde_json::to_string(&line).unwrap_or_default());
    }
}

impl Drop for Reporter {
    /// Takes the bar away.
    fn drop(&mut self) {
        if let Style::Bar(bar) = &self.style {
            bar.finish_and_clear();
        }
    }
}

fn bar() -> ProgressBar {
    let style = ProgressStyle::with_template("{prefix:>5} {bar:24} {wide_msg}");
    ProgressBar::new(1000).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

/// How much is done, 0 to 1: where only light tells, that dies out like a power of the work, so logarithms grow evenly.
fn done(progress: &Progress, stop: &StopArguments) -> f64 {
    if let Some(done) = progress.done {
        return done;
    }
    let StopRule { until, max_shots } = method::stop_rule(stop);
    let by_light = progress.unshot_share.ln() / until.max(1e-12).ln();
    let by_shots = max_shots.map_or(0.0, |n| progress.shots as f64 / n.max(1) as f64);
    by_light.max(by_shots).clamp(0.0, 1.0)
}

fn sentence(progress: &Progress, rate: f64, left: Option<f64>) -> String {
    let left = left.map_or(String::new(), |left| format!(", about {} left", duration(left)));
    let rate = rate / 1e6;
    if let Some(done) = progress.done {
        return format!("{:.0} % done, {rate:.2} M rays/s{left}", 100.0 * done);
    }
    let (unshot, shots) = (100.0 * progress.unshot_share, progress.shots);
    format!("unshot {unshot:.2} %, {shots} shots, {rate:.2} M rays/s{left}")
}

/// Seconds in words.
pub fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 60.0 => format!("{s:.0} s"),
        s if s < 3600.0 => format!("{:.0} min", s / 60.0),
        s if s < 172_800.0 => format!("{:.1} h", s / 3600.0),
        s => format!("{:.1} days", s / 86_400.0),
    }
}

/// How fast it goes: from now and half the time ago.
#[derive(Default)]
pub struct Pace {
    notes: Vec<(Instant, Progress)>,
}

impl Pace {
    /// Remembers how far it was.
    pub fn note(&mut self, now: Instant, progress: &Progress) {
        if self.notes.last().is_none_or(|(last, _)| now - *last >= Duration::from_millis(250)) {
            self.notes.push((now, *progress));
        }
    }

    /// Rays per second so far.
    pub fn rays_per_second(&self, now: Instant, progress: &Progress) -> f64 {
        let elapsed = self.notes.first().map_or(0.0, |(first, _)| (now - *first).as_secs_f64());
        if elapsed > 0.0 { progress.rays as f64 / elapsed } else { 0.0 }
    }

    /// Seconds to the first stop rule that will be met; nothing while too little is known.
    pub fn seconds_left(
        &self,
        now: Instant,
        progress: &Progress,
        stop: &StopArguments,
        elapsed: Duration,
    ) -> Option<f64> {
        let (then, before) = self.notes.get(self.notes.len() / 2)?;
        let span = (now - *then).as_secs_f64();
        let measured =
            |change: f64, missing: f64| (change > 0.0 && span > 0.0).then(|| missing.max(0.0) * span / change);
        let by_time = stop.time_limit.map(|limit| (limit - elapsed.as_secs_f64()).max(0.0));
        let StopRule { until, max_shots } = method::stop_rule(stop);
        let first =
            |known: [Option<f64>; 3]| known.into_iter().flatten().filter(|s| s.is_finite()).min_by(f64::total_cmp);
        if let (Some(before), Some(done)) = (before.done, progress.done) {
            return first([measured(done - before, 1.0 - done), by_time, None]);
        }
        let decay = before.unshot_share.ln() - progress.unshot_share.ln();
        let by_light = measured(decay, progress.unshot_share.ln() - until.ln());
        let shots = (progress.shots - before.shots) as f64;
        let by_shots = max_shots.and_then(|n| measured(shots, n.saturating_sub(progress.shots) as f64));
        first([by_light, by_shots, by_time])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_that_halves_each_second_takes_as_many_seconds_as_halvings_are_left() {
        let start = Instant::now();
        let mut pace = Pace::default();
        let at =
            |second: u64| Progress { shots: second, unshot_share: 0.5f64.powi(second as i32), ..Progress::default() };
        (0..=4).for_each(|second| pace.note(start + Duration::from_secs(second), &at(second)));
        let now = start + Duration::from_secs(4);
        let mut stop = StopArguments { until: Some(0.5f64.powi(10)), ..StopArguments::default() };
        let left = pace.seconds_left(now, &at(4), &stop, now - start);
        assert!((left.unwrap() - 6.0).abs() < 1e-9, "{left:?}");
        stop.max_shots = Some(7);
        assert_eq!(pace.seconds_left(now, &at(4), &stop, now - start), Some(3.0));
        stop.time_limit = Some(5.0);
        assert_eq!(pace.seconds_left(now, &at(4), &stop, now - start), Some(1.0));
    }

    #[test]
    fn work_that_grows_evenly_takes_as_long_as_what_is_left_of_it() {
        let start = Instant::now();
        let mut pace = Pace::default();
        let at = |second: u64| Progress { done: Some(0.1 * second as f64), unshot_share: 1.0, ..Progress::default() };
        (0..=4).for_each(|second| pace.note(start + Duration::from_secs(second), &at(second)));
        let now = start + Duration::from_secs(4);
        let left = |stop: &StopArguments| pace.seconds_left(now, &at(4), stop, now - start).unwrap();
        assert!((left(&StopArguments::default()) - 6.0).abs() < 1e-9);
        assert_eq!(left(&StopArguments { time_limit: Some(5.0), ..StopArguments::default() }), 1.0);
        assert!(sentence(&at(4), 1e6, None).starts_with("40 % done, 1.00 M rays/s"));
    }
}
