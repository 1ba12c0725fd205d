//! What is fast beside what is slow and obvious.

use glam::{DVec2, DVec3};
use ringlight::column::Store;
use ringlight::form_factor::contour;
use ringlight::mesh::{self, MeshOptions, Quality};
use ringlight_accuracy::method::exact;
use ringlight_accuracy::oracle::integral;
use ringlight_accuracy::oracle::kernel::{PatchShooter, triangles};
use ringlight_accuracy::scene::own;
use ringlight_visibility::{Points, reference};
use std::f64::consts::PI;

/// Numbers between −1 and 1, always the same (SplitMix64).
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    fn signed(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::from(std::array::from_fn(|_| self.signed()))
    }
}

/// A triangle or parallelogram; the contour takes triangles and convex quadrilaterals.
fn polygon(random: &mut Random, size: f64) -> Vec<DVec3> {
    let (origin, u, v) = (random.vector(), size * random.vector(), size * random.vector());
    if random.bits().is_multiple_of(2) {
        vec![origin, origin + u, origin + v]
    } else {
        vec![origin, origin + u, origin + u + v, origin + v]
    }
}

#[test]
fn the_contour_equals_the_integral_of_the_definition() {
    let random = &mut Random(1);
    let (mut worst, mut cut, mut seen) = (0.0f64, 0, 0);
    for case in 0..300 {
        let corners = polygon(random, [1.0, 0.3, 0.05][case % 3]);
        let (point, normal) = (random.vector(), random.vector().normalize());
        let vector = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        // Close to its plane the integrand is too sharp for numbers of points that a test can wait for.
        if vector.normalize().dot(point - corners[0]).abs() < 0.03 {
            continue;
        }
        let closed = contour(point, normal, &corners);
        let integral = integral::form_factor(point, normal, &corners, 1e-10);
        worst = worst.max((closed - integral).abs());
        let above = corners.iter().filter(|c| normal.dot(**c - point) > 0.0).count();
        cut += usize::from(above > 0 && above < corners.len());
        seen += usize::from(closed > 0.0);
    }
    assert!(cut > 40 && seen > 100, "{cut} cut by the horizon, {seen} seen");
    assert!(worst < 1e-8, "{worst}");
}

#[test]
fn what_blockers_leave_of_a_polygon_equals_rays_to_a_million_places() {
    let random = &mut Random(5);
    let mut hidden = 0;
    for _ in 0..12 {
        let shooter: Vec<DVec3> =
            [(-1., -1.), (1., -1.), (1., 1.), (-1., 1.)].map(|(x, y)| DVec3::new(x, y, 3.0)).to_vec();
        let blockers: Vec<Vec<DVec3>> =
            (0..3).map(|_| polygon(random, 1.0).iter().map(|c| *c + DVec3::new(0.0, 0.0, 1.6)).collect()).collect();
        let normal = (DVec3::Z + 0.3 * random.vector()).normalize();
        let found = exact::form_factor(DVec3::ZERO, normal, &shooter, &blockers);
        let side = 1000;
        let mut sum = 0.0;
        for k in 0..side * side {
            let place = |i: i32| (f64::from(i) + 0.5) * 2.0 / f64::from(side) - 1.0;
            let to = DVec3::new(place(k % side), place(k / side), 3.0);
            if !blockers.iter().any(|blocker| blocks(blocker, to)) {
                let r2 = to.length_squared();
                sum += normal.dot(to).max(0.0) * to.z / (PI * r2 * r2) * 4.0 / f64::from(side * side);
            }
        }
        hidden += usize::from(found < 0.9 * contour(DVec3::ZERO, normal, &shooter));
        // An edge of length 2 across a thousand rows of places: below a place's share for each row, of random sign.
        assert!((found - sum).abs() < 1e-4, "{found} {sum}");
    }
    assert!(hidden > 6, "{hidden} hidden by a tenth or more");
}

/// Whether the way from the origin to a point meets a triangle or parallelogram.
fn blocks(corners: &[DVec3], to: DVec3) -> bool {
    let (u, v) = (corners[1] - corners[0], corners[corners.len() - 1] - corners[0]);
    // −origin = u·a + v·b − to·t, by Cramer's rule.
    let determinant = u.cross(v).dot(-to);
    let a = (-corners[0]).cross(v).dot(-to) / determinant;
    let b = u.cross(-corners[0]).dot(-to) / determinant;
    let t = u.cross(v).dot(-corners[0]) / determinant;
    let inside = if corners.len() == 3 { a + b <= 1.0 } else { a <= 1.0 && b <= 1.0 };
    a >= 0.0 && b >= 0.0 && inside && t > 0.0 && t < 1.0
}

