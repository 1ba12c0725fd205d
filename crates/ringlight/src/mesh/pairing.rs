//! Triangles that pair into planar convex quadrilaterals become one facet.

use super::NONE;
use crate::column::{Column, Store};
use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::io;

/// A triangle in mesh coordinates with its attributes.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Corner {
    /// Position, metres.
    pub position: Vec3,
    /// Base texture coordinates.
    pub base_uv: [f32; 2],
    /// Emission texture coordinates.
    pub emission_uv: [f32; 2],
    /// Vertex colour.
    pub colour: [f32; 4],
}

/// Three or four corners.
#[derive(Clone, Copy, Debug)]
pub struct Polygon {
    /// Corners; a triangle repeats corner 0.
    pub corners: [Corner; 4],
    /// Whether there are three.
    pub triangle: bool,
}

/// Largest distance of the fourth corner from the plane of the other three, relative to the longest edge.
const PLANAR: f32 = 1e-4;

/// Pairs triangles; its columns serve one surface after another.
pub struct Pairing {
    edges: Column<Edge>,
    /// For each triangle edge, the triangle on its other side when there is exactly one, else [`NONE`].
    neighbours: Column<[u32; 3]>,
    /// Whether a triangle is part of a quadrilateral already.
    taken: Column<u8>,
}

/// An edge of a triangle.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
#[repr(C)]
struct Edge {
    key: u64,
    /// Thrice the triangle, plus the number of the edge.
    number: u64,
}

impl Pairing {
    /// With columns in `store`.
    pub fn new(store: Store<'_>) -> io::Result<Pairing> {
        Ok(Pairing { edges: store.column()?, neighbours: store.column()?, taken: store.column()? })
    }

    /// Pairs neighbouring triangles of one surface, in file order, each with the neighbour that makes the quadrilateral
    /// nearest to a rectangle.
    pub fn pair(
        &mut self,
        triangles: &[[Corner; 3]],
        mut sink: impl FnMut(&Polygon) -> io::Result<()>,
    ) -> io::Result<()> {
        self.find_neighbours(triangles)?;
        self.taken.clear();
        self.taken.resize(triangles.len(), 0)?;
        let (neighbours, taken): (&[_], &mut [_]) = (&self.neighbours, &mut self.taken);
        for (i, triangle) in triangles.iter().enumerate() {
            if taken[i] != 0 {
                continue;
            }
            let mut best: Option<(f32, usize, [Corner; 4])> = None;
            for (edge, &j) in neighbours[i].iter().enumerate().filter(|&(_, &j)| j != NONE) {
                let j = j as usize;
                if taken[j] != 0 || j <= i {
                    continue;
                }
                if let Some((score, corners)) = join(triangle, edge, &triangles[j])
                    && best.as_ref().is_none_or(|b| score > b.0)
                {
                    best = Some((score, j, corners));
                }
            }
            let [a, b, c] = *triangle;
            sink(&match best {
                Some((_, j, corners)) => {
                    taken[j] = 1;
                    Polygon { corners, triangle: false }
                }
                None => Polygon { corners: [a, b, c, a], triangle: true },
            })?;
        }
        Ok(())
    }

    fn find_neighbours(&mut self, triangles: &[[Corner; 3]]) -> io::Result<()> {
        self.edges.clear();
        self.edges.reserve(triangles.len() * 3)?;
        for (i, t) in (0..).zip(triangles) {
            let key = |e: usize| edge_key(t[e].position, t[(e + 1) % 3].position);
            self.edges.extend_from_slice(&[0, 1, 2].map(|e| Edge { key: key(e), number: i * 3 + e as u64 }))?;
        }
        self.edges.par_sort_unstable();
        self.neighbours.clear();
        self.neighbours.resize(triangles.len(), [NONE; 3])?;
        let found: &mut [[u32; 3]] = &mut self.neighbours;
        for run in self.edges.chunk_by(|a, b| a.key == b.key) {
            if let [a, b] = *run {
                for (one, other) in [(a.number, b.number), (b.number, a.number)] {
                    found[one as usize / 3][one as usize % 3] = (other / 3) as u32;
                }
            }
        }
        Ok(())
    }
}

