//! A solve that is watched in the browser: what every rank does to have its light shown, and what the first one shows.

use crate::arguments::{StopArguments, ViewArguments};
use crate::failure::Failure;
use crate::launch::COMMAND;
use crate::machine;
use crate::progress::Pace;
use crate::signals::Signals;
use anyhow::Context;
use rayon::prelude::*;
use ringlight::column::Store;
use ringlight::mesh::Mesh;
use ringlight::output::report::Units;
use ringlight::output::{AmbientSums, Exposure, LitOptions, ambient, write_glb};
use ringlight::quantity::Rgb;
use ringlight::resources::Bytes;
use ringlight::scene::Alpha;
use ringlight::solution::{Description, ImageReference, OwnLight, Solution};
use ringlight::solve::{Control, Ledger, Progress, Ring, SolveSettings, State, StopReason, World};
use ringlight::transport::{self, Communicator};
use ringlight_view::protocol::{self, Camera, Hello, Load, Phase, Status, Surface, Texture};
use ringlight_view::{Image, Server, display};
use serde::{Deserialize, Serialize};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::time::{Duration, Instant};

/// Time between two updates at least.
const UPDATE: Duration = Duration::from_millis(250);

/// Updates by time take at most one part in so many of the solver's time.
const PART: u32 = 64;

/// How long the solver waits before it looks whether it is still to wait.
const NAP: Duration = Duration::from_millis(50);

/// What is shown besides light and geometry.
#[derive(Clone, Copy)]
pub struct Subject<'a> {
    /// The scene without geometry.
    pub description: &'a Description,
    /// Patches and elements.
    pub mesh: &'a Mesh,
    /// Settings in force.
    pub settings: SolveSettings,
    /// Encoded images where they are at hand.
    pub images: &'a [Option<Bytes>],
}

/// On every rank of a solve that is watched.
pub struct Showing {
    /// On the first rank.
    server: Option<Server>,
    /// Shots between updates, if they do not go by time.
    every: Option<u64>,
    /// Hashes of what was last shown of own clusters.
    seen: Vec<u64>,
    /// CPU and waiting time of this rank when its light was last shown.
    load: Load,
    /// What light was last shown, and when it may be next.
    shown: Option<(u64, u64)>,
    next: Instant,
    status: Status,
    told: Instant,
    pace: Pace,
    /// What tells whether there is new light: shots, and the bits of the unshot share.
    light: (u64, u64),
}

/// What a rank tells the first of its light besides its colours.
#[derive(Default, Serialize, Deserialize)]
struct Part {
    ambient: AmbientSums,
    load: Load,
}

impl Showing {
    /// If it is asked for; the first rank begins to serve.
    pub fn open(arguments: &ViewArguments, first: bool) -> Result<Option<Showing>, Failure> {
        let Some(address) = &arguments.view else { return Ok(None) };
        let server = || Server::open(address).with_context(|| format!("{address}: cannot be listened to"));
        let now = Instant::now();
        Ok(Some(Showing {
            server: first.then(server).transpose()?,
            every: arguments.view_every,
            seen: Vec::new(),
            load: Load::default(),
            shown: None,
            next: now,
            status: Status::default(),
            told: now,
            pace: Pace::default(),
            light: (0, 0),
        }))
    }

    /// The link to open, in words, on the first rank.
    pub fn invitation(&self) -> Option<String> {
        let link = self.server.as_ref()?.link();
        let hint = match ringlight_view::is_built() {
            true => "",
            false => "\nwarning: this ringlight was built without its page; `cargo xtask viewer` builds it",
        };
        Some(format!("view: {link}{hint}"))
    }

    /// Begins to show, dark. `until` is the unshot share at which the solver stops, if it goes on.
    pub fn begin(&self, subject: &Subject<'_>, until: Option<f64>, ranks: usize) {
        let Some(server) = &self.server else { return };
        let mesh = subject.mesh;
        let geometry = (0..mesh.clusters.len() as u32).into_par_iter().map(|c| display::geometry(mesh, c)).collect();
        let image = |(reference, bytes): (&ImageReference, &Option<Bytes>)| {
            Some(Image { media_type: reference.media_type.clone(), bytes: bytes.clone()? })
        };
        let images = subject.description.images.iter().zip(subject.images).map(image).collect();
        server.stage().begin(&hello(subject, until, ranks), images, geometry);
    }

