//! Random scenes, shooters and points, all from one seed, so that a failure is one number.
#![allow(dead_code, reason = "each test binary uses a part")]

use std::sync::Arc;

use ringlight_visibility::{
    Bitmap, Cells, Filter, Grid, Hierarchy, InstructionSet, Layout, NO_PLANE, OPAQUE, Points, Shooter, Triangle,
};

pub type Vector = [f32; 3];

/// A small generator (SplitMix64).
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    /// Between −1 and 1.
    pub fn signed(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1u32 << 23) as f32 - 1.0
    }

    pub fn vector(&mut self) -> Vector {
        std::array::from_fn(|_| self.signed())
    }

    /// On a coarse lattice, so that coordinates coincide often.
    pub fn lattice(&mut self) -> Vector {
        std::array::from_fn(|_| self.below(9) as f32 * 0.25 - 1.0)
    }
}

/// Where a scene made in the unit cube is put.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    pub scale: f32,
    pub offset: Vector,
}

impl Place {
    pub fn at(&self, p: Vector) -> Vector {
        std::array::from_fn(|i| p[i] * self.scale + self.offset[i])
    }

    /// From 1e-3 to 1e5 metres at the origin, or metres 10 km away.
    pub fn random(random: &mut Random) -> Place {
        match random.below(4) {
            0 => Place { scale: 10f32.powi(random.below(9) as i32 - 3), offset: [0.0; 3] },
            1 => Place { scale: 5.0, offset: [10_000.0, -10_000.0, 3.0] },
            _ => Place { scale: 1.0, offset: [0.0; 3] },
        }
    }
}

pub fn add(a: Vector, b: Vector, share: f32) -> Vector {
    std::array::from_fn(|i| a[i] + share * b[i])
}

/// The kinds of occluders that break careless predicates.
pub fn triangles(random: &mut Random, place: Place, count: usize, filters: usize) -> Vec<Triangle> {
    let mut made: Vec<[Vector; 3]> = Vec::new();
    // Those that are in the plane of the one before.
    let mut pairs = Vec::new();
    while made.len() < count {
        let a = random.vector();
        match random.below(12) {
            // A soup of all sizes.
            0 | 1 => {
                let size = 10f32.powi(-(random.below(3) as i32));
                made.push([a, add(a, random.vector(), size), add(a, random.vector(), size)]);
            }
            // Degenerate: two corners or three in one place or on one line.
            2 => {
                let b = random.vector();
                made.push(match random.below(3) {
                    0 => [a, a, b],
                    1 => [a, a, a],
                    _ => [a, add(a, b, 1.0), add(a, b, 0.5)],
                });
            }
            // A needle.
            3 => {
                let along = random.vector();
                let width = 10f32.powi(-(random.below(6) as i32));
                made.push([a, add(a, along, 1.0), add(add(a, along, 0.5), random.vector(), width)]);
            }
            // Corners on a lattice: coplanar, axis-aligned, touching.
            4 | 5 => made.push([random.lattice(), random.lattice(), random.lattice()]),
            // A fan with stored twice corners.
            6 => {
                let ring: Vec<Vector> = (0..5).map(|_| add(a, random.vector(), 0.3)).collect();
                made.extend((0..5).map(|i| [a, ring[i], ring[(i + 1) % 5]]));
            }
            // In one plane with much else.
            7 => {
                let flat = |p: Vector| [p[0], p[1], 0.125];
                made.push([flat(a), flat(random.vector()), flat(random.vector())]);
            }
            11 => {
                for pair in box_sides(random, a) {
                    pairs.push(made.len() + 1);
                    made.extend(pair);
                }
            }
            // Parallelograms, cut along either diagonal: on a lattice, anywhere, thin, and not quite flat.
            kind => {
                let a = if kind == 8 { random.lattice() } else { a };
                let edge = |random: &mut Random| match (kind, random.below(3)) {
                    (8, axis) => {
                        std::array::from_fn(|i| if i == axis { 0.25 * random.below(9) as f32 - 1.0 } else { 0.0 })
                    }
                    (_, 0) => random.vector().map(|c| 0.01 * c),
                    _ => random.vector(),
                };
                let (e, g) = (edge(random), edge(random));
                let off = if random.below(2) == 0 { 0.0 } else { 10f32.powi(-3 - random.below(5) as i32) };
                let (b, c) = (add(a, e, 1.0), add(a, g, 1.0));
                let d = add(add(b, g, 1.0), random.vector(), off);
                let mut pair = [[a, b, c], [c, b, d]];
                pair[0].rotate_left(random.below(3));
                pair[1].rotate_left(random.below(3));
                if random.below(2) == 0 {
                    pair[1].swap(0, 1);
                }
                pairs.push(made.len() + 1);
                made.extend(pair);
            }
        }
    }
    let mut triangles: Vec<Triangle> = made
        .iter()
        .zip(0..)
        .map(|(corners, id)| Triangle {
            corners: corners.map(|c| place.at(c)),
            plane: if random.below(3) == 0 { random.below(4) as u32 } else { NO_PLANE },
            id,
            filter: if filters > 0 && random.below(3) == 0 { random.below(filters) as u32 } else { OPAQUE },
        })
        .collect();
    for second in pairs {
        triangles[second].plane = triangles[second - 1].plane;
    }
    triangles
}

