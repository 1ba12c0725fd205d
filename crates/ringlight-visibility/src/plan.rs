//! A shooter made ready for the predicate: its cells, and the functions of them that the predicate asks for.

use crate::predicate::{BOX_MARGIN, Prepared, Vector, dot, norm, pass, sub};
use crate::shadow::axes;
use crate::{Cells, Layout, MAX_CELLS, NO_PLANE, Shooter};

/// How the cells are evaluated. What the predicate computes depends on this, never on lanes or instruction set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Affine in (u, v).
    Grid,
    /// Cell by cell; also a grid that is twisted, or so thin that it has no axes.
    Points,
    /// Cell by cell, at infinity.
    Directions,
}

/// A shooter that is asked about again and again, with what depends on it alone found once.
#[derive(Clone, Debug)]
pub struct PreparedShooter(Option<Box<Plan>>);

impl PreparedShooter {
    /// Prepares a shooter.
    pub fn new(shooter: &Shooter) -> PreparedShooter {
        PreparedShooter((!shooter.cells.is_empty()).then(|| Box::new(Plan::new(shooter))))
    }

    /// The shooter's plane id, or [`NO_PLANE`].
    pub fn plane(&self) -> u32 {
        self.0.as_ref().map_or(NO_PLANE, |plan| plan.plane)
    }

    /// None if there are no cells.
    pub(crate) fn plan(&self) -> Option<&Plan> {
        self.0.as_deref()
    }
}

/// A shooter made ready.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    pub kind: Kind,
    /// Side of a quadrilateral grid whose rows and columns may be evaluated apart; else 0.
    pub side: usize,
    pub count: usize,
    /// A grid's cells lie at parameters (whole number + 1 / `lattice.1`) / `lattice.0`, or some of those.
    pub lattice: (f32, f32),
    /// A grid's axes, see [`crate::shadow`].
    pub axes: Option<[Vector; 3]>,
    /// A grid's columns and rows.
    pub lines: [Lines; 2],
    /// Mask with a bit for every cell.
    pub all: u64,
    /// Positions, or directions, of the cells.
    pub cells: [Vector; MAX_CELLS],
    /// Parameters of a grid's cells.
    pub u: [f32; MAX_CELLS],
    pub v: [f32; MAX_CELLS],
    /// Least and greatest parameters.
    pub u_range: [f32; 2],
    pub v_range: [f32; 2],
    /// A grid's origin; else the centre of the cells' box.
    pub anchor: Vector,
    pub edge_u: Vector,
    pub edge_v: Vector,
    /// Half the extent of the box around scattered cells, rounded up.
    pub half: Vector,
    /// No cell is farther (in the sum of coordinates) from the anchor than this.
    pub spread: f32,
    /// Share of the way that counts; 1 for directions.
    pub far: f32,
    pub plane: u32,
}

/// The lines of a lattice, along one of its directions, on which cells lie.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Lines {
    lines: [Line; MAX_LINES],
    count: usize,
}

/// The most lines of a grid: those of a triangle with eight cells along a side.
const MAX_LINES: usize = 16;

/// Cells with the same parameter.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Line {
    /// Which whole number of the lattice.
    pub at: f32,
    /// Mask bits 0 to 31, and 32 to 63.
    pub cells: [u32; 2],
}

impl Lines {
    /// Of cells with these parameters.
    fn new(parameters: &[f32], (count, part): (f32, f32)) -> Lines {
        let mut lines = Lines::default();
        for (k, t) in parameters.iter().enumerate() {
            let at = (t * count - 1.0 / part).round();
            let known = lines.as_slice().iter().position(|line| line.at == at);
            let number = known.unwrap_or(lines.count);
            lines.count = lines.count.max(number + 1);
            lines.lines[number].at = at;
            lines.lines[number].cells[k / 32] |= 1 << (k % 32);
        }
        lines
    }

    #[inline(always)]
    pub fn as_slice(&self) -> &[Line] {
        &self.lines[..self.count]
    }
}

impl Plan {
    pub fn new(shooter: &Shooter) -> Plan {
        let count = shooter.cells.len();
        assert!((1..=MAX_CELLS).contains(&count), "a shooter has 1 to {MAX_CELLS} cells, not {count}");
        let mut plan = Plan {
            kind: Kind::Points,
            side: 0,
            count,
            lattice: (1.0, 2.0),
            axes: None,
            lines: [Lines::default(); 2],
            all: shooter.cells.all(),
            cells: [[0.0; 3]; MAX_CELLS],
            u: [0.0; MAX_CELLS],
            v: [0.0; MAX_CELLS],
            u_range: [0.0; 2],
            v_range: [0.0; 2],
            anchor: [0.0; 3],
            edge_u: [0.0; 3],
            edge_v: [0.0; 3],
            half: [0.0; 3],
            spread: 0.0,
            far: shooter.far,
            plane: shooter.plane,
        };
        match &shooter.cells {
            Cells::Grid(grid) => {
                let side = grid.side as f32;
                let lattice = if grid.layout == Layout::Quad { (side, 2.0) } else { (3.0 * side, 1.0) };
                let straight = grid.straight().and_then(|grid| Some((axes(grid.edge_u, grid.edge_v, lattice)?, grid)));
                let Some((axes, grid)) = straight else {
                    let points: Vec<Vector> = (0..count).map(|k| grid.point(k)).collect();
                    plan.scatter(&points);
                    return plan;
                };
                plan.kind = Kind::Grid;
                plan.axes = Some(axes);
                plan.lattice = lattice;
                if grid.layout == Layout::Quad {
                    plan.side = grid.side as usize;
                }
                for k in 0..count {
                    plan.cells[k] = grid.point(k);
                    [plan.u[k], plan.v[k]] = grid.layout.centre(grid.side, k);
                }
                plan.lines = [Lines::new(&plan.u[..count], plan.lattice), Lines::new(&plan.v[..count], plan.lattice)];
                let range = |t: &[f32]| [t.iter().copied().fold(1.0, f32::min), t.iter().copied().fold(0.0, f32::max)];
                plan.u_range = range(&plan.u[..count]);
                plan.v_range = range(&plan.v[..count]);
                (plan.anchor, plan.edge_u, plan.edge_v) = (grid.origin, grid.edge_u, grid.edge_v);
                plan.spread = norm(grid.edge_u) + norm(grid.edge_v);
            }
            Cells::Points(cells) => plan.scatter(cells),
            Cells::Directions(cells) => {
                plan.scatter(cells);
                plan.kind = Kind::Directions;
                plan.far = 1.0;
            }
        }
        plan
    }

