//! Closed forms, and what must hold for any polygons.

use super::*;
use glam::DVec3;
use ringlight_visibility::NO_PLANE;
use std::f64::consts::PI;

fn polygon(corners: &[[f64; 3]]) -> Polygon {
    Polygon::new(corners.iter().copied().map(DVec3::from).collect(), NO_PLANE).unwrap()
}

/// Exchange area with nothing between.
fn open(a: &Polygon, b: &Polygon) -> f64 {
    exchange(a, b, None, &Tolerance::default(), &mut Work::default()).area
}

/// x × y rectangle at height z that faces up or down.
fn rectangle([x0, x1]: [f64; 2], [y0, y1]: [f64; 2], z: f64, up: bool) -> Polygon {
    let mut corners = [[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]];
    if !up {
        corners.reverse();
    }
    polygon(&corners)
}

/// Rectangle in the plane x = 0 with corners (y0, z0) and (y1, z1), facing +x.
fn wall([y0, y1]: [f64; 2], [z0, z1]: [f64; 2]) -> Polygon {
    polygon(&[[0.0, y0, z0], [0.0, y1, z0], [0.0, y1, z1], [0.0, y0, z1]])
}

/// Howell C-11: aligned parallel rectangles.
fn parallel(a: f64, b: f64, c: f64) -> f64 {
    let (x, y) = (a / c, b / c);
    let (p, q) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
    let log = (p * p * q * q / (1.0 + x * x + y * y)).sqrt().ln();
    2.0 / (PI * x * y) * (log + x * q * (x / q).atan() + y * p * (y / p).atan() - x * x.atan() - y * y.atan())
}

/// Howell C-14: rectangles l × w and l × h with the common edge l, at right angles; F from w.
fn perpendicular(l: f64, w: f64, h: f64) -> f64 {
    let (w, h) = (w / l, h / l);
    let (w2, h2) = (w * w, h * h);
    let s = w2 + h2;
    let log = ((1.0 + w2) * (1.0 + h2) / (1.0 + s)).ln()
        + w2 * (w2 * (1.0 + s) / ((1.0 + w2) * s)).ln()
        + h2 * (h2 * (1.0 + s) / ((1.0 + h2) * s)).ln();
    (w * (1.0 / w).atan() + h * (1.0 / h).atan() - s.sqrt() * (1.0 / s.sqrt()).atan() + log / 4.0) / (PI * w)
}

#[test]
fn equals_the_closed_form_for_parallel_squares() {
    for d in [0.01, 0.1, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0] {
        let f = open(&rectangle([0., 1.], [0., 1.], 0., true), &rectangle([0., 1.], [0., 1.], d, false));
        let e = parallel(1.0, 1.0, d);
        assert!((f / e - 1.0).abs() < 1e-10, "{d}: {:e}", f / e - 1.0);
    }
}

#[test]
fn equals_the_closed_form_for_perpendicular_rectangles() {
    for (l, w, h) in [(1.0, 1.0, 1.0), (1.0, 2.0, 3.0), (1.0, 1000.0, 1.0), (1.0, 0.001, 0.001), (1.0, 0.001, 1.0)] {
        let a = polygon(&[[0., 0., 0.], [w, 0., 0.], [w, l, 0.], [0., l, 0.]]);
        let f = open(&a, &wall([0.0, l], [0.0, h])) / a.area;
        let e = perpendicular(l, w, h);
        assert!((f / e - 1.0).abs() < 1e-9, "{l} {w} {h}: {:e}", f / e - 1.0);
    }
}

#[test]
fn equals_independent_values_for_squares_that_meet_at_an_angle() {
    // Closed form and adaptive contour agree to 1e-9.
    for (degrees, e) in [
        (30.0f64, 0.619028323091),
        (60.0, 0.370905321150),
        (90.0, 0.200043776075),
        (120.0, 0.086615001118),
        (150.0, 0.021345325413),
    ] {
        let (s, c) = degrees.to_radians().sin_cos();
        let a = polygon(&[[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]]);
        let b = polygon(&[[0., 0., 0.], [0., 1., 0.], [c, 1., s], [c, 0., s]]);
        let f = open(&a, &b);
        assert!((f / e - 1.0).abs() < 1e-9, "{degrees}: {:e}", f / e - 1.0);
    }
}

/// Two triangles of a parallelogram.
fn screen(origin: [f64; 3], u: [f64; 3], v: [f64; 3]) -> Vec<Occluder> {
    let [o, u, v] = [origin, u, v].map(DVec3::from);
    [[o, o + u, o + u + v], [o, o + u + v, o + v]].map(|corners| Occluder { corners, plane: NO_PLANE }).into()
}

fn obstructed(a: &Polygon, b: &Polygon, occluders: Vec<Occluder>) -> Exchange {
    exchange(a, b, Some(&Occluders::new(occluders)), &Tolerance::default(), &mut Work::default())
}

