use super::{Smooth, SurfaceLight};
use crate::mesh::{self, Inquiry, at_once};
use crate::output::fixture::{closed_box, elements, mixed, paint, read, solve, solve_refined};
use crate::solution::Solution;
use glam::{DVec2, DVec3};
use std::f64::consts::PI;
use std::sync::Arc;

/// Largest difference of the corners' light from what `light` says, over elements with corners that `wanted` accepts.
fn worst(solution: &Solution, light: impl Fn(DVec3, DVec3) -> f64, wanted: impl Fn(&[DVec3], DVec3) -> bool) -> f64 {
    let smooth = Smooth::new(solution);
    let mut worst = 0.0f64;
    for (element, corners, normal) in elements(solution).into_iter().filter(|(_, c, n)| wanted(c, *n)) {
        for (corner, got) in corners.iter().zip(smooth.corners(element)) {
            worst = worst.max((f64::from(got[0]) - light(*corner, normal)).abs());
        }
    }
    worst
}

#[test]
fn inside_a_glowing_furnace_light_is_even_up_to_the_corners() {
    // Ke = 1, ρ = 0.5: E = π/(1 − 0.5) everywhere inside.
    let solution = solve(read(&closed_box("glow")), 0.25, 1e-3);
    // Of the order of the point values' error near shooters of 16 cells.
    let inward = |c: &[DVec3], n: DVec3| (DVec3::splat(0.5) - c[0]).dot(n) > 0.0;
    let error = worst(&solution, |_, _| 2.0 * PI, inward);
    assert!(error < 0.01 * 2.0 * PI, "{error}");
    let smooth = Smooth::new(&solution);
    let outside = elements(&solution).into_iter().filter(|(_, c, n)| !inward(c, *n));
    for (element, ..) in outside {
        assert_eq!(smooth.corners(element), [[0.0; 3]; 4]);
    }
}

#[test]
fn the_sides_of_a_sheet_and_the_faces_of_a_box_keep_their_own_light() {
    let mut solution = solve(read(&closed_box("grey")), 0.25, 1.0);
    let light = |_: DVec3, n: DVec3| 10.0 + n.x + 2.0 * n.y + 4.0 * n.z;
    paint(&mut solution, light);
    assert!(worst(&solution, light, |_, _| true) < 1e-5);
}

#[test]
fn linear_light_runs_to_the_border_and_over_unequal_grids_without_a_seam() {
    // One large quad beside three of a third of its height, and two triangles: corners lie on the edges of neighbours.
    let obj = "v 0 0 0\nv 1 0 0\nv 1 3 0\nv 0 3 0\nv 1 1 0\nv 1 2 0\nv 2 0 0\nv 2 1 0\nv 2 2 0\nv 2 3 0\nv 4 0 0\n\
               usemtl grey\nf 1 2 3 4\nf 2 7 8 5\nf 5 8 9 6\nf 6 9 10 3\nf 7 11 10\n";
    for element in [0.3, 0.7] {
        let mut solution = solve(read(obj), element, 1.0);
        let light = |p: DVec3, _: DVec3| 5.0 + p.x + 0.5 * p.y;
        paint(&mut solution, light);
        // Exact but for elements of facets cut once, whose gradient is not known.
        let error = worst(&solution, light, |c, _| c.iter().all(|p| p.x < 2.0 - 1e-9));
        assert!(error < if element < 0.5 { 1e-4 } else { 0.2 }, "element {element}: {error}");
        let error = worst(&solution, light, |_, _| true);
        assert!(error < 0.3, "element {element}: {error}");
    }
}

