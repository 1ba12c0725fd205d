//! The command line: a contract that scripts rely on.

mod choices;
mod examples;

pub use choices::*;

use crate::outputs::Output;
use crate::values::{self, CheckpointChoice, ExposureChoice, Matrix, PictureSize, RingsChoice};
use clap::{Args, Parser, Subcommand};
use examples::*;
use ringlight::probe::GridRequest;
use std::path::PathBuf;

/// Bakes light into 3D scenes: glTF or OBJ in; a lit model, pictures, lux values out.
#[derive(Debug, Parser)]
#[command(name = "ringlight", version, about, after_help = EXAMPLES)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub verb: Verb,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Verb {
    /// Solve a scene's light and write it
    #[command(after_help = BAKE_EXAMPLES)]
    Bake(Box<Bake>),
    /// Go on from a solution or checkpoint, exactly where it stopped
    #[command(after_help = RESUME_EXAMPLES)]
    Resume(Box<Resume>),
    /// Write any output of a solution again
    #[command(after_help = EXPORT_EXAMPLES)]
    Export(Export),
    /// Draw a picture of a solution from any camera
    #[command(after_help = RENDER_EXAMPLES)]
    Render(Export),
    /// Tell the irradiance at points or on a calculation grid of a solution
    #[command(after_help = PROBE_EXAMPLES)]
    Probe(Box<Probe>),
    /// Tell what is in a scene, what will be ignored, and how big the solve will be
    #[command(after_help = INSPECT_EXAMPLES)]
    Inspect(Inspect),
    /// Area-averaged form factors between the objects or faces of a scene, obstructed
    #[command(name = "viewfactors", after_help = VIEW_FACTOR_EXAMPLES)]
    ViewFactors(ViewFactors),
    /// Show a scene in the browser while it is solved, or a solution, until interrupted
    #[command(
        after_help = VIEW_EXAMPLES,
        mut_arg("scene", |scene| scene.value_name("SCENE|SOLUTION").help("Scene (.glb, .gltf, .obj) or solution (.ringlight)")),
        mut_arg("output", |output| output.required(false))
    )]
    View(Box<Bake>),
    /// Print the completion script of a shell
    #[command(after_help = COMPLETIONS_EXAMPLES)]
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
}

/// `bake`.
#[derive(Debug, Args)]
pub struct Bake {
    /// Scene: .glb, .gltf or .obj
    pub scene: PathBuf,
    #[command(flatten)]
    pub targets: Targets,
    #[command(flatten)]
    pub sizes: SizeArguments,
    #[command(flatten)]
    pub method: MethodArguments,
    #[command(flatten)]
    pub stop: StopArguments,
    #[command(flatten)]
    pub display: DisplayArguments,
    #[command(flatten)]
    pub spread: SpreadArguments,
    #[command(flatten)]
    pub running: RunArguments,
}

/// `resume`.
#[derive(Debug, Args)]
pub struct Resume {
    /// Solution or checkpoint (.ringlight)
    pub solution: PathBuf,
    /// Scene to take textures from; without it they are looked for beside the solution
    #[arg(long, value_name = "FILE")]
    pub scene: Option<PathBuf>,
    #[command(flatten)]
    pub targets: Targets,
    #[command(flatten)]
    pub stop: StopArguments,
    #[command(flatten)]
    pub display: DisplayArguments,
    #[command(flatten)]
    pub spread: SpreadArguments,
    #[command(flatten)]
    pub running: RunArguments,
}

/// `export` and `render`.
#[derive(Debug, Args)]
pub struct Export {
    /// Solution (.ringlight)
    pub solution: PathBuf,
    /// Scene to take textures from; without it they are looked for beside the solution
    #[arg(long, value_name = "FILE")]
    pub scene: Option<PathBuf>,
    #[command(flatten)]
    pub targets: Targets,
    #[command(flatten)]
    pub display: DisplayArguments,
    #[command(flatten)]
    pub spread: SpreadArguments,
    /// Threads of each rank; its share of the cores by default
    #[arg(long, value_name = "N", value_parser = values::threads)]
    pub threads: Option<usize>,
    /// Write a report as JSON: what each rank did for the picture
    #[arg(long, value_name = "FILE.json")]
    pub report: Option<PathBuf>,
    /// Say what each rank did for the picture
    #[arg(long, short)]
    pub verbose: bool,
    /// Say nothing but errors
    #[arg(long, short, conflicts_with = "verbose")]
    pub quiet: bool,
}

