//! Masks of the hierarchy against brute force with the scalar predicate, bit for bit.

mod common;

use common::{Place, Random, Samples, filters, hierarchies, samples, shooter, shooter_of, triangles};
use proptest::prelude::*;
use ringlight_visibility::{Cells, Hierarchy, NO_PLANE, Tally, reference};

fn every_instruction_set_gives_the_reference_masks(
    seed: u64,
    count: usize,
    shooters: usize,
    kinds: std::ops::Range<usize>,
) -> Result<u64, TestCaseError> {
    let random = &mut Random(seed);
    let place = Place::random(random);
    let filters = filters(random);
    let triangles = triangles(random, place, count, if seed.is_multiple_of(2) { filters.len() } else { 0 });
    let hierarchies = hierarchies(&triangles, &filters);
    let mut cleared = 0;
    for _ in 0..shooters {
        let kind = kinds.start + random.below(kinds.len());
        let shooter = shooter_of(kind, random, place);
        let samples = samples(random, place);
        let all = shooter.cells.all();
        let given: Vec<u64> =
            samples.x.iter().map(|_| if random.below(4) == 0 { random.bits() & all } else { all }).collect();
        let mut expected = given.clone();
        reference::clear_blocked(&triangles, &filters, &shooter, samples.points(), &mut expected);
        for (set, hierarchy) in &hierarchies {
            let mut masks = given.clone();
            let tally = hierarchy.clear_blocked(&shooter, samples.points(), &mut masks);
            prop_assert_eq!(&masks, &expected, "seed {}, {:?}, {:?}, {:?}", seed, set, place, shooter);
            let rays = given.iter().map(|mask| u64::from(mask.count_ones())).sum::<u64>();
            prop_assert_eq!((tally.masks, tally.rays), (given.len() as u64, rays));
            prop_assert!(tally.masks_without_rays <= tally.masks);
        }
        cleared += given.iter().zip(&expected).map(|(a, b)| u64::from((a ^ b).count_ones())).sum::<u64>();
    }
    Ok(cleared)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn masks_equal_brute_force_on_small_scenes(seed: u64, count in 0usize..60) {
        every_instruction_set_gives_the_reference_masks(seed, count, 4, 0..5)?;
    }

    #[test]
    fn masks_of_scattered_cells_equal_brute_force(seed: u64, count in 0usize..60) {
        every_instruction_set_gives_the_reference_masks(seed, count, 4, 3..5)?;
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 30, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn masks_equal_brute_force_on_larger_scenes(seed: u64) {
        every_instruction_set_gives_the_reference_masks(seed, 1500, 1, 0..5)?;
    }

    #[test]
    fn masks_of_a_scene_in_two_hierarchies_are_the_and_of_both(seed: u64) {
        let random = &mut Random(seed);
        let place = Place::random(random);
        let filters = filters(random);
        let all = triangles(random, place, 400, filters.len());
        let (left, right): (Vec<_>, Vec<_>) = all.iter().partition(|_| random.below(2) == 0);
        let [whole, left, right] = [all, left, right].map(|t| Hierarchy::build(t, filters.clone()));
        let shooter = shooter(random, place);
        let samples = samples(random, place);
        let masks = |hierarchies: &[&Hierarchy]| {
            let mut masks = vec![shooter.cells.all(); samples.x.len()];
            for hierarchy in hierarchies {
                hierarchy.clear_blocked(&shooter, samples.points(), &mut masks);
            }
            masks
        };
        let separate: Vec<u64> = masks(&[&left]).iter().zip(masks(&[&right])).map(|(a, b)| a & b).collect();
        prop_assert_eq!(&masks(&[&whole]), &separate);
        prop_assert_eq!(&masks(&[&right, &left, &left]), &separate);
    }

    #[test]
    fn masks_do_not_depend_on_the_packets_of_points(seed: u64) {
        let random = &mut Random(seed);
        let place = Place::random(random);
        let hierarchy = Hierarchy::build(triangles(random, place, 300, 0), Vec::new());
        let shooter = shooter(random, place);
        let samples = samples(random, place);
        let count = samples.x.len();
        let mut together = vec![shooter.cells.all(); count];
        hierarchy.clear_blocked(&shooter, samples.points(), &mut together);
        let mut order: Vec<usize> = (0..count).collect();
        for i in (1..count).rev() {
            order.swap(i, random.below(i + 1));
        }
        for chunk in order.chunks(1 + random.below(40)) {
            let points: Vec<_> = chunk.iter().map(|&i| samples.points().at(i)).collect();
            let part = Samples::new(&points, chunk.iter().map(|&i| samples.plane[i]).collect());
            let mut masks = vec![shooter.cells.all(); chunk.len()];
            hierarchy.clear_blocked(&shooter, part.points(), &mut masks);
            let expected: Vec<u64> = chunk.iter().map(|&i| together[i]).collect();
            prop_assert_eq!(masks, expected);
        }
    }
}

/// The comparisons above would hold for a predicate that never blocks.
#[test]
fn random_scenes_block_a_good_share_of_the_rays() {
    let cleared: u64 = (0..30)
        .map(|seed| every_instruction_set_gives_the_reference_masks(seed, 40, 4, 0..5).expect("masks agree"))
        .sum();
    assert!(cleared > 20_000, "only {cleared} rays were blocked");
}

/// What is near the cells is not left out for the rounding of what is far.
#[test]
fn receivers_near_and_far_in_one_packet_are_answered_alike() {
    let random = &mut Random(5);
    for size in [1e-4, 1e-3, 1e-2] {
        let place = Place { scale: size, offset: [0.0; 3] };
        let made = triangles(random, place, 200, 0);
        let hierarchy = Hierarchy::build(made.clone(), Vec::new());
        for _ in 0..200 {
            let shooter = shooter_of(3, random, place);
            let far = random.vector().map(|c| 1000.0 * c);
            let points: Vec<_> = (0..16).map(|i| if i % 4 == 0 { far } else { place.at(random.vector()) }).collect();
            let samples = Samples::new(&points, vec![NO_PLANE; 16]);
            // Far ones see nothing any more, or all would be looked at for them.
            let given: [u64; 16] = std::array::from_fn(|i| if i % 4 == 0 { 0 } else { shooter.cells.all() });
            let (mut masks, mut expected) = (given, given);
            hierarchy.clear_blocked(&shooter, samples.points(), &mut masks);
            reference::clear_blocked(&made, &[], &shooter, samples.points(), &mut expected);
            assert_eq!(masks, expected, "{shooter:?}");
        }
    }
}

#[test]
fn coordinates_that_are_not_finite_block_nothing() {
    let random = &mut Random(1);
    let place = Place { scale: 1.0, offset: [0.0; 3] };
    let good = triangles(random, place, 30, 0);
    let mut bad = good.clone();
    for (i, value) in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY].into_iter().enumerate() {
        let mut triangle = good[i];
        triangle.corners[i][i] = value;
        bad.push(triangle);
    }
    let (good, bad) = (Hierarchy::build(good, Vec::new()), Hierarchy::build(bad, Vec::new()));
    assert_eq!(bad.slivers(), good.slivers() + 3);
    let (shooter, samples) = (shooter(random, place), samples(random, place));
    let masks = |h: &Hierarchy| {
        let mut masks = vec![shooter.cells.all(); samples.x.len()];
        h.clear_blocked(&shooter, samples.points(), &mut masks);
        masks
    };
    assert_eq!(masks(&good), masks(&bad));
}

#[test]
fn no_points_no_cells_and_no_triangles_are_answered() {
    let empty = Hierarchy::build(Vec::new(), Vec::new());
    let mut shooter = shooter(&mut Random(3), Place { scale: 1.0, offset: [0.0; 3] });
    let samples = Samples::new(&[[0.0; 3]], vec![NO_PLANE]);
    let mut masks = [shooter.cells.all()];
    let tally = empty.clear_blocked(&shooter, samples.points(), &mut masks);
    assert_eq!(masks[0], shooter.cells.all());
    assert_eq!(tally, Tally { rays: u64::from(masks[0].count_ones()), masks: 1, masks_without_rays: 1 });
    let none = Samples::new(&[], Vec::new());
    assert_eq!(empty.clear_blocked(&shooter, none.points(), &mut []), Tally::default());
    shooter.cells = Cells::Points(Vec::new());
    assert_eq!(empty.clear_blocked(&shooter, samples.points(), &mut [0]).masks, 1);
}
