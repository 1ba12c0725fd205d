//! The JSON report of a run. Modules own their parts ([`Energy`], [`Progress`], [`Warnings`]); this nests them. The library
//! reads no clock: seconds and memory are passed in.

use super::picture::{Drawn, PictureLoad, max_over_mean};
use crate::mesh::Mesh;
use crate::ring::Window;
use crate::scene::Warnings;
use crate::solution::Description;
use crate::solve::{Energy, Progress, Solver, StopReason};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// Name and version of the report's form.
pub const SCHEMA: &str = "ringlight-report-1";

/// A report.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Version of the program.
    pub version: &'static str,
    /// The command line.
    pub command: Vec<String>,
    /// Units of all numbers here and in the outputs.
    pub units: Units,
    /// What was ignored or changed.
    pub warnings: Vec<ReportedWarning>,
    /// What was lit.
    pub scene: SceneReport,
    /// Settings in force; the program's part.
    pub settings: serde_json::Value,
    /// What the solver did.
    pub solve: SolveReport,
    /// Wall-clock time of each stage.
    pub seconds: Seconds,
    /// Where the power went.
    pub energy: Energy,
    /// Share of the lit model's vertices that were clipped to 1; 0 when none was written.
    pub clipped: f64,
    /// The largest private memory of all ranks; 0 where the system does not tell.
    pub peak_memory_bytes: u64,
    /// See [`crate::solution::digest`].
    pub solution_digest: String,
    /// One entry for each rank.
    pub ranks: Vec<RankReport>,
    /// How the picture was drawn, if there was one.
    pub picture: Option<PictureReport>,
    /// How the load was balanced between the members of the first ring, window by window.
    pub balance: Vec<WindowReport>,
}

/// Units by quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Units {
    /// Of lengths.
    pub length: &'static str,
    /// Of power.
    pub power: &'static str,
    /// Of irradiance.
    pub irradiance: &'static str,
    /// Of radiosity and exitance.
    pub radiosity: &'static str,
    /// Of radiance.
    pub radiance: &'static str,
}

impl Units {
    /// Those of glTF.
    pub const PHOTOMETRIC: Units =
        Units { length: "m", power: "lm", irradiance: "lx", radiosity: "lm/m2", radiance: "cd/m2" };

    /// Those of OBJ, whose `Ke` is radiance.
    pub const RADIOMETRIC: Units =
        Units { length: "m", power: "W", irradiance: "W/m2", radiosity: "W/m2", radiance: "W/(m2 sr)" };

    /// Those of the file that the scene came from.
    pub fn of(description: &Description) -> Units {
        let file = description.surfaces.first().map_or("", |s| &s.place.file);
        if file.to_ascii_lowercase().ends_with(".obj") { Units::RADIOMETRIC } else { Units::PHOTOMETRIC }
    }
}

/// A warning with its place in words.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ReportedWarning {
    /// Stable name.
    pub code: String,
    /// A sentence for people.
    pub message: String,
    /// How often.
    pub count: u64,
    /// Where first.
    pub first_place: String,
}

/// The warnings of a run.
pub fn warnings(warnings: &Warnings) -> Vec<ReportedWarning> {
    let reported = warnings.0.iter().map(|w| ReportedWarning {
        code: w.code.clone(),
        message: w.message.clone(),
        count: w.count,
        first_place: w.first_place.to_string(),
    });
    reported.collect()
}

/// What was lit.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SceneReport {
    /// Triangles in the file, instances counted each.
    pub triangles: u64,
    /// Patches.
    pub patches: u64,
    /// Elements.
    pub elements: u64,
    /// Nodes with surfaces.
    pub objects: u64,
    /// Punctual lights.
    pub lights: u64,
    /// Triangles left out, by reason.
    pub skipped: BTreeMap<String, u64>,
}

impl SceneReport {
    /// Counts.
    pub fn new(description: &Description, mesh: &Mesh) -> SceneReport {
        let nodes: BTreeSet<u32> = description.surfaces.iter().map(|s| s.node).collect();
        SceneReport {
            triangles: description.surfaces.iter().map(|s| s.triangles).sum(),
            patches: mesh.patch_count() as u64,
            elements: mesh.element_count() as u64,
            objects: nodes.len() as u64,
            lights: description.lights.len() as u64,
            skipped: mesh.skipped.iter().cloned().collect(),
        }
    }
}

