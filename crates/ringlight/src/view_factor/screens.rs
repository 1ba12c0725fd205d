//! Convex things that hide whole pairs of polygons: walls, and solids as houses and boxes. In a city most pairs are hidden,
//! and a screen proves it with a few cut segments, where integration would look for what is left to see.
//!
//! For a convex screen S and a point x the points y whose segment xy meets S form a convex set, S's shadow from x. So if every
//! segment between a corner of one polygon and a corner of the other meets S, all segments between the polygons do.
//!
//! Not all of a solid need block: a side may be open, and what lies in a polygon's own plane never blocks its view. What
//! meets such a solid is hidden only if it surely goes through one of its other sides, see [`Screens::covers`].

use super::hull::Side;
use super::joining::{Part, join};
use super::solids::{Wall, solids};
use super::{Occluders, Polygon};
use glam::DVec3;
use ringlight_visibility::{NO_PLANE, Ray};
use std::ops::Range;

/// A convex solid, or a convex polygon in a plane.
#[derive(Clone, Debug)]
struct Screen {
    /// Of a polygon.
    plane: Option<Wall>,
    /// In [`Screens::sides`]: those of a solid, or what bounds a polygon.
    sides: Range<usize>,
}

/// All screens of a scene.
#[derive(Debug, Default)]
pub(super) struct Screens {
    screens: Vec<Screen>,
    sides: Vec<Wall>,
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
            screens.add(None, solid.sides, &solid.parts);
        }
        let rest: Vec<usize> = (0..parts.len()).filter(|&i| screens.screen_of[i] == u32::MAX).collect();
        let rest_parts: Vec<Part> = rest.iter().map(|&i| parts[i]).collect();
        for joined in join(&rest_parts) {
            let members: Vec<usize> = joined.parts.iter().map(|&k| rest[k]).collect();
            if let Some(polygon) = Polygon::new(joined.corners, joined.plane) {
                let side = Side { normal: polygon.normal, offset: polygon.normal.dot(polygon.corners[0]) };
                screens.add(Some(Wall { side, plane: Some(polygon.plane) }), edges(&polygon), &members);
            }
        }
        screens
    }

    fn add(&mut self, plane: Option<Wall>, sides: Vec<Wall>, members: &[usize]) {
        members.iter().for_each(|&i| self.screen_of[i] = self.screens.len() as u32);
        let first = self.sides.len();
        self.sides.extend(sides);
        self.screens.push(Screen { plane, sides: first..self.sides.len() });
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

    /// Height over a side, metres.
    fn height(&self, wall: &Wall, p: DVec3) -> f64 {
        let height = wall.side.normal.dot(p) - wall.side.offset;
        if height.abs() <= self.slack { 0.0 } else { height }
    }

    /// Whether a segment goes through a polygon. Grazing counts, as for solids: of segments between polygons that face each
    /// other only a set of measure 0 grazes.
    fn is_crossed(&self, plane: &Wall, edges: &[Wall], from: DVec3, to: DVec3) -> bool {
        let (here, there) = (self.height(plane, from), self.height(plane, to));
        if here * there >= 0.0 {
            return false;
        }
        let crossing = from + here / (here - there) * (to - from);
        edges.iter().all(|edge| self.height(edge, crossing) <= 0.0)
    }

    /// The numbers of the sides by which a segment enters and leaves a solid, none where it begins or ends within it; none
    /// at all if it does not meet the solid in more than an end point.
    fn passage(&self, sides: &[Wall], from: DVec3, to: DVec3) -> Option<[Option<usize>; 2]> {
        let (mut enters, mut leaves) = ((0.0f64, None), (1.0f64, None));
        for (number, wall) in sides.iter().enumerate() {
            let (here, there) = (self.height(wall, from), self.height(wall, to));
            if here.max(there) <= 0.0 {
                continue;
            }
            if here.min(there) >= 0.0 {
                return None;
            }
            let crossing = (here / (here - there), Some(number));
            if here > 0.0 && crossing.0 > enters.0 {
                enters = crossing;
            } else if there > 0.0 && crossing.0 < leaves.0 {
                leaves = crossing;
            }
        }
        (enters.0 < leaves.0).then_some([enters.1, leaves.1])
    }

    /// Whether a screen hides polygons of the planes `planes` from each other.
    fn covers(&self, screen: u32, planes: [u32; 2], a: &[DVec3], b: &[DVec3]) -> bool {
        let screen = &self.screens[screen as usize];
        let sides = &self.sides[screen.sides.clone()];
        let blocks = |wall: &Wall| wall.plane.is_some_and(|plane| plane == NO_PLANE || !planes.contains(&plane));
        let mut segments = a.iter().flat_map(|&from| b.iter().map(move |&to| (from, to)));
        if let Some(plane) = &screen.plane {
            return blocks(plane) && segments.all(|(from, to)| self.is_crossed(plane, sides, from, to));
        }
        // The sides of the first segment, as long as all others pass them, too.
        let mut common: Option<[Option<usize>; 2]> = None;
        for (from, to) in segments {
            let Some(passage) = self.passage(sides, from, to) else { return false };
            let shared = common.unwrap_or(passage).map(|side| side.filter(|_| passage.contains(&side)));
            common = Some(shared);
        }
        // All segments go through one side, and that is a convex screen by itself.
        if common.into_iter().flatten().flatten().any(|side| blocks(&sides[side])) {
            return true;
        }
        // A segment goes through as many sides as it has ends outside of the solid: more than can be open to it.
        let some_above = |wall: &Wall, corners: &[DVec3]| corners.iter().any(|&c| self.height(wall, c) > 0.0);
        let is_outside = |corners: &[DVec3]| {
            let is_beyond = |wall: &Wall| corners.iter().all(|&c| self.height(wall, c) >= 0.0);
            sides.iter().any(|wall| is_beyond(wall) && some_above(wall, corners))
        };
        let open = sides.iter().filter(|wall| !blocks(wall) && (some_above(wall, a) || some_above(wall, b))).count();
        usize::from(is_outside(a)) + usize::from(is_outside(b)) > open
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
        if let Some(&screen) = memory.0.iter().find(|&&screen| self.screens.covers(screen, self.planes, a, b)) {
            memory.put_first(screen);
            return true;
        }
        let Some(screen) = self.screen_between(a, b) else { return false };
        memory.put_first(screen);
        if self.screens.covers(screen, self.planes, a, b) {
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
        let hit =
            self.occluders.hierarchy.nearest_hit_where(&ray, |t| t.plane == NO_PLANE || t.plane != self.planes[1])?;
        Some(self.screens.screen_of[hit.triangle as usize]).filter(|&screen| screen != u32::MAX)
    }
}

/// The half-spaces within the edges of a convex polygon.
fn edges(polygon: &Polygon) -> Vec<Wall> {
    let corners = &polygon.corners;
    let pairs = corners.iter().zip(corners.iter().cycle().skip(1));
    pairs
        .filter_map(|(&from, &to)| {
            let normal = (to - from).cross(polygon.normal).try_normalize()?;
            Some(Wall { side: Side { normal, offset: normal.dot(from) }, plane: None })
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
#[path = "screens_tests.rs"]
mod tests;
