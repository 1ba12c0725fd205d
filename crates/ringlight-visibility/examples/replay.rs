//! Replays a set of shadow rays (RLRAYS01) against a mesh (RLTRIS01) and prints one JSON object.
//!
//! ```text
//! replay SCENE.tris FILE.rays [--threads N] [--runs K] [--masks OUT] [--instructions avx512|avx2|portable]
//!        [--scattered] [--job N]
//! ```
//!
//! The rays of a shooter are its cells as points; where they are a regular grid they are replayed as one, but not with
//! `--scattered`. `--job` is how many receivers are asked about at a time, 4096 if not given. `--masks` writes a
//! little-endian u64 per (shooter, receiver) pair in the file's order, bit k set where cell k is visible.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use ringlight_visibility::{
    Cells, Grid, Hierarchy, InstructionSet, Layout, NO_PLANE, OPAQUE, Points, Shooter, Triangle,
};

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let options = Options::parse(std::env::args().skip(1))?;
    let triangles = read_triangles(&std::fs::read(&options.scene)?)?;
    let rays = Rays::read(&std::fs::read(&options.rays)?, options.scattered)?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(options.threads).build()?;

    let begin = Instant::now();
    let hierarchy = pool.install(|| Hierarchy::build(triangles, Vec::new())).with_instruction_set(options.instructions);
    let build_seconds = begin.elapsed().as_secs_f64();

    let (mut seconds, mut masks) = (Vec::new(), Vec::new());
    for _ in 0..options.runs.max(1) {
        let begin = Instant::now();
        masks = pool.install(|| replay(&hierarchy, &rays, &options));
        seconds.push(begin.elapsed().as_secs_f64());
    }
    let count = (masks.len() * rays.cells) as f64;
    let visible: u64 = masks.iter().map(|mask| u64::from(mask.count_ones())).sum();
    let mut sorted = seconds.clone();
    sorted.sort_by(f64::total_cmp);
    let grids = rays.shooters.iter().filter(|s| matches!(s.cells, Cells::Grid(_))).count();
    let report = serde_json::json!({
        "rays": count as u64,
        "blocked": count as u64 - visible,
        "build_seconds": build_seconds,
        "seconds": seconds,
        "mrays_per_second": count / sorted[sorted.len() / 2] / 1e6,
        "hierarchy_bytes": hierarchy.hierarchy_bytes(),
        "bytes_per_triangle": hierarchy.hierarchy_bytes() as f64 / hierarchy.triangles().len().max(1) as f64,
        "slivers": hierarchy.slivers(),
        "shooters_as_grids": grids,
        "instructions": format!("{:?}", options.instructions),
        "threads": options.threads,
    });
    println!("{report}");
    if let Some(path) = options.masks {
        std::fs::write(path, masks.iter().flat_map(|mask| mask.to_le_bytes()).collect::<Vec<u8>>())?;
    }
    Ok(())
}

struct Options {
    scene: String,
    rays: String,
    threads: usize,
    runs: usize,
    masks: Option<String>,
    instructions: InstructionSet,
    scattered: bool,
    /// Receivers that a thread takes at a time.
    job: usize,
}

impl Options {
    fn parse(mut arguments: impl Iterator<Item = String>) -> Result<Options, Failure> {
        let mut files = Vec::new();
        let mut options = Options {
            scene: String::new(),
            rays: String::new(),
            threads: 1,
            runs: 1,
            masks: None,
            instructions: InstructionSet::best(),
            scattered: false,
            job: 4096,
        };
        while let Some(argument) = arguments.next() {
            let mut value = || arguments.next().ok_or_else(|| format!("{argument} needs a value"));
            match argument.as_str() {
                "--threads" => options.threads = value()?.parse()?,
                "--runs" => options.runs = value()?.parse()?,
                "--scattered" => options.scattered = true,
                "--job" => options.job = value()?.parse::<std::num::NonZeroUsize>()?.get(),
                "--masks" => options.masks = Some(value()?),
                "--instructions" => {
                    options.instructions = match value()?.as_str() {
                        "avx512" => InstructionSet::Avx512,
                        "avx2" => InstructionSet::Avx2,
                        "portable" => InstructionSet::Portable,
                        other => {
                            return Err(format!("--instructions: avx512, avx2 or portable, not {other}").into());
                        }
                    };
                    if !InstructionSet::available().contains(&options.instructions) {
                        return Err(format!("this machine has no {:?}", options.instructions).into());
                    }
                }
                _ => files.push(argument),
            }
        }
        let [scene, rays] = files.try_into().map_err(|_| "usage: replay SCENE.tris FILE.rays [options]")?;
        Ok(Options { scene, rays, ..options })
    }
}

