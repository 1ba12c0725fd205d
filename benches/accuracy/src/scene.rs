//! Scenes from OBJ text, solved in memory.

use ringlight::column::Store;
use ringlight::mesh::{self, Mesh, MeshOptions, Patch};
use ringlight::probe::{self, GatherOptions, Point, Reading, Status, SurfaceOptions};
use ringlight::resources::{Bytes, Resources};
use ringlight::scene::{self, ReadOptions, Scene};
use ringlight::shooting::{ElementLight, Shoot};
use ringlight::solution::{Description, Solution, SolvedLight};
use ringlight::solve::{
    self, Energy, Ledger, Progress, Ring, SolveSettings, Solver, State, StopReason, StopRule, World,
};
use ringlight::transport::Communicator;
use ringlight_visibility::Hierarchy;
use std::fmt::Write;
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A single MTL file.
pub struct Material(pub String);

impl Resources for Material {
    fn read(&self, path: &str) -> std::io::Result<Bytes> {
        if path == "scene.mtl" {
            Ok(Bytes::new(self.0.clone().into_bytes()))
        } else {
            Err(std::io::Error::from(std::io::ErrorKind::NotFound))
        }
    }
}

/// Builds OBJ text face by face.
#[derive(Default)]
pub struct Builder {
    obj: String,
    mtl: String,
    vertices: usize,
    materials: usize,
}

impl Builder {
    /// A material of this reflectance and exitance; gives its name.
    pub fn material(&mut self, reflectance: [f32; 3], exitance: [f32; 3]) -> String {
        let name = format!("m{}", self.materials);
        self.materials += 1;
        let [r, g, b] = reflectance;
        let [x, y, z] = exitance.map(|e| f64::from(e) / std::f64::consts::PI);
        writeln!(self.mtl, "newmtl {name}\nKd {r} {g} {b}\nKe {x} {y} {z}").unwrap();
        name
    }

    /// A polygon, counter-clockwise seen from its front.
    pub fn face(&mut self, material: &str, corners: &[[f64; 3]]) {
        for [x, y, z] in corners {
            writeln!(self.obj, "v {x} {y} {z}").unwrap();
        }
        write!(self.obj, "usemtl {material}\nf").unwrap();
        for i in 0..corners.len() {
            write!(self.obj, " {}", self.vertices + i + 1).unwrap();
        }
        self.obj.push('\n');
        self.vertices += corners.len();
    }

    /// A box, its faces looking outwards (or inwards).
    pub fn cuboid(
        &mut self,
        low: [f64; 3],
        high: [f64; 3],
        inwards: bool,
        mut material: impl FnMut(&mut Self) -> String,
    ) {
        for axis in 0..3 {
            for side in [0, 1] {
                let mut corners = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(a, b)| {
                    let mut p = [0.0; 3];
                    p[axis] = if side == 0 { low[axis] } else { high[axis] };
                    for (k, t) in [((axis + 1) % 3, a), ((axis + 2) % 3, b)] {
                        p[k] = if t == 0 { low[k] } else { high[k] };
                    }
                    p
                });
                if (side == 0) != inwards {
                    corners.reverse();
                }
                let name = material(self);
                self.face(&name, &corners);
            }
        }
    }

    /// The scene, its surfaces lit on their fronts only if `single_sided`.
    pub fn scene(&self, single_sided: bool) -> Scene {
        let obj = format!("mtllib scene.mtl\n{}", self.obj);
        let name = "scene.obj";
        let mut scene =
            scene::read(name, Bytes::new(obj.into_bytes()), &Material(self.mtl.clone()), &ReadOptions::default())
                .unwrap();
        if single_sided {
            scene.materials.iter_mut().for_each(|m| m.double_sided = false);
        }
        scene
    }
}

