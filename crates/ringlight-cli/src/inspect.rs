//! `inspect`: what is in a scene, what will be ignored, and how big the solve will be.

use crate::arguments::{Inspect, StopArguments};
use crate::bake;
use crate::estimate;
use crate::failure::{End, Failure};
use crate::input;
use crate::method;
use crate::progress::duration;
use crate::run::warning;
use crate::scratch::FileScratch;
use crate::spread::in_words;
use ringlight::column::Store;
use ringlight::mesh::{self, Mesh};
use ringlight::output::report::{ReportedWarning, SceneReport, Units, warnings};
use ringlight::plan::{self, GroupCounts, MeshPlace};
use ringlight::ring::Rings;
use ringlight::scene::{LightKind, Surface};
use ringlight::shooting;
use ringlight::solution::Description;
use ringlight::solve::{
    self, Control, OUTLINE, Observer, Ring, SolveSettings, Solver, Spread, State, StopReason, StopRule, World,
};
use ringlight::transport::Communicator;
use ringlight_visibility::Hierarchy;
use serde::Serialize;
use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// Seconds of shooting that measure the speed.
const TRIAL: f64 = 1.0;

/// What `inspect` found.
#[derive(Serialize)]
struct Inspection {
    file: String,
    units: Units,
    scene: SceneReport,
    surfaces: usize,
    emitting_surfaces: usize,
    materials: usize,
    images: usize,
    lights: Vec<Named>,
    cameras: Vec<Named>,
    extent: [f64; 3],
    warnings: Vec<ReportedWarning>,
    patch_size: f64,
    element_size: f64,
    clusters: usize,
    cells: u32,
    memory_bytes: u64,
    memory_per_rank: Vec<RankMemory>,
    forecast: Option<Forecast>,
}

/// Memory of each of so many ranks in so many rings.
#[derive(Serialize)]
struct RankMemory {
    ranks: usize,
    rings: usize,
    bytes: u64,
}

/// Something with a name.
#[derive(Serialize)]
struct Named {
    name: String,
    kind: &'static str,
}

/// How long it will take.
#[derive(Serialize)]
struct Forecast {
    solver: &'static str,
    /// Of group shooting.
    error: Option<f64>,
    /// Of plain refinement.
    until: Option<f64>,
    /// Elements of which each looks for light of its own, in group shooting.
    own_elements: Option<u64>,
    shots: f64,
    rays: f64,
    rays_per_second: f64,
    measured: bool,
    seconds: f64,
}

/// Inspects.
pub fn inspect(arguments: &Inspect) -> Result<End, Failure> {
    let path = arguments.scene.as_path();
    let scratch = arguments.sizes.scratch.as_deref().map(FileScratch::new);
    let store = scratch.as_ref().map_or(Store::Heap, |scratch| Store::Scratch(scratch));
    let (scene, _) = input::scene(path, arguments.sizes.unit, store)?;
    let options = input::mesh_options(&arguments.sizes);
    let mesh = mesh::build(&scene, &options, store).map_err(|error| input::locate(error, path))?;
    let stop = StopArguments { until: arguments.until, ..StopArguments::default() };
    let settings = method::settings(&arguments.method, &stop, arguments.sizes.quality)?;
    let has_light = input::has_light(&scene, &mesh, settings.sky);
    let scene = Description::new(&scene);
    let mut inspection = Inspection::new(path, &scene, &mesh, &settings);
    inspection.warnings.extend(warnings(&bake::skipped(&mesh)));
    if has_light {
        inspection.forecast =
            Some(forecast(&scene, mesh, settings, &method::stop_rule(&stop), arguments.rays_per_second)?);
    }
    let text = if arguments.json {
        let json = serde_json::to_string_pretty(&inspection).map_err(anyhow::Error::new)?;
        json + "\n"
    } else {
        inspection.to_text()
    };
    crate::print(text.as_bytes())
}

