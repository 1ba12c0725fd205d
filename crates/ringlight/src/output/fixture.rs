//! Small solved scenes for tests.

use crate::column::Store;
use crate::mesh::{self, MeshOptions};
use crate::resources::{Bytes, Resources};
use crate::scene::{self, ReadOptions, Scene};
use crate::shooting::Shoot;
use crate::solution::{Description, Solution, SolvedLight};
use crate::solve::{self, Energy, Ledger, Ring, SolveSettings, Solver, Spread, State, StopRule, World};
use crate::transport::{Communicator, Failure, threads};
use std::io;
use std::sync::Arc;

/// Materials: `grey`, `white`, `mirror` (too bright), `black`, `lamp`, `glow` (Ke 1, Kd 0.5).
const MATERIALS: &str = "newmtl grey\nKd 0.5 0.5 0.5\nnewmtl white\nKd 0.8 0.8 0.8\nnewmtl mirror\nKd 1 1 1\n\
    newmtl black\nKd 0 0 0\nnewmtl lamp\nKd 0 0 0\nKe 10 10 10\nnewmtl glow\nKd 0.5 0.5 0.5\nKe 1 1 1\n";

struct Materials;

impl Resources for Materials {
    fn read(&self, _: &str) -> io::Result<Bytes> {
        Ok(Bytes::new(MATERIALS.as_bytes()))
    }
}

/// Reads OBJ text that uses the materials above.
pub fn read(obj: &str) -> Scene {
    let obj = format!("mtllib m.mtl\n{obj}");
    scene::read("test.obj", Bytes::new(obj.into_bytes()), &Materials, &ReadOptions::default()).unwrap()
}

/// Solves a scene with elements of `element` metres and patches four times as large, as far as `until`.
pub fn solve(scene: Scene, element: f64, until: f64) -> Solution {
    solve_refined(scene, [4.0 * element, element], until, |_| 1)
}

/// Solves a scene by groups, with elements and patches of `element` metres.
pub fn solve_by_groups(scene: Scene, element: f64) -> Solution {
    solve_by(Solver::Group(0.01), scene, &sizes([element; 2]), 0.0, |_| 1)
}

/// Subdivisions of patches, of `choices`, here and there.
pub fn mixed<const N: usize>(choices: [u8; N]) -> impl Fn(u32) -> u8 {
    move |patch| choices[(patch.wrapping_mul(0x9e37_79b9) >> 8) as usize % N]
}

/// Solves a scene with patches and elements of these sizes, metres, as far as `until`; the elements of each patch are refined.
pub fn solve_refined(scene: Scene, sizes: [f64; 2], until: f64, subdivision: impl Fn(u32) -> u8) -> Solution {
    solve_by(Solver::Plain, scene, &self::sizes(sizes), until, subdivision)
}

/// Solves a scene with patches and elements of `size` metres, as far as `until` or by groups; facets are cut where the light of so many
/// area lights breaks, and the elements of each patch are refined.
pub fn solve_along_lines(
    scene: Scene,
    (solver, until): (Solver, f64),
    (size, lines): (f64, u32),
    subdivision: impl Fn(u32) -> u8,
) -> Solution {
    solve_by(solver, scene, &MeshOptions { lines, ..sizes([size; 2]) }, until, subdivision)
}

/// Patches and elements of these sizes, metres.
fn sizes([patch, element]: [f64; 2]) -> MeshOptions {
    MeshOptions { patch_size: Some(patch), element_size: Some(element), ..MeshOptions::default() }
}