#[test]
fn half_a_screen_hides_half() {
    let (a, b) = (rectangle([0., 1.], [0., 1.], 0., true), rectangle([0., 1.], [0., 1.], 1., false));
    let found = obstructed(&a, &b, screen([0., 0., 0.5], [0.5, 0., 0.], [0., 1., 0.]));
    // By symmetry: x + x' < 1 is as likely as x + x' > 1.
    let exact = parallel(1.0, 1.0, 1.0) / 2.0;
    assert!((found.area - exact).abs() < 1e-3 * exact && (found.area - exact).abs() < found.error, "{found:?} {exact}");
}

#[test]
fn a_square_blocker_as_in_view3d() {
    // Exact clipping with adaptive quadrature, 1e-6.
    let (a, b) = (rectangle([0., 1.], [0., 1.], 0., true), rectangle([0., 1.], [0., 1.], 1., false));
    let found = obstructed(&a, &b, screen([0., 0., 0.5], [0.5, 0., 0.], [0., 0.5, 0.]));
    assert!((found.area - 0.149869).abs() < 1e-3 * 0.149869, "{found:?}");
}

/// Random numbers, always the same.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn vector(&mut self) -> DVec3 {
        let [x, y, z] = [(); 3].map(|()| 2.0 * self.unit() - 1.0);
        DVec3::new(x, y, z)
    }

    /// A triangle or a parallelogram.
    fn polygon(&mut self, spread: f64) -> Polygon {
        let (o, u, v) = (spread * self.vector(), self.vector(), self.vector());
        let corners = if self.unit() < 0.3 { vec![o, o + u, o + v] } else { vec![o, o + u, o + u + v, o + v] };
        Polygon::new(corners, NO_PLANE).unwrap()
    }

    fn occluders(&mut self, count: usize) -> Vec<Occluder> {
        (0..count)
            .map(|_| {
                let centre = self.vector();
                Occluder { corners: [(); 3].map(|()| centre + 0.4 * self.vector()), plane: NO_PLANE }
            })
            .collect()
    }
}

#[test]
fn is_the_same_to_the_bit_from_either_side_and_whatever_was_done_before() {
    let mut random = Random(1);
    let mut reused = Work::default();
    let tolerance = Tolerance::default();
    let mut seen = 0;
    for case in 0..60 {
        let (a, b) = (random.polygon(1.0), random.polygon(2.0));
        let occluders = Occluders::new(random.occluders(case % 8));
        for occluders in [None, Some(&occluders)] {
            let there = exchange(&a, &b, occluders, &tolerance, &mut reused);
            assert_eq!(there, exchange(&b, &a, occluders, &tolerance, &mut reused));
            assert_eq!(there, exchange(&a, &b, occluders, &tolerance, &mut Work::default()));
            seen += u32::from(there.area > 0.0);
        }
    }
    assert!(seen > 30, "{seen} pairs see each other");
}

#[test]
fn parts_add_up_to_the_whole() {
    let mut random = Random(2);
    let mut compared = 0;
    for case in 0..400 {
        let (a, b) = (random.polygon(1.0), random.polygon(2.0));
        let whole = open(&a, &b);
        // Cut from the first corner to a point of the opposite edge.
        let n = a.corners.len();
        let cut = a.corners[n - 2].lerp(a.corners[n - 1], 0.2 + 0.6 * random.unit());
        let first = [&a.corners[..n - 1], &[cut]].concat();
        let parts: f64 = [first, vec![a.corners[0], cut, a.corners[n - 1]]]
            .into_iter()
            .map(|corners| open(&Polygon::new(corners, NO_PLANE).unwrap(), &b))
            .sum();
        // 1e-9 of the whole; where next to nothing is seen, the angles' last digits.
        let smaller = a.area.min(b.area);
        assert!((parts - whole).abs() <= 1e-9 * whole + 4e-15 * smaller, "case {case}: {parts} of {whole}");
        compared += u32::from(whole > 1e-6 * smaller);
    }
    assert!(compared > 100, "{compared} pairs see each other");
}

