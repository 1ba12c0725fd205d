//! `view`: a scene while it is solved, or a solution, in the browser.

use crate::arguments::{Bake, VIEW_ADDRESS, Verb};
use crate::bake;
use crate::failure::{End, Failure};
use crate::host::Host;
use crate::outputs::Kind;
use crate::showing::{Showing, Subject};
use crate::signals::Signals;
use crate::{reading, spread};
use anyhow::Context;
use ringlight::solve::StopReason;
use ringlight::transport::Communicator;

/// A verb with what it implies: `view` is a `bake` that is shown, and goes on showing.
pub fn asked(mut verb: Verb) -> Verb {
    if let Verb::View(bake) = &mut verb {
        bake.running.view.view.get_or_insert_with(|| VIEW_ADDRESS.into());
        bake.running.view.stay = true;
    }
    verb
}

/// Shows.
pub fn view(arguments: &Bake, ranks: &mut Communicator<'_>) -> Result<End, Failure> {
    match Kind::of(&arguments.scene) {
        Some(Kind::Solution) => solution(arguments, ranks),
        _ => bake::bake(arguments, ranks),
    }
}

/// Shows a solution until it is interrupted.
fn solution(arguments: &Bake, ranks: &mut Communicator<'_>) -> Result<End, Failure> {
    spread::check(&arguments.spread, ranks.size())?;
    if !arguments.targets.output.is_empty() {
        return Err(Failure::Usage("a solution that is shown is not written again; use ringlight export".into()));
    }
    let signals = Signals::listen().context("signals cannot be listened to")?;
    let host = Host::find(ranks, None, arguments.spread.is_bounded())?;
    let solution = reading::solution(ranks, &host, &arguments.scene, None)?;
    let Some(mut showing) = Showing::open(&arguments.running.view, ranks.rank() == 0)? else { return Ok(End::Done) };
    if let Some(invitation) = showing.invitation() {
        eprintln!("{invitation}");
    }
    let (description, mesh, settings) = (&solution.description, &solution.mesh, solution.settings);
    showing.begin(&Subject { description, mesh, settings, images: &solution.images }, None, ranks.size());
    showing.show_solution(&solution, None);
    Ok(match showing.stay(Some(&solution), &signals, ranks)? {
        StopReason::Interrupted => End::Interrupted,
        _ => End::Terminated,
    })
}
