//! Regular grids over facets and patches: cells are elements (or patches), vertices their corners.

use crate::mesh::{Frame, Tile};
use glam::DVec2;
use ringlight_visibility::Layout;

/// A grid over a facet or a patch. Cells are numbered as [`Tile::of`] numbers tiles; a vertex is (column, row).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    /// Quadrilateral or triangle.
    pub layout: Layout,
    /// Columns and rows of cells; equal for triangles.
    pub size: [u32; 2],
}

impl Lattice {
    /// The grid with each cell cut into columns and rows.
    pub fn refined(&self, parts: [u32; 2]) -> Lattice {
        Lattice { layout: self.layout, size: [0, 1].map(|i| self.size[i] * parts[i]) }
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        let [columns, rows] = self.size.map(|n| n as usize);
        match self.layout {
            Layout::Quad => (columns + 1) * (rows + 1),
            Layout::Triangle => (columns + 1) * (columns + 2) / 2,
        }
    }

    /// Number of cells.
    pub fn cell_count(&self) -> u32 {
        self.size[0] * self.size[1]
    }

    /// All vertices, in the order of [`Lattice::vertex_index`].
    pub fn vertices(&self) -> impl Iterator<Item = [u32; 2]> + use<> {
        let Lattice { layout, size: [columns, rows] } = *self;
        (0..=rows).flat_map(move |row| {
            let last = if layout == Layout::Quad { columns } else { columns - row };
            (0..=last).map(move |column| [column, row])
        })
    }

    /// Place of a vertex in the order of vertices.
    pub fn vertex_index(&self, [column, row]: [u32; 2]) -> usize {
        let (column, row, columns) = (column as usize, row as usize, self.size[0] as usize);
        match self.layout {
            Layout::Quad => row * (columns + 1) + column,
            Layout::Triangle => row * (2 * columns + 3 - row) / 2 + column,
        }
    }

    /// Whether a vertex lies on the grid's border.
    pub fn on_border(&self, [column, row]: [u32; 2]) -> bool {
        let [columns, rows] = self.size;
        column == 0
            || row == 0
            || match self.layout {
                Layout::Quad => column == columns || row == rows,
                Layout::Triangle => column + row == columns,
            }
    }

    /// Parameters of a vertex.
    pub fn parameters(&self, [column, row]: [u32; 2]) -> DVec2 {
        DVec2::new(f64::from(column) / f64::from(self.size[0]), f64::from(row) / f64::from(self.size[1]))
    }

    /// Parameters of the middle of a cell.
    pub fn middle(&self, cell: u32) -> DVec2 {
        Tile::of(self.layout, self.size, cell).at(Frame::middle(self.layout))
    }

    /// Vertices of a cell in the order of [`Frame::corner_parameters`]; a triangle repeats the last one.
    pub fn corners(&self, cell: u32) -> [[u32; 2]; 4] {
        let [c, r, inverted] = self.position(cell);
        match (self.layout, inverted) {
            (Layout::Quad, _) => [[c, r], [c + 1, r], [c + 1, r + 1], [c, r + 1]],
            (Layout::Triangle, 0) => [[c, r], [c + 1, r], [c, r + 1], [c, r + 1]],
            (Layout::Triangle, _) => [[c + 1, r + 1], [c, r + 1], [c + 1, r], [c + 1, r]],
        }
    }

    /// Column, row, and 1 for inverted triangles, of a cell.
    pub fn position(&self, cell: u32) -> [u32; 3] {
        match self.layout {
            Layout::Quad => [cell % self.size[0], cell / self.size[0], 0],
            Layout::Triangle => {
                let tile = Tile::of(self.layout, self.size, cell);
                let inverted = u32::from(tile.size.x < 0.0);
                let [c, r] = (tile.origin * f64::from(self.size[0])).to_array().map(|x| (x + 0.5) as u32);
                [c - inverted, r - inverted, inverted]
            }
        }
    }

