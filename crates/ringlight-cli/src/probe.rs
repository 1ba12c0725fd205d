//! `probe`: irradiance at points and on calculation grids.

use crate::arguments::{HowChoice, Probe, Targets};
use crate::failure::{End, Failure};
use crate::host::Host;
use crate::outputs::{self, Kind, Others};
use crate::{files, launch, reading, spread};
use anyhow::Context;
use ringlight::output::report::Units;
use ringlight::output::{FalseColour, Unit, grid_picture, write_png};
use ringlight::probe::{self, GatherOptions, Grid, Point, Reading, Statistics, Status, SurfaceOptions};
use ringlight::transport::Communicator;
use std::path::Path;

/// Reads points or makes a grid, finds their light, writes and tells it.
pub fn probe(arguments: &Probe, ranks: &mut Communicator<'_>) -> Result<End, Failure> {
    spread::check(&arguments.spread, ranks.size())?;
    launch::on_first_rank(ranks, || check(arguments))?;
    // A bad table is refused before the solution is read.
    let listed = arguments.points.as_deref().map(read_points).transpose()?;
    let host = Host::find(ranks, None, arguments.spread.is_bounded())?;
    let solution = reading::solution(ranks, &host, &arguments.solution, None)?;
    let grid = match &arguments.grid {
        Some(request) => Some(request.points(&solution, arguments.height).map_err(Failure::Usage)?),
        None => None,
    };
    let points = match &grid {
        Some(grid) => grid.points.iter().flatten().copied().collect(),
        None => listed.unwrap_or_default(),
    };
    let mut ring = reading::ring(ranks, &arguments.spread, &solution.mesh)?;
    let readings = match arguments.how {
        HowChoice::Gather => {
            let usual = GatherOptions::default();
            let options = GatherOptions {
                cells: arguments.cells.unwrap_or(usual.cells),
                tolerance: arguments.tolerance.unwrap_or(usual.tolerance),
            };
            probe::gather(&solution, &points, &options, &mut ring, ranks)?
        }
        HowChoice::Surface => {
            probe::surface(&solution, &points, &SurfaceOptions { reach: arguments.reach }, &mut ring, ranks)?
        }
    };
    // The first rank writes and speaks.
    let Some(readings) = readings else { return Ok(End::Done) };
    let unit = match Units::of(&solution.description) {
        Units::RADIOMETRIC => Unit::WattsPerSquareMetre,
        _ => Unit::Lux,
    };
    for output in &arguments.output {
        match (output.kind, &grid) {
            (Kind::Png, Some(grid)) => {
                let colours = FalseColour { unit, ..FalseColour::default() };
                let picture = grid_picture(grid.columns, grid.cell, &values(grid, &readings), colours);
                files::write(&output.path, |out| write_png(&picture, out))?;
            }
            _ => files::write(&output.path, |out| probe::write_readings(&points, &readings, out))?,
        }
    }
    match grid {
        _ if arguments.quiet => Ok(End::Done),
        Some(grid) => crate::print(table(&grid, &readings, unit).as_bytes()),
        None => {
            warn(&readings);
            Ok(End::Done)
        }
    }
}

/// Whether the outputs can be written, and are none of the files that are read.
fn check(arguments: &Probe) -> Result<(), Failure> {
    let usage = |path: &Path, what: &str| Err(Failure::Usage(format!("{}{what}", path.display())));
    let idle = match arguments.how {
        HowChoice::Gather => arguments.reach.is_some().then_some("--reach is for --how surface"),
        HowChoice::Surface => (arguments.cells.is_some() || arguments.tolerance.is_some())
            .then_some("--cells and --tolerance are for --how gather"),
    };
    if let Some(message) = idle {
        return Err(Failure::Usage(message.into()));
    }
    let read = || std::iter::once(&arguments.solution).chain(&arguments.points);
    for output in &arguments.output {
        match output.kind {
            Kind::Table => {}
            Kind::Png if arguments.grid.is_some() => {}
            Kind::Png => return usage(&output.path, ": a picture needs --grid; points are written as .csv"),
            _ => return usage(&output.path, ": expected .csv, or .png for a grid"),
        }
        if read().any(|path| outputs::identity(path) == outputs::identity(&output.path)) {
            return usage(&output.path, " is read; it would be overwritten");
        }
    }
    let targets = Targets { output: arguments.output.clone(), force: arguments.force };
    outputs::check(&targets, &Others::default())
}

fn read_points(path: &Path) -> anyhow::Result<Vec<Point>> {
    let bytes = files::open(path).with_context(|| format!("{}: cannot be read", path.display()))?;
    probe::read_points(&bytes).with_context(|| path.display().to_string())
}

/// Illuminance of all cells of a grid.
fn values(grid: &Grid, readings: &[Reading]) -> Vec<Option<f32>> {
    let mut readings = readings.iter();
    grid.points.iter().map(|point| point.and_then(|_| readings.next()).and_then(Reading::illuminance)).collect()
}

/// The numbers that lighting calculations state.
fn table(grid: &Grid, readings: &[Reading], unit: Unit) -> String {
    let found = Statistics::new(readings);
    let [wide, high] = grid.cell;
    let mut text = format!("{:14}{} x {} of {wide:.3} m x {high:.3} m\n", "cells", grid.columns, grid.rows);
    text += &format!("{:14}{}", "points", found.points);
    if found.left_out > 0 {
        text += &format!(" ({} more have no light: {})", found.left_out, left_out(readings));
    }
    text.push('\n');
    if found.points == 0 {
        return text;
    }
    for (name, value) in [("E min", found.minimum), ("E mean", found.mean), ("E max", found.maximum)] {
        text += &format!("{name:14}{} {}\n", digits(value), unit.sign());
    }
    for (name, value) in [("U0 min/mean", found.uniformity()), ("Ud min/max", found.diversity())] {
        text += &format!("{name:14}{value:.3}\n");
    }
    text
}

/// Four significant digits.
fn digits(value: f64) -> String {
    let rounded: f64 = format!("{value:.3e}").parse().unwrap_or(value);
    if (1e-3..1e7).contains(&rounded) || rounded == 0.0 { rounded.to_string() } else { format!("{rounded:e}") }
}

/// Says how many points have no light.
fn warn(readings: &[Reading]) {
    let without = readings.iter().filter(|r| r.status != Status::Ok).count();
    if without > 0 {
        eprintln!("warning: {without} of {} points have no light: {}", readings.len(), left_out(readings));
    }
}

/// How many points have which status but ok.
fn left_out(readings: &[Reading]) -> String {
    let count = |status: Status| (readings.iter().filter(|r| r.status == status).count(), status.word());
    let found = [Status::Inside, Status::Far].map(count);
    found.iter().filter(|(n, _)| *n > 0).map(|(n, word)| format!("{n} {word}")).collect::<Vec<_>>().join(", ")
}
