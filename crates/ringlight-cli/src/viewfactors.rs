//! `viewfactors`: scene → matrix of area-averaged form factors, with its audit.

use crate::arguments::{PerChoice, ProgressChoice, SidesChoice, ViewFactors};
use crate::failure::{End, Failure};
use crate::files::{self, NewFile};
use crate::launch::{self, COMMAND};
use crate::progress::{Reporter, Stage};
use crate::run::{command_line, warning};
use crate::signals::Signals;
use crate::values::Matrix;
use crate::{input, machine, outputs};
use anyhow::Context;
use ringlight::column::Store;
use ringlight::output::report::{self, ReportedWarning};
use ringlight::output::{FactorForm, FactorValue, FactorWriter};
use ringlight::scene::{Place, Warnings};
use ringlight::solve::StopReason;
use ringlight::transport::Communicator;
use ringlight::view_factor::{self, Auditor, Computed, Faces, MatrixSettings, Occluders, Pairs, Per, Reciprocity};
use ringlight::view_factor::{RowSums, Sides, Storage, Tolerance, Watch};
use serde::Serialize;
use std::io::{self, Cursor};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What a factor between two polygons may be off by, as a share of the relative tolerance.
const FLOOR: f64 = 0.005;

/// Warnings of readers about what factors do not depend on: colours, textures, lights and cameras.
const ABOUT_LOOKS: [&str; 17] = [
    "black-texture",
    "camera-ignored",
    "colour-out-of-range",
    "duplicate-material",
    "light-without-direction",
    "metal-as-diffuse",
    "missing-material",
    "missing-texture",
    "missing-texture-coordinates",
    "spectral-colour",
    "specular-glossiness-as-diffuse",
    "specular-only",
    "texture-format",
    "texture-option",
    "transmission-texture-ignored",
    "unsupported-image",
    "vertex-colour-range",
];

/// A dense matrix of more values than this is worth a word.
const MANY_VALUES: f64 = 1e8;

/// Computes and writes.
pub fn viewfactors(arguments: &ViewFactors, ranks: &mut Communicator<'_>) -> Result<End, Failure> {
    let mut run = Run::begin(arguments, ranks)?;
    let path = arguments.scene.as_path();
    let targets = targets(arguments)?;
    launch::on_first_rank(run.ranks, || outputs::check_files(&targets, path, arguments.force))?;
    run.reporter.stage(Stage::Load);
    let (mut scene, read) = input::scene(path, arguments.unit, Store::Heap)?;
    outputs::check_unread(&targets, &read)?;
    scene.warnings.0.retain(|warning| !ABOUT_LOOKS.contains(&warning.code.as_str()));
    run.seconds.load = run.lap();
    run.warn(&scene.warnings);
    run.reporter.stage(Stage::Mesh);
    let per = match arguments.per {
        PerChoice::Object => Per::Object,
        PerChoice::Face => Per::Face,
    };
    let sides = match arguments.sides {
        SidesChoice::Front => Sides::Front,
        SidesChoice::Both => Sides::Both,
    };
    let faces = Faces::new(&scene, per, sides).map_err(|error| input::locate(error, path))?;
    drop(scene);
    run.seconds.faces = run.lap();
    run.warn(&faces.warnings);
    run.warn(&foreseen(arguments, &faces));
    run.reporter.stage(Stage::Build);
    let occluders = Occluders::new(faces.blockers.clone());
    let mut thin = Warnings::default();
    let message = "triangles are too thin, for their size and place, to stand in the way of others";
    thin.add_many("thin-blockers", message, Place::default(), occluders.slivers() as u64);
    run.warn(&thin);
    run.seconds.build = run.lap();
    run.reporter.stage(Stage::Solve);
    let settings = settings(arguments);
    let done = run.compute(&faces, &occluders, &settings)?;
    run.seconds.solve = run.lap();
    run.reporter.stage(Stage::Write);
    let mut reciprocity = None;
    if let Some(done) = &done {
        run.warn(&noticed(arguments, &faces, done));
        // The audit comes first: a signal during it still leaves no file.
        let audit = || view_factor::reciprocity(&faces, &occluders, &settings.tolerance, &done.computed);
        reciprocity = arguments.report.as_ref().map(|_| audit());
    }
    run.seconds.audit = run.lap();
    let stopped = run.stopped()?;
    if stopped != End::Done {
        run.say("stopped: nothing was written");
        return Ok(stopped);
    }
    // The first rank has it all.
    let Some(done) = done else { return Ok(End::Done) };
    for (file, path) in done.files {
        file.finish().with_context(|| cannot_write(&path))?;
    }
    run.seconds.write = run.lap();
    run.seconds.total = run.start.elapsed().as_secs_f64();
    run.say(&summary(&faces, &done.computed.pairs, &done.sums, done.values, run.seconds.total));
    if let (Some(path), Some(reciprocity)) = (&arguments.report, reciprocity) {
        let report = run.report(&faces, &settings, &(done.computed, done.sums, done.values), reciprocity);
        files::write_json(path, &report)?;
    }
    Ok(End::Done)
}