    /// The cell at a position, if there is one; coordinates may lie outside.
    pub fn cell(&self, column: i64, row: i64, inverted: bool) -> Option<u32> {
        let [columns, rows] = self.size.map(i64::from);
        match self.layout {
            Layout::Quad => {
                let inside = !inverted && (0..columns).contains(&column) && (0..rows).contains(&row);
                inside.then(|| (row * columns + column) as u32)
            }
            Layout::Triangle => {
                let inside = column >= 0 && row >= 0 && column + row + i64::from(inverted) < columns;
                inside.then(|| (row * (2 * columns - row) + 2 * column + i64::from(inverted)) as u32)
            }
        }
    }

    /// Calls with the cells that the place at parameters `at` touches, and the parameters within them; `slack` is the tolerance
    /// in cells.
    pub fn holding(&self, at: DVec2, slack: DVec2, mut each: impl FnMut(u32, DVec2)) {
        let at = at * DVec2::new(self.size[0].into(), self.size[1].into());
        let range = |x: f64, slack: f64| (x - slack).floor() as i64..=(x + slack).floor() as i64;
        let mut add = |position: (i64, i64, bool), within: DVec2| {
            if let Some(cell) = self.cell(position.0, position.1, position.2) {
                each(cell, within);
            }
        };
        let reach = slack.x.max(slack.y);
        for row in range(at.y, slack.y) {
            for column in range(at.x, slack.x) {
                let within = at - DVec2::new(column as f64, row as f64);
                if self.layout == Layout::Quad || within.x + within.y <= 1.0 + reach {
                    add((column, row, false), within);
                }
                if self.layout == Layout::Triangle && within.x + within.y >= 1.0 - reach {
                    add((column, row, true), DVec2::ONE - within);
                }
            }
        }
    }

    /// Cells that touch a vertex.
    pub fn cells_at(&self, [column, row]: [u32; 2]) -> impl Iterator<Item = u32> + use<> {
        /// Steps from a vertex to the positions of the cells around it.
        const QUADS: [(i64, i64, bool); 4] = [(-1, -1, false), (0, -1, false), (-1, 0, false), (0, 0, false)];
        const TRIANGLES: [(i64, i64, bool); 6] =
            [(0, 0, false), (-1, 0, false), (0, -1, false), (-1, -1, true), (0, -1, true), (-1, 0, true)];
        let steps: &'static [(i64, i64, bool)] = match self.layout {
            Layout::Quad => &QUADS,
            Layout::Triangle => &TRIANGLES,
        };
        let lattice = *self;
        let (column, row) = (i64::from(column), i64::from(row));
        steps.iter().filter_map(move |&(c, r, inverted)| lattice.cell(column + c, row + r, inverted))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_and_vertices_know_each_other() {
        for lattice in [
            Lattice { layout: Layout::Quad, size: [3, 5] },
            Lattice { layout: Layout::Triangle, size: [1, 1] },
            Lattice { layout: Layout::Triangle, size: [6, 6] },
        ] {
            assert_eq!(lattice.vertices().count(), lattice.vertex_count());
            for (index, vertex) in lattice.vertices().enumerate() {
                assert_eq!(lattice.vertex_index(vertex), index);
                for cell in lattice.cells_at(vertex) {
                    assert!(lattice.corners(cell).contains(&vertex));
                }
            }
            let corners = if lattice.layout == Layout::Quad { 4 } else { 3 };
            for cell in 0..lattice.cell_count() {
                let [c, r, inverted] = lattice.position(cell);
                assert_eq!(lattice.cell(c.into(), r.into(), inverted == 1), Some(cell));
                let tile = Tile::of(lattice.layout, lattice.size, cell);
                for (&p, vertex) in Frame::corner_parameters(lattice.layout).iter().zip(lattice.corners(cell)) {
                    assert!((tile.at(p) - lattice.parameters(vertex)).length() < 1e-12);
                }
            }
            let touches: usize = lattice.vertices().map(|v| lattice.cells_at(v).count()).sum();
            assert_eq!(touches, corners * lattice.cell_count() as usize);
        }
    }
}