/// The sides of a box, two triangles each: five or six of them, or fewer; upright, turned or askew, thick or thin, and
/// some not quite closed or not quite a box.
pub fn box_sides(random: &mut Random, a: Vector) -> Vec<[[Vector; 3]; 2]> {
    let lattice = random.below(3) == 0;
    let a = if lattice { random.lattice() } else { a };
    let size = [1.0, 1.0, 0.1][random.below(3)];
    let thick: Vector =
        std::array::from_fn(|_| if lattice { 0.25 } else { size * 10f32.powi(-(random.below(3) as i32)) });
    let (sine, cosine) = (3.0 * random.signed()).sin_cos();
    let askew = random.below(4) == 0;
    let edges: [Vector; 3] = std::array::from_fn(|axis| match (lattice, axis) {
        _ if askew => random.vector().map(|c| c * thick[axis]),
        (false, 0) => [cosine, sine, 0.0].map(|c| c * thick[0]),
        (false, 1) => [-sine, cosine, 0.0].map(|c| c * thick[1]),
        _ => std::array::from_fn(|i| if i == axis { thick[axis] } else { 0.0 }),
    });
    let mut corners: [Vector; 8] =
        std::array::from_fn(|k| (0..3).fold(a, |p, axis| add(p, edges[axis], (k >> axis & 1) as f32)));
    if random.below(4) == 0 {
        let moved = random.below(8);
        corners[moved] = add(corners[moved], random.vector(), 10f32.powi(-3 - random.below(5) as i32));
    }
    let mut sides = vec![[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
    for i in (1..6).rev() {
        sides.swap(i, random.below(i + 1));
    }
    sides.truncate([4, 5, 5, 6, 6, 6][random.below(6)]);
    let mut made = Vec::new();
    for side in sides {
        let [a, b, c, d] = std::array::from_fn(|i| corners[side[i]]);
        let mut pair = if random.below(2) == 0 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] };
        pair[0].rotate_left(random.below(3));
        pair[1].rotate_left(random.below(3));
        // A corner that is stored twice, not quite in one place.
        if random.below(24) == 0 {
            let corner = &mut pair[random.below(2)][random.below(3)];
            *corner = add(*corner, random.vector(), 10f32.powi(-3 - random.below(5) as i32));
        }
        made.push(pair);
    }
    made
}

pub fn filters(random: &mut Random) -> Vec<Filter> {
    let bitmap = Arc::new(Bitmap { width: 8, height: 5, bits: vec![random.bits()] });
    let mut filters: Vec<Filter> =
        (0..4).map(|seed| Filter::Screen { share: 0.5 + 0.5 * random.signed(), seed: seed * 7919 }).collect();
    filters.extend((0..3).map(|_| Filter::Cutout {
        bitmap: bitmap.clone(),
        uv: std::array::from_fn(|_| [2.0 * random.signed(), 2.0 * random.signed()]),
    }));
    filters
}

pub fn shooter(random: &mut Random, place: Place) -> Shooter {
    let kind = random.below(5);
    shooter_of(kind, random, place)
}