/// Our own scene of this name in `scenes/`.
pub fn own(file: &str) -> Scene {
    let folder = Folder(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes"));
    let bytes = folder.read(file).unwrap();
    scene::read(file, bytes, &folder, &ReadOptions::default()).unwrap()
}

/// The files of a folder.
struct Folder(PathBuf);

impl Resources for Folder {
    fn read(&self, path: &str) -> std::io::Result<Bytes> {
        std::fs::read(self.0.join(path)).map(Bytes::new)
    }
}

/// A meshed scene.
pub struct Meshed {
    /// As read.
    pub scene: Scene,
    /// Cut into patches and elements.
    pub mesh: Mesh,
    /// What blocks light.
    pub hierarchy: Arc<Hierarchy>,
}

/// Cuts a scene into patches and elements of these sizes, metres.
pub fn meshed(scene: Scene, patch: f64, element: f64) -> Meshed {
    let options = MeshOptions { patch_size: Some(patch), element_size: Some(element), ..MeshOptions::default() };
    let mut mesh = mesh::build(&scene, &options, Store::Heap).unwrap();
    let hierarchy = Arc::new(mesh::hierarchy(&mesh));
    mesh::find_valid_samples(&mut mesh, &hierarchy);
    Meshed { scene, mesh, hierarchy }
}

impl Meshed {
    /// What is solved, with this many cells of a shooter.
    pub fn world(&self, cells: u32) -> Whole<'_> {
        self.world_of(SolveSettings {
            solver: Solver::Plain,
            cells,
            shoot: Shoot::Elements,
            sky: None,
            shooters_in_flight: 1,
        })
    }

    /// What is solved, with these settings.
    pub fn world_of(&self, settings: SolveSettings) -> Whole<'_> {
        let (mut ring, ranks) = (Ring::alone(&self.mesh, self.hierarchy.clone()), &mut Communicator::alone());
        let world = World::new(&mut ring, &self.scene.lights, settings, ranks).expect("one rank does not fail");
        Whole { world, hierarchy: self.hierarchy.clone() }
    }

    /// All elements that are not wholly covered: their patch, number, lit area in m², and light.
    pub fn elements<'a>(&'a self, state: &'a State) -> impl Iterator<Item = (Patch, u32, f64, &'a ElementLight)> {
        self.mesh.clusters.iter().zip(&state.clusters).flat_map(move |(cluster, light)| {
            cluster.patches.clone().map(|id| self.mesh.patch(id)).flat_map(move |patch| {
                let lit = patch.elements().filter(|&e| self.mesh.valid[e as usize] != 0);
                lit.map(move |e| {
                    let area = patch.element_area(e - patch.first_element) * self.mesh.valid_share(e);
                    (patch, e, area, &light.elements[(e - cluster.elements.start) as usize])
                })
            })
        })
    }

    /// Mean irradiance over the elements of the patches that `wanted` takes.
    pub fn mean_irradiance(&self, state: &State, wanted: impl Fn(&Patch) -> bool) -> [f64; 3] {
        let (mut sum, mut total) = ([0.0; 3], 0.0);
        for (_, _, area, light) in self.elements(state).filter(|(patch, ..)| wanted(patch)) {
            (0..3).for_each(|c| sum[c] += area * f64::from(light.mean()[c]));
            total += area;
        }
        sum.map(|x| x / total)
    }

    /// What is probed: the light of this scene.
    pub fn solution(&self, world: &World<'_>, state: State) -> Solution {
        let energy = energy(&state, world);
        // Probes ask for nothing else of the scene.
        let description = Description { lights: self.scene.lights.clone(), ..Description::default() };
        let mesh = self.mesh.clone();
        let (ledger, light) = (Ledger::of(&state), SolvedLight::of(state.clusters, Store::Heap).unwrap());
        Solution { description, mesh, settings: world.settings, ledger, light, energy, images: Vec::new() }
    }

    /// The one rank that reads a solution of this scene.
    fn alone<'a>(&self, solution: &'a Solution) -> Ring<'a> {
        Ring::alone(&solution.mesh, self.hierarchy.clone())
    }

    /// Irradiance gathered at points (position, normal); not a number where there is none to tell of.
    pub fn gathered(&self, solution: &Solution, points: &[Place]) -> Vec<[f64; 3]> {
        let points: Vec<Point> = points.iter().map(|&(position, normal)| Point { position, normal }).collect();
        let (ring, ranks) = (&mut self.alone(solution), &mut Communicator::alone());
        let found = probe::gather(solution, &points, &GatherOptions::default(), ring, ranks);
        found.expect("one rank does not fail").into_iter().flatten().map(irradiance).collect()
    }

    /// Stored irradiance at points (position, normal) as it is displayed; not a number where there is none to tell of.
    pub fn displayed(&self, solution: &Solution, points: &[Place]) -> Vec<[f64; 3]> {
        let points: Vec<Point> = points.iter().map(|&(position, normal)| Point { position, normal }).collect();
        let (ring, ranks) = (&mut self.alone(solution), &mut Communicator::alone());
        let found = probe::surface(solution, &points, &SurfaceOptions::default(), ring, ranks);
        found.expect("one rank does not fail").into_iter().flatten().map(irradiance).collect()
    }
}

/// A point and the normal of the side that receives.
pub type Place = ([f64; 3], [f64; 3]);

fn irradiance(reading: Reading) -> [f64; 3] {
    match reading.status {
        Status::Ok => reading.irradiance.map(f64::from),
        _ => [f64::NAN; 3],
    }
}

/// The world of one rank, which holds all geometry.
pub struct Whole<'a> {
    world: World<'a>,
    hierarchy: Arc<Hierarchy>,
}

impl<'a> Deref for Whole<'a> {
    type Target = World<'a>;

    fn deref(&self) -> &World<'a> {
        &self.world
    }
}

/// Plain progressive refinement until this share of the power is unshot.
pub fn solve(world: &Whole<'_>, until: f64) -> (State, StopReason, Progress) {
    let ranks = &mut Communicator::alone();
    let mut ring = Ring::alone(world.mesh, world.hierarchy.clone());
    let mut state = State::new(world, ranks).expect("one rank does not fail");
    let stop = StopRule { until, max_shots: None };
    let (reason, progress) =
        solve::plain(world, &mut ring, &mut state, &stop, ranks, &mut ()).expect("one rank does not fail");
    (state, reason, progress)
}

/// The audit of a state.
pub fn energy(state: &State, world: &World<'_>) -> Energy {
    state.energy(world, &mut Communicator::alone()).expect("one rank does not fail")
}
