//! Lines where light breaks, and facets cut along them, against what follows from similar triangles.

use super::{Line, lines};
use crate::column::{Bytes, Store};
use crate::mesh::tests::Files;
use crate::mesh::{Facet, Mesh, MeshOptions, build};
use crate::output::fixture::read;
use crate::scene::{self, ReadOptions, Scene};
use glam::{DVec2, DVec3};

/// A floor of 4 m × 4 m at height 0, and a square lamp of 1 m × 1 m at 3 m that looks down.
const ROOM: &str = "v -2 0 -2\nv -2 0 2\nv 2 0 2\nv 2 0 -2\nv -0.5 3 -0.5\nv 0.5 3 -0.5\nv 0.5 3 0.5\nv -0.5 3 0.5\n\
    o floor\nusemtl black\nf 1 2 3 4\no lamp\nusemtl lamp\nf 5 6 7 8\n";

/// A rectangle at a height that looks up.
fn plate(low: [f64; 2], high: [f64; 2], height: f64) -> String {
    let corners = [[low[0], low[1]], [low[0], high[1]], [high[0], high[1]], [high[0], low[1]]];
    let vertices: String = corners.iter().map(|[x, z]| format!("v {x} {height} {z}\n")).collect();
    format!("{vertices}o plate{height}\nusemtl black\nf -4 -3 -2 -1\n")
}

fn meshed(scene: &Scene, lines: u32) -> Mesh {
    let options = MeshOptions { element_size: Some(0.25), patch_size: Some(0.25), lines, ..MeshOptions::default() };
    build(scene, &options, Store::Heap).unwrap()
}

/// The lines on the floor.
fn on_floor(scene: &Scene, lights: u32) -> Vec<Line> {
    let mesh = meshed(scene, 0);
    let found = lines(&mesh, scene, lights);
    found.into_iter().filter(|line| mesh.facets[line.facet as usize].surface == 0).collect()
}

#[test]
fn light_breaks_where_edges_of_the_lamp_appear_behind_edges() {
    let scene = read(&(ROOM.to_owned() + &plate([-0.37, -0.43], [0.63, 0.57], 1.0)));
    let found = on_floor(&scene, 1);
    assert!(on_floor(&scene, 0).is_empty());
    // From an edge of the lamp at 3 m past one at 1 m to the floor.
    let foot = |edge: f64, lamp: f64| edge + (edge - lamp) / 2.0;
    for (axis, edges) in [(0, [-0.37, 0.63]), (2, [-0.43, 0.57])] {
        let along = 2 - axis;
        let across = if along == 0 { [-0.37, 0.63] } else { [-0.43, 0.57] };
        let whole = [foot(across[0], 0.5), foot(across[1], -0.5)];
        for at in edges.iter().flat_map(|&edge| [-0.5, 0.5].map(|lamp| foot(edge, lamp))) {
            let is_it = |line: &&Line| line.ends.iter().all(|end| (end[axis] - at).abs() < 1e-5);
            let [line] = found.iter().filter(is_it).collect::<Vec<_>>()[..] else {
                panic!("no line at {at}: {found:?}")
            };
            let (from, to) =
                (line.ends[0][along].min(line.ends[1][along]), line.ends[0][along].max(line.ends[1][along]));
            assert!(from > whole[0] - 1e-5 && to < whole[1] + 1e-5 && to - from > 0.7 * (whole[1] - whole[0]));
        }
    }
    assert_eq!(found.len(), 8);
}

#[test]
fn light_does_not_break_where_the_lamp_is_hidden_anyway() {
    let hidden = plate([-1.9, -1.9], [1.9, 1.9], 1.2) + &plate([-0.37, -0.43], [0.63, 0.57], 1.0);
    assert_eq!(on_floor(&read(&(ROOM.to_owned() + &hidden)), 1), []);
    // What glows less than something else does not cast lines either.
    let weak = plate([-0.5, -0.5], [0.5, 0.5], 2.0).replace("black", "glow");
    let scene = read(&(ROOM.to_owned() + &plate([-0.37, -0.43], [0.63, 0.57], 1.0) + &weak));
    assert!(on_floor(&scene, 1).len() <= on_floor(&scene, 2).len());
}