impl Inspection {
    fn new(path: &Path, scene: &Description, mesh: &Mesh, settings: &SolveSettings) -> Inspection {
        let (low, high) =
            mesh.clusters.iter().fold((glam::Vec3::INFINITY, glam::Vec3::NEG_INFINITY), |(low, high), c| {
                (low.min(c.low), high.max(c.high))
            });
        let emits = |s: &&Surface| scene.materials[s.material as usize].emission.iter().any(|&x| x > 0.0);
        let kind = |light: &LightKind| match light {
            LightKind::Point { .. } => "point",
            LightKind::Spot { .. } => "spot",
            LightKind::Directional { .. } => "directional",
        };
        let [heap, files] = [MeshPlace::Heap, MeshPlace::Files].map(|place| plan::demand(mesh, place, settings));
        let Spread { window, packet_size, .. } = Spread::new(Rings::one(1));
        let memory = |ranks, rings| {
            let demand = if ranks == 1 { heap } else { files }.with_packets(window, packet_size, OUTLINE);
            let bytes = Rings::new(ranks, rings).map_or(0, |rings| demand.of_a_rank(rings));
            RankMemory { ranks, rings, bytes }
        };
        let camera = |field_of_view: f64| if field_of_view > 0.0 { "perspective" } else { "orthographic" };
        Inspection {
            file: path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            units: Units::of(scene),
            scene: SceneReport::new(scene, mesh),
            surfaces: scene.surfaces.len(),
            emitting_surfaces: scene.surfaces.iter().filter(emits).count(),
            materials: scene.materials.len(),
            images: scene.images.len(),
            lights: scene.lights.iter().map(|l| Named { name: l.name.clone(), kind: kind(&l.kind) }).collect(),
            cameras: scene
                .cameras
                .iter()
                .map(|c| Named { name: c.name.clone(), kind: camera(c.vertical_field_of_view) })
                .collect(),
            extent: (high - low).as_dvec3().to_array(),
            warnings: warnings(&scene.warnings),
            patch_size: mesh.sizes.patch,
            element_size: mesh.sizes.element,
            clusters: mesh.clusters.len(),
            cells: settings.cells,
            memory_bytes: memory(1, 1).bytes,
            memory_per_rank: (1..=4)
                .flat_map(|ranks| (0..=ranks).map(move |rings| (1 << ranks, 1 << rings)))
                .map(|(ranks, rings)| memory(ranks, rings))
                .collect(),
            forecast: None,
        }
    }

    fn to_text(&self) -> String {
        let mut text = String::new();
        // Writing to a string cannot fail.
        self.write(&mut text).ok();
        text
    }

    fn write(&self, out: &mut String) -> std::fmt::Result {
        let scene = &self.scene;
        let [x, y, z] = self.extent;
        writeln!(out, "scene        {}, {x:.3} × {y:.3} × {z:.3} m", self.file)?;
        writeln!(out, "surfaces     {} of {} objects, {} triangles", self.surfaces, scene.objects, scene.triangles)?;
        writeln!(out, "materials    {}, {} images", self.materials, self.images)?;
        let lamps = if self.lights.is_empty() { String::new() } else { format!(": {}", list(&self.lights)) };
        writeln!(out, "light        {} emitting surfaces, {} lamps{lamps}", self.emitting_surfaces, self.lights.len())?;
        writeln!(out, "cameras      {}", if self.cameras.is_empty() { "none".into() } else { list(&self.cameras) })?;
        writeln!(out, "patches      {} up to {:.3} m", scene.patches, self.patch_size)?;
        writeln!(
            out,
            "elements     {} up to {:.3} m, in {} clusters",
            scene.elements, self.element_size, self.clusters
        )?;
        let single = self.memory_per_rank.iter().filter(|memory| memory.rings == 1);
        let single: Vec<String> = single.map(|m| format!("{} on each of {}", in_words(m.bytes), m.ranks)).collect();
        writeln!(out, "memory       about {}; in a ring {}", in_words(self.memory_bytes), single.join(", "))?;
        match &self.forecast {
            None => {
                writeln!(out, "solve        nothing shines: bake would refuse the scene; --sky RADIANCE lights it")?
            }
            Some(f) => {
                let how = if f.measured { "measured" } else { "given" };
                let (rate, cells, rays) = (f.rays_per_second / 1e6, self.cells, f.rays);
                match (f.error, f.until) {
                    (Some(error), _) => writeln!(
                        out,
                        "solve        by groups to an error of {} %: {} elements look about along {rays:.3e} rays",
                        100.0 * error,
                        f.own_elements.unwrap_or(0)
                    )?,
                    (None, until) => writeln!(
                        out,
                        "solve        to {} % unshot with {cells} cells: about {:.0} shots, {rays:.3e} rays",
                        100.0 * until.unwrap_or(0.0),
                        f.shots
                    )?,
                }
                writeln!(out, "time         about {} at {rate:.2} M rays/s ({how})", duration(f.seconds))?;
            }
        }
        for w in &self.warnings {
            writeln!(out, "warning      {}", warning(&w.message, w.count, &w.first_place))?;
        }
        Ok(())
    }
}