    /// Adds what watchers want to what else is to be done.
    pub fn wish(&self, control: &mut Control) {
        let Some(server) = &self.server else { return };
        let stage = server.stage();
        if stage.stopped() {
            control.stop = control.stop.max(Some(StopReason::Stopped));
        }
        let news = match self.every {
            // A round of group shooting brings light without a shot.
            Some(every) => self.shown.is_none_or(|(shots, unshot)| {
                self.light.0 >= shots + every || self.light.0 == shots && self.light.1 != unshot
            }),
            None => self.shown != Some(self.light) && Instant::now() >= self.next,
        };
        control.show = stage.watchers() > 0 && (news || stage.paused() && self.shown != Some(self.light));
        control.show |= stage.wants_model();
        control.wait = stage.paused();
        if control.wait && control.stop.is_none() && !control.show {
            std::thread::sleep(NAP);
        }
    }

    /// Tells how far the solver is.
    pub fn note(&mut self, progress: &Progress, stop: &StopArguments, start: Instant) {
        let Some(server) = &self.server else { return };
        let now = Instant::now();
        self.light = (progress.shots, progress.unshot_share.to_bits());
        self.pace.note(now, progress);
        if now - self.told < UPDATE && progress.shots > 0 {
            return;
        }
        self.told = now;
        let paused = server.stage().paused();
        self.status.phase = if paused { Phase::Pause } else { Phase::Solve };
        self.tell(progress, start);
        self.status.time_left = self.pace.seconds_left(now, progress, stop, now - start).filter(|_| !paused);
        self.publish();
    }

    /// Tells that the solver has ended, and what comes next.
    pub fn end(&mut self, progress: &Progress, reason: StopReason, start: Instant) {
        self.status.ended = Some(reason);
        self.status.phase = Phase::Write;
        self.status.time_left = None;
        self.tell(progress, start);
        self.publish();
    }

    /// Tells that there is nothing more to do.
    pub fn done(&mut self) {
        self.status.phase = Phase::Done;
        self.publish();
    }

    fn tell(&mut self, progress: &Progress, start: Instant) {
        self.status.seconds = start.elapsed().as_secs_f64();
        self.status.rays_per_second = self.pace.rays_per_second(Instant::now(), progress);
        let Progress { shots, unshot_share, rays, .. } = *progress;
        (self.status.shots, self.status.unshot_share, self.status.rays) = (shots, unshot_share, rays);
    }

    fn publish(&self) {
        if let Some(server) = &self.server {
            server.stage().status(&self.status);
        }
    }