#[test]
fn light_breaks_where_something_stands_or_passes_through() {
    // A box turned by the angle whose tangent is 3/4, its foot at `low`.
    let box_at = |low: f64| {
        let corners = [[0.8, 0.6], [-0.6, 0.8], [-0.8, -0.6], [0.6, -0.8]];
        let ring = |y: f64| corners.map(|[x, z]| format!("v {x} {y} {z}\n")).concat();
        let sides = [[1, 2, 6, 5], [2, 3, 7, 6], [3, 4, 8, 7], [4, 1, 5, 8], [5, 6, 7, 8]].map(|f| f.map(|v| v + 4));
        let faces = sides.map(|[a, b, c, d]| format!("f {d} {c} {b} {a}\n")).concat();
        let floor = "v -2 0 -2\nv -2 0 2\nv 2 0 2\nv 2 0 -2\no floor\nusemtl black\nf 1 2 3 4\n";
        (corners, read(&format!("{floor}{}{}o box\nusemtl black\n{faces}", ring(low), ring(1.0))))
    };
    for low in [0.0, -0.2] {
        let (corners, scene) = box_at(low);
        let found = on_floor(&scene, 1);
        assert_eq!(found.len(), 4, "{found:?}");
        for k in 0..4 {
            let [a, b] = [corners[k], corners[(k + 1) % 4]].map(|[x, z]| DVec3::new(x, 0.0, z));
            let is_it = |line: &Line| {
                let [c, d] = line.ends.map(|end| DVec3::new(end.x, 0.0, end.z));
                (a - c).length().max((b - d).length()).min((a - d).length().max((b - c).length())) < 1e-5
            };
            assert!(found.iter().any(is_it), "{found:?}");
        }
        // What lies above the floor does not touch it.
        assert_eq!(on_floor(&box_at(0.1).1, 1), []);
    }
}

#[test]
fn parts_are_the_whole_with_its_texture() {
    // Of its texture, whose first row is its uppermost, the floor has (x + 2) / 4 and (z + 2) / 4.
    let floor =
        ROOM.replace("usemtl black\nf 1 2 3 4", "vt 0 1\nvt 0 0\nvt 1 0\nvt 1 1\nusemtl leaf\nf 1/1 2/2 3/3 4/4");
    let turned = "v 0.3 0.4 0.4\nv 1.1 0.4 1\nv 0.5 0.4 1.8\nv -0.3 0.4 1.2\no turned\nusemtl black\nf -1 -2 -3 -4\n";
    let standing = "v 0.3 0 0.4\nv 1.1 0 1\nv 1.1 1 1\nv 0.3 1 0.4\no wall\nusemtl black\nf -4 -3 -2 -1\n";
    let text = floor + &plate([-0.37, -0.43], [0.63, 0.57], 1.0) + turned + standing;
    let text = format!("mtllib panes.mtl\n{}", text.replace("black", "wall"));
    let files = Files(Store::Heap);
    let scene = scene::read("textured.obj", Bytes::new(text), &files, &ReadOptions::default()).unwrap();
    let [whole, cut] = [0, 1].map(|lines| meshed(&scene, lines));
    cut.check().unwrap();
    for surface in 0..scene.surfaces.len() as u32 {
        let area = |mesh: &Mesh| -> f64 {
            mesh.facets.iter().filter(|f| f.surface == surface).map(|f| f.frame().area_vector().length()).sum()
        };
        assert!((area(&whole) - area(&cut)).abs() < 1e-5 * area(&whole), "{surface}");
        let planes = |mesh: &Mesh| mesh.facets.iter().filter(|f| f.surface == surface).map(|f| f.plane).min();
        assert_eq!(planes(&whole), planes(&cut));
    }
    let floor: Vec<_> = cut.facets.iter().filter(|facet| facet.surface == 0).collect();
    assert!(floor.len() > 15 && floor.iter().all(|facet| facet.part == 1));
    for facet in &floor {
        assert!(facet.frame().area_vector().y > 0.0);
        for (corner, uv) in facet.corners.iter().zip(cut.base_uv[facet.base_uv as usize]) {
            let expected = DVec2::new((f64::from(corner.x) + 2.0) / 4.0, (f64::from(corner.z) + 2.0) / 4.0);
            assert!((DVec2::new(f64::from(uv[0]), f64::from(uv[1])) - expected).abs().max_element() < 1e-5);
        }
    }
    // No place is held twice, none by nobody.
    for k in 0..900 {
        let at = DVec3::new(f64::from(k % 30), 0.0, f64::from(k / 30)) * (4.0 / 30.0) + DVec3::new(-1.937, 0.0, -1.943);
        let inside = |facet: &&&Facet| {
            let corners = facet.outline();
            (0..corners.len()).all(|i| {
                let [a, b] = [corners[i], corners[(i + 1) % corners.len()]].map(|c| c.as_dvec3());
                (b - a).cross(at - a).y >= 0.0
            })
        };
        assert_eq!(floor.iter().filter(inside).count(), 1, "{at}");
    }
}
