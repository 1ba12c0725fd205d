//! The parametrisation shared by facets, patches and elements.
//!
//! A piece of surface is p(u, v) = origin + u·edge_u + v·edge_v + u·v·twist over the unit square (quadrilaterals) or the
//! unit triangle u + v ≤ 1 (triangles, twist 0). Regular pieces of it are again such frames, so that no element's
//! geometry is stored.

use glam::{DVec2, DVec3};
use ringlight_visibility::Layout;

/// A parametrised planar piece of surface, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Position at u = v = 0.
    pub origin: DVec3,
    /// Edge along u.
    pub edge_u: DVec3,
    /// Edge along v.
    pub edge_v: DVec3,
    /// Bilinear term.
    pub twist: DVec3,
    /// Quadrilateral or triangle.
    pub layout: Layout,
}

/// A sub-range of parameters: (u, v) ↦ origin + (u·size.x, v·size.y). Sizes are negative for inverted triangles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tile {
    /// Parameters of the tile's own origin.
    pub origin: DVec2,
    /// Extent.
    pub size: DVec2,
}

impl Tile {
    /// Tile `k` of a regular `grid` (columns, rows): row-major for quadrilaterals, rows of upright and inverted triangles
    /// in turn for triangles (columns = rows).
    pub fn of(layout: Layout, grid: [u32; 2], k: u32) -> Tile {
        let size = DVec2::new(1.0 / f64::from(grid[0]), 1.0 / f64::from(grid[1]));
        match layout {
            Layout::Quad => Tile { origin: DVec2::new((k % grid[0]).into(), (k / grid[0]).into()) * size, size },
            Layout::Triangle => {
                let (column, row, inverted) = triangle_position(grid[0], k);
                let corner = DVec2::new(column.into(), row.into());
                if inverted {
                    Tile { origin: (corner + 1.0) * size, size: -size }
                } else {
                    Tile { origin: corner * size, size }
                }
            }
        }
    }

    /// The tile of the grid that holds `at`, and the parameters of `at` within that tile.
    pub fn find(layout: Layout, grid: [u32; 2], at: DVec2) -> (u32, DVec2) {
        let scaled = at * DVec2::new(grid[0].into(), grid[1].into());
        let cell = |t: f64, n: u32| (t.max(0.0) as u32).min(n - 1);
        let mut column = cell(scaled.x, grid[0]);
        let row = cell(scaled.y, grid[1]);
        match layout {
            Layout::Quad => (row * grid[0] + column, scaled - DVec2::new(column.into(), row.into())),
            Layout::Triangle => {
                let side = grid[0];
                column = column.min(side - 1 - row);
                let within = scaled - DVec2::new(column.into(), row.into());
                let inverted = within.x + within.y > 1.0 && column + row + 1 < side;
                let first = row * (2 * side - row);
                if inverted { (first + 2 * column + 1, DVec2::ONE - within) } else { (first + 2 * column, within) }
            }
        }
    }

    /// The parameters of the enclosing frame for parameters of this tile.
    pub fn at(&self, p: DVec2) -> DVec2 {
        self.origin + p * self.size
    }

    /// `inner`, a tile of this tile, as a tile of the enclosing frame.
    pub fn compose(&self, inner: Tile) -> Tile {
        Tile { origin: self.at(inner.origin), size: self.size * inner.size }
    }
}

/// Column, row and whether inverted, of triangle `k` among side² of them.
fn triangle_position(side: u32, k: u32) -> (u32, u32, bool) {
    // Row r starts at r·(2·side − r).
    let s = f64::from(side);
    let mut row = (s - (s * s - f64::from(k)).max(0.0).sqrt()) as u32;
    while row > 0 && row * (2 * side - row) > k {
        row -= 1;
    }
    while (row + 1) * (2 * side - row - 1) <= k {
        row += 1;
    }
    let i = k - row * (2 * side - row);
    (i / 2, row, i % 2 == 1)
}

impl Frame {
    /// From three or four corners in order.
    pub fn from_corners(corners: &[DVec3]) -> Frame {
        let (origin, edge_u) = (corners[0], corners[1] - corners[0]);
        match *corners {
            [_, _, c] => Frame { origin, edge_u, edge_v: c - origin, twist: DVec3::ZERO, layout: Layout::Triangle },
            [a, b, c, d] => Frame { origin, edge_u, edge_v: d - a, twist: (c - b) - (d - a), layout: Layout::Quad },
            _ => unreachable!("a frame has three or four corners"),
        }
    }

    /// Position at parameters `p`.
    pub fn at(&self, p: DVec2) -> DVec3 {
        self.origin + p.x * self.edge_u + p.y * self.edge_v + p.x * p.y * self.twist
    }

    /// The piece of this frame over `tile`.
    pub fn tile(&self, tile: Tile) -> Frame {
        let DVec2 { x, y } = tile.size;
        Frame {
            origin: self.at(tile.origin),
            edge_u: x * (self.edge_u + tile.origin.y * self.twist),
            edge_v: y * (self.edge_v + tile.origin.x * self.twist),
            twist: x * y * self.twist,
            layout: self.layout,
        }
    }

