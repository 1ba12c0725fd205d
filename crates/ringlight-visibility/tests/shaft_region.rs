//! Triangles outside of the region hide nothing.

mod common;

use common::{Place, Random, Samples, filters, samples, shooter, triangles};
use proptest::prelude::*;
use ringlight_visibility::{Cells, Grid, Hierarchy, Layout, NO_PLANE, PreparedShooter, Region, Shooter};

type Box3 = [[f32; 3]; 2];

fn around(boxes: impl Iterator<Item = Box3>) -> Box3 {
    boxes.fold([[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]], |a, b| {
        [std::array::from_fn(|i| a[0][i].min(b[0][i])), std::array::from_fn(|i| a[1][i].max(b[1][i]))]
    })
}

/// Masks with all triangles and with those alone whose boxes meet the region.
fn same_masks(seed: u64) -> Result<(), TestCaseError> {
    let random = &mut Random(seed);
    let place = Place::random(random);
    let filters = filters(random);
    let all = triangles(random, place, 300, filters.len());
    let scene = around(all.iter().flat_map(|t| t.corners).map(|c| [c, c]));
    let (shooter, samples) = (shooter(random, place), samples(random, place));
    let cells = shooter.cells.all();
    let given: Vec<u64> = samples.x.iter().map(|_| [cells, random.bits() & cells, 0][random.below(3)]).collect();
    let region = Region::new(&PreparedShooter::new(&shooter), samples.points(), &given, scene);
    let met: Vec<_> = all
        .iter()
        .filter(|t| {
            let [low, high] = around(t.corners.iter().map(|&c| [c, c]));
            region.meets(low, high)
        })
        .copied()
        .collect();
    let masks = [all, met].map(|triangles| {
        let mut masks = given.clone();
        Hierarchy::build(triangles, filters.clone()).clear_blocked(&shooter, samples.points(), &mut masks);
        masks
    });
    prop_assert_eq!(&masks[0], &masks[1], "seed {}, {:?}, {:?}", seed, place, shooter);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn triangles_outside_of_the_region_hide_nothing(seed: u64) {
        same_masks(seed)?;
    }
}

/// The comparison above would hold for a region that holds everything: between a small shooter and points near each
/// other lies little of a scene, and the triangle in the middle does.
#[test]
fn the_region_leaves_much_out() {
    let corner = [-0.9, -0.8, -0.7];
    let grid = Grid {
        origin: corner,
        edge_u: [0.1, 0.0, 0.0],
        edge_v: [0.0, 0.1, 0.0],
        twist: [0.0; 3],
        layout: Layout::Quad,
        side: 4,
    };
    let points: Vec<[f32; 3]> = (0..8).map(|i| [0.8 + 0.1 * (i & 1) as f32, 0.8, 0.7 + 0.01 * i as f32]).collect();
    let samples = Samples::new(&points, vec![NO_PLANE; points.len()]);
    let towards = [-1.7, -1.6, -1.4].map(|c| c / 2.72);
    for cells in [Cells::Grid(grid), Cells::Points(vec![corner]), Cells::Directions(vec![towards])] {
        let shooter = Shooter { cells, plane: NO_PLANE, far: 0.9999 };
        let masks = vec![shooter.cells.all(); points.len()];
        let region = Region::new(&PreparedShooter::new(&shooter), samples.points(), &masks, [[-1.0; 3], [1.0; 3]]);
        let boxes = (0..8000).map(|i| [i % 20, i / 20 % 20, i / 400].map(|k| k as f32 * 0.1 - 1.0));
        let met = boxes.filter(|low| region.meets(*low, low.map(|c| c + 0.1))).count();
        assert!((20..800).contains(&met), "{met} of 8000 boxes");
        assert!(region.meets([-0.05, -0.05, -0.05], [0.05; 3]));
        assert!(
            !Region::new(&PreparedShooter::new(&shooter), samples.points(), &[0; 8], [[-1.0; 3], [1.0; 3]])
                .meets([-1.0; 3], [1.0; 3])
        );
    }
}
