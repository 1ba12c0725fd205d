//! Which elements touch a point, which facets are near it: a tree of boxes over facets.
//!
//! One question answers both shared corners and T-junctions, where a corner lies on the edge of a neighbour's element.

use super::lattice::Lattice;
use crate::form_factor::atan2;
use crate::mesh::{Facet, Frame, Mesh};
use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;
use ringlight_visibility::Layout;

/// Children of a node of the tree.
const FAN: usize = 8;

/// Boxes around runs of facets, which are in an order that keeps neighbours together; level by level, largest last.
pub struct Places<'a> {
    facets: &'a [Facet],
    levels: Vec<Vec<[Vec3; 2]>>,
}

/// An element of a facet that touches a point.
#[derive(Clone, Copy, Debug)]
pub struct Touch {
    /// Number of the facet.
    pub facet: u32,
    /// Cell of its lattice.
    pub cell: u32,
    /// The angle that the cell spans at the point, radians.
    pub angle: f64,
}

impl<'a> Places<'a> {
    /// Of a mesh.
    pub fn new(mesh: &'a Mesh) -> Places<'a> {
        let join = |boxes: &[[Vec3; 2]]| {
            boxes.iter().fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |a, b| [a[0].min(b[0]), a[1].max(b[1])])
        };
        let mut levels: Vec<Vec<[Vec3; 2]>> =
            vec![mesh.facets.par_chunks(FAN).map(|run| join(&run.iter().map(bounds).collect::<Vec<_>>())).collect()];
        while let Some(last) = levels.last().filter(|l| l.len() > 1) {
            let next = last.chunks(FAN).map(join).collect();
            levels.push(next);
        }
        Places { facets: &mesh.facets, levels }
    }

    /// Collects the elements (of the facets' grids, whichever side) on whose facets' borders `point` lies, within
    /// `tolerance` metres, in the order of facets.
    pub fn touching(&self, point: DVec3, tolerance: f64, found: &mut Vec<Touch>) {
        found.clear();
        self.visit(point, tolerance, &mut |f| touch(f, &self.facets[f as usize], point, tolerance, found));
    }

    /// Calls `each` for the facets whose boxes, grown by `distance` metres, hold `point`, in the order of facets.
    pub fn visit(&self, point: DVec3, distance: f64, each: &mut dyn FnMut(u32)) {
        self.visit_around([point; 2], distance, each);
    }

    /// The same for a box: calls `each` for the facets whose grown boxes meet that of facet `facet`.
    pub fn visit_neighbours(&self, facet: u32, distance: f64, each: &mut dyn FnMut(u32)) {
        self.visit_around(bounds(&self.facets[facet as usize]).map(|corner| corner.as_dvec3()), distance, each);
    }

    fn visit_around(&self, place: [DVec3; 2], distance: f64, each: &mut dyn FnMut(u32)) {
        if let Some(top) = self.levels.len().checked_sub(1) {
            self.descend(top, 0, place, distance, each);
        }
    }

    fn descend(&self, level: usize, node: usize, place: [DVec3; 2], distance: f64, each: &mut dyn FnMut(u32)) {
        if !meets(&self.levels[level][node], place, distance) {
            return;
        }
        let children = node * FAN..(node + 1) * FAN;
        if level > 0 {
            for child in children.start..children.end.min(self.levels[level - 1].len()) {
                self.descend(level - 1, child, place, distance, each);
            }
            return;
        }
        for f in children.start..children.end.min(self.facets.len()) {
            let facet = &self.facets[f];
            if meets(&bounds(facet), place, distance) {
                each(f as u32);
            }
        }
    }
}

fn bounds(facet: &Facet) -> [Vec3; 2] {
    facet.corners.iter().fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |a, &c| [a[0].min(c), a[1].max(c)])
}

/// Whether a box, grown by a tolerance, has a point in common with another one.
fn meets([low, high]: &[Vec3; 2], [least, most]: [DVec3; 2], tolerance: f64) -> bool {
    (low.as_dvec3() - tolerance).cmple(most).all() && (high.as_dvec3() + tolerance).cmpge(least).all()
}

/// Adds the cells of a facet that touch a point of its border.
fn touch(number: u32, facet: &Facet, point: DVec3, tolerance: f64, found: &mut Vec<Touch>) {
    let Some(at) = on_border(facet, point, tolerance) else { return };
    let (frame, lattice) = (facet.frame(), Lattice::of(facet));
    let size = DVec2::new(lattice.size[0].into(), lattice.size[1].into());
    // The tolerance in cells.
    let lengths = DVec2::new(frame.edge_u.length(), frame.edge_v.length());
    let slack = (2.0 * tolerance / lengths * size).clamp(DVec2::splat(1e-9), DVec2::splat(0.02));
    let at = at * size;
    let columns = range(at.x, slack.x);
    for row in range(at.y, slack.y) {
        for column in columns.clone() {
            let within = at - DVec2::new(column as f64, row as f64);
            match lattice.layout {
                Layout::Quad => add(number, &frame, &lattice, (column, row, false), within, slack, found),
                Layout::Triangle => {
                    let reach = slack.x.max(slack.y);
                    if within.x + within.y <= 1.0 + reach {
                        add(number, &frame, &lattice, (column, row, false), within, slack, found);
                    }
                    if within.x + within.y >= 1.0 - reach {
                        add(number, &frame, &lattice, (column, row, true), DVec2::ONE - within, slack, found);
                    }
                }
            }
        }
    }
}

/// Parameters of a point of a facet's border, which is straight between corners; none if it does not lie on it.
fn on_border(facet: &Facet, point: DVec3, tolerance: f64) -> Option<DVec2> {
    let parameters = Frame::corner_parameters(facet.layout());
    let n = parameters.len();
    (0..n).find_map(|k| {
        let next = (k + 1) % n;
        let (from, to) = (facet.corners[k].as_dvec3(), facet.corners[next].as_dvec3());
        let edge = to - from;
        let t = ((point - from).dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
        let near = (from + t * edge - point).length_squared() <= tolerance * tolerance;
        near.then(|| parameters[k] + t * (parameters[next] - parameters[k]))
    })
}

/// Columns (or rows) whose closed range holds `x`.
fn range(x: f64, slack: f64) -> std::ops::RangeInclusive<i64> {
    (x - slack).floor() as i64..=(x + slack).floor() as i64
}

fn add(
    facet: u32,
    frame: &Frame,
    lattice: &Lattice,
    (column, row, inverted): (i64, i64, bool),
    within: DVec2,
    slack: DVec2,
    found: &mut Vec<Touch>,
) {
    let Some(cell) = lattice.cell(column, row, inverted) else { return };
    let parameters = Frame::corner_parameters(lattice.layout);
    let corner = parameters.iter().position(|&p| (within - p).abs().cmple(slack).all());
    // On an edge of the cell, it spans half a turn.
    let angle = corner.map_or(std::f64::consts::PI, |k| {
        let vertices = lattice.corners(cell).map(|v| frame.at(lattice.parameters(v)));
        let n = parameters.len();
        let (a, b) = (vertices[(k + 1) % n] - vertices[k], vertices[(k + n - 1) % n] - vertices[k]);
        atan2(a.cross(b).length(), a.dot(b))
    });
    found.push(Touch { facet, cell, angle });
}
