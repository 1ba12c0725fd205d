//! Triangles in a convex region, against testing each of them.

mod common;

use common::{Place, Random};
use ringlight_visibility::{HalfSpace, Hierarchy, NO_PLANE, OPAQUE, Triangle};

#[test]
fn visits_every_triangle_with_a_corner_inside_and_none_beyond_the_leaves_around_it() {
    let (mut inside, mut visits) = (0, 0);
    for seed in 0..200 {
        let mut random = Random(seed);
        let place = Place::random(&mut random);
        let triangles: Vec<Triangle> = (0..500)
            .map(|id| {
                let centre = random.vector();
                let corners = [(); 3].map(|()| {
                    let v = random.vector();
                    place.at(std::array::from_fn(|i| centre[i] + 0.1 * v[i]))
                });
                Triangle { corners, plane: NO_PLANE, id, filter: OPAQUE }
            })
            .collect();
        let region: Vec<HalfSpace> = (0..random.below(9))
            .map(|_| {
                let normal = random.vector().map(f64::from);
                let on = place.at(random.vector().map(|c| 0.5 * c)).map(f64::from);
                HalfSpace { normal, offset: (0..3).map(|i| normal[i] * on[i]).sum() }
            })
            .collect();
        let hierarchy = Hierarchy::build(triangles, Vec::new());
        let mut visited = vec![0; 500];
        hierarchy.visit(&region, |t| visited[t.id as usize] += 1);
        for t in hierarchy.triangles() {
            let has = |p: [f32; 3]| {
                region.iter().all(|h| (0..3).map(|i| h.normal[i] * f64::from(p[i])).sum::<f64>() <= h.offset)
            };
            let count = visited[t.id as usize];
            assert!(count <= 1, "seed {seed}: triangle {} visited {count} times", t.id);
            if t.corners.into_iter().any(has) {
                assert_eq!(count, 1, "seed {seed}: triangle {}", t.id);
                inside += 1;
            }
            visits += count;
        }
    }
    // A query that visits everything would do its duty, but not its work: there are 100,000 triangles.
    assert!(inside > 10_000 && visits < 2 * inside + 20_000, "{inside} inside, {visits} visited");
}
