//! Polygons → triangles.

use earcut::Earcut;
use glam::{DVec2, DVec3};

/// Faces with more corners than this are cut as fans.
const MOST_CORNERS: usize = 1 << 20;

/// Cuts polygons, which may be concave, into triangles.
#[derive(Default)]
pub(super) struct Triangulator {
    corners: Vec<DVec3>,
    flat: Vec<[f64; 2]>,
    cut: Vec<u32>,
    earcut: Option<Earcut<f64>>,
}

impl Triangulator {
    /// Calls `sink` with the corner numbers of each triangle of the polygon, which keep its orientation.
    ///
    /// A fan from the first corner where that works (convex polygons, and every quad in its usual order, so that its two
    /// triangles can be paired again); otherwise ears are cut off its projection on the Newell plane.
    pub(super) fn triangulate(&mut self, corners: &[[f64; 3]], mut sink: impl FnMut([u32; 3])) {
        let Some(&first) = corners.first() else { return };
        self.corners.clear();
        self.corners.extend(corners.iter().map(|&corner| DVec3::from(corner) - DVec3::from(first)));
        let normal = newell_normal(&self.corners);
        let count = self.corners.len() as u32;
        if count <= 3 || count as usize > MOST_CORNERS || self.fan_fits(normal) || !self.cut_ears(normal) {
            (1..count.saturating_sub(1)).for_each(|i| sink([0, i, i + 1]));
            return;
        }
        for &[a, b, c] in self.cut.as_chunks::<3>().0 {
            let [pa, pb, pc] = [a, b, c].map(|i| DVec2::from(self.flat[i as usize]));
            sink(if (pb - pa).perp_dot(pc - pa) < 0.0 { [a, c, b] } else { [a, b, c] });
        }
    }

    /// Whether no triangle of the fan from the first corner is turned over.
    fn fan_fits(&self, normal: DVec3) -> bool {
        self.corners.windows(2).all(|edge| edge[0].cross(edge[1]).dot(normal) >= 0.0)
    }

    /// Cuts ears off the projection; false if that gives nothing.
    fn cut_ears(&mut self, normal: DVec3) -> bool {
        let Some(normal) = normal.try_normalize() else { return false };
        let (u, v) = normal.any_orthonormal_pair();
        self.flat.clear();
        self.flat.extend(self.corners.iter().map(|corner| [corner.dot(u), corner.dot(v)]));
        let earcut = self.earcut.get_or_insert_with(Earcut::new);
        earcut.earcut_slice(&self.flat, &[], &mut self.cut);
        !self.cut.is_empty()
    }
}

/// Twice the area vector of a polygon (Newell's method).
fn newell_normal(corners: &[DVec3]) -> DVec3 {
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).map(|(a, b)| a.cross(*b)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(polygon: &[[f64; 3]]) -> (f64, DVec3, usize) {
        let (mut sum, mut vector, mut count) = (0.0, DVec3::ZERO, 0);
        Triangulator::default().triangulate(polygon, |t| {
            let [a, b, c] = t.map(|i| DVec3::from(polygon[i as usize]));
            let normal = (b - a).cross(c - a) / 2.0;
            sum += normal.length();
            vector += normal;
            count += 1;
        });
        (sum, vector, count)
    }

    #[test]
    fn concave_polygons_keep_their_area_and_orientation() {
        let arrow = [[4.0, 0.0, 0.0], [0.0, 3.0, 0.0], [1.0, 0.0, 0.0], [0.0, -3.0, 0.0]];
        let comb: Vec<[f64; 3]> = [
            [0.0, 0.0],
            [7.0, 0.0],
            [7.0, 4.0],
            [6.0, 4.0],
            [6.0, 1.0],
            [4.0, 1.0],
            [4.0, 4.0],
            [3.0, 4.0],
            [3.0, 1.0],
            [1.0, 1.0],
            [1.0, 4.0],
            [0.0, 4.0],
        ]
        .map(|[x, y]| [14678.0 + x, 9605.0, 0.25 - y])
        .to_vec();
        for start in 0..4 {
            let mut turned = arrow;
            turned.rotate_left(start);
            let (sum, vector, count) = area(&turned);
            assert!((sum - 9.0).abs() < 1e-12 && (vector.z - 9.0).abs() < 1e-12 && count == 2);
        }
        for start in 0..comb.len() {
            let mut turned = comb.clone();
            turned.rotate_left(start);
            let (sum, vector, _) = area(&turned);
            assert!((sum - 16.0).abs() < 1e-9 && (vector.y - 16.0).abs() < 1e-9, "{sum} {vector}");
        }
    }

    #[test]
    fn degenerate_polygons_do_not_fail() {
        for polygon in [vec![], vec![[0.0; 3]], vec![[0.0; 3]; 2], vec![[1.0; 3]; 7]] {
            assert!(area(&polygon).0.abs() < 1e-12);
        }
        let pentagram: Vec<[f64; 3]> = (0..5).map(|i| (i as f64 * 2.513).sin_cos()).map(|(x, y)| [x, y, 0.0]).collect();
        area(&pentagram);
    }
}
