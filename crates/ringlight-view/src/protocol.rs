//! The words between server and page; the README describes them.

use ringlight::mesh::Mesh;
use ringlight::quantity::Rgb;
use ringlight::scene::Wrap;
use ringlight::solve::{Energy, StopReason};
use serde::{Deserialize, Serialize};

/// Version of the protocol: a page of another version says so and shows nothing.
pub const VERSION: u32 = 1;

/// What the records of a binary message are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Kind {
    /// Geometry of clusters.
    Geometry = 1,
    /// Light of clusters.
    Light = 2,
    /// Who owns and who holds what.
    Places = 3,
}

impl Kind {
    /// A message without records.
    pub(crate) fn begin(self) -> Vec<u8> {
        (self as u32).to_le_bytes().to_vec()
    }
}

/// What is shown.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Hello {
    /// [`VERSION`].
    pub protocol: u32,
    /// Version of the program.
    pub version: &'static str,
    /// Name of the scene.
    pub name: String,
    /// Whether irradiance is in lux, and not in W/m².
    pub photometric: bool,
    /// Whether the solver goes on, and can be paused and stopped.
    pub live: bool,
    /// Number of clusters.
    pub clusters: usize,
    /// Number of patches.
    pub patches: usize,
    /// Number of elements.
    pub elements: usize,
    /// Number of ranks.
    pub ranks: usize,
    /// Unshot share at which the solver stops.
    pub until: f64,
    /// What is to be added to positions for world coordinates, metres.
    pub origin: [f64; 3],
    /// Box around the scene, metres: lower and upper corner.
    pub bounds: [[f32; 3]; 2],
    /// Surfaces.
    pub surfaces: Vec<Surface>,
    /// Cameras.
    pub cameras: Vec<Camera>,
    /// Radiance of the sky behind everything.
    pub sky: Rgb,
}

/// A surface of the scene.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Surface {
    /// Name.
    pub name: String,
    /// What its reflectance is drawn with in detail.
    pub texture: Option<Texture>,
}

/// A texture, and how it is used.
#[derive(Clone, Debug, Serialize)]
pub struct Texture {
    /// Number of the image.
    pub image: u32,
    /// Wrapping along u and v.
    pub wrap: [Wrap; 2],
    /// Whether magnified texels stay sharp.
    pub nearest: bool,
    /// What texels are multiplied with.
    pub factor: Rgb,
    /// Alpha below which nothing is there.
    pub cutoff: f32,
}

/// A camera of the scene.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Camera {
    /// Name.
    pub name: String,
    /// Camera-to-scene transformation, column-major; it looks along its −z.
    pub matrix: [[f64; 4]; 4],
    /// Vertical field of view, radians; 0 for an orthographic camera.
    pub field_of_view: f64,
    /// Half height of an orthographic view, metres.
    pub half_height: f64,
}

/// What the command is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Phase {
    /// It solves.
    #[default]
    Solve,
    /// It waits because a watcher wants it to.
    Pause,
    /// It writes.
    Write,
    /// It has nothing more to do.
    Done,
}

/// How far the solver is.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Status {
    /// What it is doing.
    pub phase: Phase,
    /// Why it has ended.
    pub ended: Option<StopReason>,
    /// Seconds since the command began.
    pub seconds: f64,
    /// Shots so far.
    pub shots: u64,
    /// Unshot power over emitted power.
    pub unshot_share: f64,
    /// Rays in this run.
    pub rays: u64,
    /// Rays per second.
    pub rays_per_second: f64,
    /// Seconds that are left, as far as can be told.
    pub time_left: Option<f64>,
    /// The audit when the light was last shown.
    pub energy: Option<Energy>,
    /// Ambient irradiance when the light was last shown, W/m² or lux.
    pub ambient: Rgb,
    /// Loads between the last two times that the light was shown.
    pub ranks: Vec<Load>,
}

/// What a rank did with its time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Load {
    /// CPU time of its own work, seconds.
    pub busy: f64,
    /// Time spent waiting for other ranks, seconds.
    pub wait: f64,
}

/// A point of the curves: seconds, shots, and shares of the emitted power: unshot, absorbed, absorbed by backs, escaped; no
/// number where it is not known yet.
pub type Point = [f64; 6];

impl Status {
    pub(crate) fn point(&self) -> Point {
        let share = |of: fn(&Energy) -> f64| {
            self.energy.as_ref().filter(|e| e.emitted > 0.0).map_or(f64::NAN, |e| of(e) / e.emitted)
        };
        let (absorbed, backs, escaped) = (share(|e| e.absorbed), share(|e| e.absorbed_by_backs), share(|e| e.escaped));
        [self.seconds, self.shots as f64, self.unshot_share, absorbed, backs, escaped]
    }
}

/// The curves so far.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Curves<'a> {
    points: &'a [Point],
}

impl<'a> Curves<'a> {
    pub(crate) fn of(points: &'a [Point]) -> Curves<'a> {
        Curves { points }
    }
}

/// A text as it is sent: an object with one entry, named after what it holds.
pub(crate) fn text<T: Text>(value: &T) -> String {
    let value = serde_json::to_string(value).unwrap_or_else(|_| "null".into());
    format!("{{\"{}\":{value}}}", T::NAME)
}

/// What is sent as text.
pub(crate) trait Text: Serialize {
    /// Its name.
    const NAME: &'static str;
}

impl Text for Hello {
    const NAME: &'static str = "hello";
}

impl Text for Status {
    const NAME: &'static str = "status";
}

impl Text for Curves<'_> {
    const NAME: &'static str = "curves";
}

/// What a page says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Word {
    /// It has shown what it was sent, and can take more.
    Ready,
    /// The solver is to wait.
    Pause,
    /// The solver is to go on.
    Resume,
    /// The solver is to stop, and what is there to be saved.
    Stop,
}

/// The record of who owns and who holds what: the owner of each cluster, then for each patch the rank that holds its
/// geometry for the ring of rank 0.
pub fn places(mesh: &Mesh, owners: &[u32], holder: impl Fn(u32) -> usize) -> Vec<u8> {
    let holders = mesh.patch_facets.iter().map(|code| holder(code >> 1) as u16);
    let ranks = owners.iter().map(|&rank| rank as u16).chain(holders);
    let mut record: Vec<u8> = ranks.flat_map(u16::to_le_bytes).collect();
    record.resize(record.len().next_multiple_of(4), 0);
    record
}