#[test]
fn no_jump_where_a_corner_lies_on_a_neighbours_edge() {
    // Three rows beside four.
    let obj = "v 0 0 0\nv 1 0 0\nv 1 1.2 0\nv 0 1.2 0\nv 1 0.0 0\nv 2 0 0\nv 2 0.9 0\nv 1 0.9 0\n\
               usemtl grey\nf 1 2 3 4\nf 5 6 7 8\n";
    let mut solution = solve(read(obj), 0.31, 1.0);
    let light = |p: DVec3, _: DVec3| 3.0 + (p.x - 1.0) * (p.x - 1.0) + 0.3 * p.y;
    paint(&mut solution, light);
    let smooth = Smooth::new(&solution);
    let along = |left: bool, y: f64| {
        let all = elements(&solution);
        let x = if left { 0.999_999 } else { 1.000_001 };
        let found = all.iter().find(|(_, c, n)| {
            let (low, high) = c.iter().fold((c[0], c[0]), |a, &p| (a.0.min(p), a.1.max(p)));
            n.z > 0.0 && low.x <= x && x <= high.x && low.y <= y && y <= high.y
        });
        let (element, c, _) = found.unwrap();
        // The files' corners begin at the lower left or elsewhere: solve for the parameters.
        let frame = crate::mesh::Frame::from_corners(c);
        f64::from(smooth.at(*element, frame.parameters(DVec3::new(x, y, 0.0)))[0])
    };
    for i in 1..30 {
        let y = 0.029 * f64::from(i);
        let (left, right) = (along(true, y), along(false, y));
        assert!((left - right).abs() < 0.01 * left, "at y = {y}: {left} and {right}");
    }
}

#[test]
fn light_does_not_cross_a_wall_that_stands_on_a_floor() {
    let obj = "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\nv 2 -1 -1\nv 2 5 -1\nv 2 5 2\nv 2 -1 2\n\
               o floor\nusemtl grey\nf 1 2 3 4\no wall\nf 5 6 7 8\n";
    let mut solution = solve(read(obj), 0.5, 1.0);
    let light = |p: DVec3, _: DVec3| if p.x < 2.0 { 10.0 } else { 1.0 };
    paint(&mut solution, light);
    let left = worst(&solution, |_, _| 10.0, |c, n| n.z > 0.5 && c.iter().all(|p| p.x < 2.1));
    let right = worst(&solution, |_, _| 1.0, |c, n| n.z > 0.5 && c.iter().all(|p| p.x > 1.9));
    assert!(left < 1e-5 && right < 1e-5, "{left} {right}");
    // Without the wall the same light is smoothed.
    solution.mesh.occluder.coverage = vec![0.0; 2];
    let left = worst(&solution, |_, _| 10.0, |c, n| n.z > 0.5 && c.iter().all(|p| p.x < 2.1));
    assert!(left > 4.0, "{left}");
}

#[test]
fn elements_under_a_block_take_the_light_around_it() {
    let obj = "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\n\
               v 1 1 -0.1\nv 3 1 -0.1\nv 3 3 -0.1\nv 1 3 -0.1\nv 1 1 1\nv 3 1 1\nv 3 3 1\nv 1 3 1\n\
               usemtl grey\no floor\nf 1 2 3 4\no block\nf 5 8 7 6\nf 9 10 11 12\nf 5 6 10 9\nf 6 7 11 10\nf 7 8 12 11\n\
               f 8 5 9 12\n";
    let mut solution = solve(read(obj), 0.4, 1.0);
    for (element, corners, normal) in elements(&solution) {
        let inside = corners.iter().all(|p| (1.0..=3.0).contains(&p.x) && (1.0..=3.0).contains(&p.y));
        let floor = normal.z > 0.5 && corners[0].z == 0.0;
        solution.mesh.valid[element as usize] = if inside && floor { 0 } else { crate::mesh::ALL_VALID };
    }
    paint(&mut solution, |p, _| if (p - DVec3::new(2.0, 2.0, 0.0)).abs().max_element() < 1.0 { 0.0 } else { 7.0 });
    let error = worst(&solution, |_, _| 7.0, |c, n| n.z > 0.5 && c[0].z == 0.0);
    assert!(error < 1e-5, "{error}");
}

