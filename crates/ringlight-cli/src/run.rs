//! A run: scene or solution → light → files, stage by stage, timed.

use crate::arguments::{ProgressChoice, RunArguments, SpreadArguments, StopArguments};
use crate::failure::Failure;
use crate::host::Host;
use crate::launch::COMMAND;
use crate::machine;
use crate::method;
use crate::outputs::Others;
use crate::progress::{Reporter, Stage};
use crate::showing::{Showing, Subject};
use crate::signals::Signals;
use crate::spread::{self, Choice};
use crate::watch::{Checkpoint, Watch};
use anyhow::Context;
use ringlight::mesh::Mesh;
use ringlight::output::report::{RankReport, Seconds, WindowReport};
use ringlight::plan;
use ringlight::resources::Bytes;
use ringlight::ring::{Demand, Rings};
use ringlight::scene::{Place, Warnings};
use ringlight::solution::{Description, OwnLight};
use ringlight::solve::{self, Energy, Observer, Progress, Ring, Share, SolveSettings, State, StopReason, World};
use ringlight::transport::Communicator;
use ringlight_visibility::Hierarchy;
use serde::{Serialize, de::DeserializeOwned};
use std::io::Write;
use std::sync::Arc;
use std::time::Instant;

/// Settings by name, as the report shows them.
pub type Settings = serde_json::Map<String, serde_json::Value>;

/// What lasts from the start of a command to its end.
pub struct Run<'a, 'b> {
    pub(crate) arguments: &'a RunArguments,
    pub(crate) spread: &'a SpreadArguments,
    /// The way to the other ranks.
    pub ranks: &'a mut Communicator<'b>,
    pub(crate) rings: Rings,
    /// What each rank may use, bytes.
    pub(crate) available: Vec<u64>,
    /// For how many elements each rank has room.
    pub(crate) rooms: Vec<u64>,
    /// What this rank has to report, as far as it is known.
    pub(crate) own: RankReport,
    /// How the load of this rank's ring was balanced.
    pub(crate) balance: Vec<WindowReport>,
    pub(crate) start: Instant,
    pub(crate) signals: Signals,
    pub(crate) reporter: Reporter,
    /// If it is watched in the browser.
    pub(crate) showing: Option<Showing>,
    pub(crate) seconds: Seconds,
    pub(crate) warnings: Warnings,
}

/// What is solved: on ranks that do not lead, without what only outputs need.
pub struct Made {
    /// Patches and elements.
    pub mesh: Mesh,
    /// The scene without geometry.
    pub description: Description,
    /// Encoded images where they are at hand.
    pub images: Vec<Option<Bytes>>,
}

/// All that outputs are made of.
pub struct Baked {
    /// The scene.
    pub made: Made,
    /// What decided the result.
    pub settings: SolveSettings,
    /// The result.
    pub solved: Solved,
}

/// What the solver left.
pub struct Solved {
    /// What this rank owns.
    pub share: Arc<Share>,
    /// The light of own clusters.
    pub state: State,
    /// Its audit.
    pub energy: Energy,
    /// What was done in this run.
    pub progress: Progress,
    /// Why it ended.
    pub reason: StopReason,
}

impl Solved {
    /// The light that this rank owns.
    pub fn light(&self) -> OwnLight<'_> {
        OwnLight { own: &self.share.own, clusters: &self.state.clusters }
    }
}

impl<'a, 'b> Run<'a, 'b> {
    /// Begins, on every rank; only the first one speaks and writes.
    pub fn begin(
        arguments: &'a RunArguments,
        spread: &'a SpreadArguments,
        ranks: &'a mut Communicator<'b>,
    ) -> Result<Run<'a, 'b>, Failure> {
        let start = Instant::now();
        spread::check(spread, ranks.size())?;
        let signals = Signals::listen().context("signals cannot be listened to")?;
        let progress = if ranks.rank() == 0 { arguments.progress } else { ProgressChoice::None };
        let reporter = Reporter::new(progress, arguments.quiet, arguments.verbose, start);
        let showing = Showing::open(&arguments.view, ranks.rank() == 0)?;
        if let Some(invitation) = showing.as_ref().and_then(Showing::invitation) {
            // Also to those who want silence: nobody could guess it.
            reporter.say(&invitation);
        }
        let (seconds, warnings) = (Seconds::default(), Warnings::default());
        let (rings, own) = (Rings::one(ranks.size()), RankReport::default());
        let available = spread::available(spread, ranks)?;
        let (rooms, balance) = (vec![u64::MAX; ranks.size()], Vec::new());
        Ok(Run {
            arguments,
            spread,
            ranks,
            rings,
            available,
            rooms,
            own,
            balance,
            start,
            signals,
            reporter,
            showing,
            seconds,
            warnings,
        })
    }

