//! Plane ids: coplanar facets share one, so that surfaces in a receiver's or shooter's own plane never shadow it.

use glam::DVec3;
use std::collections::HashMap;

/// Facets whose corners lie within this share of the scene's diagonal of a plane belong to it.
pub const RELATIVE_TOLERANCE: f64 = 2e-6;

/// Normals of coplanar facets differ by at most this (radians).
const ANGLE: f64 = 1e-3;

/// Gives plane ids.
#[derive(Debug)]
pub struct Planes {
    tolerance: f64,
    /// Cell size of offsets: as far as a plane turned by [`ANGLE`] can move at the scene's rim.
    offset_cell: f64,
    planes: Vec<(DVec3, f64)>,
    cells: HashMap<[i64; 4], Vec<u32>>,
}

/// Cell size of normal components.
const NORMAL_CELL: f64 = 0.05;

impl Planes {
    /// For corners that may lie off their plane by `tolerance`, given near the origin and within `reach` of it; metres.
    pub fn new(tolerance: f64, reach: f64) -> Planes {
        Planes {
            tolerance,
            offset_cell: (2.0 * ANGLE * reach + tolerance).max(1e-9),
            planes: Vec::new(),
            cells: HashMap::new(),
        }
    }

    /// The id of the plane of a polygon; a new one if none fits. Ask for large facets first: they define planes best.
    pub fn id(&mut self, corners: &[DVec3], area_vector: DVec3) -> u32 {
        let mut normal = area_vector.normalize();
        // One sign for both orientations.
        let leading = normal.to_array().into_iter().fold(0.0f64, |a, x| if x.abs() > a.abs() + 1e-6 { x } else { a });
        if leading < 0.0 {
            normal = -normal;
        }
        let centre = corners.iter().sum::<DVec3>() / corners.len() as f64;
        let offset = normal.dot(centre);
        let range =
            |x: f64, slack: f64, cell: f64| ((x - slack) / cell).floor() as i64..=((x + slack) / cell).floor() as i64;
        for x in range(normal.x, ANGLE, NORMAL_CELL) {
            for y in range(normal.y, ANGLE, NORMAL_CELL) {
                for z in range(normal.z, ANGLE, NORMAL_CELL) {
                    for d in range(offset, self.offset_cell / 2.0, self.offset_cell) {
                        if let Some(id) = self
                            .cells
                            .get(&[x, y, z, d])
                            .and_then(|ids| ids.iter().copied().find(|&id| self.fits(id, corners, normal)))
                        {
                            return id;
                        }
                    }
                }
            }
        }
        let id = self.planes.len() as u32;
        self.planes.push((normal, offset));
        let cell = |x: f64, cell: f64| (x / cell).floor() as i64;
        let key = [
            cell(normal.x, NORMAL_CELL),
            cell(normal.y, NORMAL_CELL),
            cell(normal.z, NORMAL_CELL),
            cell(offset, self.offset_cell),
        ];
        self.cells.entry(key).or_default().push(id);
        id
    }

    fn fits(&self, id: u32, corners: &[DVec3], normal: DVec3) -> bool {
        let (n, d) = self.planes[id as usize];
        (n - normal).length() <= ANGLE && corners.iter().all(|c| (n.dot(*c) - d).abs() <= self.tolerance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coplanar_facets_share_an_id_whatever_their_orientation() {
        let mut planes = Planes::new(10.0 * RELATIVE_TOLERANCE, 10.0);
        let square = [(0., 0.), (1., 0.), (1., 1.), (0., 1.)].map(|(x, y)| DVec3::new(x, 2.0, y));
        let far = square.map(|p| p + DVec3::new(7.0, 0.0, 3.0));
        let above = square.map(|p| p + DVec3::new(0.0, 1e-3, 0.0));
        let a = planes.id(&square, DVec3::Y);
        assert_eq!(planes.id(&far, -DVec3::Y), a);
        assert_ne!(planes.id(&above, DVec3::Y), a);
        let wall = square.map(|p| DVec3::new(p.y, p.x, p.z));
        assert_ne!(planes.id(&wall, DVec3::X), a);
    }
}