fn list(named: &[Named]) -> String {
    const SHOWN: usize = 8;
    let mut names: Vec<String> = named.iter().take(SHOWN).map(|n| format!("'{}' ({})", n.name, n.kind)).collect();
    if named.len() > SHOWN {
        names.push(format!("{} more", named.len() - SHOWN));
    }
    names.join(", ")
}

/// Ends a trial when it has taken its time.
struct Trial(Instant);

impl Observer for Trial {
    fn control(&mut self) -> Control {
        let late = self.0.elapsed().as_secs_f64() >= TRIAL;
        Control { stop: late.then_some(StopReason::TimeLimit), ..Control::default() }
    }
}

/// Foretells the solve; the speed is that of a trial, or as given.
fn forecast(
    scene: &Description,
    mut mesh: Mesh,
    settings: SolveSettings,
    rule: &StopRule,
    given: Option<f64>,
) -> Result<Forecast, Failure> {
    let sky = settings.sky.map_or(0, |radiance| shooting::skies(radiance, 1, 1.0).len());
    let emitters = scene.lights.len() + sky;
    let rays_per_second = match given {
        Some(given) => given,
        None => {
            let hierarchy = Arc::new(mesh::hierarchy(&mesh));
            mesh::find_valid_samples(&mut mesh, &hierarchy);
            match settings.solver {
                Solver::Plain | Solver::PlainTo(_) => trial(scene, &mesh, hierarchy, settings, rule)?,
                Solver::Group(_) => estimate::looks_per_second(&mesh, &hierarchy, TRIAL),
            }
        }
    };
    let found = |rays: f64| (rays, rays_per_second, given.is_none(), rays / rays_per_second.max(1.0));
    Ok(match settings.solver {
        Solver::Plain | Solver::PlainTo(_) => {
            let work = estimate::work(&mesh, emitters, settings.cells, rule.until);
            let (rays, rays_per_second, measured, seconds) = found(work.rays);
            let (shots, until) = (work.shots, Some(rule.until));
            Forecast {
                solver: "plain",
                error: None,
                until,
                own_elements: None,
                shots,
                rays,
                rays_per_second,
                measured,
                seconds,
            }
        }
        Solver::Group(error) => {
            let counts = GroupCounts::of(&mesh);
            let (rays, rays_per_second, measured, seconds) = found(counts.rays(error));
            let (shots, error, own_elements) = (emitters as f64, Some(error), Some(counts.own));
            Forecast {
                solver: "group",
                error,
                until: None,
                own_elements,
                shots,
                rays,
                rays_per_second,
                measured,
                seconds,
            }
        }
    })
}

/// Rays per second of plain refinement.
fn trial(
    scene: &Description,
    mesh: &Mesh,
    hierarchy: Arc<Hierarchy>,
    settings: SolveSettings,
    rule: &StopRule,
) -> Result<f64, Failure> {
    let ranks = &mut Communicator::alone();
    let mut ring = Ring::alone(mesh, hierarchy);
    let world = World::new(&mut ring, &scene.lights, settings, ranks)?;
    let mut state = State::new(&world, ranks)?;
    let start = Instant::now();
    let (_, progress) = solve::plain(&world, &mut ring, &mut state, rule, ranks, &mut Trial(start))?;
    Ok(progress.rays as f64 / start.elapsed().as_secs_f64())
}