#[test]
fn does_not_depend_on_where_things_are() {
    let mut random = Random(3);
    let (tolerance, mut work) = (Tolerance::default(), Work::default());
    for case in 0..100 {
        let (a, b) = (random.polygon(1.0), random.polygon(2.0));
        let occluders = random.occluders(3);
        let rotation = glam::DQuat::from_scaled_axis(3.0 * random.vector());
        let offset = 10.0 * random.vector();
        let scale = 0.5 + random.unit();
        let at = |c: DVec3| scale * (rotation * c) + offset;
        let moved = |p: &Polygon| Polygon::new(p.corners.iter().map(|&c| at(c)).collect(), NO_PLANE).unwrap();
        let here = open(&a, &b);
        let there = open(&moved(&a), &moved(&b)) / (scale * scale);
        assert!((there - here).abs() <= 1e-9 * here + 1e-14 * a.area.min(b.area), "case {case}: {here} {there}");
        let there_occluders =
            Occluders::new(occluders.iter().map(|o| Occluder { corners: o.corners.map(at), ..*o }).collect());
        let here = exchange(&a, &b, Some(&Occluders::new(occluders)), &tolerance, &mut work);
        let there = exchange(&moved(&a), &moved(&b), Some(&there_occluders), &tolerance, &mut work);
        let there = there.area / (scale * scale);
        let allowed = (2e-3 * here.area).max(1e-5 * a.area.min(b.area));
        assert!((there - here.area).abs() <= allowed, "case {case}: {here:?} {there}");
    }
}

#[test]
fn what_lies_in_a_polygons_plane_or_shares_its_id_never_hides_it() {
    let (mut a, mut b) = (rectangle([0., 1.], [0., 1.], 0., true), rectangle([0., 1.], [0., 1.], 1., false));
    let whole = open(&a, &b);
    let in_its_plane = screen([-1., -1., 0.], [3., 0., 0.], [0., 3., 0.]);
    assert_eq!(obstructed(&a, &b, in_its_plane).area, whole);
    let mut just_above = screen([-1., -1., 1e-4], [3., 0., 0.], [0., 3., 0.]);
    assert_eq!(obstructed(&a, &b, just_above.clone()).area, 0.0);
    just_above.iter_mut().for_each(|o| o.plane = 7);
    a.plane = 7;
    assert_eq!(obstructed(&a, &b, just_above).area, whole);
    // Two polygons of one plane see nothing of each other.
    b.plane = 7;
    assert_eq!(open(&a, &b), 0.0);
}

#[test]
fn polygons_that_face_away_or_lie_behind_see_nothing() {
    let square = |z: f64, up: bool| rectangle([0., 1.], [0., 1.], z, up);
    assert_eq!(open(&square(0.0, true), &square(1.0, true)), 0.0);
    assert_eq!(open(&square(0.0, false), &square(1.0, true)), 0.0);
    assert_eq!(open(&square(0.0, true), &rectangle([1., 2.], [0., 1.], 0., true)), 0.0);
    // Half of a wall that reaches as far below the floor as above it.
    let floor = square(0.0, true);
    let whole = open(&floor, &wall([0.0, 1.0], [-1.0, 1.0]));
    assert!((whole - perpendicular(1.0, 1.0, 1.0)).abs() < 1e-12, "{whole}");
}

#[test]
fn very_many_small_occluders_are_done_by_rays_within_the_estimate() {
    let (a, b) = (rectangle([0., 1.], [0., 1.], 0., true), rectangle([0., 1.], [0., 1.], 1., false));
    let coarse = obstructed(&a, &b, screen([0.2, 0.3, 0.4], [0.5, 0., 0.], [0., 0.4, 0.]));
    let n = 16;
    let fine = (0..n * n).flat_map(|k| {
        let (x, y) = (f64::from(k % n) / f64::from(n), f64::from(k / n) / f64::from(n));
        screen([0.2 + 0.5 * x, 0.3 + 0.4 * y, 0.4], [0.5 / f64::from(n), 0., 0.], [0., 0.4 / f64::from(n), 0.])
    });
    let fine = obstructed(&a, &b, fine.collect());
    assert!((fine.area - coarse.area).abs() <= fine.error + coarse.error, "{fine:?} {coarse:?}");
    assert!((fine.area - coarse.area).abs() < 2e-3 * coarse.area, "{fine:?} {coarse:?}");
}

#[test]
fn pieces_that_are_one_too_many_are_in_the_estimate() {
    // More triangles in a disc of 1000 corners than pieces may be made; in parts it takes fewer.
    let corner = |k: usize| {
        let (sin, cos) = (2.0 * PI * k as f64 / 1000.0).sin_cos();
        [cos, sin, 0.0]
    };
    let disc = polygon(&(0..1000).map(corner).collect::<Vec<_>>());
    let square = rectangle([-0.5, 0.5], [-0.5, 0.5], 1.0, false);
    let blocker = || screen([0.0, -0.3, 0.9], [0.4, 0., 0.], [0., 0.5, 0.]);
    let found = obstructed(&disc, &square, blocker());
    let parts: f64 = (0..10)
        .map(|part| {
            let arc = (100 * part..=100 * (part + 1)).map(corner);
            obstructed(&polygon(&[[0.0; 3]].into_iter().chain(arc).collect::<Vec<_>>()), &square, blocker()).area
        })
        .sum();
    assert!((found.area - parts).abs() <= found.error + 1e-3 * parts, "{found:?}, in parts {parts}");
}