fn solve_by(
    solver: Solver,
    scene: Scene,
    options: &MeshOptions,
    until: f64,
    subdivision: impl Fn(u32) -> u8,
) -> Solution {
    let mesh = mesh::build(&scene, options, Store::Heap).unwrap();
    let subdivisions: Vec<u8> = (0..mesh.patch_count() as u32).map(subdivision).collect();
    let mut mesh = mesh.refined(&scene, &subdivisions, Store::Heap).unwrap();
    let hierarchy = Arc::new(mesh::hierarchy(&mesh));
    mesh::find_valid_samples(&mut mesh, &hierarchy);
    let settings = SolveSettings { solver, cells: 16, shoot: Shoot::Elements, sky: None, shooters_in_flight: 1 };
    let ranks = &mut Communicator::alone();
    let mut ring = Ring::alone(&mesh, hierarchy);
    let world = World::new(&mut ring, &scene.lights, settings, ranks).unwrap();
    let mut state = State::new(&world, ranks).unwrap();
    let stop = StopRule { until, max_shots: None };
    solve::solve(&world, &mut ring, &mut state, &stop, ranks, &mut ()).unwrap();
    drop((world, ring));
    let images = scene.images.iter().map(|i| Some(i.bytes.clone())).collect();
    let ledger = Ledger::of(&state);
    let light = SolvedLight::of(state.clusters, Store::Heap).unwrap();
    let energy = Energy::default();
    Solution { description: Description::new(&scene), mesh, settings, ledger, light, energy, images }
}

/// The one rank of a world, which holds all geometry of a solution.
pub fn alone(solution: &Solution) -> (Ring<'_>, Communicator<'static>) {
    (Ring::alone(&solution.mesh, Arc::new(mesh::hierarchy(&solution.mesh))), Communicator::alone())
}

/// What rank 0 has of what all of a world's ranks do, of every rank's place in its ring.
pub fn over_ranks<'a, T: Send>(
    solution: &'a Solution,
    spread: &Spread,
    read: impl Fn(&mut Ring<'a>, &mut Communicator<'_>) -> Result<T, Failure> + Sync,
) -> T {
    let all =
        threads::run(spread.rings.ranks(), |ranks| read(&mut Ring::new(&solution.mesh, spread, ranks.rank()), ranks));
    all.unwrap().remove(0)
}

/// Sets the irradiance of every element from the position of its middle (world, metres) and its normal.
pub fn paint(solution: &mut Solution, light: impl Fn(glam::DVec3, glam::DVec3) -> f64) {
    let mesh = &solution.mesh;
    for patch in (0..mesh.patch_count() as u32).map(|id| mesh.patch(id)) {
        for k in 0..patch.element_count() {
            let middle = mesh::Frame::middle(patch.frame.layout);
            let at = mesh.to_world(patch.frame.at(patch.element_tile(k).at(middle)));
            let element = &mut solution.light.elements[(patch.first_element + k) as usize];
            *element = Default::default();
            element.shot = [light(at, patch.normal) as f32; 3];
        }
    }
}

/// A box of white faces between two corners, metres.
pub fn block([ax, ay, az]: [f64; 3], [bx, by, bz]: [f64; 3]) -> String {
    let mut obj = String::from("usemtl white\n");
    for [x, y, z] in [ay, by].iter().flat_map(|&y| [[ax, y, az], [bx, y, az], [bx, y, bz], [ax, y, bz]]) {
        obj += &format!("v {x} {y} {z}\n");
    }
    obj + "f -8 -7 -6 -5\nf -4 -1 -2 -3\nf -8 -4 -3 -7\nf -7 -3 -2 -6\nf -6 -2 -1 -5\nf -5 -1 -4 -8\n"
}

/// Each element with the positions of its corners (world), its normal and whether it is a triangle.
pub fn elements(solution: &Solution) -> Vec<(u32, Vec<glam::DVec3>, glam::DVec3)> {
    let mesh = &solution.mesh;
    let mut all = Vec::new();
    for id in 0..mesh.patch_count() as u32 {
        let patch = mesh.patch(id);
        for k in 0..patch.element_count() {
            let (corners, n) = patch.frame.tile(patch.element_tile(k)).corners();
            let corners = corners[..n].iter().map(|&c| mesh.to_world(c)).collect();
            all.push((patch.first_element + k, corners, patch.normal));
        }
    }
    all
}

/// A closed box from (0, 0, 0) to (1, 1, 1), its inside of one material.
pub fn closed_box(material: &str) -> String {
    format!(
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\no box\nusemtl {material}\n\
         f 1 2 3 4\nf 5 8 7 6\nf 1 5 6 2\nf 4 3 7 8\nf 1 4 8 5\nf 2 6 7 3\n"
    )
}
