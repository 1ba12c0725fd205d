//! Triangles that pair into planar convex quadrilaterals become one facet.

use glam::{Vec2, Vec3};

/// A triangle in mesh coordinates with its attributes.
#[derive(Clone, Copy, Debug)]
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

/// Pairs neighbouring triangles of one surface, in file order, each with the neighbour that makes the quadrilateral
/// nearest to a rectangle.
pub fn pair(triangles: &[[Corner; 3]]) -> Vec<Polygon> {
    let neighbours = Neighbours::find(triangles);
    let mut taken = vec![false; triangles.len()];
    let mut polygons = Vec::with_capacity(triangles.len());
    for (i, triangle) in triangles.iter().enumerate() {
        if taken[i] {
            continue;
        }
        let mut best: Option<(f32, usize, [Corner; 4])> = None;
        for (edge, j) in neighbours.of(i) {
            if taken[j] || j <= i {
                continue;
            }
            if let Some((score, corners)) = join(triangle, edge, &triangles[j])
                && best.as_ref().is_none_or(|b| score > b.0)
            {
                best = Some((score, j, corners));
            }
        }
        let [a, b, c] = *triangle;
        polygons.push(match best {
            Some((_, j, corners)) => {
                taken[j] = true;
                Polygon { corners, triangle: false }
            }
            None => Polygon { corners: [a, b, c, a], triangle: true },
        });
    }
    polygons
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

/// For each triangle edge, the triangle on its other side, when there is exactly one.
struct Neighbours(Vec<[u32; 3]>);

impl Neighbours {
    fn find(triangles: &[[Corner; 3]]) -> Neighbours {
        let mut edges: Vec<(u64, u32)> = Vec::with_capacity(triangles.len() * 3);
        for (i, t) in triangles.iter().enumerate() {
            for e in 0..3 {
                edges.push((edge_key(t[e].position, t[(e + 1) % 3].position), (i * 3 + e) as u32));
            }
        }
        edges.sort_unstable();
        let mut found = vec![[u32::MAX; 3]; triangles.len()];
        for run in edges.chunk_by(|a, b| a.0 == b.0) {
            if let [(_, a), (_, b)] = *run {
                found[a as usize / 3][a as usize % 3] = b / 3;
                found[b as usize / 3][b as usize % 3] = a / 3;
            }
        }
        Neighbours(found)
    }

    fn of(&self, triangle: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.0[triangle].iter().enumerate().filter(|&(_, &t)| t != u32::MAX).map(|(e, &t)| (e, t as usize))
    }
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

    #[test]
    fn two_triangles_of_a_square_become_one_quadrilateral() {
        let [a, b, c, d] = [corner(0., 0., 0.), corner(2., 0., 0.), corner(2., 1., 0.), corner(0., 1., 0.)];
        let polygons = pair(&[[a, b, c], [a, c, d]]);
        assert_eq!(polygons.len(), 1);
        assert!(!polygons[0].triangle);
    }

    #[test]
    fn bent_concave_or_differently_textured_pairs_stay_triangles() {
        let [a, b, c] = [corner(0., 0., 0.), corner(2., 0., 0.), corner(2., 1., 0.)];
        assert_eq!(pair(&[[a, b, c], [a, c, corner(0., 1., 0.1)]]).len(), 2);
        assert_eq!(pair(&[[a, b, c], [a, c, corner(3., 2., 0.)]]).len(), 2);
        let mut other = a;
        other.base_uv = [1.0, 1.0];
        assert_eq!(pair(&[[a, b, c], [other, c, corner(0., 1., 0.)]]).len(), 2);
    }
}
