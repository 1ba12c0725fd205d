//! Small solved scenes for the tests of this module.

use crate::mesh::{self, MeshOptions};
use crate::resources::{Bytes, Resources};
use crate::scene::{self, ReadOptions};
use crate::shooting::Shoot;
use crate::solution::{Description, Solution};
use crate::solve::{Control, SolveSettings, State, StopRule, World, plain};
use crate::transport::Alone;
use ringlight_visibility::Hierarchy;
use std::io;

/// Materials of the scenes below: reflectance 0.5, a darker red, and a lamp of radiance 10.
const MATERIALS: &str = "newmtl grey\nKd .5 .5 .5\nnewmtl red\nKd .6 .1 .1\nnewmtl lamp\nKd 0 0 0\nKe 10 10 10\n";

/// A floor of 4.2 m × 4 m, a lamp of 1 m × 1 m two metres above it, and a standing triangle.
pub const LAMP_OVER_FLOOR: &str = "mtllib m.mtl\n\
    v -2 0 2\nv 2.2 0 2\nv 2.2 0 -2\nv -2 0 -2\nv -.5 2 -.5\nv .5 2 -.5\nv .5 2 .5\nv -.5 2 .5\n\
    v -2 0 -1.5\nv 0 0 -1.5\nv -2 1 -1.5\n\
    o floor\nusemtl grey\nf 1 2 3 4\no lamp\nusemtl lamp\nf 5 6 7 8\no sail\nusemtl red\nf 9 10 11\n";

/// A closed room of 4 m × 3 m × 5 m from (10, 0, 0) with a lamp under its ceiling.
pub const ROOM: &str = "mtllib m.mtl\n\
    v 10 0 0\nv 14 0 0\nv 14 0 5\nv 10 0 5\nv 10 3 0\nv 14 3 0\nv 14 3 5\nv 10 3 5\n\
    v 11.5 2.9 2\nv 12.5 2.9 2\nv 12.5 2.9 3\nv 11.5 2.9 3\n\
    usemtl grey\no floor\nf 4 3 2 1\no ceiling\nf 5 6 7 8\no north\nf 1 2 6 5\no south\nf 3 4 8 7\n\
    usemtl red\no west\nf 4 1 5 8\nusemtl grey\no east\nf 2 3 7 6\nusemtl lamp\no lamp\nf 9 10 11 12\n";

struct Materials;

impl Resources for Materials {
    fn read(&self, path: &str) -> io::Result<Bytes> {
        match path {
            "m.mtl" => Ok(Bytes::new(MATERIALS)),
            _ => Err(io::ErrorKind::NotFound.into()),
        }
    }
}

/// Reads, cuts into elements of `element_size` metres, and solves.
pub fn solved(obj: &str, element_size: f64) -> (Solution, Hierarchy) {
    let bytes = Bytes::new(obj.as_bytes().to_vec());
    let scene = scene::read("scene.obj", bytes, &Materials, &ReadOptions::default()).unwrap();
    let options = MeshOptions { element_size: Some(element_size), ..MeshOptions::default() };
    let mut mesh = mesh::build(&scene, &options).unwrap();
    let hierarchy = mesh::hierarchy(&mesh);
    mesh::find_valid_samples(&mut mesh, &hierarchy);
    let settings = SolveSettings { cells: 4, shoot: Shoot::Elements, sky: None };
    let world = World::new(&mesh, &hierarchy, &scene.lights, settings);
    let mut state = State::new(&world);
    let stop = StopRule { until: 0.01, max_shots: Some(200) };
    plain(&world, &mut state, &stop, &mut Alone::default(), &mut |_, _| Control::Continue);
    let energy = state.energy(&world);
    drop(world);
    let description = Description::new(&scene);
    (Solution { description, mesh, settings, state, energy, images: Vec::new() }, hierarchy)
}