/// The masks of all pairs, in the file's order.
fn replay(hierarchy: &Hierarchy, rays: &Rays, options: &Options) -> Vec<u64> {
    let mut masks = vec![0; rays.receiver_index.len()];
    let mut jobs = Vec::new();
    let mut rest = masks.as_mut_slice();
    for (shooter, range) in rays.shooters.iter().zip(&rays.pairs) {
        let mut first = range.start;
        while first < range.end {
            let (job, after) = rest.split_at_mut(options.job.min(range.end - first));
            jobs.push(std::sync::Mutex::new((shooter, first, job)));
            first += jobs.last_mut().map_or(0, |job| job.get_mut().map_or(0, |job| job.2.len()));
            rest = after;
        }
    }
    let next = AtomicUsize::new(0);
    rayon::scope(|scope| {
        for _ in 0..options.threads {
            scope.spawn(|_| {
                let mut points = [const { Vec::new() }; 3];
                let plane = vec![NO_PLANE; options.job];
                while let Some(job) = jobs.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let mut job = job.lock().expect("no thread panics with a job");
                    let (shooter, first, ref mut masks) = *job;
                    let receivers = &rays.receiver_index[first..first + masks.len()];
                    for (axis, points) in points.iter_mut().enumerate() {
                        points.clear();
                        points.extend(receivers.iter().map(|&r| rays.receivers[r as usize][axis]));
                    }
                    masks.fill(shooter.cells.all());
                    let [x, y, z] = &points;
                    let points = Points { x, y, z, plane: &plane[..masks.len()] };
                    hierarchy.clear_blocked(shooter, points, masks);
                }
            });
        }
    });
    drop(jobs);
    masks
}

struct Rays {
    cells: usize,
    shooters: Vec<Shooter>,
    receivers: Vec<[f32; 3]>,
    pairs: Vec<std::ops::Range<usize>>,
    receiver_index: Vec<u32>,
}

impl Rays {
    fn read(bytes: &[u8], scattered: bool) -> Result<Rays, Failure> {
        let mut reader = Reader { bytes, file: "rays" };
        reader.magic(b"RLRAYS01")?;
        let [shooters, cells, receivers, pairs] = [reader.u64()?, reader.u64()?, reader.u64()?, reader.u64()?];
        let (near, far) = (reader.f32()?, reader.f32()?);
        if near != 0.0 || !(1..=64).contains(&cells) {
            return Err(format!("rays: expected near 0 and 1 to 64 cells, found {near} and {cells}").into());
        }
        let mut read = Rays {
            cells: cells as usize,
            shooters: Vec::new(),
            receivers: Vec::new(),
            pairs: Vec::new(),
            receiver_index: Vec::new(),
        };
        for _ in 0..shooters {
            let points = (0..cells).map(|_| reader.point()).collect::<Result<Vec<_>, _>>()?;
            let grid = if scattered { None } else { grid_of(&points) };
            let cells = grid.map_or(Cells::Points(points), Cells::Grid);
            read.shooters.push(Shooter { cells, plane: NO_PLANE, far });
        }
        read.receivers = (0..receivers).map(|_| reader.point()).collect::<Result<_, _>>()?;
        let starts = (0..=shooters).map(|_| reader.u64()).collect::<Result<Vec<_>, _>>()?;
        read.pairs = starts.windows(2).map(|pair| pair[0] as usize..pair[1] as usize).collect();
        read.receiver_index = (0..pairs).map(|_| reader.u32()).collect::<Result<_, _>>()?;
        if starts.first() != Some(&0) || starts.last() != Some(&pairs) || !starts.is_sorted() {
            return Err("rays: the shooters' pairs do not add up".into());
        }
        if read.receiver_index.iter().any(|&r| u64::from(r) >= receivers) {
            return Err("rays: a pair names a receiver that is not there".into());
        }
        Ok(read)
    }
}