#[test]
fn round_things_are_smooth_and_sharp_ones_are_not() {
    // An arch of flat strips, turning by 20° and then by 60°.
    let mut obj = String::new();
    let mut p = DVec2::ZERO;
    for (i, turn) in [0.0f64, 20.0, 40.0, 100.0].into_iter().enumerate() {
        let next = p + DVec2::from_angle(turn.to_radians());
        obj += &format!(
            "v {} 0 {}\nv {} 0 {}\nv {} 1 {}\nv {} 1 {}\n",
            p.x, p.y, next.x, next.y, next.x, next.y, p.x, p.y
        );
        obj += &format!("usemtl grey\nf {} {} {} {}\n", 4 * i + 1, 4 * i + 2, 4 * i + 3, 4 * i + 4);
        p = next;
    }
    let mut solution = solve(read(&obj), 5.0, 1.0);
    let light = |_: DVec3, n: DVec3| 10.0 + 5.0 * n.z;
    paint(&mut solution, light);
    let smooth = Smooth::new(&solution);
    let mut ends = Vec::new();
    for (element, corners, normal) in
        elements(&solution).into_iter().filter(|(.., n)| n.dot(DVec3::new(-1., 0., 2.)) > 0.)
    {
        for (corner, light) in corners.iter().zip(smooth.corners(element)).filter(|(c, _)| c.y == 0.0) {
            ends.push((corner.x, normal.z, light[0]));
        }
    }
    ends.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.total_cmp(&b.0)));
    // From the steepest: two ends of the strip beyond the crease, then of 40°, 20° and 0°.
    let light: Vec<f32> = ends.iter().map(|e| e.2).collect();
    assert_eq!(light.len(), 8, "{ends:?}");
    assert!((light[0] - light[1]).abs() < 1e-4, "beyond the crease it is even: {ends:?}");
    assert!((light[2] - light[5]).abs() < 1e-5, "{ends:?}");
    assert!((light[4] - light[7]).abs() < 1e-5, "{ends:?}");
}

/// The element of the front of the horizontal floor that holds (x, y), and the parameters within it.
fn floor_at(solution: &Solution, x: f64, y: f64) -> (u32, DVec2) {
    let mesh = &solution.mesh;
    let point = DVec3::new(x, y, 0.0) - DVec3::from(mesh.origin);
    let facet =
        mesh.facets.iter().find(|f| f.frame().area_vector().z > 0.99 * f.frame().area_vector().length()).unwrap();
    let (_, element, within) = mesh.find_element(facet, false, facet.frame().parameters(point));
    (element, within)
}

fn here(solution: &Solution) -> Inquiry<'_> {
    Inquiry::Here(&solution.mesh, Arc::new(mesh::hierarchy(&solution.mesh)))
}

#[test]
fn places_at_sample_points_have_the_light_found_there() {
    let obj = "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\nusemtl grey\nf 1 2 3 4\n";
    let mut solution = solve(read(obj), 0.5, 1.0);
    // A shadow edge.
    let light = |p: DVec3, _: DVec3| if p.x + 0.3 * p.y < 2.0 { 10.0 } else { 1.0 };
    paint(&mut solution, light);
    let inquiry = here(&solution);
    let surface = SurfaceLight::new(&solution);
    for (element, corners, normal) in elements(&solution) {
        let middle = corners.iter().sum::<DVec3>() / 4.0;
        let expected = [light(middle, normal) as f32; 3];
        assert_eq!(at_once(surface.at(&inquiry, element, DVec2::splat(0.5))), Some(expected));
    }
}