/// `probe`.
#[derive(Debug, Args)]
pub struct Probe {
    /// Solution (.ringlight)
    pub solution: PathBuf,
    /// Points with normals, CSV
    #[arg(long, value_name = "CSV", required_unless_present = "grid", conflicts_with = "grid")]
    pub points: Option<PathBuf>,
    /// Grid of points: the top of an object (or the front of a flat one), a rectangle by two opposite corners, or a
    /// parallelogram by a corner and the two beside it; @ the largest distance between points, metres. A rectangle that
    /// lies looks up; three corners look to where they run counter-clockwise
    #[arg(long, value_name = "OBJECT|x,y,z;x,y,z[;x,y,z]@M", allow_hyphen_values = true)]
    pub grid: Option<GridRequest>,
    /// Height of the grid over its area, metres, along the normal
    #[arg(long, value_name = "M", default_value = "0", value_parser = values::number, allow_hyphen_values = true)]
    pub height: f64,
    /// Output: .csv rows of points, .png false-colour picture of a grid; may be repeated
    #[arg(short, long = "output", value_name = "OUT", required_unless_present = "grid", value_parser = values::output)]
    pub output: Vec<Output>,
    /// Overwrite files that are there
    #[arg(long)]
    pub force: bool,
    /// Gather light at the point, or read what the nearest surface shows
    #[arg(long, value_enum, default_value = "gather")]
    pub how: HowChoice,
    /// Gather: most cells of a patch, or of each part of one; 64 by default
    #[arg(long, value_name = "1|4|16|64", value_parser = values::cells)]
    pub cells: Option<u32>,
    /// Gather: share of a point's light by which a patch may be off before it is cut into parts; 2e-5 by default
    #[arg(long, value_name = "SHARE", value_parser = values::positive)]
    pub tolerance: Option<f64>,
    /// Surface: how far the surface may be, metres; the size of elements by default
    #[arg(long, value_name = "M", value_parser = values::positive)]
    pub reach: Option<f64>,
    #[command(flatten)]
    pub spread: SpreadArguments,
    /// Threads of each rank; its share of the cores by default. The result does not depend on it
    #[arg(long, value_name = "N", value_parser = values::threads)]
    pub threads: Option<usize>,
    /// Say nothing but errors
    #[arg(long, short)]
    pub quiet: bool,
}

/// `inspect`.
#[derive(Debug, Args)]
pub struct Inspect {
    /// Scene: .glb, .gltf or .obj
    pub scene: PathBuf,
    #[command(flatten)]
    pub sizes: SizeArguments,
    #[command(flatten)]
    pub method: MethodArguments,
    /// Plain refinement: unshot share down to which to foretell; 0.01 by default
    #[arg(long, value_name = "SHARE", value_parser = values::share)]
    pub until: Option<f64>,
    /// Foretell with this speed instead of measuring for a second
    #[arg(long, value_name = "R", value_parser = values::positive)]
    pub rays_per_second: Option<f64>,
    /// Threads; all cores by default
    #[arg(long, value_name = "N", value_parser = values::threads)]
    pub threads: Option<usize>,
    /// As JSON
    #[arg(long)]
    pub json: bool,
}

/// `viewfactors`.
#[derive(Debug, Args)]
pub struct ViewFactors {
    /// Scene: .glb, .gltf or .obj
    pub scene: PathBuf,
    /// Matrix, by ending: .csv table, .npy NumPy array; may be repeated
    #[arg(short, long = "output", value_name = "OUT", required = true, value_parser = values::matrix)]
    pub output: Vec<Matrix>,
    /// Estimated errors of the factors, in the same form: .csv or .npy
    #[arg(long, value_name = "FILE", value_parser = values::matrix)]
    pub errors: Option<Matrix>,
    /// What has a row: objects by name, or every face of the file
    #[arg(long, value_enum, default_value = "object")]
    pub per: PerChoice,
    /// Which sides of faces see and are seen
    #[arg(long, value_enum, default_value = "front")]
    pub sides: SidesChoice,
    /// Estimated error that partly hidden faces may have, as a share of F; a factor between two polygons may always be off
    /// by 0.005 times this
    #[arg(long, value_name = "SHARE", default_value = "0.001", value_parser = values::tolerance)]
    pub tolerance: f64,
    /// Write only factors of at least F, a line each: from,to,area,factor,error
    #[arg(long, value_name = "F", value_parser = values::least)]
    pub min: Option<f64>,
    /// Unit of an OBJ file's lengths; metres by default
    #[arg(long, value_enum)]
    pub unit: Option<UnitChoice>,
    /// Ranks, as threads of this process; each has a share of the rows, and all of the scene. Under an MPI launcher its -n says
    /// how many there are
    #[arg(long, value_name = "N", value_parser = values::threads)]
    pub ranks: Option<usize>,
    /// Threads of each rank; its share of the cores by default. The result does not depend on it
    #[arg(long, value_name = "N", value_parser = values::threads)]
    pub threads: Option<usize>,
    /// Write an audit as JSON: counts, row sums, reciprocity, estimates
    #[arg(long, value_name = "FILE.json")]
    pub report: Option<PathBuf>,
    /// Progress on standard error; auto: a bar on terminals, else plain lines
    #[arg(long, value_enum, default_value = "auto")]
    pub progress: ProgressChoice,
    /// Say nothing but errors
    #[arg(long, short)]
    pub quiet: bool,
    /// Overwrite files that are there
    #[arg(long)]
    pub force: bool,
}