/// The planar grid with these cells, or `None` if they deviate from one by more than a few roundings.
fn grid_of(points: &[[f32; 3]]) -> Option<Grid> {
    let side = (points.len() as f64).sqrt() as usize;
    if ![1, 2, 4, 8].contains(&side) || side * side != points.len() {
        return None;
    }
    let at = |i: usize, j: usize, axis: usize| f64::from(points[j * side + i][axis]);
    let last = side - 1;
    let slope = |from: f64, to: f64| {
        if last == 0 { 0.0 } else { (to - from) * side as f64 / last as f64 }
    };
    let edge_u: [f64; 3] = std::array::from_fn(|a| slope(at(0, 0, a), at(last, 0, a)));
    let edge_v: [f64; 3] = std::array::from_fn(|a| slope(at(0, 0, a), at(0, last, a)));
    let half = 0.5 / side as f64;
    let grid = Grid {
        origin: std::array::from_fn(|a| (at(0, 0, a) - half * (edge_u[a] + edge_v[a])) as f32),
        edge_u: edge_u.map(|c| c as f32),
        edge_v: edge_v.map(|c| c as f32),
        twist: [0.0; 3],
        layout: Layout::Quad,
        side: side as u32,
    };
    let size = points.iter().flatten().fold(0f32, |size, c| size.max(c.abs()));
    let deviation = points.iter().enumerate().flat_map(|(k, p)| {
        let q = grid.point(k);
        (0..3).map(move |a| (p[a] - q[a]).abs())
    });
    (deviation.fold(0f32, f32::max) <= 4.0 * f32::EPSILON * size).then_some(grid)
}

fn read_triangles(bytes: &[u8]) -> Result<Vec<Triangle>, Failure> {
    let mut reader = Reader { bytes, file: "scene" };
    reader.magic(b"RLTRIS01")?;
    let (vertices, triangles) = (reader.u64()?, reader.u64()?);
    let vertices = (0..vertices).map(|_| reader.point()).collect::<Result<Vec<_>, _>>()?;
    (0..triangles as u32)
        .map(|id| {
            let mut corners = [[0.0; 3]; 3];
            for corner in &mut corners {
                let index = reader.u32()? as usize;
                *corner = *vertices.get(index).ok_or_else(|| format!("scene: triangle {id} has no vertex {index}"))?;
            }
            Ok(Triangle { corners, plane: NO_PLANE, id, filter: OPAQUE })
        })
        .collect()
}

/// Little-endian numbers from a file.
struct Reader<'a> {
    bytes: &'a [u8],
    file: &'static str,
}

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], Failure> {
        let (head, rest) =
            self.bytes.split_first_chunk().ok_or_else(|| format!("{}: the file ends early", self.file))?;
        self.bytes = rest;
        Ok(*head)
    }

    fn magic(&mut self, expected: &[u8; 8]) -> Result<(), Failure> {
        if self.take()? == *expected {
            Ok(())
        } else {
            Err(format!("{}: does not begin with {}", self.file, String::from_utf8_lossy(expected)).into())
        }
    }

    fn u64(&mut self) -> Result<u64, Failure> {
        Ok(u64::from_le_bytes(self.take()?))
    }

    fn u32(&mut self) -> Result<u32, Failure> {
        Ok(u32::from_le_bytes(self.take()?))
    }

    fn f32(&mut self) -> Result<f32, Failure> {
        Ok(f32::from_le_bytes(self.take()?))
    }

    fn point(&mut self) -> Result<[f32; 3], Failure> {
        Ok([self.f32()?, self.f32()?, self.f32()?])
    }
}