    /// Puts cells where they are.
    fn scatter(&mut self, cells: &[Vector]) {
        self.cells[..cells.len()].copy_from_slice(cells);
        let (low, high) = around(cells);
        self.anchor = std::array::from_fn(|i| 0.5 * low[i] + 0.5 * high[i]);
        self.half = std::array::from_fn(|i| (high[i] - self.anchor[i]).max(self.anchor[i] - low[i]) * 1.00001);
        self.spread = norm(self.half);
    }

    /// Bound on the distance from `x` to any cell; for directions, on their length.
    #[inline(always)]
    pub fn reach(&self, x: Vector) -> f32 {
        if self.kind == Kind::Directions {
            norm(self.anchor) + self.spread
        } else {
            norm(sub(self.anchor, x)) + self.spread
        }
    }

    /// From `x` to cell `k`.
    #[inline(always)]
    pub fn towards(&self, x: Vector, k: usize) -> Vector {
        if self.kind == Kind::Directions { self.cells[k] } else { sub(self.cells[k], x) }
    }

    /// n·(c−x) + allowance for cell `k`.
    #[inline(always)]
    pub fn along(&self, n: Vector, x: Vector, k: usize, allowance: f32) -> f32 {
        match self.kind {
            Kind::Points | Kind::Directions => dot(n, self.towards(x, k)) + allowance,
            Kind::Grid => {
                let base = dot(n, sub(self.anchor, x)) + allowance;
                self.affine([base, dot(n, self.edge_u), dot(n, self.edge_v)], k)
            }
        }
    }

    /// Not negative when the hit lies before cell `k`: far · |N·(c−x)| − |T|, `height` being T.
    #[inline(always)]
    pub fn before_cell(&self, t: &Prepared, x: Vector, k: usize, height: f32) -> f32 {
        let scale = self.far.copysign(height);
        match self.kind {
            // Any distance will do, but the ray must come nearer to the plane.
            Kind::Directions => scale * dot(t.normal, self.cells[k]) - f32::MIN_POSITIVE,
            Kind::Points => scale * dot(t.normal, self.towards(x, k)) - height.abs(),
            Kind::Grid => {
                let base = scale * dot(t.normal, sub(self.anchor, x)) - height.abs();
                let slopes = [self.edge_u, self.edge_v].map(|edge| scale * dot(t.normal, edge));
                self.affine([base, slopes[0], slopes[1]], k)
            }
        }
    }

    /// base + v·b + u·a, rows first, so that row and column terms are added once each.
    #[inline(always)]
    fn affine(&self, [base, a, b]: [f32; 3], k: usize) -> f32 {
        (base + self.v[k] * b) + self.u[k] * a
    }

    /// Whether rounding may claim a hit far from the triangle, see [`crate::predicate::GRAZING`].
    pub fn is_grazing(&self, t: &Prepared, x: Vector, k: usize, height: f32) -> bool {
        match self.kind {
            Kind::Directions => {
                let rise = 1f32.copysign(height) * dot(t.normal, self.cells[k]);
                rise < t.grazing() * self.reach(x)
            }
            _ => height.abs() < t.grazing() * ((norm(sub(t.corners[0], x)) + t.longest) + self.reach(x)),
        }
    }

    /// Whether the way from `x` to cell `k` passes the triangle's box, grown by the margin of grazing hits.
    pub fn passes_box(&self, t: &Prepared, x: Vector, k: usize) -> bool {
        let (around, far) = self.grown_box(t, x);
        pass(around, self.towards(x, k), far).is_some()
    }

    /// The triangle's box seen from `x`, grown by the margin of grazing hits, and how far along the way to a cell it
    /// counts.
    pub fn grown_box(&self, t: &Prepared, x: Vector) -> ((Vector, Vector), f32) {
        let (margin, far) = match self.kind {
            Kind::Directions => (BOX_MARGIN * distance(t, x), f32::INFINITY),
            _ => (BOX_MARGIN * self.reach(x), 1.0),
        };
        (t.box_around(x, margin), far)
    }
}

/// The greatest distance (in the sum of coordinates) from `x` to a corner.
pub(crate) fn distance(t: &Prepared, x: Vector) -> f32 {
    t.corners.iter().map(|&c| norm(sub(c, x))).fold(0.0, f32::max)
}

/// Box around points.
fn around(points: &[Vector]) -> (Vector, Vector) {
    (
        std::array::from_fn(|i| points.iter().map(|p| p[i]).fold(f32::INFINITY, f32::min)),
        std::array::from_fn(|i| points.iter().map(|p| p[i]).fold(f32::NEG_INFINITY, f32::max)),
    )
}