/// Everything that will be written, `--min` with what it fits.
fn targets(arguments: &ViewFactors) -> Result<Vec<&Path>, Failure> {
    let matrices = || arguments.output.iter().chain(&arguments.errors);
    if arguments.min.is_some() {
        if let Some(Matrix { path, .. }) = matrices().find(|matrix| matrix.numpy) {
            let message = format!("{}: --min is for CSV; an array has all factors", path.display());
            return Err(Failure::Usage(message));
        }
        if arguments.errors.is_some() {
            return Err(Failure::Usage("with --min the errors are in the table itself; --errors adds nothing".into()));
        }
    }
    Ok(matrices().map(|matrix| matrix.path.as_path()).chain(arguments.report.as_deref()).collect())
}

fn settings(arguments: &ViewFactors) -> MatrixSettings {
    let tolerance = Tolerance { relative: arguments.tolerance, absolute: FLOOR * arguments.tolerance };
    MatrixSettings { tolerance, least: arguments.min.unwrap_or(0.0) }
}

/// What is worth a word before the work begins.
fn foreseen(arguments: &ViewFactors, faces: &Faces) -> Warnings {
    let mut warnings = Warnings::default();
    let values = (faces.groups.len() as f64).powi(2);
    if arguments.min.is_none() && values > MANY_VALUES {
        let message = format!("the whole matrix has {values:.1e} values; --min F writes only those that matter");
        warnings.add("large-matrix", message, Place::default());
    }
    warnings
}

/// What is worth a word when the factors are known.
fn noticed(arguments: &ViewFactors, faces: &Faces, done: &Done) -> Warnings {
    let mut warnings = Warnings::default();
    let (rows, empty) = (faces.groups.len() as u64, done.sums.empty);
    let seems_turned = match arguments.per {
        PerChoice::Object => empty > 0,
        PerChoice::Face => 2 * empty > rows,
    };
    if seems_turned && rows > 1 && arguments.sides == SidesChoice::Front {
        let message = "of some rows nothing is seen: if their faces are turned away from the others, --sides both, or \
                       corners in the other order, will help";
        warnings.add_many("nothing-seen", message, Place::default(), empty);
    }
    if done.sums.most > 1.0 + done.sums.largest_error + 1e-6 {
        let message = format!("a row adds up to {:.6}: surfaces overlap or lie in each other", done.sums.most);
        warnings.add("row-above-1", message, Place::default());
    }
    warnings
}

fn cannot_write(path: &Path) -> String {
    format!("{}: cannot be written", path.display())
}