    /// Shows the light of all ranks, and has a lit model made if a watcher wants one. Every rank calls it.
    pub fn show(
        &mut self,
        subject: &Subject<'_>,
        (world, state): (&World<'_>, &State),
        ring: &Ring<'_>,
        ranks: &mut Communicator<'_>,
    ) -> Result<(), transport::Failure> {
        let start = Instant::now();
        let mesh = subject.mesh;
        let wanted = self.server.as_ref().is_some_and(|server| server.stage().wants_model());
        let wanted = ranks.broadcast(0, COMMAND, vec![u8::from(wanted)])? == [1];
        let energy = state.energy(world, ranks)?;
        let part = self.part(mesh, world, state, ranks);
        if let Some(parts) = ranks.gather(0, COMMAND, part)? {
            let mut light = Vec::new();
            let mut sums = AmbientSums::default();
            self.status.ranks.clear();
            for bytes in parts {
                let part = take_part(&bytes, &mut light);
                sums = sums.join(part.ambient);
                self.status.ranks.push(part.load);
            }
            (self.status.ambient, self.status.energy) = (sums.ambient(), Some(energy));
            if let Some(server) = &self.server {
                server.stage().light(light);
                server.stage().places(protocol::places(mesh, &world.share.owners, |facet| ring.holder(facet)));
            }
        }
        self.shown = Some(self.light);
        self.next = Instant::now() + UPDATE.max(start.elapsed() * PART);
        if wanted {
            let light = OwnLight { own: &world.share.own, clusters: &state.clusters };
            let light = light.gather(mesh, Store::Heap, ranks)?;
            if let (Some(server), Some(light)) = (&self.server, light) {
                let &Subject { description, settings, images, .. } = subject;
                let (description, mesh, images) = (description.clone(), mesh.clone(), images.to_vec());
                let ledger = Ledger::of(state);
                let solution = Solution { description, mesh, settings, ledger, light, energy, images };
                let promise = server.stage().promise();
                // The solver goes on meanwhile.
                std::thread::spawn(move || promise.keep(model(&solution)));
            }
        }
        Ok(())
    }

    /// This rank's part: what of its light has changed.
    fn part(&mut self, mesh: &Mesh, world: &World<'_>, state: &State, ranks: &Communicator<'_>) -> Vec<u8> {
        let load = Load { busy: machine::busy_seconds(), wait: ranks.waited_seconds() };
        let since = Load { busy: load.busy - self.load.busy, wait: load.wait - self.load.wait };
        self.load = load;
        let own = world.share.own.par_iter().zip(&state.clusters);
        let sums = own.clone().map(|(&cluster, light)| {
            let mut sums = AmbientSums::default();
            for (id, patch_light) in mesh.clusters[cluster as usize].patches.clone().zip(&light.patches) {
                let patch = mesh.patch(id);
                sums.add(mesh, &patch, light.patch(mesh, &patch), patch_light.emission_waits);
            }
            sums
        });
        let ambient = sums.reduce(AmbientSums::default, AmbientSums::join);
        self.seen.resize(state.clusters.len(), 0);
        let changed = own.zip(&mut self.seen).filter_map(|((&cluster, light), seen)| {
            let record = display::light(mesh, cluster, &light.elements);
            let hash = hash(&record);
            (std::mem::replace(seen, hash) != hash).then_some(record)
        });
        let changed: Vec<Vec<u8>> = changed.collect();
        let words = serde_json::to_vec(&Part { ambient, load: since }).unwrap_or_default();
        let mut bytes = Vec::new();
        append(&mut bytes, &words);
        changed.iter().for_each(|record| append(&mut bytes, record));
        bytes
    }

    /// Shows a solution that is not being solved any more.
    pub fn show_solution(&mut self, solution: &Solution, reason: Option<StopReason>) {
        let Some(server) = &self.server else { return };
        let (mesh, elements) = (&solution.mesh, &solution.light.elements);
        let light = (0..mesh.clusters.len() as u32).into_par_iter().map(|cluster| {
            let range = &mesh.clusters[cluster as usize].elements;
            (cluster, display::light(mesh, cluster, &elements[range.start as usize..range.end as usize]))
        });
        server.stage().light(light.collect());
        let energy = solution.energy;
        self.status.ambient = ambient(solution);
        self.status.ended = reason;
        self.status.shots = solution.ledger.shots;
        self.status.unshot_share = if energy.emitted > 0.0 { energy.unshot / energy.emitted } else { 0.0 };
        self.status.energy = Some(energy);
        self.done();
    }

    /// Goes on showing until a signal comes to any rank. The first rank has the solution. Every rank calls it.
    pub fn stay(
        &mut self,
        solution: Option<&Solution>,
        signals: &Signals,
        ranks: &mut Communicator<'_>,
    ) -> Result<StopReason, Failure> {
        self.done();
        loop {
            let here = match signals.reason() {
                None => 0,
                Some(StopReason::Interrupted) => 1,
                Some(_) => 2,
            };
            match ranks.all_reduce(COMMAND, [here], |a, b| a.max(b))? {
                [0] => {}
                [1] => return Ok(StopReason::Interrupted),
                _ => return Ok(StopReason::Terminated),
            }
            let server = self.server.as_ref().filter(|server| server.stage().wants_model());
            if let (Some(server), Some(solution)) = (server, solution) {
                server.stage().promise().keep(model(solution));
            }
            std::thread::sleep(2 * NAP);
        }
    }
}

/// Appends a piece of what a rank sends, with its length before it.
fn append(bytes: &mut Vec<u8>, piece: &[u8]) {
    bytes.extend_from_slice(&(piece.len() as u32).to_le_bytes());
    bytes.extend_from_slice(piece);
}

/// Takes apart what a rank has sent: appends the records of its clusters, which begin with their numbers.
fn take_part(mut bytes: &[u8], light: &mut Vec<(u32, Vec<u8>)>) -> Part {
    let mut next = || {
        let (length, rest) = bytes.split_first_chunk()?;
        let (piece, rest) = rest.split_at_checked(u32::from_le_bytes(*length) as usize)?;
        bytes = rest;
        Some(piece)
    };
    let part = next().and_then(|words| serde_json::from_slice(words).ok()).unwrap_or_default();
    while let Some(record) = next() {
        light.extend(record.first_chunk().map(|cluster| (u32::from_le_bytes(*cluster), record.to_vec())));
    }
    part
}

fn hash(record: &[u8]) -> u64 {
    let mut hasher = DefaultHasher::new();
    record.hash(&mut hasher);
    hasher.finish()
}

/// The lit model, as `-o` writes it.
fn model(solution: &Solution) -> Result<Vec<u8>, String> {
    let options = LitOptions { exposure: Exposure::automatic(solution), ambient: false };
    let mut bytes = Vec::new();
    write_glb(solution, &options, &mut bytes).map_err(|error| error.to_string())?;
    Ok(bytes)
}

fn hello(subject: &Subject<'_>, until: Option<f64>, ranks: usize) -> Hello {
    let &Subject { description, mesh, settings, .. } = subject;
    let low = mesh.clusters.iter().fold(glam::Vec3::INFINITY, |a, c| a.min(c.low));
    let high = mesh.clusters.iter().fold(glam::Vec3::NEG_INFINITY, |a, c| a.max(c.high));
    let camera = |(number, camera): (usize, &ringlight::scene::Camera)| {
        let mut matrix = camera.world;
        (0..3).for_each(|axis| matrix[3][axis] -= mesh.origin[axis]);
        Camera {
            name: if camera.name.is_empty() { format!("camera {number}") } else { camera.name.clone() },
            matrix,
            field_of_view: camera.vertical_field_of_view,
            half_height: camera.half_height,
        }
    };
    let surface = |surface: &ringlight::scene::Surface| {
        let material = &description.materials[surface.material as usize];
        let at_hand = |texture: &ringlight::scene::Texture| {
            subject.images.get(texture.image as usize).is_some_and(Option::is_some)
        };
        let texture = material.base_texture.filter(at_hand).map(|texture| {
            let [r, g, b, alpha] = material.base_colour;
            let cutoff = match material.alpha {
                Alpha::Mask(cutoff) if alpha > 0.0 => cutoff / alpha,
                _ => 0.0,
            };
            let ringlight::scene::Texture { image, wrap, nearest } = texture;
            Texture { image, wrap, nearest, factor: [r, g, b], cutoff }
        });
        Surface { name: surface.name.to_string(), texture }
    };
    Hello {
        protocol: protocol::VERSION,
        version: env!("CARGO_PKG_VERSION"),
        name: description.name.clone(),
        photometric: Units::of(description) == Units::PHOTOMETRIC,
        live: until.is_some(),
        clusters: mesh.clusters.len(),
        patches: mesh.patch_count(),
        elements: mesh.element_count(),
        ranks,
        until: until.unwrap_or(0.0),
        origin: mesh.origin,
        bounds: [low.to_array(), high.to_array()],
        surfaces: description.surfaces.iter().map(surface).collect(),
        cameras: description.cameras.iter().enumerate().map(camera).collect(),
        sky: settings.sky.unwrap_or(Rgb::default()),
    }
}
