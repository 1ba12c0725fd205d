//! The shaft from a packet of receivers to the cells (Haines & Wallace 1991): the hull of their two boxes, plus the
//! shooter's own plane. Grown by [`SHAFT_MARGIN`] of the reach, it holds every triangle that the predicate accepts for
//! any receiver and cell, so what lies outside may be skipped.

use crate::instruction_set::Machine;

use crate::build::{Bounds, Node, WIDTH};
use crate::lanes::{Lanes, any, splat};
use crate::packet::{PACKET, Packet};
use crate::plan::{Kind, Plan};
use crate::predicate::{SHAFT_MARGIN, Vector, cross, dot, norm, sub};

/// Three pairs of axes, four kinds of corners; and the shooter's plane.
const MAX_PLANES: usize = 13;

/// A convex region, relative to a centre near it, so that coordinates far from the origin do not cost precision.
pub(crate) struct Shaft {
    centre: Vector,
    low: Vector,
    high: Vector,
    planes: [Plane; MAX_PLANES],
    count: usize,
}

/// Keeps normal · y ≤ offset.
#[derive(Clone, Copy, Default)]
struct Plane {
    normal: Vector,
    offset: f32,
}

impl Shaft {
    /// Around the receivers of the lanes `unfinished` and the cells that any of them still sees; `scene` is the box of
    /// all triangles.
    pub fn new(plan: &Plan, packet: &Packet, unfinished: u32, scene: &Bounds) -> Shaft {
        let mut points = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        let mut reach = 0.0f32;
        for lane in (0..PACKET).filter(|lane| unfinished >> lane & 1 == 1) {
            extend(&mut points, packet.point(lane));
            reach = reach.max(packet.reach[lane]);
        }
        Shaft::between(plan, points, reach, packet.union(), scene)
    }

    /// From the box `points` to the cells `bits`; `reach` is the largest [`Plan::reach`] of any point.
    pub fn between(plan: &Plan, points: (Vector, Vector), reach: f32, bits: u64, scene: &Bounds) -> Shaft {
        let mut reach = reach;
        let mut cells = around(plan, bits);
        if plan.kind == Kind::Directions {
            let way;
            (reach, way) = leave(plan, points, scene);
            cells = along(points, cells, way);
        }
        let margin = SHAFT_MARGIN * reach;
        let centre: Vector = std::array::from_fn(|i| 0.5 * points.0[i] + 0.5 * points.1[i]);
        let grown = |(low, high): (Vector, Vector)| {
            (sub(low, centre).map(|c| c - margin), sub(high, centre).map(|c| c + margin))
        };
        let (from, to) = (grown(points), grown(cells));
        let mut shaft = Shaft {
            centre,
            low: std::array::from_fn(|i| from.0[i].min(to.0[i])),
            high: std::array::from_fn(|i| from.1[i].max(to.1[i])),
            planes: [Plane::default(); MAX_PLANES],
            count: 0,
        };
        let extent = norm(shaft.low).max(norm(shaft.high)) + norm(sub(shaft.high, shaft.low));
        for axis in 0..3 {
            shaft.add_hull_planes(from, to, axis, extent);
        }
        if plan.kind == Kind::Grid {
            shaft.add_shooter_plane(plan, points, margin, extent);
        }
        shaft
    }

    /// Planes along `axis` through corners of both boxes that have both boxes on one side.
    fn add_hull_planes(&mut self, from: (Vector, Vector), to: (Vector, Vector), axis: usize, extent: f32) {
        let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
        for corner in 0..4 {
            let (right, top) = (corner & 1 == 1, corner & 2 == 2);
            let pick = |b: (Vector, Vector)| [if right { b.1[i] } else { b.0[i] }, if top { b.1[j] } else { b.0[j] }];
            let (p, q) = (pick(from), pick(to));
            let along = [q[0] - p[0], q[1] - p[1]];
            let outward = [if right { 1.0 } else { -1.0 }, if top { 1.0 } else { -1.0 }];
            // The perpendicular points outward in both coordinates, or the plane supports only one of the boxes.
            let normal = if along[1] * outward[0] > 0.0 { [along[1], -along[0]] } else { [-along[1], along[0]] };
            if normal[0] * outward[0] > 0.0 && normal[1] * outward[1] > 0.0 {
                let mut plane = Plane::default();
                (plane.normal[i], plane.normal[j]) = (normal[0], normal[1]);
                plane.offset = (normal[0] * p[0] + normal[1] * p[1]).max(normal[0] * q[0] + normal[1] * q[1]);
                self.add(plane, extent);
            }
        }
    }

    /// What lies behind the shooter hides nothing of it from receivers in front.
    fn add_shooter_plane(&mut self, plan: &Plan, points: (Vector, Vector), margin: f32, extent: f32) {
        let normal = cross(plan.edge_u, plan.edge_v);
        let origin = sub(plan.anchor, self.centre);
        let (low, high) = (sub(points.0, self.centre), sub(points.1, self.centre));
        let farthest = |n: Vector| dot(n, std::array::from_fn(|i| if n[i] > 0.0 { high[i] } else { low[i] }));
        for normal in [normal, normal.map(|n| -n)] {
            if farthest(normal) <= dot(normal, origin) {
                let offset = dot(normal, origin) + margin * norm(normal);
                self.add(Plane { normal, offset }, extent);
                break;
            }
        }
    }

