//! Progressive refinement: choose, shoot, receive, until it is good.

mod among;
mod asking;
mod choice;
mod energy;
mod exchange;
mod group;
mod holding;
mod ledger;
mod plain;
mod precision;
mod receiving;
mod ring;
mod share;
mod state;
mod walking;

pub use among::Among;
pub use energy::Energy;
pub use group::usual_rays;
pub use holding::OUTLINE;
pub use ledger::Ledger;
pub use plain::plain;
pub use ring::{Clock, Job, Ring};
pub use share::{Share, Spread};
pub use state::{State, World};

use crate::quantity::Rgb;
use crate::shooting::Shoot;
use crate::transport::{Communicator, Failure};
use serde::{Deserialize, Serialize};

/// What decides the result, saved with it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SolveSettings {
    /// Method.
    #[serde(default)]
    pub solver: Solver,
    /// Cells of a shooter: 1, 4, 16 or 64.
    pub cells: u32,
    /// What a patch shoots.
    pub shoot: Shoot,
    /// Radiance of the uniform sky, W/(m²·sr) or cd/m².
    pub sky: Option<Rgb>,
    /// Most shots under way at once.
    #[serde(default = "one")]
    pub shooters_in_flight: u32,
}

/// Methods.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Solver {
    /// Plain progressive refinement: one patch shoots at a time.
    #[default]
    Plain,
    /// Group shooting, to about this relative error.
    Group(f64),
    /// Plain progressive refinement with as many cells for each receiver as this relative error asks for.
    PlainTo(f64),
}

fn one() -> u32 {
    1
}

/// When to stop; not part of the result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StopRule {
    /// Unshot power as a share of emitted power.
    pub until: f64,
    /// Total number of shots.
    pub max_shots: Option<u64>,
}

/// Why a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StopReason {
    /// The stop rule is met.
    Converged,
    /// No patch has anything left to shoot.
    NothingLeft,
    /// The number of shots is reached.
    MaxShots,
    /// There was no memory for smaller elements.
    Memory,
    /// The observer asked for it: whoever watches finds it good enough.
    Stopped,
    /// The observer asked for it: time limit.
    TimeLimit,
    /// The observer asked for it: interrupted.
    Interrupted,
    /// The observer asked for it: terminated.
    Terminated,
}

/// What the observer wants before a shot. What any rank wants is done on all of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Control {
    /// Have the state saved.
    pub checkpoint: bool,
    /// Have the state shown.
    pub show: bool,
    /// Shoot nothing yet, but ask again.
    pub wait: bool,
    /// Stop, with a valid state; of several reasons the last in the order of [`StopReason`] counts.
    pub stop: Option<StopReason>,
}

impl Control {
    /// All of both.
    fn join(self, other: Control) -> Control {
        Control {
            checkpoint: self.checkpoint || other.checkpoint,
            show: self.show || other.show,
            wait: self.wait || other.wait,
            stop: self.stop.max(other.stop),
        }
    }
}

/// Solves from `state` by the method of the settings, until it is good or the observer ends it; every rank of the world calls it.
pub fn solve(
    world: &World<'_>,
    ring: &mut Ring<'_>,
    state: &mut State,
    stop: &StopRule,
    ranks: &mut Communicator<'_>,
    observer: &mut dyn Observer,
) -> Result<(StopReason, Progress), Failure> {
    match world.settings.solver {
        Solver::Plain | Solver::PlainTo(_) => plain::plain(world, ring, state, stop, ranks, observer),
        Solver::Group(error) => group::group(world, ring, state, error, ranks, observer),
    }
}

/// Watches a run.
pub trait Observer {
    /// What to do; asked of every rank before the first shot and after every shot, and again while it is to wait.
    fn control(&mut self) -> Control {
        Control::default()
    }

    /// Told of every rank whenever it is asked.
    fn observe(&mut self, _progress: &Progress) {}

    /// Saves the state, of which every rank holds its own clusters; called on all of them at the same time.
    fn checkpoint(&mut self, _state: &State, _ranks: &mut Communicator<'_>) -> Result<(), Failure> {
        Ok(())
    }

    /// Shows the state, of which every rank holds its own clusters; called on all of them at the same time.
    fn show(&mut self, _state: &State, _ring: &Ring<'_>, _ranks: &mut Communicator<'_>) -> Result<(), Failure> {
        Ok(())
    }
}

/// Lets a run go on to its end.
impl Observer for () {}

/// Where the run stands.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Progress {
    /// Shots so far.
    pub shots: u64,
    /// Unshot power over emitted power.
    pub unshot_share: f64,
    /// Share of the work that is done, where the method knows it.
    pub done: Option<f64>,
    /// Rays in this run.
    pub rays: u64,
    /// Masks in this run.
    pub masks: u64,
    /// Masks that needed no ray.
    pub masks_without_rays: u64,
}
