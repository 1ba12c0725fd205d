//! Nearest hits of the hierarchy against brute force with the scalar predicate.

mod common;

use common::{Place, Random, filters, hierarchies, triangles};
use proptest::prelude::*;
use ringlight_visibility::{Boxes, Hierarchy, Hit, NO_PLANE, OPAQUE, Ray, Triangle, reference};

proptest! {
    #![proptest_config(ProptestConfig { cases: 120, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn nearest_hits_equal_brute_force(seed: u64, count in 0usize..400) {
        let random = &mut Random(seed);
        let place = Place::random(random);
        let filters = filters(random);
        let triangles = triangles(random, place, count, filters.len());
        let hierarchies = hierarchies(&triangles, &filters);
        for _ in 0..60 {
            let lattice = random.below(3) == 0;
            let origin = place.at(if lattice { random.lattice() } else { random.vector() });
            let towards = if lattice { random.lattice() } else { random.vector() };
            let direction = match random.below(3) {
                0 => towards,
                1 => towards.map(|c| c * place.scale),
                _ => { let mut axis = [0.0; 3]; axis[random.below(3)] = random.signed(); axis }
            };
            let ray = Ray {
                origin,
                direction,
                near: if random.below(2) == 0 { 0.0 } else { 0.3 },
                far: if random.below(2) == 0 { f32::INFINITY } else { 1.0 },
                plane: if random.below(2) == 0 { 1 } else { NO_PLANE },
            };
            let expected = reference::nearest_hit(&triangles, &filters, &ray);
            for (set, hierarchy) in &hierarchies {
                prop_assert_eq!(hierarchy.nearest_hit(&ray), expected, "seed {}, {:?}, {:?}", seed, set, ray);
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 120, failure_persistence: None, ..ProptestConfig::default() })]

    /// Parts of a scene asked one after the other, those passed by whose box the ray cannot meet.
    #[test]
    fn hits_of_beams_are_those_of_their_rays(seed: u64, count in 0usize..400) {
        let random = &mut Random(seed);
        let place = Place::random(random);
        let filters = filters(random);
        let triangles = triangles(random, place, count, filters.len());
        let hierarchies = hierarchies(&triangles, &filters);
        for _ in 0..12 {
            let towards = if random.below(3) == 0 { random.lattice() } else { random.vector() };
            let mut direction = if random.below(2) == 0 { towards } else { towards.map(|c| c * place.scale) };
            if random.below(4) == 0 {
                direction[random.below(3)] = 0.0;
            }
            // From beside each other to anywhere.
            let (middle, spread) = (random.vector(), [0.0, 0.01, 0.2, 1.0][random.below(4)]);
            let ray = |random: &mut Random| {
                let off = random.vector();
                let origin = match random.below(6) {
                    0 => random.lattice(),
                    _ => std::array::from_fn(|i| middle[i] + spread * off[i]),
                };
                Ray {
                    origin: place.at(origin),
                    direction,
                    near: if random.below(4) == 0 { 0.3 } else { 0.0 },
                    far: if random.below(4) == 0 { 1.0 } else { f32::INFINITY },
                    plane: if random.below(2) == 0 { 1 } else { NO_PLANE },
                }
            };
            let rays: Vec<Ray> = (0..random.below(40)).map(|_| ray(random)).collect();
            for (set, hierarchy) in &hierarchies {
                let expected: Vec<_> = rays.iter().map(|ray| hierarchy.nearest_hit(ray)).collect();
                prop_assert_eq!(hierarchy.nearest_hits(&rays), expected, "seed {}, {:?}, {:?}", seed, set, rays);
            }
        }
    }

    #[test]
    fn nearest_hits_of_parts_join_to_that_of_the_whole(seed: u64, count in 0usize..400, parts in 1usize..9) {
        let random = &mut Random(seed);
        let place = Place::random(random);
        let filters = filters(random);
        let triangles = triangles(random, place, count, filters.len());
        let whole = Hierarchy::build(triangles.clone(), filters.clone());
        let mut held = vec![Vec::new(); parts];
        // Small parts last: their boxes are passed by most often.
        triangles.iter().for_each(|&t| held[random.below(parts).min(random.below(parts))].push(t));
        let boxes: Vec<[[f32; 3]; 2]> = held
            .iter()
            .map(|part| {
                let corners = || part.iter().flat_map(|t| t.corners);
                let least = |i: usize| corners().map(|c| c[i]).fold(f32::INFINITY, f32::min);
                let most = |i: usize| corners().map(|c| c[i]).fold(f32::NEG_INFINITY, f32::max);
                [std::array::from_fn(least), std::array::from_fn(most)]
            })
            .collect();
        let held: Vec<Hierarchy> = held.into_iter().map(|part| Hierarchy::build(part, filters.clone())).collect();
        for _ in 0..60 {
            let lattice = random.below(3) == 0;
            let vector = |random: &mut Random| if lattice { random.lattice() } else { random.vector() };
            let direction = vector(random);
            // Some that are parallel: boxes are asked about them together.
            let ray = |random: &mut Random| Ray {
                origin: place.at(vector(random)),
                direction,
                near: 0.0,
                far: if random.below(2) == 0 { f32::INFINITY } else { place.scale },
                plane: if random.below(2) == 0 { 1 } else { NO_PLANE },
            };
            let rays: Vec<Ray> = (0..1 + random.below(4)).map(|_| ray(random)).collect();
            let mut best: Vec<Option<Hit>> = vec![None; rays.len()];
            for (part, [low, high]) in held.iter().zip(&boxes) {
                if !Boxes::new(&[(*low, *high, NO_PLANE)]).may_be_hit(&rays, &best) {
                    continue;
                }
                for (ray, best) in rays.iter().zip(&mut best) {
                    let far = best.map_or(ray.far, |hit| hit.distance);
                    *best = part.nearest_hit(&Ray { far, ..*ray }).filter(|hit| hit.is_nearer(best)).or(*best);
                }
            }
            let expected: Vec<_> = rays.iter().map(|ray| whole.nearest_hit(ray)).collect();
            prop_assert_eq!(best, expected, "seed {}, {:?}", seed, rays);
        }
    }
}

