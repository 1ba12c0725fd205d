//! `export` and `render`: any output of a solution, again.

use crate::arguments::Export;
use crate::failure::{End, Failure};
use crate::input;
use crate::outputs::{self, Content, Others};
use crate::run;

/// Writes outputs of a solution.
pub fn export(arguments: &Export) -> Result<End, Failure> {
    let (path, scene) = (arguments.solution.as_path(), arguments.scene.as_deref());
    outputs::check(&arguments.targets, &Others { scene, ..Others::default() })?;
    let solution = input::solution(path, scene)?;
    outputs::check_camera(&arguments.display, &solution.description.cameras)?;
    outputs::check_sizes(&arguments.targets, &solution.mesh)?;
    if !arguments.quiet {
        for warning in outputs::missing_images(&solution.description, &solution.images, &arguments.targets).0 {
            eprintln!("warning: {}", run::warning(&warning.message, warning.count, ""));
        }
    }
    let content = Content::new(&solution, &arguments.display, None);
    for output in &arguments.targets.output {
        outputs::write(output, &content)?;
    }
    Ok(End::Done)
}

/// Draws pictures of a solution.
pub fn render(arguments: &Export) -> Result<End, Failure> {
    match arguments.targets.output.iter().find(|output| !output.kind.is_picture()) {
        Some(output) => Err(Failure::Usage(format!("{} is no picture; expected .png or .exr", output.path.display()))),
        None => export(arguments),
    }
}