/// Of a grid (kinds 0 to 2), of points (3), or of directions (4).
pub fn shooter_of(kind: usize, random: &mut Random, place: Place) -> Shooter {
    let lattice = random.below(2) == 0;
    let point = |random: &mut Random| {
        if lattice { random.lattice() } else { random.vector() }
    };
    let difference = |a: Vector, b: Vector| -> Vector { std::array::from_fn(|i| a[i] - b[i]) };
    let side = [1, 2, 4, 8][random.below(4)];
    let cells = match kind {
        0..=2 => {
            let corner = place.at(point(random));
            let edges = [place.at(point(random)), place.at(point(random))].map(|p| difference(p, corner));
            let twist = difference(place.at(random.vector()), place.at([0.0; 3])).map(|c| 0.2 * c);
            Cells::Grid(Grid {
                origin: corner,
                edge_u: edges[0],
                edge_v: edges[1],
                twist: if kind == 2 { twist } else { [0.0; 3] },
                layout: if kind == 1 { Layout::Triangle } else { Layout::Quad },
                side,
            })
        }
        3 => Cells::Points(scattered(random, point).into_iter().map(|p| place.at(p)).collect()),
        _ => Cells::Directions(scattered(random, |random| {
            if lattice { add(random.lattice(), [0.0, 0.0, 1.0], 1.5) } else { random.vector() }
        })),
    };
    Shooter { cells, plane: if random.below(2) == 0 { random.below(4) as u32 } else { NO_PLANE }, far: 0.9999 }
}

/// 1 to 64 points, often few: anywhere, near each other, in a plane, along an axis, in a line, or in one place.
pub fn scattered(random: &mut Random, point: impl Fn(&mut Random) -> Vector) -> Vec<Vector> {
    let most = [4, 16, 64][random.below(3)];
    let count = 1 + random.below(most);
    let (first, edges) = (point(random), [random.vector(), random.vector()]);
    let (kind, axis, size) = (random.below(6), random.below(3), [1.0, 0.1, 0.001][random.below(3)]);
    let near = |random: &mut Random| match kind {
        0 => point(random),
        1 => add(first, random.vector(), size),
        2 => {
            let [u, v] = [size * random.signed(), size * random.signed()];
            add(add(first, edges[0], u), edges[1], v)
        }
        3 => {
            let apart = random.vector();
            std::array::from_fn(|i| if i == axis { first[i] } else { first[i] + size * apart[i] })
        }
        4 => add(first, edges[0], size * random.signed()),
        _ => first,
    };
    (0..count).map(|_| near(random)).collect()
}

/// Sample points with their planes, owned.
#[derive(Clone)]
pub struct Samples {
    pub x: Vec<f32>,
    pub y: Vec<f32>,
    pub z: Vec<f32>,
    pub plane: Vec<u32>,
}

impl Samples {
    pub fn new(points: &[Vector], plane: Vec<u32>) -> Samples {
        let axis = |i: usize| points.iter().map(|p| p[i]).collect();
        Samples { x: axis(0), y: axis(1), z: axis(2), plane }
    }

    pub fn points(&self) -> Points<'_> {
        Points { x: &self.x, y: &self.y, z: &self.z, plane: &self.plane }
    }
}

/// 1 to 100 points: near each other or scattered, in the planes of triangles or not.
pub fn samples(random: &mut Random, place: Place) -> Samples {
    let spread = [0.0, 0.01, 0.1, 1.0][random.below(4)];
    let centre = random.vector();
    let count = 1 + random.below(100);
    let points: Vec<Vector> = (0..count)
        .map(|_| {
            let p = add(centre, random.vector(), spread);
            place.at(match random.below(4) {
                0 => random.lattice(),
                1 => [p[0], p[1], 0.125],
                _ => p,
            })
        })
        .collect();
    let plane = (0..count).map(|_| if random.below(2) == 0 { random.below(4) as u32 } else { NO_PLANE }).collect();
    Samples::new(&points, plane)
}

/// The hierarchy once per instruction set of this machine.
pub fn hierarchies(triangles: &[Triangle], filters: &[Filter]) -> Vec<(InstructionSet, Hierarchy)> {
    InstructionSet::available()
        .into_iter()
        .map(|set| (set, Hierarchy::build(triangles.to_vec(), filters.to_vec()).with_instruction_set(set)))
        .collect()
}
