//! Which facets are near a point: a tree of boxes over facets.

use crate::mesh::{Facet, Mesh};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Children of a node of the tree.
const FAN: usize = 8;

/// Boxes around runs of facets, which are in an order that keeps neighbours together; level by level, largest last.
pub struct Places<'a> {
    facets: &'a [Facet],
    levels: Vec<Vec<[Vec3; 2]>>,
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
