//! Convex things that hide whole pairs of polygons: walls, and solids as houses and boxes. In a city most pairs are hidden,
//! and a screen proves it with a few cut segments, where integration would look for what is left to see.
//!
//! For a convex screen S and a point x the points y whose segment xy meets S form a convex set, S's shadow from x. So if every
//! segment between a corner of one polygon and a corner of the other meets S, all segments between the polygons do.

use super::hull::Side;
use super::joining::{Part, join};
use super::solids::solids;
use super::{Occluders, Polygon};
use glam::DVec3;
use ringlight_visibility::Ray;
use std::ops::Range;

/// A convex solid, or a convex polygon in a plane.
#[derive(Clone, Debug)]
struct Screen {
    /// Of a polygon.
    plane: Option<Side>,
    /// In [`Screens::sides`].
    sides: Range<usize>,
    /// How many of the sides, the first ones, are made of triangles; a solid may have an open one after them.
    real: usize,
}

/// All screens of a scene.
#[derive(Debug, Default)]
pub(super) struct Screens {
    screens: Vec<Screen>,
    sides: Vec<Side>,
    /// Screen of each blocking triangle.
    screen_of: Vec<u32>,
    /// Heights over a side up to this count as 0, metres: segments that graze a screen meet it.
    slack: f64,
}

/// [`Screens::slack`] as a share of the scene's diagonal: what single precision leaves of a corner's place.
const SLACK: f64 = 1e-7;

/// Solids with more sides are taken apart into their polygons.
const MOST_SIDES: usize = 64;

/// Pairs of polygons with more pairs of corners are not tried.
const MOST_SEGMENTS: usize = 64;

/// How often a pair is halved, to be hidden by several screens together.
const MOST_HALVINGS: u32 = 6;

/// How many screens are remembered that hid or nearly hid what came before.
const REMEMBERED: usize = 6;

/// Screens that hid something lately: the next polygon is probably behind one of them.
#[derive(Debug, Default)]
pub(super) struct Memory(Vec<u32>);

impl Memory {
    fn put_first(&mut self, screen: u32) {
        match self.0.iter().position(|&known| known == screen) {
            Some(place) => self.0[..=place].rotate_right(1),
            None => {
                self.0.truncate(REMEMBERED - 1);
                self.0.insert(0, screen);
            }
        }
    }
}

impl Screens {
    /// Finds the screens among the triangles that block.
    pub fn new(occluders: &Occluders) -> Screens {
        let corners = || occluders.triangles.iter().flat_map(|t| t.corners);
        let low = corners().fold(DVec3::INFINITY, DVec3::min);
        let high = corners().fold(DVec3::NEG_INFINITY, DVec3::max);
        let slack = if occluders.triangles.is_empty() { 0.0 } else { SLACK * (high - low).length() };
        let mut screens = Screens { slack, screen_of: vec![u32::MAX; occluders.triangles.len()], ..Screens::default() };
        let parts: Vec<Part> =
            occluders.triangles.iter().map(|t| Part { corners: t.corners, plane: t.plane, unit: 0 }).collect();
        for solid in solids(&parts, slack, MOST_SIDES) {
            screens.add(None, solid.sides, solid.real, &solid.parts);
        }
        let rest: Vec<usize> = (0..parts.len()).filter(|&i| screens.screen_of[i] == u32::MAX).collect();
        let rest_parts: Vec<Part> = rest.iter().map(|&i| parts[i]).collect();
        for joined in join(&rest_parts) {
            let members: Vec<usize> = joined.parts.iter().map(|&k| rest[k]).collect();
            if let Some(polygon) = Polygon::new(joined.corners, joined.plane) {
                let plane = Side { normal: polygon.normal, offset: polygon.normal.dot(polygon.corners[0]) };
                let edges = edges(&polygon);
                let real = edges.len();
                screens.add(Some(plane), edges, real, &members);
            }
        }
        screens
    }

    fn add(&mut self, plane: Option<Side>, sides: Vec<Side>, real: usize, members: &[usize]) {
        members.iter().for_each(|&i| self.screen_of[i] = self.screens.len() as u32);
        let first = self.sides.len();
        self.sides.extend(sides);
        self.screens.push(Screen { plane, sides: first..self.sides.len(), real });
    }

    /// Whether the two polygons surely see nothing of each other. A no says nothing. `memory` makes it fast and decides
    /// which pairs are found out, so it has to begin empty at the same place for the same result.
    pub fn hide(&self, a: &Polygon, b: &Polygon, occluders: &Occluders, memory: &mut Memory) -> bool {
        if a.corners.len() * b.corners.len() > MOST_SEGMENTS {
            return false;
        }
        let pair = Pair { screens: self, occluders, planes: [a.plane, b.plane] };
        pair.is_hidden(&a.corners, &b.corners, MOST_HALVINGS, memory)
    }

