//! `export` and `render`: any output of a solution, again.

use crate::arguments::Export;
use crate::failure::{End, Failure};
use crate::host::Host;
use crate::outputs::{self, Content, Others, Outcome, Output};
use crate::{launch, reading, run, spread};
use ringlight::transport::Communicator;

/// Writes outputs of a solution: pictures are drawn by all ranks, all else the first one writes as it reads it.
pub fn export(arguments: &Export, ranks: &mut Communicator<'_>) -> Result<End, Failure> {
    let (path, scene) = (arguments.solution.as_path(), arguments.scene.as_deref());
    spread::check(&arguments.spread, ranks.size())?;
    let others = Others { scene, ..Others::default() };
    launch::on_first_rank(ranks, || outputs::check(&arguments.targets, &others))?;
    let host = Host::find(ranks, None, arguments.spread.memory_per_rank.is_some())?;
    let solution = reading::solution(ranks, &host, path, scene)?;
    outputs::check_camera(&arguments.display, &solution.description.cameras)?;
    outputs::check_sizes(&arguments.targets, &solution.mesh)?;
    if ranks.rank() == 0 && !arguments.quiet {
        for warning in outputs::missing_images(&solution.description, &solution.images, &arguments.targets).0 {
            eprintln!("warning: {}", run::warning(&warning.message, warning.count, ""));
        }
    }
    let content = Content { solution: &solution, display: &arguments.display };
    let outputs: Vec<&Output> = arguments.targets.output.iter().collect();
    let ring = match outputs.iter().any(|output| output.kind.is_picture()) {
        true => Some(reading::ring(ranks, &arguments.spread, &solution.mesh)?),
        false => None,
    };
    let mut outcome = Outcome::default();
    outputs::write_all(&outputs, &content, ring, ranks, &mut outcome)?;
    // All but the last are said here, the last by whoever takes the failure.
    if let Some(last) = outcome.errors.pop() {
        outcome.errors.iter().for_each(|error| eprintln!("error: {error:#}"));
        return Err(last.into());
    }
    Ok(End::Done)
}

/// Draws pictures of a solution.
pub fn render(arguments: &Export, ranks: &mut Communicator<'_>) -> Result<End, Failure> {
    match arguments.targets.output.iter().find(|output| !output.kind.is_picture()) {
        Some(output) => Err(Failure::Usage(format!("{} is no picture; expected .png or .exr", output.path.display()))),
        None => export(arguments, ranks),
    }
}