    pub fn is_first(&self) -> bool {
        self.ranks.rank() == 0
    }

    /// Chooses the rings and who owns how much, before memory is taken for what they divide; says why not if there is too little.
    pub fn choose_rings(&mut self, host: &Host, mesh: &Mesh, settings: &SolveSettings) -> Result<(), String> {
        let demand = plan::demand(mesh, host.mesh_place(), settings);
        let demand = Demand { saving: self.arguments.checkpoint.as_ref().map_or(0, |_| demand.writing), ..demand };
        let Choice { rings, needed, rooms } = spread::choose(self.spread, demand, &self.available)?;
        let elements = |bytes: u64| match demand.owned {
            0 => u64::MAX,
            owned => (bytes as f64 / owned as f64 * mesh.element_count() as f64) as u64,
        };
        (self.rings, self.rooms) = (rings, rooms.into_iter().map(elements).collect());
        if rings.ranks() > 1 {
            let (ranks, count, needed) = (rings.ranks(), rings.rings(), spread::in_words(needed));
            let rings = if count == 1 { "one ring".into() } else { format!("{count} rings") };
            self.say(&format!("{ranks} ranks in {rings}, each with up to about {needed} of memory"));
        }
        Ok(())
    }

    /// Files besides the outputs that will be written.
    pub fn others(&self) -> Others<'a> {
        let RunArguments { report, checkpoint, .. } = self.arguments;
        let checkpoint = checkpoint.as_ref().map(|c| c.file.as_path());
        Others { report: report.as_deref(), checkpoint, ..Others::default() }
    }

    /// Does a stage's work and takes its time.
    pub fn stage<T>(&mut self, stage: Stage, work: impl FnOnce(&mut Self) -> T) -> T {
        self.reporter.stage(stage);
        let start = Instant::now();
        let result = work(self);
        let spent = start.elapsed().as_secs_f64();
        *match stage {
            Stage::Load => &mut self.seconds.load,
            Stage::Mesh => &mut self.seconds.mesh,
            Stage::Build => &mut self.seconds.build,
            Stage::Solve => &mut self.seconds.solve,
            Stage::Write => &mut self.seconds.write,
        } += spent;
        result
    }

    /// Says a line, unless the user wants silence.
    pub fn say(&self, text: &str) {
        if self.is_first() && !self.arguments.quiet {
            self.reporter.say(text);
        }
    }

    /// Says a line to those who asked for more.
    pub fn detail(&self, text: &str) {
        if self.is_first() && self.arguments.verbose {
            self.reporter.say(text);
        }
    }

    /// Says warnings, once each, and keeps them for the report.
    pub fn warn(&mut self, warnings: &Warnings) {
        for w in &warnings.0 {
            let words = warning(&w.message, w.count, &w.first_place.to_string());
            self.say(&format!("warning: {words}"));
        }
        self.remember(warnings);
    }

    /// Keeps warnings for the report that were said by an earlier run.
    pub fn remember(&mut self, warnings: &Warnings) {
        self.warnings.0.extend(warnings.0.iter().cloned());
    }

    /// This rank's place in its ring, with the hierarchy of its shard if it has been built before.
    pub fn ring<'m>(&self, mesh: &'m Mesh, hierarchy: Option<Arc<Hierarchy>>) -> Ring<'m> {
        let spread = spread::spread(self.spread, self.rings);
        let share = Share::within(mesh, self.ranks.rank(), &self.rooms);
        Ring::with(mesh, &spread, share, hierarchy, Box::new(machine::thread_seconds))
    }

    /// Gives all ranks what the first has to say. Every rank calls it.
    pub fn tell<T: Serialize + DeserializeOwned>(&mut self, words: Option<T>) -> Result<T, Failure> {
        let words = words.map_or(Ok(Vec::new()), |words| serde_json::to_vec(&words)).context("what all are told")?;
        let words = self.ranks.broadcast(0, COMMAND, words)?;
        Ok(serde_json::from_slice(&words).context("what all are told")?)
    }

    /// Gives all ranks of a machine what its first has made.
    pub fn share(&mut self, host: &Host, made: Option<Made>) -> Result<Made, Failure> {
        if self.ranks.size() == 1 {
            return made.context("a rank that is alone makes its mesh").map_err(Failure::from);
        }
        let lights = self.tell(made.as_ref().map(|made| made.description.lights.clone()))?;
        let write = made.as_ref().map(|made| |out: &mut dyn Write| made.mesh.share(out));
        let mesh = Mesh::shared(&host.share(self.ranks, write)?).context("what ranks share")?;
        Ok(match made {
            Some(made) => Made { mesh, ..made },
            None => Made { mesh, description: Description { lights, ..Description::default() }, images: Vec::new() },
        })
    }

    /// Finds the samples of the mesh that lie free, each rank those of its own clusters, and tells all. Gives the hierarchy
    /// of this rank's shard.
    pub fn find_valid_samples(&mut self, host: &Host, mesh: &mut Mesh) -> Result<Arc<Hierarchy>, Failure> {
        let mut ring = self.ring(mesh, None);
        let own = ring.find_valid_samples(self.ranks)?;
        let (hierarchy, share) = (ring.hierarchy().clone(), ring.share().clone());
        drop(ring);
        mesh.valid =
            if self.ranks.size() == 1 { own.into() } else { host.share_valid(self.ranks, mesh, &share, &own)? };
        Ok(hierarchy)
    }

    /// The hierarchy of the whole scene, if this rank's ring has no other member.
    pub fn whole_hierarchy(&self, ring: &Ring<'_>) -> Option<Arc<Hierarchy>> {
        let alone = self.rings.members(self.rings.ring_of(self.ranks.rank())).len() == 1;
        alone.then(|| ring.hierarchy().clone())
    }

    /// Solves from `state`, or from the dark, until a stop rule, the time limit or a signal ends it.
    pub fn solve(
        &mut self,
        subject: Subject<'_>,
        world: &World<'_>,
        ring: &mut Ring<'_>,
        mut state: State,
        stop: &StopArguments,
    ) -> Result<Solved, Failure> {
        let rule = method::stop_rule(stop);
        if let Some(showing) = &self.showing {
            showing.begin(&subject, Some(rule.until), self.ranks.size());
        }
        let (reason, progress, checkpoint_failed) = self.stage(Stage::Solve, |run| {
            let checkpoint = run.arguments.checkpoint.as_ref().map(Checkpoint::new);
            let Run { ranks, reporter, signals, start, showing, .. } = run;
            let (start, showing) = (*start, showing.as_mut());
            let mut watch = Watch { reporter, signals, start, stop, subject, world, checkpoint, showing };
            let (reason, progress) = solve::solve(world, ring, &mut state, &rule, ranks, &mut watch)?;
            watch.reporter.shot(&progress, stop, true);
            watch.show(&state, ring, ranks)?;
            if let Some(showing) = &mut watch.showing {
                showing.end(&progress, reason, start);
            }
            Ok::<_, Failure>((reason, progress, watch.checkpoint.and_then(|checkpoint| checkpoint.failed)))
        })?;
        if let Some(error) = checkpoint_failed {
            let mut warnings = Warnings::default();
            warnings.add("checkpoint-failed", format!("a checkpoint failed: {error}"), Place::default());
            self.warn(&warnings);
        }
        self.note_share(ring);
        let energy = state.energy(world, self.ranks)?;
        Ok(Solved { share: world.share.clone(), state, energy, progress, reason })
    }

    /// Notes this rank's share of the work, for the report.
    fn note_share(&mut self, ring: &Ring<'_>) {
        self.balance = ring.windows().iter().map(WindowReport::new).collect();
        let (rank, clusters) = (self.ranks.rank(), &ring.mesh().clusters);
        let own = ring.share().own.iter().map(|&cluster| &clusters[cluster as usize]);
        self.own = RankReport {
            rank: rank as u32,
            ring: self.rings.ring_of(rank) as u32,
            patches: own.clone().map(|cluster| cluster.patches.len() as u64).sum(),
            elements: own.map(|cluster| cluster.elements.len() as u64).sum(),
            shard_triangles: (ring.hierarchy().triangles().len() + ring.hierarchy().slivers()) as u64,
            packets_visited: ring.visits().tested,
            ..RankReport::default()
        };
    }
}

/// The command line, as reports show it.
pub fn command_line() -> Vec<String> {
    std::env::args_os().map(|argument| argument.to_string_lossy().into_owned()).collect()
}

/// A warning in words.
pub fn warning(message: &str, count: u64, first_place: &str) -> String {
    match (count, first_place) {
        (1, "") => message.to_owned(),
        (1, place) => format!("{message} ({place})"),
        (n, "") => format!("{message} ({n} times)"),
        (n, place) => format!("{message} ({n} times, first at {place})"),
    }
}
