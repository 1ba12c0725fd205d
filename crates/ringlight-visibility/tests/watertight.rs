//! Closed meshes hide what is outside from what is inside, though every triangle stores its own corners.

mod common;

use common::{Place, Random, Samples, Vector, add, hierarchies};
use proptest::prelude::*;
use ringlight_visibility::{Cells, Grid, Layout, NO_PLANE, OPAQUE, Ray, Shooter, Triangle};

/// A cube's sides in n × n quads, blown up to the sphere if `round`.
fn closed_mesh(place: Place, n: usize, round: bool) -> Vec<Triangle> {
    let mut triangles = Vec::new();
    for side in 0..6 {
        let at = |i: usize, j: usize| {
            let mut p = [0.0; 3];
            let step = |t: usize| 2.0 * t as f32 / n as f32 - 1.0;
            (p[side % 3], p[(side + 1) % 3], p[(side + 2) % 3]) = (if side < 3 { 1.0 } else { -1.0 }, step(i), step(j));
            let length = if round { p.iter().map(|c| c * c).sum::<f32>().sqrt() } else { 1.0 };
            place.at(p.map(|c| c / length))
        };
        for (i, j) in (0..n * n).map(|k| (k % n, k / n)) {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            triangles.extend([[a, b, c], [c, d, a]]);
        }
    }
    (0..).zip(triangles).map(|(id, corners)| Triangle { corners, plane: NO_PLANE, id, filter: OPAQUE }).collect()
}

fn outside(random: &mut Random) -> Vector {
    let p = random.vector();
    let size = p.iter().fold(0f32, |size, c| size.max(c.abs())).max(1e-3);
    p.map(|c| c / size * (2.0 + random.signed().abs()))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_cell_outside_is_seen_from_inside_a_closed_mesh(seed: u64, n in 1usize..12, round: bool) {
        let random = &mut Random(seed);
        let place = Place::random(random);
        let triangles = closed_mesh(place, n, round);
        let inside: Vec<Vector> = (0..64).map(|_| place.at(random.vector().map(|c| 0.5 * c))).collect();
        let samples = Samples::new(&inside, vec![NO_PLANE; 64]);
        let corner = outside(random);
        let cells = match random.below(3) {
            0 => Cells::Points((0..64).map(|_| place.at(outside(random))).collect()),
            1 => Cells::Directions((0..64).map(|_| random.vector()).collect()),
            _ => Cells::Grid(Grid {
                origin: place.at(corner),
                // Away from the mesh, so that the whole grid is outside.
                edge_u: corner.map(|c| c * place.scale * 0.5),
                edge_v: add(corner, random.vector(), 0.3).map(|c| c * place.scale),
                twist: [0.0; 3],
                layout: if random.below(2) == 0 { Layout::Quad } else { Layout::Triangle },
                side: 8,
            }),
        };
        let shooter = Shooter { cells, plane: NO_PLANE, far: 0.9999 };
        for (set, hierarchy) in hierarchies(&triangles, &[]) {
            let mut masks = vec![shooter.cells.all(); 64];
            hierarchy.clear_blocked(&shooter, samples.points(), &mut masks);
            prop_assert!(masks.iter().all(|&mask| mask == 0), "seed {}, {:?}: {:x?}", seed, set, masks);
            for _ in 0..20 {
                let ray = Ray {
                    origin: inside[random.below(64)],
                    direction: random.vector(),
                    near: 0.0,
                    far: f32::INFINITY,
                    plane: NO_PLANE,
                };
                prop_assert!(hierarchy.nearest_hit(&ray).is_some(), "seed {}, {:?}", seed, ray);
            }
        }
    }

    #[test]
    fn rays_aimed_at_shared_edges_and_corners_do_not_leak(seed: u64, n in 1usize..9, round: bool) {
        let random = &mut Random(seed);
        let place = Place::random(random);
        let triangles = closed_mesh(place, n, round);
        let x = place.at(random.vector().map(|c| 0.4 * c));
        let cells = (0..64)
            .map(|_| {
                let corners = triangles[random.below(triangles.len())].corners;
                let share = if random.below(2) == 0 { 0.0 } else { 0.5 };
                let on_edge: Vector = std::array::from_fn(|i| corners[0][i] + share * (corners[1][i] - corners[0][i]));
                std::array::from_fn(|i| x[i] + 3.0 * (on_edge[i] - x[i]))
            })
            .collect();
        let shooter = Shooter { cells: Cells::Points(cells), plane: NO_PLANE, far: 0.9999 };
        let samples = Samples::new(&[x], vec![NO_PLANE]);
        for (set, hierarchy) in hierarchies(&triangles, &[]) {
            let mut masks = [u64::MAX];
            hierarchy.clear_blocked(&shooter, samples.points(), &mut masks);
            prop_assert_eq!(masks[0], 0, "seed {}, {:?}", seed, set);
        }
    }
}

/// The tests above would hold for a predicate that always blocks.
#[test]
fn a_mesh_with_a_hole_lets_the_light_through_the_hole_only() {
    let mut triangles = closed_mesh(Place { scale: 1.0, offset: [0.0; 3] }, 4, false);
    // The quad of the +x side around (1, 0.25, 0.25).
    triangles.retain(|t| {
        !t.corners.iter().all(|c| c[0] == 1.0 && (0.0..=0.5).contains(&c[1]) && (0.0..=0.5).contains(&c[2]))
    });
    assert_eq!(triangles.len(), 6 * 32 - 2);
    let cells = vec![[3.0, 0.75, 0.75], [3.0, -0.75, 0.75], [-3.0, 0.75, 0.75]];
    let shooter = Shooter { cells: Cells::Points(cells), plane: NO_PLANE, far: 0.9999 };
    let samples = Samples::new(&[[0.0; 3]], vec![NO_PLANE]);
    for (set, hierarchy) in hierarchies(&triangles, &[]) {
        let mut masks = [7];
        hierarchy.clear_blocked(&shooter, samples.points(), &mut masks);
        assert_eq!(masks[0], 1, "{set:?}");
    }
}