/// Average over the unit square at z = 0 of the contour's form factor to a rectangle, by the midpoint rule on `n` × `n` points.
fn averaged(normal_up: DVec3, rectangle: &[DVec3], n: u32) -> f64 {
    let at = |k: u32| DVec3::new((f64::from(k % n) + 0.5) / f64::from(n), (f64::from(k / n) + 0.5) / f64::from(n), 0.0);
    (0..n * n).map(|k| contour(at(k), normal_up, rectangle)).sum::<f64>() / f64::from(n * n)
}

#[test]
fn the_contour_averaged_over_a_square_gives_the_published_factors_of_the_cube() {
    // Unit squares: opposite ones (Howell's catalogue, C-11), and by closure ones that share an edge.
    let opposite = {
        let logarithm = (4.0f64 / 3.0).sqrt().ln();
        let arcs = 2.0 * 2.0f64.sqrt() * (1.0 / 2.0f64.sqrt()).atan() - 2.0 * 1.0f64.atan();
        2.0 / PI * (logarithm + arcs)
    };
    let adjacent = (1.0 - opposite) / 4.0;
    let squares = [
        (opposite, [(0., 0., 1.), (1., 0., 1.), (1., 1., 1.), (0., 1., 1.)]),
        (adjacent, [(0., 0., 0.), (1., 0., 0.), (1., 0., 1.), (0., 0., 1.)]),
    ];
    for (expected, square) in squares {
        let square = square.map(|(x, y, z)| DVec3::new(x, y, z));
        let [coarse, fine] = [128, 256].map(|n| averaged(DVec3::Z, &square, n));
        // The midpoint rule's error falls with the square of the step: extrapolated (Richardson), it is gone, but for what the
        // shared edge's corner leaves.
        let extrapolated = (4.0 * fine - coarse) / 3.0;
        assert!((extrapolated / expected - 1.0).abs() < 2e-6, "{extrapolated} for {expected}");
    }
}

#[test]
fn masks_on_our_own_scenes_equal_every_ray_against_every_triangle() {
    for file in ["office.glb", "gallery.glb", "furnace.glb", "cornell_box.obj"] {
        let options = MeshOptions { quality: Quality::Draft, ..MeshOptions::default() };
        let mesh = mesh::build(&own(file), &options, Store::Heap).unwrap();
        let (hierarchy, triangles) = (mesh::hierarchy(&mesh), triangles(&mesh));
        let random = &mut Random(9);
        let (mut blocked, mut rays) = (0, 0);
        for _ in 0..12 {
            let any = |random: &mut Random| mesh.patch((random.bits() % mesh.patch_count() as u64) as u32);
            let shooter = PatchShooter::new(&any(random), 8).shooter;
            // Anywhere, edges and corners of patches included.
            let receivers: Vec<_> = (0..40)
                .map(|k| {
                    let patch = any(random);
                    let at = DVec2::new(random.signed().abs(), random.signed().abs());
                    (patch.frame.at(if k % 4 == 0 { at.round() } else { at }).as_vec3(), patch.plane)
                })
                .collect();
            let axis = |i: usize| -> Vec<f32> { receivers.iter().map(|(p, _)| p[i]).collect() };
            let (x, y, z) = (axis(0), axis(1), axis(2));
            let plane: Vec<u32> = receivers.iter().map(|(_, plane)| *plane).collect();
            let points = Points { x: &x, y: &y, z: &z, plane: &plane };
            let mut expected = vec![u64::MAX; receivers.len()];
            reference::clear_blocked(&triangles, &[], &shooter, points, &mut expected);
            let mut masks = vec![u64::MAX; receivers.len()];
            hierarchy.clear_blocked(&shooter, points, &mut masks);
            assert_eq!(masks, expected, "{file}");
            rays += 64 * masks.len();
            blocked += masks.iter().map(|mask| mask.count_zeros() as usize).sum::<usize>();
        }
        assert!(blocked * 10 > rays && blocked < rays, "{file}: {blocked} of {rays} blocked");
    }
}