fn triangle(corners: [[f32; 3]; 3], id: u32) -> Triangle {
    Triangle { corners, plane: NO_PLANE, id, filter: OPAQUE }
}

#[test]
fn equally_near_triangles_report_the_lowest_id() {
    let corners = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
    let ray =
        Ray { origin: [0.25, 0.25, 0.0], direction: [0.0, 0.0, 2.0], near: 0.0, far: f32::INFINITY, plane: NO_PLANE };
    for ids in [[5, 3, 9], [3, 5, 9], [9, 5, 3]] {
        let hierarchy = Hierarchy::build(ids.map(|id| triangle(corners, id)).to_vec(), Vec::new());
        let hit = hierarchy.nearest_hit(&ray).expect("the ray meets all three");
        assert_eq!((hit.triangle, hit.distance, hit.barycentric), (3, 0.5, [0.25, 0.25]));
    }
}

#[test]
fn the_side_from_which_corners_run_counter_clockwise_is_the_front() {
    let ray = |z: f32, towards: f32| Ray {
        origin: [0.2, 0.3, z],
        direction: [0.0, 0.0, towards],
        near: 0.0,
        far: f32::INFINITY,
        plane: NO_PLANE,
    };
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    for turn in 0..3 {
        let mut turned = corners;
        turned.rotate_left(turn);
        let hierarchy = Hierarchy::build(vec![triangle(turned, 0)], Vec::new());
        assert!(hierarchy.nearest_hit(&ray(1.0, -1.0)).expect("a hit from above").front);
        assert!(!hierarchy.nearest_hit(&ray(-1.0, 1.0)).expect("a hit from below").front);
        turned.reverse();
        let hierarchy = Hierarchy::build(vec![triangle(turned, 0)], Vec::new());
        assert!(!hierarchy.nearest_hit(&ray(1.0, -1.0)).expect("a hit from above").front);
    }
}
