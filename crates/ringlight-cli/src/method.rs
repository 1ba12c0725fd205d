//! How light is solved and when that ends: what the flags come to.

use crate::arguments::{MethodArguments, QualityChoice, ShootChoice, SolverChoice, StopArguments};
use crate::failure::Failure;
use crate::input;
use crate::run::Settings;
use ringlight::mesh::Mesh;
use ringlight::shooting::Shoot;
use ringlight::solve::{SolveSettings, Solver, StopRule};
use std::path::Path;

/// The error of group shooting unless another is asked for.
const ERROR: f64 = 0.01;

/// The unshot share at which plain refinement stops unless another is asked for.
const UNTIL: f64 = 0.01;

/// The settings that decide the result. Who names the error names group shooting, and who names only what plain refinement
/// stops by or is set by means that.
pub fn settings(
    method: &MethodArguments,
    stop: &StopArguments,
    quality: QualityChoice,
) -> Result<SolveSettings, Failure> {
    let given = of_plain(method, stop);
    let solver = match (method.solver, method.error) {
        (Some(SolverChoice::Plain), Some(_)) if method.cells.is_some() => {
            return Err(Failure::Usage(
                "--cells says how many cells shooters have, --error asks for as many as it takes".into(),
            ));
        }
        (Some(SolverChoice::Plain), Some(error)) => Solver::PlainTo(error),
        (Some(SolverChoice::Plain), None) => Solver::Plain,
        (None, None) if given.is_some() => Solver::Plain,
        (_, error) => match given {
            // A sky has cells whichever solver takes its light.
            Some(flag) if flag != CELLS || method.sky.is_none() => {
                return Err(Failure::Usage(format!("{flag} is for --solver plain; group shooting stops by --error")));
            }
            _ => Solver::Group(error.unwrap_or(ERROR)),
        },
    };
    let shoot = match method.shoot {
        Some(ShootChoice::Average) => Shoot::Average,
        Some(ShootChoice::Elements) | None => Shoot::Elements,
    };
    Ok(SolveSettings {
        solver,
        cells: method.cells.unwrap_or(input::default_cells(quality)),
        shoot,
        sky: method.sky,
        shooters_in_flight: method.shooters_in_flight.unwrap_or(1),
    })
}

const CELLS: &str = "--cells";

/// A flag that only plain refinement has; [`CELLS`] last.
fn of_plain(method: &MethodArguments, stop: &StopArguments) -> Option<&'static str> {
    let given = [
        ("--until", stop.until.is_some()),
        ("--max-shots", stop.max_shots.is_some()),
        ("--shoot", method.shoot.is_some()),
        ("--shooters-in-flight", method.shooters_in_flight.is_some()),
        (CELLS, method.cells.is_some()),
    ];
    given.into_iter().find_map(|(flag, is_given)| is_given.then_some(flag))
}

/// When plain refinement stops; group shooting ends when it is done.
pub fn stop_rule(stop: &StopArguments) -> StopRule {
    StopRule { until: stop.until.unwrap_or(UNTIL), max_shots: stop.max_shots }
}

/// Refuses to go on from a solution of group shooting by stop rules that it does not have.
pub fn check_resumed(settings: &SolveSettings, stop: &StopArguments, solution: &Path) -> Result<(), Failure> {
    let flag = match (settings.solver, stop) {
        (Solver::Group(_), StopArguments { until: Some(_), .. }) => "--until",
        (Solver::Group(_), StopArguments { max_shots: Some(_), .. }) => "--max-shots",
        _ => return Ok(()),
    };
    let path = solution.display();
    Err(Failure::Usage(format!(
        "{flag} is for plain refinement, and {path} was begun by group shooting, which goes on to its error; \
         bake with --solver plain, or with another --error"
    )))
}

/// Settings as the report shows them, whatever verb set them.
pub fn reported(settings: &SolveSettings, mesh: &Mesh, stop: &StopArguments) -> Settings {
    let shoot = match settings.shoot {
        Shoot::Elements => "elements",
        Shoot::Average => "average",
    };
    let (solver, error, until) = match settings.solver {
        Solver::Plain => ("plain", None, Some(stop_rule(stop).until)),
        Solver::PlainTo(error) => ("plain", Some(error), Some(stop_rule(stop).until)),
        Solver::Group(error) => ("group", Some(error), None),
    };
    let value = serde_json::json!({
        "solver": solver,
        "error": error,
        "patch_size": mesh.sizes.patch,
        "element_size": mesh.sizes.element,
        "cells": settings.cells,
        "shoot": shoot,
        "sky": settings.sky,
        "shooters_in_flight": settings.shooters_in_flight,
        "until": until,
        "max_shots": stop.max_shots,
        "time_limit": stop.time_limit,
    });
    match value {
        serde_json::Value::Object(map) => map,
        _ => Settings::new(),
    }
}