    /// How much each corner counts at parameters `at`: bilinear in quadrilaterals, linear in triangles (whose fourth is 0).
    pub fn corner_weights(layout: Layout, at: DVec2) -> [f64; 4] {
        let (u, v) = (at.x.clamp(0.0, 1.0), at.y.clamp(0.0, 1.0));
        match layout {
            Layout::Quad => [(1.0 - u) * (1.0 - v), u * (1.0 - v), u * v, (1.0 - u) * v],
            Layout::Triangle => [(1.0 - u - v).max(0.0), u, v, 0.0],
        }
    }

    /// The parameters of the corners, in order.
    pub fn corner_parameters(layout: Layout) -> &'static [DVec2] {
        const QUAD: [DVec2; 4] = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];
        const TRIANGLE: [DVec2; 3] = [DVec2::ZERO, DVec2::X, DVec2::Y];
        match layout {
            Layout::Quad => &QUAD,
            Layout::Triangle => &TRIANGLE,
        }
    }

    /// The corners, counter-clockwise about [`Frame::area_vector`]; the number of valid ones is the second value.
    pub fn corners(&self) -> ([DVec3; 4], usize) {
        let parameters = Self::corner_parameters(self.layout);
        let mut corners = [self.origin; 4];
        for (corner, &p) in corners.iter_mut().zip(parameters) {
            *corner = self.at(p);
        }
        (corners, parameters.len())
    }

    /// The normal times the area, m². Exact for planar pieces.
    pub fn area_vector(&self) -> DVec3 {
        match self.layout {
            Layout::Triangle => self.edge_u.cross(self.edge_v) / 2.0,
            Layout::Quad => {
                let diagonal = self.edge_u + self.edge_v + self.twist;
                diagonal.cross(self.edge_v - self.edge_u) / 2.0
            }
        }
    }

    /// Parameters of the middle: of the square's centre, or the triangle's centroid.
    pub fn middle(layout: Layout) -> DVec2 {
        match layout {
            Layout::Quad => DVec2::splat(0.5),
            Layout::Triangle => DVec2::splat(1.0 / 3.0),
        }
    }

    /// Area of the piece at parameters `p` per area of parameters, relative to the mean (1 for parallelograms and
    /// triangles).
    pub fn relative_density(&self, p: DVec2) -> f64 {
        if self.twist == DVec3::ZERO {
            return 1.0;
        }
        let local = (self.edge_u + p.y * self.twist).cross(self.edge_v + p.x * self.twist).length();
        local / self.area_vector().length()
    }

    /// The parameters of the point of the piece's plane nearest to `point`; the inverse of [`Frame::at`].
    pub fn parameters(&self, point: DVec3) -> DVec2 {
        let normal = self.area_vector();
        let solve = |a: DVec3, b: DVec3, d: DVec3| {
            let n = a.cross(b);
            let n = if n.dot(n) > 0.0 { n } else { normal };
            DVec2::new(d.cross(b).dot(n), a.cross(d).dot(n)) / n.dot(n)
        };
        let mut p = solve(self.edge_u, self.edge_v, point - self.origin);
        if self.twist != DVec3::ZERO {
            // Newton's method on the bilinear map; convex quadrilaterals converge in a few steps.
            p = p.clamp(DVec2::ZERO, DVec2::ONE);
            for _ in 0..12 {
                let (du, dv) = (self.edge_u + p.y * self.twist, self.edge_v + p.x * self.twist);
                let step = solve(du, dv, point - self.at(p));
                p = (p + step).clamp(DVec2::splat(-0.5), DVec2::splat(1.5));
                if step.length_squared() < 1e-24 {
                    break;
                }
            }
        }
        p
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangle_tiles_cover_the_triangle_once() {
        for side in [1u32, 2, 3, 7, 40] {
            let mut area = 0.0;
            for k in 0..side * side {
                let tile = Tile::of(Layout::Triangle, [side; 2], k);
                area += tile.size.x * tile.size.y / 2.0;
                let middle = tile.at(Frame::middle(Layout::Triangle));
                assert!(middle.x > 0.0 && middle.y > 0.0 && middle.x + middle.y < 1.0);
                let (found, within) = Tile::find(Layout::Triangle, [side; 2], middle);
                assert_eq!(found, k);
                assert!((within - Frame::middle(Layout::Triangle)).length() < 1e-9);
            }
            assert!((area - 0.5).abs() < 1e-12);
        }
    }

    #[test]
    fn parameters_invert_a_trapezoid() {
        let corners = [(0., 0.), (4., 0.), (3., 2.), (1., 3.)].map(|(x, y)| DVec3::new(x, y, 5.0));
        let frame = Frame::from_corners(&corners);
        for (u, v) in [(0.1, 0.2), (0.9, 0.7), (0.5, 0.5), (1.0, 1.0)] {
            let p = DVec2::new(u, v);
            assert!((frame.parameters(frame.at(p)) - p).length() < 1e-9);
        }
        let grid = [3, 2];
        let sum: f64 = (0..6).map(|k| frame.tile(Tile::of(Layout::Quad, grid, k)).area_vector().length()).sum();
        assert!((sum - frame.area_vector().length()).abs() < 1e-12);
    }
}