/// Where results go.
#[derive(Debug, Args)]
pub struct Targets {
    /// Output, by ending: .glb .gltf lit model, .ringlight solution, .csv .vtu elements, .png .exr picture; may be repeated
    #[arg(short, long = "output", value_name = "OUT", required = true, value_parser = values::output)]
    pub output: Vec<Output>,
    /// Overwrite files that are there
    #[arg(long)]
    pub force: bool,
}

/// How finely surfaces are cut, and the unit of their lengths.
#[derive(Debug, Args)]
pub struct SizeArguments {
    /// Preset for sizes and cells
    #[arg(long, value_enum, default_value = "normal")]
    pub quality: QualityChoice,
    /// Largest edge of a patch, metres; chosen from the scene by default
    #[arg(long, value_name = "M", value_parser = values::positive)]
    pub patch_size: Option<f64>,
    /// Largest edge of an element, metres; chosen from the scene by default
    #[arg(long, value_name = "M", value_parser = values::positive)]
    pub element_size: Option<f64>,
    /// Cut large faces along the straight edges of the shadows of so many area lights, the strongest, and where things stand on them
    #[arg(long, value_name = "LIGHTS", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=256))]
    pub lines: u32,
    /// Unit of an OBJ file's lengths; metres by default
    #[arg(long, value_enum)]
    pub unit: Option<UnitChoice>,
    /// Keep what grows with the scene in files in this folder, not in memory
    #[arg(long, value_name = "DIR")]
    pub scratch: Option<PathBuf>,
}

/// How light is solved.
#[derive(Debug, Args)]
pub struct MethodArguments {
    /// Cut elements in nine where light changes much, up to so many times: edges of shadows, contacts
    #[arg(long, value_name = "TIMES", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=5))]
    pub adapt: u32,
    /// Method: group shooting, which finds all light at once, the default; or plain progressive refinement, also chosen by any
    /// flag that is for it alone
    #[arg(long, value_enum)]
    pub solver: Option<SolverChoice>,
    /// Error relative to each place's own light, 0.01 by default. With --solver plain: each shadow takes as many cells as this asks
    /// for, 1 to 64, by the light at stake
    #[arg(long, value_name = "SHARE", value_parser = values::tolerance)]
    pub error: Option<f64>,
    /// Plain refinement: cells of a shooter; 4 for draft, 16 for normal, 64 for high quality by default. Also those of each part
    /// of a sky
    #[arg(long, value_name = "1|4|16|64", value_parser = values::cells)]
    pub cells: Option<u32>,
    /// Plain refinement: what a patch shoots, the light of its elements, the default, or their average everywhere
    #[arg(long, value_enum)]
    pub shoot: Option<ShootChoice>,
    /// Plain refinement: most shots under way at once, so that many ranks need not wait for each other; decides the order of
    /// shots. 1 by default
    #[arg(long, value_name = "K", value_parser = values::shooters)]
    pub shooters_in_flight: Option<u32>,
    /// Radiance of a uniform sky above the horizon, one number or R,G,B
    #[arg(long, value_name = "RADIANCE", value_parser = values::radiance)]
    pub sky: Option<[f32; 3]>,
}

/// When to stop.
#[derive(Clone, Copy, Debug, Default, Args)]
pub struct StopArguments {
    /// Plain refinement: stop when this share of the emitted power is unshot; 0.01 by default
    #[arg(long, value_name = "SHARE", value_parser = values::share)]
    pub until: Option<f64>,
    /// Plain refinement: stop after this many shots in all, those before a resume included
    #[arg(long, value_name = "N")]
    pub max_shots: Option<u64>,
    /// Stop this many seconds after the start of the command, and write what is there
    #[arg(long, value_name = "S", value_parser = values::positive)]
    pub time_limit: Option<f64>,
}