/// What the solver did.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SolveReport {
    /// Shots, those before a resume included.
    pub shots: u64,
    /// Rays in this run.
    pub rays: u64,
    /// Masks in this run.
    pub masks: u64,
    /// Masks that needed no ray.
    pub masks_without_rays: u64,
    /// Rays in this run fewer than with 16 cells for each mask that needed some; 0 unless cells are chosen by the light at stake.
    pub rays_saved: u64,
    /// Unshot power over emitted power.
    pub unshot_share: f64,
    /// Why it ended.
    pub stop_reason: StopReason,
}

impl SolveReport {
    /// Of a finished run with this solver.
    pub fn new(progress: &Progress, solver: Solver, stop_reason: StopReason) -> SolveReport {
        let Progress { shots, unshot_share, rays, masks, masks_without_rays, .. } = *progress;
        let chosen = matches!(solver, Solver::PlainTo(_));
        let rays_saved = if chosen { (16 * (masks - masks_without_rays)).saturating_sub(rays) } else { 0 };
        SolveReport { shots, rays, masks, masks_without_rays, rays_saved, unshot_share, stop_reason }
    }
}

/// Wall-clock seconds of the stages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Seconds {
    /// Reading the scene.
    pub load: f64,
    /// Patches, elements, clusters.
    pub mesh: f64,
    /// The hierarchy, and which samples lie free.
    pub build: f64,
    /// Shots.
    pub solve: f64,
    /// Outputs.
    pub write: f64,
    /// All of it.
    pub total: f64,
}

/// Some shots of the first ring, over which its members' busy times were added up.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WindowReport {
    /// Number of shots.
    pub shots: u64,
    /// Busy time of the slowest member, CPU seconds.
    pub slowest_seconds: f64,
    /// Busy time of the fastest member over that of the slowest.
    pub fastest_over_slowest: f64,
    /// Rank correlation of the members' busy times with those of the window before; 1 if the slowest stayed the slowest.
    pub rank_correlation: Option<f64>,
    /// Pieces of geometry that moved when it ended.
    pub pieces_moved: usize,
}

impl WindowReport {
    /// Of a window.
    pub fn new(window: &Window) -> WindowReport {
        WindowReport {
            shots: window.shots,
            slowest_seconds: window.slowest,
            fastest_over_slowest: window.balance,
            rank_correlation: window.correlation,
            pieces_moved: window.moved,
        }
    }
}

/// Name and version of the form of [`RenderReport`].
pub const RENDER_SCHEMA: &str = "ringlight-render-report-1";

/// What was drawn of a solution.
#[derive(Clone, Debug, Serialize)]
pub struct RenderReport {
    /// [`RENDER_SCHEMA`].
    pub schema: &'static str,
    /// Version of the program.
    pub version: &'static str,
    /// The command line.
    pub command: Vec<String>,
    /// How the picture was drawn, if there was one.
    pub picture: Option<PictureReport>,
}

/// How a picture was drawn.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PictureReport {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// How it was divided among ranks: `tiles` or `scanlines`.
    pub split: &'static str,
    /// By how much the rank that had most exceeds the mean.
    pub max_over_mean: PictureBalance,
    /// What each rank did.
    pub ranks: Vec<PictureLoad>,
}

/// For a picture, the largest load of a rank over the mean of all.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PictureBalance {
    /// Of pixels.
    pub pixels: f64,
    /// Of rays of sight.
    pub rays: f64,
    /// Of nodes and triangles looked at.
    pub searched: f64,
    /// Of the memory of light between sample points.
    pub light_bytes: f64,
}

impl PictureReport {
    /// Of what was drawn.
    pub fn new(drawn: &Drawn) -> PictureReport {
        let Drawn { picture, split, loads } = drawn;
        PictureReport {
            width: picture.width,
            height: picture.height,
            split: split.name(),
            max_over_mean: PictureBalance {
                pixels: max_over_mean(loads, |load| load.pixels),
                rays: max_over_mean(loads, |load| load.rays),
                searched: max_over_mean(loads, |load| load.searched),
                light_bytes: max_over_mean(loads, |load| load.light_bytes),
            },
            ranks: loads.clone(),
        }
    }
}

/// One rank's share.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RankReport {
    /// Number of the rank.
    pub rank: u32,
    /// Ring it is in.
    pub ring: u32,
    /// Patches it owns.
    pub patches: u64,
    /// Elements it owns.
    pub elements: u64,
    /// Triangles in its shard.
    pub shard_triangles: u64,
    /// CPU time of its threads: its own work. Waiting sleeps.
    pub busy_seconds: f64,
    /// Wall-clock time spent waiting for messages of others.
    pub wait_seconds: f64,
    /// Bytes sent to others.
    pub bytes_sent: u64,
    /// Packets that visited it.
    pub packets_visited: u64,
    /// The largest private memory of its process, which it may share with other ranks.
    pub peak_memory_bytes: u64,
}