    fn add(&mut self, mut plane: Plane, extent: f32) {
        plane.offset += norm(plane.normal) * extent * (1.0 / 262144.0);
        self.planes[self.count] = plane;
        self.count += 1;
    }

    /// Whether a box reaches into the shaft; a scalar twin of [`Shaft::children`].
    pub fn meets(&self, low: Vector, high: Vector) -> bool {
        let low: Vector = std::array::from_fn(|i| self.low[i].max(low[i] - self.centre[i]));
        let high: Vector = std::array::from_fn(|i| self.high[i].min(high[i] - self.centre[i]));
        let least = |n: Vector| dot(n, std::array::from_fn(|i| if n[i] > 0.0 { low[i] } else { high[i] }));
        (0..3).all(|i| high[i] >= low[i]) && self.planes[..self.count].iter().all(|p| p.offset >= least(p.normal))
    }

    /// The children of `node` that reach into the shaft, as bits.
    #[inline(always)]
    pub fn children<S: Machine>(&self, simd: S, node: &Node) -> u32 {
        let mut bits = 0;
        for chunk in 0..WIDTH / S::F32_LANES {
            let mut low = splat(simd, self.low);
            let mut high = splat(simd, self.high);
            for i in 0..3 {
                low[i] = low[i].max(Lanes::new(simd, S::as_simd_f32s(&node.low[i]).0[chunk]) - self.centre[i]);
                high[i] = high[i].min(Lanes::new(simd, S::as_simd_f32s(&node.high[i]).0[chunk]) - self.centre[i]);
            }
            let mut inside = high[0].at_least(low[0]);
            inside = simd.and_m32s(inside, high[1].at_least(low[1]));
            inside = simd.and_m32s(inside, high[2].at_least(low[2]));
            if !any(simd, inside) {
                continue;
            }
            // The nearest corner of what the shaft's box leaves of the child.
            for plane in &self.planes[..self.count] {
                let n = plane.normal;
                let x = if n[0] > 0.0 { low[0] } else { high[0] };
                let y = if n[1] > 0.0 { low[1] } else { high[1] };
                let z = if n[2] > 0.0 { low[2] } else { high[2] };
                let least = (x * n[0] + y * n[1]) + z * n[2];
                inside = simd.and_m32s(inside, Lanes::splat(simd, plane.offset).at_least(least));
            }
            bits |= simd.bits(inside) << (chunk * S::F32_LANES);
        }
        bits
    }
}

/// For directions: no triangle is farther than the first of any of the points in the box, and the second times any
/// direction leads out of the scene.
pub(crate) fn leave(plan: &Plan, points: (Vector, Vector), scene: &Bounds) -> (f32, f32) {
    let reach = (0..3).map(|i| (scene.high[i] - points.0[i]).max(points.1[i] - scene.low[i]).max(0.0)).sum::<f32>();
    let shortest = plan.cells[..plan.count].iter().map(|d| d.map(f32::abs).into_iter().fold(0.0, f32::max));
    (reach, 1.01 * reach / shortest.filter(|&d| d > 0.0).fold(1.0, f32::min))
}

/// Where points of a box get to, so far along directions of another one.
#[inline(always)]
pub(crate) fn along(points: (Vector, Vector), directions: (Vector, Vector), way: f32) -> (Vector, Vector) {
    (
        std::array::from_fn(|i| points.0[i] + way * directions.0[i]),
        std::array::from_fn(|i| points.1[i] + way * directions.1[i]),
    )
}

/// The box around these cells; around a parallelogram that holds them, if they are of a plane grid.
pub(crate) fn around(plan: &Plan, mut bits: u64) -> (Vector, Vector) {
    let mut cells = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    if plan.kind == Kind::Grid && plan.side > 1 {
        let side = plan.side;
        let row = (1u64 << side) - 1;
        let rows = [bits.trailing_zeros() as usize / side, (63 - bits.leading_zeros() as usize) / side];
        let columns = (rows[0]..=rows[1]).fold(0, |all, j| all | bits >> (j * side) & row);
        for j in rows {
            for i in [columns.trailing_zeros() as usize, 63 - columns.leading_zeros() as usize] {
                extend(&mut cells, plan.cells[j * side + i]);
            }
        }
        return cells;
    }
    while bits != 0 {
        extend(&mut cells, plan.cells[bits.trailing_zeros() as usize]);
        bits &= bits - 1;
    }
    cells
}

pub(crate) fn extend(bounds: &mut (Vector, Vector), p: Vector) {
    for (i, c) in p.into_iter().enumerate() {
        bounds.0[i] = bounds.0[i].min(c);
        bounds.1[i] = bounds.1[i].max(c);
    }
}
