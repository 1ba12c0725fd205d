//! What screens hide, and what they must not.

use super::super::{Exchange, Occluder, Tolerance, Work, exchange};
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
    // All corners of a large table are hidden from the bulb, each by another side of the shade, and its middle is not.
    let large = quad([-10.0, -10.0, -2.0], [20.0, 0.0, 0.0], [0.0, 20.0, 0.0], 1);
    let all: Vec<&Polygon> = [&bulb, &ceiling, &large].into_iter().chain(shade.iter().copied()).collect();
    let occluders = blocking(&all);
    let (screens, mut memory) = (Screens::new(&occluders), Memory::default());
    // With the shade remembered from what it did hide.
    assert!(screens.hide(&bulb, &ceiling, &occluders, &mut memory));
    assert!(!screens.hide(&bulb, &large, &occluders, &mut memory));
    assert!(hides(&shade, &table, &ceiling) && hides(&shade, &bulb, &ceiling));
    // What lies on the shade's inner side looks out below, what lies on its outer side does not look in.
    let inner = quad([-1.0, -0.5, 1.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.5], 20);
    let outer = quad([-1.0, -0.5, 1.0], [0.0, 0.0, 0.5], [0.0, 1.0, 0.0], 20);
    assert!(!hides(&shade, &inner, &table));
    let far = quad([-3.0, -0.5, 1.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.5], 21);
    assert!(!hides(&shade, &outer, &far) && !hides(&shade, &far, &outer));
}

/// Checks that what is hidden is so without screens; how many of the pairs are hidden, and what the first and the last polygon
/// exchange. The pairs of the first go through one memory: what stands before those in between is tried before the last, too.
fn hidden_pairs(polygons: &[Polygon], walls: &[Polygon]) -> (usize, Exchange) {
    let all: Vec<&Polygon> = polygons.iter().chain(walls).collect();
    let occluders = blocking(&all);
    let screens = Screens::new(&occluders);
    let mut work = Work::default();
    let mut between = |a: &Polygon, b: &Polygon| exchange(a, b, Some(&occluders), &Tolerance::default(), &mut work);
    let mut hidden = 0;
    for (number, a) in polygons.iter().enumerate() {
        let mut memory = Memory::default();
        for (other, b) in polygons.iter().enumerate().skip(number + 1) {
            if screens.hide(a, b, &occluders, &mut memory) {
                hidden += 1;
                assert_eq!(between(a, b).area, 0.0, "{number} and {other} see each other");
            }
        }
    }
    (hidden, between(&polygons[0], &polygons[polygons.len() - 1]))
}

/// The sides of a box, seen from outside, with plane ids from `plane` on: −x, +x, −y, +y, −z, +z.
fn cuboid(low: [f64; 3], size: [f64; 3], plane: u32) -> Vec<Polygon> {
    let (low, size) = (DVec3::from(low), DVec3::from(size));
    (0..6)
        .map(|k| {
            let (axis, high) = (k / 2, k % 2 == 1);
            let along = |axis: usize| (size[axis % 3] * DVec3::AXES[axis % 3]).to_array();
            let at = if high { low + DVec3::from(along(axis)) } else { low };
            let (u, v) = if high { (axis + 1, axis + 2) } else { (axis + 2, axis + 1) };
            quad(at.to_array(), along(u), along(v), plane + k as u32)
        })
        .collect()
}

#[test]
fn what_is_seen_through_a_window_is_not_hidden() {
    let mut walls = cuboid([0.0; 3], [1.0; 3], 10);
    walls.remove(1);
    let at = |y: f64, z: f64| DVec3::new(1.0, y, z);
    let outer = [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)];
    // Exact in binary, so that the opening would have the wall's very numbers.
    let rim = [at(0.375, 0.375), at(0.625, 0.375), at(0.625, 0.625), at(0.375, 0.625)];
    walls.extend((0..4).map(|k| {
        let next = (k + 1) % 4;
        Polygon::new(vec![outer[k], outer[next], rim[next], rim[k]], 11).unwrap()
    }));
    let inside = quad([0.5, 0.45, 0.45], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1], 0);
    let outside = quad([2.0, 0.45, 0.45], [0.0, 0.0, 0.1], [0.0, 0.1, 0.0], 1);
    // Nothing of what the two see of each other is cut by the frame.
    let open = exchange(&inside, &outside, None, &Tolerance::default(), &mut Work::default());
    let behind = quad([-1.0, 0.45, 0.45], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1], 2);
    let mut turned = inside.clone();
    turned.corners.reverse();
    let turned = Polygon::new(turned.corners, 3).unwrap();
    // From the outside in: past the window's wall, what is behind the box is hidden, what is in it is not.
    let beside = quad([-1.0, 2.0, 0.45], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1], 4);
    let (hidden, found) = hidden_pairs(&[outside, beside, behind, turned, inside], &walls);
    assert!(hidden > 0 && found.area > 0.0 && (found.area - open.area).abs() < 1e-9 * open.area, "{found:?} {open:?}");
}

#[test]
fn a_polygon_is_not_hidden_by_what_lies_in_its_plane() {
    // Faces of the plane 7, up to a millionth of the scene's size behind its wall or its house's side.
    let diagonal = 13.0;
    let before = quad([5.0, 0.2, 0.2], [0.0, 0.0, 0.5], [0.0, 0.5, 0.0], 1);
    // Hidden by them; they are remembered for the faces.
    let behind = quad([-5.0, 0.2, 0.2], [0.0, 0.5, 0.0], [0.0, 0.0, 0.5], 2);
    let facade = quad([0.0, -1.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 3.0], 7);
    let house = cuboid([-2.0, -1.0, 0.0], [2.0, 3.0, 3.0], 6);
    for walls in [vec![facade], house.clone(), house[..4].iter().chain(&house[5..]).cloned().collect()] {
        for depth in [0.0, 0.5e-6, 1e-6, -1e-6] {
            let face = quad([-depth * diagonal, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], 7);
            let (hidden, found) = hidden_pairs(&[before.clone(), behind.clone(), face], &walls);
            assert!(hidden > 0 && found.area > 0.0, "{depth}: {found:?}");
        }
    }
}

#[test]
fn in_a_city_what_is_hidden_is_so_without_screens() {
    let mut polygons = vec![quad([-1.0, -1.0, 0.0], [14.0, 0.0, 0.0], [0.0, 14.0, 0.0], 0)];
    // Three rows of three houses: fronts of a row share their planes. Some stand open below.
    for (i, j) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))) {
        let (x, y) = (4.0 * f64::from(i), 4.0 * f64::from(j));
        let mut house = cuboid([x, y, 0.0], [3.0, 3.0, 2.0 + f64::from((2 * i + j) % 3)], 0);
        let planes = [10 + i, 20 + i, 30 + j, 40 + j, 0, 50 + (2 * i + j) % 3];
        house.iter_mut().zip(planes).for_each(|(side, plane)| side.plane = plane as u32);
        let bottom = house.remove(4);
        polygons.extend(house);
        if (i + j) % 2 == 0 {
            polygons.push(bottom);
        }
        // A face a little behind the front that it belongs to.
        let back = 1e-6 * 20.0;
        polygons.push(quad([x + back, y + 1.0, 0.5], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0], 10 + i as u32));
    }
    let (hidden, _) = hidden_pairs(&polygons, &[]);
    assert!(hidden > 300, "{hidden} pairs are hidden");
}
