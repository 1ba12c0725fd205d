//! Masks of scenes of boxes against brute force with the scalar predicate, with rays along edges and through corners.

mod common;

use common::{Place, Random, Samples, Vector, add, box_sides, hierarchies};
use proptest::prelude::*;
use ringlight_visibility::{Cells, Grid, Layout, NO_PLANE, OPAQUE, Shooter, Triangle, reference};

/// Boxes, upright, turned or askew, thick or thin, some with open sides, and some not quite boxes; now and then a triangle
/// between them.
fn boxes(random: &mut Random, place: Place) -> Vec<Triangle> {
    let mut triangles = Vec::new();
    for _ in 0..1 + random.below(12) {
        let corner = random.vector();
        let planes = random.below(2) == 0;
        for pair in box_sides(random, corner) {
            let plane = if planes { random.below(6) as u32 } else { NO_PLANE };
            triangles.extend(pair.map(|corners| (corners, plane)));
        }
        if random.below(3) == 0 {
            triangles.push(([random.vector(), random.vector(), random.vector()], NO_PLANE));
        }
    }
    (0..)
        .zip(triangles)
        .map(|(id, (corners, plane))| Triangle { corners: corners.map(|c| place.at(c)), plane, id, filter: OPAQUE })
        .collect()
}

/// A point of the scene's surface: inside a triangle, on an edge, or a corner.
fn on_surface(random: &mut Random, triangles: &[Triangle]) -> Vector {
    let [a, b, c] = triangles[random.below(triangles.len())].corners;
    let (s, t) = (random.signed().abs(), random.signed().abs());
    let towards = |a: Vector, b: Vector, t: f32| -> Vector { std::array::from_fn(|i| a[i] + t * (b[i] - a[i])) };
    match random.below(3) {
        0 => a,
        1 => towards(a, b, t),
        _ => towards(a, towards(b, c, s), t),
    }
}

/// Receivers on surfaces, a little in front of them or behind, inside of boxes and far from them.
fn receivers(random: &mut Random, place: Place, triangles: &[Triangle]) -> Samples {
    let spread = [0.0, 1e-4, 0.01, 0.3][random.below(4)];
    let kind = random.below(4);
    let start = on_surface(random, triangles);
    let points: Vec<Vector> = (0..1 + random.below(40))
        .map(|_| {
            let point = match kind {
                0 => start,
                1 => on_surface(random, triangles),
                2 => {
                    let (p, q) = (on_surface(random, triangles), on_surface(random, triangles));
                    std::array::from_fn(|i| 0.5 * (p[i] + q[i]))
                }
                _ => place.at(random.vector()),
            };
            add(point, random.vector(), spread * place.scale)
        })
        .collect();
    let plane = points.iter().map(|_| if random.below(2) == 0 { random.below(6) as u32 } else { NO_PLANE }).collect();
    Samples::new(&points, plane)
}

/// A grid of which one cell lies behind a point of the surface, seen from a receiver, and so on the edge of a shadow.
fn shooter(random: &mut Random, place: Place, triangles: &[Triangle], samples: &Samples) -> Shooter {
    let from = samples.points().at(random.below(samples.x.len()));
    let through = on_surface(random, triangles);
    let way = 1.0 + random.signed().abs() * 3.0;
    let behind: Vector = std::array::from_fn(|i| from[i] + way * (through[i] - from[i]));
    let side = [1, 2, 4, 8, 4, 8][random.below(6)];
    let size = place.scale * [2.0, 0.5, 0.05][random.below(3)];
    let edge = |random: &mut Random| match random.below(3) {
        0 => random.vector().map(|c| c * size),
        axis => std::array::from_fn(|i| if i == axis { size } else { 0.0 }),
    };
    let mut grid = Grid {
        origin: [0.0; 3],
        edge_u: edge(random),
        edge_v: edge(random),
        twist: [0.0; 3],
        layout: if random.below(4) == 0 { Layout::Triangle } else { Layout::Quad },
        side,
    };
    let cell = grid.point(random.below(grid.len()));
    grid.origin = std::array::from_fn(|i| behind[i] - cell[i]);
    let plane = if random.below(3) == 0 { random.below(6) as u32 } else { NO_PLANE };
    Shooter { cells: Cells::Grid(grid), plane, far: 0.9999 }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn masks_among_boxes_equal_brute_force(seed: u64) {
        let random = &mut Random(seed);
        let place = Place::random(random);
        let triangles = boxes(random, place);
        let hierarchies = hierarchies(&triangles, &[]);
        for _ in 0..4 {
            let samples = receivers(random, place, &triangles);
            let shooter = shooter(random, place, &triangles, &samples);
            let mut expected = vec![shooter.cells.all(); samples.x.len()];
            let given = expected.clone();
            reference::clear_blocked(&triangles, &[], &shooter, samples.points(), &mut expected);
            for (set, hierarchy) in &hierarchies {
                // Twice: what hid something is looked at first.
                for _ in 0..2 {
                    let mut masks = given.clone();
                    hierarchy.clear_blocked(&shooter, samples.points(), &mut masks);
                    prop_assert_eq!(&masks, &expected, "seed {}, {:?}, {:?}, {:?}", seed, set, place, shooter);
                }
            }
        }
    }
}