#[test]
fn where_nothing_stands_corners_have_the_light_that_is_displayed() {
    let mut solution = solve(read(&closed_box("grey")), 0.25, 1.0);
    paint(&mut solution, |p, n| 3.0 + p.x * p.x + p.y * p.z + n.x);
    let inquiry = here(&solution);
    let (smooth, surface) = (Smooth::new(&solution), SurfaceLight::new(&solution));
    for (element, ..) in elements(&solution) {
        for k in 0..25 {
            let within = DVec2::new(f64::from(k % 5), f64::from(k / 5)) / 4.0;
            let (place, shown) = (at_once(surface.at(&inquiry, element, within)).unwrap(), smooth.at(element, within));
            if k % 20 == 0 || k % 20 == 4 {
                assert_eq!(place, shown, "element {element} at {within}");
            }
            // Corners are means over two elements' widths: off the middle's light by a share of its curvature, 0.25² × 2.
            assert!((place[0] - shown[0]).abs() < 0.05, "element {element} at {within}: {place:?} {shown:?}");
        }
    }
}

#[test]
fn a_place_has_no_light_from_behind_what_stands_on_its_element() {
    // Four walls, 0.3 m wide, like a chimney in the middle of a floor of two elements by two: no sample lies in it.
    let obj = "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\n\
               v 1.8 1.8 -0.1\nv 2.1 1.8 -0.1\nv 2.1 2.1 -0.1\nv 1.8 2.1 -0.1\n\
               v 1.8 1.8 2\nv 2.1 1.8 2\nv 2.1 2.1 2\nv 1.8 2.1 2\n\
               usemtl grey\no floor\nf 1 2 3 4\no chimney\nf 5 6 10 9\nf 6 7 11 10\nf 7 8 12 11\nf 8 5 9 12\n";
    let mut solution = solve(read(obj), 2.0, 1.0);
    let light = |p: DVec3, _: DVec3| if p.x < 2.0 { 8.0 } else { 2.0 };
    paint(&mut solution, light);
    let inquiry = here(&solution);
    let surface = SurfaceLight::new(&solution);
    let at = |x: f64, y: f64| {
        let (element, within) = floor_at(&solution, x, y);
        at_once(surface.at(&inquiry, element, within)).map(|light| light[0])
    };
    assert_eq!(at(1.95, 1.95), None, "inside the chimney");
    assert_eq!(at(2.05, 2.05), None, "inside the chimney, on another element");
    assert_eq!(at(1.0, 1.0), Some(8.0));
    // Close to the chimney's left, the samples on its right are hidden.
    let left = at(1.79, 1.95).unwrap();
    assert!(left > 7.0, "{left}");
}

#[test]
fn covered_places_and_cracks_have_no_light_though_their_element_has() {
    // A floor of one element, and two boxes on it with a crack of 4 cm between them; all samples of the floor are open.
    let mut obj = String::from("v 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\nusemtl grey\no floor\nf 1 2 3 4\n");
    for (k, (low, high)) in [(1.6, 1.98), (2.02, 2.4)].into_iter().enumerate() {
        let n = 4 + 8 * k;
        for z in [0.0, 2.0] {
            for (x, y) in [(low, 1.6), (high, 1.6), (high, 2.4), (low, 2.4)] {
                obj += &format!("v {x} {y} {z}\n");
            }
        }
        for face in [[5, 6, 7, 8], [1, 2, 6, 5], [2, 3, 7, 6], [3, 4, 8, 7], [4, 1, 5, 8]] {
            obj += &format!("f {} {} {} {}\n", n + face[0], n + face[1], n + face[2], n + face[3]);
        }
    }
    let mut solution = solve(read(&obj), 4.0, 1.0);
    paint(&mut solution, |_, _| 5.0);
    let (element, _) = floor_at(&solution, 0.5, 0.5);
    solution.mesh.valid[element as usize] = 0x000f;
    let inquiry = here(&solution);
    let surface = SurfaceLight::new(&solution);
    let at = |x: f64, y: f64| at_once(surface.at(&inquiry, element, DVec2::new(x, y) / 4.0));
    assert_eq!([at(0.3, 0.3), at(2.0, 1.0)], [Some([5.0; 3]); 2], "in the open");
    assert_eq!([at(1.8, 2.0), at(2.3, 1.7)], [None; 2], "under the boxes");
    assert_eq!(at(2.0, 2.0), None, "in the crack");
}

