//! `export` and `render`: any output of a solution, again.

use crate::arguments::Export;
use crate::failure::{End, Failure};
use crate::host::Host;
use crate::outputs::{self, Content, Others};
use crate::{files, launch, reading, run, spread};
use ringlight::output::report::{PictureReport, RENDER_SCHEMA, RenderReport};
use ringlight::transport::Communicator;

/// Writes outputs of a solution; pictures are drawn by all ranks.
pub fn export(arguments: &Export, ranks: &mut Communicator<'_>) -> Result<End, Failure> {
    let (path, scene) = (arguments.solution.as_path(), arguments.scene.as_deref());
    spread::check(&arguments.spread, ranks.size())?;
    let others = Others { scene, report: arguments.report.as_deref(), ..Others::default() };
    launch::on_first_rank(ranks, || outputs::check(&arguments.targets, &others))?;
    let host = Host::find(ranks, None, arguments.spread.is_bounded())?;
    let solution = reading::solution(ranks, &host, path, scene)?;
    outputs::check_camera(&arguments.display, &solution.description.cameras)?;
    outputs::check_sizes(&arguments.targets, &solution.mesh)?;
    let first = ranks.rank() == 0;
    if first && !arguments.quiet {
        for warning in outputs::missing_images(&solution.description, &solution.images, &arguments.targets).0 {
            eprintln!("warning: {}", run::warning(&warning.message, warning.count, ""));
        }
    }
    let content = Content { solution: &solution, display: &arguments.display };
    let outputs = &arguments.targets.output;
    let drawn = match outputs.iter().any(|output| output.kind.is_picture()) {
        true => content.picture(&mut reading::ring(ranks, &arguments.spread, &solution.mesh)?, ranks)??,
        false => None,
    };
    let picture = drawn.as_ref().map(PictureReport::new);
    picture.iter().filter(|_| arguments.verbose).flat_map(outputs::loads).for_each(|line| eprintln!("{line}"));
    // The first rank writes: pictures when all have drawn them, all else as it reads it.
    for output in outputs.iter().filter(|_| first) {
        outputs::write(output, &content, drawn.as_ref().map(|drawn| &drawn.picture))?;
    }
    if let Some(path) = arguments.report.as_deref().filter(|_| first) {
        let (version, command) = (env!("CARGO_PKG_VERSION"), run::command_line());
        files::write_json(path, &RenderReport { schema: RENDER_SCHEMA, version, command, picture })?;
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