/// The quadrilateral of `a` and `b` over edge `edge` of `a`, with a score (1 for a rectangle), if they make a planar
/// convex one with attributes that run on.
fn join(a: &[Corner; 3], edge: usize, b: &[Corner; 3]) -> Option<(f32, [Corner; 4])> {
    let (p, q, r) = (a[edge], a[(edge + 1) % 3], a[(edge + 2) % 3]);
    // b runs the shared edge the other way: q → p.
    let start = (0..3).find(|&i| b[i].position == q.position && b[(i + 1) % 3].position == p.position)?;
    let s = b[(start + 2) % 3];
    let same =
        |x: &Corner, y: &Corner| x.base_uv == y.base_uv && x.emission_uv == y.emission_uv && x.colour == y.colour;
    if !same(&b[start], &q) || !same(&b[(start + 1) % 3], &p) {
        return None;
    }
    // Begin at the corner after the diagonal that comes first in `a`'s own order, so that u runs along a file edge.
    let corners = [r, p, s, q];
    let x = corners.map(|c| c.position);
    let edges: [Vec3; 4] = std::array::from_fn(|i| x[(i + 1) % 4] - x[i]);
    let longest = edges.iter().map(|e| e.length()).fold(0.0, f32::max);
    let normal = (x[2] - x[0]).cross(x[3] - x[1]).try_normalize()?;
    if (x[2] - x[0]).dot(normal).abs() + (x[3] - x[0]).dot(normal).abs() + (x[1] - x[0]).dot(normal).abs()
        > PLANAR * longest
    {
        return None;
    }
    let mut squarest = 1.0f32;
    for i in 0..4 {
        let sine = edges[i].cross(edges[(i + 1) % 4]).dot(normal) / (edges[i].length() * edges[(i + 1) % 4].length());
        squarest = squarest.min(sine);
    }
    (squarest > 0.05 && runs_on(&corners)).then_some((squarest, corners))
}

/// Whether the attributes of the fourth corner continue those of the other three, so that bilinear interpolation over the
/// quadrilateral shows what the two triangles showed.
fn runs_on(c: &[Corner; 4]) -> bool {
    let plain = |f: fn(&Corner) -> [f32; 2]| c.iter().all(|x| f(x) == f(&c[0]));
    let plain_colour = c.iter().all(|x| x.colour == c[0].colour);
    if plain(|x| x.base_uv) && plain(|x| x.emission_uv) && plain_colour {
        return true;
    }
    // Affine coordinates of corner 2 in the frame of corners 0, 1, 3.
    let (u, v, w) = (c[1].position - c[0].position, c[3].position - c[0].position, c[2].position - c[0].position);
    let n = u.cross(v);
    let (s, t) = (w.cross(v).dot(n) / n.dot(n), u.cross(w).dot(n) / n.dot(n));
    let parallelogram = (s - 1.0).abs() < 1e-3 && (t - 1.0).abs() < 1e-3;
    let affine = |f: fn(&Corner) -> Vec2, scale: f32| {
        let [a, b, d, e] = [f(&c[0]), f(&c[1]), f(&c[2]), f(&c[3])];
        (a + s * (b - a) + t * (e - a) - d).length() < 2e-3 * scale.max((b - a).length() + (e - a).length())
    };
    parallelogram
        && affine(|x| Vec2::from(x.base_uv), 1e-3)
        && affine(|x| Vec2::from(x.emission_uv), 1e-3)
        && affine(|x| Vec2::new(x.colour[0], x.colour[1]), 1.0)
        && affine(|x| Vec2::new(x.colour[2], x.colour[3]), 1.0)
}

/// A hash of an undirected edge; the caller compares positions, so that a collision only loses a pair.
fn edge_key(a: Vec3, b: Vec3) -> u64 {
    let hash = |p: Vec3| {
        p.to_array().iter().fold(0x9e37_79b9_7f4a_7c15u64, |h, &x| {
            (h ^ u64::from((x + 0.0).to_bits())).wrapping_mul(0xff51_afd7_ed55_8ccd).rotate_left(29)
        })
    };
    let (a, b) = (hash(a), hash(b));
    a.min(b).wrapping_mul(0xc4ce_b9fe_1a85_ec53) ^ a.max(b)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corner(x: f32, y: f32, z: f32) -> Corner {
        Corner { position: Vec3::new(x, y, z), base_uv: [0.0; 2], emission_uv: [0.0; 2], colour: [1.0; 4] }
    }

    fn paired(triangles: &[[Corner; 3]]) -> Vec<Polygon> {
        let mut polygons = Vec::new();
        let mut pairing = Pairing::new(Store::Heap).unwrap();
        pairing
            .pair(triangles, |&polygon| {
                polygons.push(polygon);
                Ok(())
            })
            .unwrap();
        polygons
    }

    #[test]
    fn two_triangles_of_a_square_become_one_quadrilateral() {
        let [a, b, c, d] = [corner(0., 0., 0.), corner(2., 0., 0.), corner(2., 1., 0.), corner(0., 1., 0.)];
        let polygons = paired(&[[a, b, c], [a, c, d]]);
        assert_eq!(polygons.len(), 1);
        assert!(!polygons[0].triangle);
    }

    #[test]
    fn bent_concave_or_differently_textured_pairs_stay_triangles() {
        let [a, b, c] = [corner(0., 0., 0.), corner(2., 0., 0.), corner(2., 1., 0.)];
        assert_eq!(paired(&[[a, b, c], [a, c, corner(0., 1., 0.1)]]).len(), 2);
        assert_eq!(paired(&[[a, b, c], [a, c, corner(3., 2., 0.)]]).len(), 2);
        let mut other = a;
        other.base_uv = [1.0, 1.0];
        assert_eq!(paired(&[[a, b, c], [other, c, corner(0., 1., 0.)]]).len(), 2);
    }
}
