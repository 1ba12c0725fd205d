//! The shooter as visibility sees it: up to 64 cells.

/// How the parameters (u, v) of a planar grid of cells run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// side × side cells of a quadrilateral, k = row · side + column.
    Quad,
    /// side² similar triangles of a triangle: row j holds 2(side − j) − 1 of them, upright and inverted in turn.
    Triangle,
}

/// Cells at the centres of a regular grid on a planar patch:
/// cell k lies at origin + u·edge_u + v·edge_v + u·v·twist.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Corner of the patch at u = v = 0, metres.
    pub origin: [f32; 3],
    /// Edge along u, metres.
    pub edge_u: [f32; 3],
    /// Edge along v, metres.
    pub edge_v: [f32; 3],
    /// Bilinear term, metres; zero for triangles and parallelograms.
    pub twist: [f32; 3],
    /// Shape of the patch.
    pub layout: Layout,
    /// Cells along a side: 1, 2, 4 or 8; there are side² cells.
    pub side: u32,
}

/// What corners given in single precision may twist a rectangle by, as a share of its coordinates.
const ROUNDING: f32 = 1e-6;

impl Layout {
    /// Parameters of the centre of cell `k`.
    pub fn centre(self, side: u32, k: usize) -> [f32; 2] {
        let n = side as f32;
        match self {
            Layout::Quad => [(k as u32 % side) as f32 + 0.5, (k as u32 / side) as f32 + 0.5].map(|t| t / n),
            Layout::Triangle => {
                let (mut row, mut i) = (0, k as u32);
                while i >= 2 * (side - row) - 1 {
                    i -= 2 * (side - row) - 1;
                    row += 1;
                }
                let third = if i % 2 == 0 { 1.0 / 3.0 } else { 2.0 / 3.0 };
                [(i / 2) as f32 + third, row as f32 + third].map(|t| t / n)
            }
        }
    }
}

impl Grid {
    /// Number of cells.
    pub fn len(&self) -> usize {
        (self.side * self.side) as usize
    }

    /// Always false: a grid has at least one cell.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// The grid with what rounding has twisted made part of its edges, so that no cell moves by more than that; none if it is twisted
    /// by more.
    pub(crate) fn straight(&self) -> Option<Grid> {
        let norm = |v: [f32; 3]| v.iter().map(|c| c.abs()).sum::<f32>();
        let rounding = ROUNDING * (norm(self.origin) + norm(self.edge_u) + norm(self.edge_v));
        let add = |a: [f32; 3], share: f32| std::array::from_fn(|i| a[i] + share * self.twist[i]);
        (norm(self.twist) <= rounding).then(|| Grid {
            origin: add(self.origin, -0.25),
            edge_u: add(self.edge_u, 0.5),
            edge_v: add(self.edge_v, 0.5),
            twist: [0.0; 3],
            ..*self
        })
    }

    /// Position of cell `k`, metres.
    pub fn point(&self, k: usize) -> [f32; 3] {
        let [u, v] = self.layout.centre(self.side, k);
        std::array::from_fn(|i| self.origin[i] + u * self.edge_u[i] + v * self.edge_v[i] + u * v * self.twist[i])
    }
}

/// Where the cells lie.
#[derive(Clone, Debug, PartialEq)]
pub enum Cells {
    /// On a planar patch.
    Grid(Grid),
    /// Anywhere, at most 64.
    Points(Vec<[f32; 3]>),
    /// At infinity: unit vectors towards the light, at most 64.
    Directions(Vec<[f32; 3]>),
}

impl Cells {
    /// Number of cells, and of bits in a mask.
    pub fn len(&self) -> usize {
        match self {
            Cells::Grid(grid) => grid.len(),
            Cells::Points(points) | Cells::Directions(points) => points.len(),
        }
    }

    /// Whether there are no cells.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The mask with a bit for every cell.
    pub fn all(&self) -> u64 {
        if self.len() == 64 { u64::MAX } else { (1 << self.len()) - 1 }
    }
}

/// A shooter: its cells and what never blocks them.
#[derive(Clone, Debug, PartialEq)]
pub struct Shooter {
    /// The cells.
    pub cells: Cells,
    /// Triangles with this plane id never block; [`crate::NO_PLANE`] if none.
    pub plane: u32,
    /// Hits beyond this share of the way to a cell do not count (below 1; replays use 0.9999). Ignored for directions.
    pub far: f32,
}
