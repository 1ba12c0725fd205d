//! Plane ids: coplanar facets share one, so that surfaces in a receiver's or shooter's own plane never shadow it.

use super::NONE;
use crate::column::{Column, Store};
use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use std::io;

/// Facets whose corners lie within this share of the scene's diagonal of a plane belong to it.
pub const RELATIVE_TOLERANCE: f64 = 2e-6;

/// Normals of coplanar facets differ by at most this (radians).
const ANGLE: f64 = 1e-3;

/// Gives plane ids.
///
/// Planes are found by cells of normal and offset, in a hash table with chains. There may be as many planes as facets, so it is
/// kept in columns.
#[derive(Debug)]
pub struct Planes {
    tolerance: f64,
    /// Cell size of offsets: as far as a plane turned by [`ANGLE`] can move at the scene's rim.
    offset_cell: f64,
    planes: Column<Plane>,
    /// First and last plane of each chain, or [`NONE`]; as many as a power of two.
    chains: Column<[u32; 2]>,
}

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Plane {
    normal: DVec3,
    offset: f64,
    cell: [i32; 4],
    /// The next in its chain, or [`NONE`]. Chains run in the order of ids.
    next: u32,
    padding: u32,
}

/// Cell size of normal components.
const NORMAL_CELL: f64 = 0.05;

/// Chains of a table without planes.
const FEWEST_CHAINS: usize = 1 << 10;

impl Planes {
    /// For corners that may lie off their plane by `tolerance`, given near the origin and within `reach` of it; metres.
    pub fn new(tolerance: f64, reach: f64, store: Store<'_>) -> io::Result<Planes> {
        let mut chains = store.column()?;
        chains.resize(FEWEST_CHAINS, [NONE; 2])?;
        let offset_cell = (2.0 * ANGLE * reach + tolerance).max(1e-9);
        Ok(Planes { tolerance, offset_cell, planes: store.column()?, chains })
    }

    /// The id of the plane of a polygon; a new one if none fits. Ask for large facets first: they define planes best.
    pub fn id(&mut self, corners: &[DVec3], area_vector: DVec3) -> io::Result<u32> {
        let mut normal = area_vector.normalize();
        // One sign for both orientations.
        let leading = normal.to_array().into_iter().fold(0.0f64, |a, x| if x.abs() > a.abs() + 1e-6 { x } else { a });
        if leading < 0.0 {
            normal = -normal;
        }
        let centre = corners.iter().sum::<DVec3>() / corners.len() as f64;
        let offset = normal.dot(centre);
        let range =
            |x: f64, slack: f64, cell: f64| ((x - slack) / cell).floor() as i32..=((x + slack) / cell).floor() as i32;
        for x in range(normal.x, ANGLE, NORMAL_CELL) {
            for y in range(normal.y, ANGLE, NORMAL_CELL) {
                for z in range(normal.z, ANGLE, NORMAL_CELL) {
                    for d in range(offset, self.offset_cell / 2.0, self.offset_cell) {
                        if let Some(id) = self.find([x, y, z, d], corners, normal) {
                            return Ok(id);
                        }
                    }
                }
            }
        }
        let cell = |x: f64, cell: f64| (x / cell).floor() as i32;
        let [x, y, z] = normal.to_array().map(|x| cell(x, NORMAL_CELL));
        let cell = [x, y, z, cell(offset, self.offset_cell)];
        self.planes.push(Plane { normal, offset, cell, next: NONE, padding: 0 })?;
        if self.planes.len() > self.chains.len() {
            let wanted = 2 * self.chains.len();
            self.chains.fill([NONE; 2]);
            self.chains.resize(wanted, [NONE; 2])?;
            (0..self.planes.len() as u32).for_each(|id| self.link(id));
        } else {
            self.link(self.planes.len() as u32 - 1);
        }
        Ok(self.planes.len() as u32 - 1)
    }

    /// The first plane of a cell that a polygon with these corners and this normal lies in.
    fn find(&self, cell: [i32; 4], corners: &[DVec3], normal: DVec3) -> Option<u32> {
        let planes: &[Plane] = &self.planes;
        let mut id = self.chains[self.chain(cell)][0];
        while let Some(plane) = planes.get(id as usize) {
            let near = |c: &DVec3| (plane.normal.dot(*c) - plane.offset).abs() <= self.tolerance;
            if plane.cell == cell && (plane.normal - normal).length() <= ANGLE && corners.iter().all(near) {
                return Some(id);
            }
            id = plane.next;
        }
        None
    }

    /// Appends plane `id` to its chain.
    fn link(&mut self, id: u32) {
        let chain = self.chain(self.planes[id as usize].cell);
        self.planes[id as usize].next = NONE;
        match std::mem::replace(&mut self.chains[chain][1], id) {
            NONE => self.chains[chain][0] = id,
            last => self.planes[last as usize].next = id,
        }
    }

    /// The chain of a cell.
    fn chain(&self, cell: [i32; 4]) -> usize {
        let mix = |h: u64, x: i32| (h ^ u64::from(x as u32)).wrapping_mul(0xff51_afd7_ed55_8ccd).rotate_left(29);
        cell.into_iter().fold(0x9e37_79b9_7f4a_7c15, mix) as usize & (self.chains.len() - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coplanar_facets_share_an_id_whatever_their_orientation() {
        let mut planes = Planes::new(10.0 * RELATIVE_TOLERANCE, 10.0, Store::Heap).unwrap();
        let square = [(0., 0.), (1., 0.), (1., 1.), (0., 1.)].map(|(x, y)| DVec3::new(x, 2.0, y));
        let far = square.map(|p| p + DVec3::new(7.0, 0.0, 3.0));
        let above = square.map(|p| p + DVec3::new(0.0, 1e-3, 0.0));
        let mut id = |corners: &[DVec3], normal| planes.id(corners, normal).unwrap();
        let a = id(&square, DVec3::Y);
        assert_eq!(id(&far, -DVec3::Y), a);
        assert_ne!(id(&above, DVec3::Y), a);
        let wall = square.map(|p| DVec3::new(p.y, p.x, p.z));
        assert_ne!(id(&wall, DVec3::X), a);
        // More planes than the table began with: all are found again.
        let many = |k: u32| square.map(|p| p + DVec3::Y * f64::from(k) * 1e-3);
        let ids: Vec<u32> = (0..5000).map(|k| id(&many(k), DVec3::Y)).collect();
        assert!(ids.windows(2).all(|w| w[0] != w[1]) && ids[0] == a);
        assert!((0..5000).all(|k| id(&many(k), -DVec3::Y) == ids[k as usize]));
    }
}