    /// Whether a segment meets the screen in more than an end point, and goes through a side that is made of triangles.
    ///
    /// Grazing counts: of segments between polygons that face each other only a set of measure 0 grazes.
    fn is_crossed(&self, screen: &Screen, from: DVec3, to: DVec3) -> bool {
        let height = |side: &Side, p: DVec3| {
            let height = side.normal.dot(p) - side.offset;
            if height.abs() <= self.slack { 0.0 } else { height }
        };
        let sides = &self.sides[screen.sides.clone()];
        if let Some(plane) = &screen.plane {
            let (here, there) = (height(plane, from), height(plane, to));
            if here * there >= 0.0 {
                return false;
            }
            let crossing = from + here / (here - there) * (to - from);
            return sides.iter().all(|side| height(side, crossing) <= 0.0);
        }
        // Where it enters and leaves, and whether there by a side made of triangles: it may leave a lampshade by the open one.
        let (mut enters, mut leaves) = ((0.0f64, false), (1.0f64, false));
        for (number, side) in sides.iter().enumerate() {
            let (here, there) = (height(side, from), height(side, to));
            if here.max(there) <= 0.0 {
                continue;
            }
            if here.min(there) >= 0.0 {
                return false;
            }
            let crossing = (here / (here - there), number < screen.real);
            if here > 0.0 && crossing.0 > enters.0 {
                enters = crossing;
            } else if there > 0.0 && crossing.0 < leaves.0 {
                leaves = crossing;
            }
        }
        enters.0 < leaves.0 && (enters.1 || leaves.1)
    }

    fn covers(&self, screen: u32, a: &[DVec3], b: &[DVec3]) -> bool {
        let screen = &self.screens[screen as usize];
        a.iter().all(|&from| b.iter().all(|&to| self.is_crossed(screen, from, to)))
    }
}

/// A pair that is asked about.
struct Pair<'a> {
    screens: &'a Screens,
    occluders: &'a Occluders,
    planes: [u32; 2],
}

impl Pair<'_> {
    fn is_hidden(&self, a: &[DVec3], b: &[DVec3], halvings: u32, memory: &mut Memory) -> bool {
        if let Some(&screen) = memory.0.iter().find(|&&screen| self.screens.covers(screen, a, b)) {
            memory.put_first(screen);
            return true;
        }
        let Some(screen) = self.screen_between(a, b) else { return false };
        memory.put_first(screen);
        if self.screens.covers(screen, a, b) {
            return true;
        }
        if halvings == 0 {
            return false;
        }
        let longest = |corners: &[DVec3]| {
            let edges = corners.iter().zip(corners.iter().cycle().skip(1));
            edges.map(|(from, to)| from.distance_squared(*to)).fold(0.0, f64::max)
        };
        let (cut, other) = if longest(a) >= longest(b) { (a, b) } else { (b, a) };
        halves(cut).iter().all(|half| self.is_hidden(half, other, halvings - 1, memory))
    }

    /// The screen that stands between the middles. It need not be found exactly: what it hides is looked at anew.
    fn screen_between(&self, a: &[DVec3], b: &[DVec3]) -> Option<u32> {
        let middle = |corners: &[DVec3]| corners.iter().sum::<DVec3>() / corners.len() as f64 - self.occluders.origin;
        let (from, to) = (middle(a), middle(b));
        let ray = Ray {
            origin: from.as_vec3().to_array(),
            direction: (to - from).as_vec3().to_array(),
            near: 1e-5,
            far: 1.0 - 1e-5,
            plane: self.planes[0],
        };
        let hit = self.occluders.hierarchy.nearest_hit_where(&ray, |t| t.plane != self.planes[1])?;
        Some(self.screens.screen_of[hit.triangle as usize]).filter(|&screen| screen != u32::MAX)
    }
}

/// The half-spaces within the edges of a convex polygon.
fn edges(polygon: &Polygon) -> Vec<Side> {
    let corners = &polygon.corners;
    let pairs = corners.iter().zip(corners.iter().cycle().skip(1));
    pairs
        .filter_map(|(&from, &to)| {
            let normal = (to - from).cross(polygon.normal).try_normalize()?;
            Some(Side { normal, offset: normal.dot(from) })
        })
        .collect()
}

/// A convex polygon halved across its longest edge, towards the corner farthest along the outline.
fn halves(corners: &[DVec3]) -> [Vec<DVec3>; 2] {
    let n = corners.len();
    let length = |k: usize| corners[k].distance_squared(corners[(k + 1) % n]);
    let longest = (1..n).fold(0, |best, k| if length(k) > length(best) { k } else { best });
    let at = |k: usize| corners[(longest + k) % n];
    let middle = at(0).midpoint(at(1));
    // A triangle is cut to its far corner, a quadrilateral to the middle of its far edge.
    let far = n.div_ceil(2);
    let (mut one, mut other) = (vec![middle], vec![middle]);
    one.extend((1..=far).map(at));
    if n.is_multiple_of(2) {
        let end = at(far).midpoint(at(far + 1));
        one.push(end);
        other.push(end);
        other.extend((far + 1..=n).map(at));
    } else {
        other.extend((far..=n).map(at));
    }
    [one, other]
}

#[cfg(test)]
mod tests {
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
}