fn summary(faces: &Faces, pairs: &Pairs, sums: &RowSums, values: u64, seconds: f64) -> String {
    let (rows, polygons, integrated) = (faces.groups.len(), faces.polygons.len(), pairs.integrated);
    let RowSums { least, mean, most, .. } = sums;
    format!(
        "{rows} rows of {polygons} polygons, {values} factors above 0, {integrated} of {} pairs integrated; row sums \
         {least:.6} to {most:.6}, mean {mean:.6}; {seconds:.1} s",
        pairs.total
    )
}

/// What lasts from the start of the command to its end.
struct Run<'a, 'b> {
    arguments: &'a ViewFactors,
    ranks: &'a mut Communicator<'b>,
    start: Instant,
    lap: Instant,
    signals: Signals,
    reporter: Reporter,
    seconds: Seconds,
    warnings: Warnings,
}

/// Wall-clock seconds of the stages.
#[derive(Clone, Copy, Debug, Default, Serialize)]
struct Seconds {
    load: f64,
    faces: f64,
    build: f64,
    solve: f64,
    audit: f64,
    write: f64,
    total: f64,
}

/// A matrix that is computed and written, but not yet under its name.
struct Done {
    computed: Computed,
    sums: RowSums,
    values: u64,
    files: Vec<(NewFile, PathBuf)>,
}

/// The audit as JSON.
#[derive(Serialize)]
struct Report {
    schema: &'static str,
    version: &'static str,
    command: Vec<String>,
    warnings: Vec<ReportedWarning>,
    scene: SceneCounts,
    settings: serde_json::Value,
    pairs: Pairs,
    values: u64,
    row_sums: RowSums,
    reciprocity: Reciprocity,
    seconds: Seconds,
    cpu_seconds: f64,
    peak_memory_bytes: u64,
}

/// What was read.
#[derive(Serialize)]
struct SceneCounts {
    triangles: u64,
    degenerate_triangles: u64,
    rows: usize,
    polygons: usize,
    area: f64,
}

impl<'a, 'b> Run<'a, 'b> {
    /// Begins, on every rank; only the first one speaks and writes.
    fn begin(arguments: &'a ViewFactors, ranks: &'a mut Communicator<'b>) -> Result<Run<'a, 'b>, Failure> {
        let start = Instant::now();
        let signals = Signals::listen().context("signals cannot be listened to")?;
        let progress = if ranks.rank() == 0 { arguments.progress } else { ProgressChoice::None };
        let reporter = Reporter::new(progress, arguments.quiet, false, start).counting_pairs();
        let (seconds, warnings) = (Seconds::default(), Warnings::default());
        Ok(Run { arguments, ranks, start, lap: start, signals, reporter, seconds, warnings })
    }

    /// Seconds since the last lap.
    fn lap(&mut self) -> f64 {
        let last = std::mem::replace(&mut self.lap, Instant::now());
        (self.lap - last).as_secs_f64()
    }

    fn say(&self, text: &str) {
        if self.ranks.rank() == 0 && !self.arguments.quiet {
            self.reporter.say(text);
        }
    }

    fn warn(&mut self, warnings: &Warnings) {
        for w in &warnings.0 {
            self.say(&format!("warning: {}", warning(&w.message, w.count, &w.first_place.to_string())));
        }
        self.warnings.0.extend(warnings.0.iter().cloned());
    }

    /// What a signal to any rank ends all of them with.
    fn stopped(&mut self) -> Result<End, Failure> {
        let own = match self.signals.reason() {
            Some(StopReason::Interrupted) => [2],
            Some(_) => [1],
            None => [0],
        };
        Ok(match self.ranks.all_reduce(COMMAND, own, |[a], [b]| [a.max(b)])? {
            [0] => End::Done,
            [1] => End::Terminated,
            _ => End::Interrupted,
        })
    }