/// Two parallelograms and a triangle side by side, and a trapezoid beyond.
const SHEETS: &str = "v 0 0 0\nv 3 0 0\nv 3 3 0\nv 0 3 0\nv 6 0.5 0\nv 6 3.5 0\nv 9 0 0\nv 12 0 0\nv 15 0 0\nv 15 2.2 0\n\
    v 12 3 0\nusemtl grey\nf 1 2 3 4\nf 2 5 6 3\nf 5 7 6\nf 8 9 10 11\n";

#[test]
fn linear_light_stays_linear_where_patches_are_cut_differently() {
    let light = |p: DVec3, n: DVec3| 8.0 + p.x + 0.5 * p.y + n.z;
    // Of light about 15; slopes that are not known have a thousandth of the weight, not none.
    let nearly = 3e-4;
    // Patches of many elements, and of one where they are not refined.
    for (sizes, choices) in [([1.0, 0.25], [1, 2, 3]), ([0.75, 0.75], [1, 2, 4]), ([1.0, 0.5], [5, 2, 1])] {
        let mut solution = solve_refined(read(SHEETS), sizes, 1.0, mixed(choices));
        paint(&mut solution, light);
        let error = worst(&solution, light, |_, _| true);
        assert!(error < nearly, "{sizes:?}: {error}");
        // The trapezoid's elements differ in size, which a gradient from cell to cell does not know.
        let parallel = |c: &[DVec3]| c[0].x < 10.0;
        let inquiry = here(&solution);
        let surface = SurfaceLight::new(&solution);
        for (element, corners, normal) in elements(&solution).into_iter().filter(|(_, c, _)| parallel(c)) {
            let frame = crate::mesh::Frame::from_corners(&corners);
            for within in [DVec2::splat(0.25), DVec2::new(0.02, 0.03)] {
                let place = frame.at(within);
                let got = f64::from(at_once(surface.at(&inquiry, element, within)).unwrap()[0]);
                assert!((got - light(place, normal)).abs() < nearly, "element {element} at {within}");
            }
        }
    }
}

#[test]
fn no_seam_between_patches_that_are_cut_differently() {
    let mut solution = solve_refined(read(SHEETS), [0.75, 0.75], 1.0, mixed([1, 2, 4]));
    paint(&mut solution, |p, _| 3.0 + (p.x - 2.0) * (p.x - 2.0) + (p.y - 1.0) * p.x);
    let (mesh, smooth) = (&solution.mesh, Smooth::new(&solution));
    let mut between = 0;
    for facet in &mesh.facets {
        let triangle = facet.layout() == ringlight_visibility::Layout::Triangle;
        let patches = facet.patches.map(f64::from);
        for k in 0..2000 {
            let t = f64::from(k) * 0.618_033_988_75 % 1.0;
            let line = |n: f64| (f64::from(k / 3) % (n - 1.0) + 1.0) / n;
            // On a border of patches along v, along u, or across a triangle; and the way over it.
            let (at, over) = match k % 3 {
                0 => (DVec2::new(line(patches[0]), t), DVec2::X),
                1 => (DVec2::new(t, line(patches[1])), DVec2::Y),
                _ if triangle => (DVec2::new(t, line(patches[0]) - t), DVec2::ONE),
                _ => continue,
            };
            if triangle && (at.x + at.y > 0.999 || at.y < 0.001) {
                continue;
            }
            for back in facet.sides() {
                let [a, b] = [-1e-9, 1e-9].map(|way| mesh.find_element(facet, back, at + way * over));
                between += usize::from(mesh.subdivision(a.0) != mesh.subdivision(b.0));
                let [a, b] = [a, b].map(|(_, element, within)| f64::from(smooth.at(element, within)[0]));
                assert!((a - b).abs() < 1e-4 * a.max(1.0), "at {at} over {over}: {a} and {b}");
            }
        }
    }
    assert!(between > 1000, "only {between} places lie between levels");
}
