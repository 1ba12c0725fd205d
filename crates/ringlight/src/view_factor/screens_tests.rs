//! What screens hide, and what they must not.

use super::super::Occluder;
use super::*;

fn quad(at: [f64; 3], u: [f64; 3], v: [f64; 3], plane: u32) -> Polygon {
    let (at, u, v) = (DVec3::from(at), DVec3::from(u), DVec3::from(v));
    Polygon::new(vec![at, at + u, at + u + v, at + v], plane).unwrap()
}

fn blocking(polygons: &[&Polygon]) -> Occluders {
    let triangles = polygons.iter().flat_map(|p| {
        let c = &p.corners;
        [[c[0], c[1], c[2]], [c[0], c[2], c[3]]].map(|corners| Occluder { corners, plane: p.plane })
    });
    Occluders::new(triangles.collect())
}

fn hides(blockers: &[&Polygon], a: &Polygon, b: &Polygon) -> bool {
    let mut all = vec![a, b];
    all.extend(blockers);
    let occluders = blocking(&all);
    let screens = Screens::new(&occluders);
    let [one, other] = [(a, b), (b, a)].map(|(a, b)| screens.hide(a, b, &occluders, &mut Memory::default()));
    assert_eq!(one, other);
    one
}

#[test]
fn a_wall_hides_what_is_wholly_behind_it() {
    let a = quad([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], 0);
    let b = quad([0.0, 0.0, 2.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], 1);
    let wall = quad([-0.1, -0.1, 1.0], [1.2, 0.0, 0.0], [0.0, 1.2, 0.0], 2);
    let gap = quad([-0.1, -0.1, 1.0], [1.2, 0.0, 0.0], [0.0, 1.05, 0.0], 2);
    // Of just their size: the outermost segments graze it.
    let tight = quad([0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], 2);
    assert!(hides(&[&wall], &a, &b) && hides(&[&tight], &a, &b));
    assert!(!hides(&[&gap], &a, &b) && !hides(&[], &a, &b));
    // Two walls one above the other hide together what neither hides alone, nor do two with a slit between.
    let low = quad([-0.1, -0.1, 1.0], [1.2, 0.0, 0.0], [0.0, 0.95, 0.0], 2);
    let high = quad([-0.1, 0.15, 1.2], [1.2, 0.0, 0.0], [0.0, 0.95, 0.0], 3);
    let slit = quad([-0.1, 0.86, 1.0], [1.2, 0.0, 0.0], [0.0, 0.3, 0.0], 2);
    assert!(hides(&[&low, &high], &a, &b) && !hides(&[&low, &slit], &a, &b));
}

#[test]
fn a_lampshade_does_not_hide_what_is_within_it() {
    let shade = [
        quad([-1.0, -1.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 2.0], 10),
        quad([1.0, -1.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0], 11),
        quad([1.0, 1.0, 0.0], [-2.0, 0.0, 0.0], [0.0, 0.0, 2.0], 12),
        quad([-1.0, 1.0, 0.0], [0.0, -2.0, 0.0], [0.0, 0.0, 2.0], 13),
        quad([-1.0, -1.0, 2.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0], 14),
    ];
    let shade: Vec<&Polygon> = shade.iter().collect();
    let bulb = quad([-0.1, -0.1, 1.0], [0.0, 0.2, 0.0], [0.2, 0.0, 0.0], 0);
    let table = quad([-0.5, -0.5, -2.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], 1);
    let ceiling = quad([-0.5, -0.5, 4.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], 2);
    assert!(!hides(&shade, &bulb, &table));
    assert!(hides(&shade, &table, &ceiling) && hides(&shade, &bulb, &ceiling));
    // What lies on the shade's inner side looks out below, what lies on its outer side does not look in.
    let inner = quad([-1.0, -0.5, 1.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.5], 20);
    let outer = quad([-1.0, -0.5, 1.0], [0.0, 0.0, 0.5], [0.0, 1.0, 0.0], 20);
    assert!(!hides(&shade, &inner, &table));
    let far = quad([-3.0, -0.5, 1.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.5], 21);
    assert!(!hides(&shade, &outer, &far) && !hides(&shade, &far, &outer));
}