/// How results are shown.
#[derive(Clone, Debug, Args)]
pub struct DisplayArguments {
    /// Show the light that is still unshot as ambient light; never in exported numbers
    #[arg(long)]
    pub ambient: bool,
    /// Camera: a name in the scene, or position;target;vertical field of view in degrees
    #[arg(long, value_name = "NAME|ex,ey,ez;tx,ty,tz;fov", value_parser = values::camera, allow_hyphen_values = true)]
    pub camera: Option<String>,
    /// Size of pictures, pixels
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = values::size)]
    pub size: PictureSize,
    /// Exposure value at ISO 100, or auto
    #[arg(long, value_name = "EV|auto", default_value = "auto", value_parser = values::exposure, allow_hyphen_values = true)]
    pub exposure: ExposureChoice,
    /// Tone mapping of PNG pictures
    #[arg(long, value_enum, default_value = "filmic")]
    pub tone: ToneChoice,
    /// Draw a quantity in false colour, with a legend
    #[arg(long, value_enum)]
    pub false_colour: Option<FalseColourChoice>,
    /// How pictures are divided among ranks; they are the same either way
    #[arg(long, value_enum, default_value = "scanlines")]
    pub split: SplitChoice,
}

/// How the work is spread over ranks. Nothing of it changes the result.
#[derive(Clone, Debug, Args)]
pub struct SpreadArguments {
    /// Ranks, as threads of this process; each has a share of the light and of the geometry. Under an MPI launcher its -n says
    /// how many there are
    #[arg(long, value_name = "N", value_parser = values::threads)]
    pub ranks: Option<usize>,
    /// Rings into which the ranks are divided; each ring holds the whole geometry. auto: as many as memory allows
    #[arg(long, value_name = "R|auto", default_value = "auto", value_parser = values::rings)]
    pub rings: RingsChoice,
    /// Memory that a rank may use, as in 2GiB or 500MB, or that each may, separated by commas; by default its share of what the
    /// system has left
    #[arg(long, value_name = "SIZE", value_parser = values::memory, value_delimiter = ',')]
    pub memory_per_rank: Vec<u64>,
    /// Most sample points that travel between ranks and are tested together; a good number by default
    #[arg(long, value_name = "N", value_parser = values::packet_size)]
    pub packet_size: Option<usize>,
    /// How geometry is dealt out in a ring
    #[arg(long, value_enum, default_value = "spatial")]
    pub shards: ShardsChoice,
    /// Which members of a ring a packet visits
    #[arg(long, value_enum, default_value = "boxes")]
    pub routing: RoutingChoice,
}

/// How a solve is watched in the browser. Nothing of it changes the result.
#[derive(Clone, Debug, Args)]
pub struct ViewArguments {
    /// Show the solve in the browser while it goes on; the link is printed. ADDR is host:port, or a port: 127.0.0.1 and a free
    /// port by default. Where others can reach it, the link holds a token
    #[arg(long, value_name = "ADDR", num_args = 0..=1, require_equals = true, default_missing_value = VIEW_ADDRESS, value_parser = values::address)]
    pub view: Option<String>,
    /// Shots between two updates of what is shown; by time as it costs little by default
    #[arg(long, value_name = "P", value_parser = clap::value_parser!(u64).range(1..))]
    pub view_every: Option<u64>,
    /// Go on showing when all is done, until interrupted
    #[arg(skip)]
    pub stay: bool,
}

/// Where the page is served unless something else is asked for.
pub const VIEW_ADDRESS: &str = "127.0.0.1:0";

/// How the command runs.
#[derive(Debug, Args)]
pub struct RunArguments {
    /// Threads of each rank; its share of the cores by default. The result does not depend on it
    #[arg(long, value_name = "N", value_parser = values::threads)]
    pub threads: Option<usize>,
    /// Write the solution to FILE as it goes, every SECONDS (60 by default) and at the end
    #[arg(long, value_name = "FILE[@SECONDS]", value_parser = values::checkpoint)]
    pub checkpoint: Option<CheckpointChoice>,
    /// Write a report as JSON
    #[arg(long, value_name = "FILE.json")]
    pub report: Option<PathBuf>,
    /// Progress on standard error; auto: a bar on terminals, else plain lines
    #[arg(long, value_enum, default_value = "auto")]
    pub progress: ProgressChoice,
    #[command(flatten)]
    pub view: ViewArguments,
    /// Say more: sizes, stages and their times
    #[arg(long, short)]
    pub verbose: bool,
    /// Say nothing but errors
    #[arg(long, short, conflicts_with = "verbose")]
    pub quiet: bool,
}