    /// Computes the matrix with all ranks; the first one writes it as it comes, under temporary names. None on the others,
    /// and if a signal came.
    fn compute(
        &mut self,
        faces: &Faces,
        occluders: &Occluders,
        settings: &MatrixSettings,
    ) -> Result<Option<Done>, Failure> {
        let first = self.ranks.rank() == 0;
        let factors = self.arguments.output.iter().map(|matrix| (matrix, FactorValue::Factor));
        let errors = self.arguments.errors.iter().map(|matrix| (matrix, FactorValue::Error));
        let mut writers = Vec::new();
        for (Matrix { path, numpy }, value) in factors.chain(errors).filter(|_| first) {
            let form = match (numpy, self.arguments.min) {
                (true, _) => FactorForm::Numpy,
                (false, Some(least)) => FactorForm::Sparse(least),
                (false, None) => FactorForm::Dense,
            };
            let begun = NewFile::create(path).and_then(|file| FactorWriter::new(form, value, &faces.groups, file));
            writers.push((begun.with_context(|| cannot_write(path))?, path));
        }
        let folder = files::folder_of(&self.arguments.output[0].path);
        let mut waiting: Box<dyn Storage> = if first {
            let file = tempfile::tempfile_in(folder);
            Box::new(file.with_context(|| format!("{}: no temporary file can be made there", folder.display()))?)
        } else {
            Box::new(Cursor::new(Vec::new()))
        };
        let mut auditor = Auditor::new(faces);
        let mut failed = None;
        let mut rows = |row: view_factor::Row<'_>| {
            auditor.row(&row);
            let written = writers
                .iter_mut()
                .try_for_each(|(writer, path)| writer.row(&row).inspect_err(|_| failed = Some(path.to_path_buf())));
            written.map_err(io::Error::other)
        };
        let (begun, signals, reporter) = (Instant::now(), &self.signals, &mut self.reporter);
        let mut progress = |pairs: &Pairs| reporter.pairs(pairs, begun, false);
        let stops = || signals.reason().is_some();
        let watch = Watch { progress: &mut progress, stops: &stops };
        let result = view_factor::compute(faces, occluders, settings, &mut *waiting, &mut rows, watch, self.ranks)?;
        let place = failed.as_deref().unwrap_or(folder);
        let Some(computed) = result.with_context(|| cannot_write(place))? else { return Ok(None) };
        self.reporter.pairs(&computed.pairs, begun, true);
        let mut files = Vec::new();
        for (writer, path) in writers {
            files.push((writer.finish().with_context(|| cannot_write(path))?, path.clone()));
        }
        Ok(Some(Done { computed, sums: auditor.sums(), values: auditor.values, files }))
    }

    fn report(
        &self,
        faces: &Faces,
        settings: &MatrixSettings,
        (computed, row_sums, values): &(Computed, RowSums, u64),
        reciprocity: Reciprocity,
    ) -> Report {
        let arguments = self.arguments;
        let settings = serde_json::json!({
            "per": format!("{:?}", arguments.per).to_lowercase(),
            "sides": format!("{:?}", arguments.sides).to_lowercase(),
            "tolerance": settings.tolerance.relative,
            "floor": settings.tolerance.absolute,
            "min": arguments.min,
            "unit": arguments.unit.map(|unit| format!("{unit:?}").to_lowercase()),
            "threads": rayon::current_num_threads(),
            "ranks": self.ranks.size(),
        });
        Report {
            schema: "ringlight-viewfactors-1",
            version: env!("CARGO_PKG_VERSION"),
            command: command_line(),
            warnings: report::warnings(&self.warnings),
            scene: SceneCounts {
                triangles: faces.triangles,
                degenerate_triangles: faces.degenerate,
                rows: faces.groups.len(),
                polygons: faces.polygons.len(),
                area: faces.groups.iter().map(|group| group.area).sum(),
            },
            settings,
            pairs: computed.pairs,
            values: *values,
            row_sums: *row_sums,
            reciprocity,
            seconds: self.seconds,
            cpu_seconds: machine::busy_seconds(),
            peak_memory_bytes: machine::peak_private_memory(),
        }
    }
}
