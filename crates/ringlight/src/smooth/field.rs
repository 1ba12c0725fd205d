//! The elements' light in the order of their lattices, and what it amounts to at a vertex.

use super::around;
use super::lattice::Lattice;
use super::pieces;
use super::places::{Places, Touch};
use crate::mesh::{Frame, Mesh, RELATIVE_TOLERANCE, Tile};
use crate::quantity::Rgb;
use crate::solution::Solution;
use glam::DVec3;
use rayon::prelude::*;
use std::ops::Range;

/// Cosine of the crease angle, 30°: surfaces that meet at less count as one smooth surface.
const CREASE: f64 = 0.866_025_403_784_438_6;

/// Where more faces than this meet, each joins only those that face like itself.
const CHAIN_LIMIT: usize = 64;

/// Light that is still to be found.
pub const UNKNOWN: Rgb = [f32::NAN; 3];

/// Light of elements, side by side in the order of facets (front, then back) and their lattices: of those facets that decide
/// the light at the vertices of some.
pub struct Field<'a> {
    mesh: &'a Mesh,
    places: Places<'a>,
    /// Where the cells of each facet begin; the next facet's begin there too if they are not held.
    first_cell: Vec<u32>,
    cells: Vec<Rgb>,
    tolerance: f64,
}

/// A side of a facet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Side {
    /// Number of the facet.
    pub facet: u32,
    /// Whether it is the back.
    pub back: bool,
}

/// An element that counts at a vertex.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// Where it lies.
    pub side: Side,
    /// Cell of the lattice.
    pub cell: u32,
    /// Its light; never unknown.
    pub light: Rgb,
    /// How much it counts: the angle it spans at the vertex.
    pub weight: f64,
}

/// Buffers reused from vertex to vertex.
#[derive(Default)]
pub struct Work {
    /// What touches `place`.
    touches: Vec<Touch>,
    place: Option<(u32, [u32; 2])>,
    faces: Vec<(Side, DVec3, bool)>,
    /// The elements that count.
    pub parts: Vec<Part>,
}

/// Number of lit sides of facet `facet`.
pub fn sides(mesh: &Mesh, facet: u32) -> impl Iterator<Item = Side> + use<> {
    let double = mesh.facets[facet as usize].double_sided();
    [false, true].into_iter().take(1 + usize::from(double)).map(move |back| Side { facet, back })
}

/// The light at an element's sample point. Unknown for elements without a free sample, and for partly covered ones that got
/// no light at all: their sample point lies in a closed pocket.
pub fn known(solution: &Solution, element: u32) -> Option<Rgb> {
    let (valid, light) = (solution.mesh.valid[element as usize], solution.irradiance(element));
    let pocket = valid != crate::mesh::ALL_VALID && light == [0.0; 3];
    (valid != 0 && !pocket && light.iter().all(|x| x.is_finite())).then_some(light)
}

/// The element over a cell.
pub fn element_of(mesh: &Mesh, side: Side, cell: u32) -> u32 {
    let facet = &mesh.facets[side.facet as usize];
    let first = if side.back { facet.first_back_element } else { facet.first_element };
    first + facet.find_element(Lattice::of(facet).middle(cell)).0
}

/// The side of a facet that an element lies on, and its cell.
pub fn locate(mesh: &Mesh, element: u32) -> (Side, u32) {
    let cluster = &mesh.clusters[mesh.clusters.partition_point(|c| c.elements.end <= element)];
    // The last patch of the cluster that begins at or before the element.
    let first_element = |id: u32| {
        let code = mesh.patch_facets[id as usize];
        let facet = &mesh.facets[(code >> 1) as usize];
        match code & 1 {
            1 => facet.first_back_element + (id - facet.first_back_patch) * facet.elements_per_patch(),
            _ => facet.first_element + (id - facet.first_patch) * facet.elements_per_patch(),
        }
    };
    let (mut low, mut high) = (cluster.patches.start, cluster.patches.end);
    while high - low > 1 {
        let middle = low + (high - low) / 2;
        if first_element(middle) <= element { low = middle } else { high = middle }
    }
    let code = mesh.patch_facets[low as usize];
    let side = Side { facet: code >> 1, back: code & 1 == 1 };
    let facet = &mesh.facets[side.facet as usize];
    let first_patch = if side.back { facet.first_back_patch } else { facet.first_patch };
    let layout = facet.layout();
    let within = Tile::of(layout, facet.elements.map(u32::from), element - first_element(low));
    let middle = facet.patch_tile(low - first_patch).at(within.at(Frame::middle(layout)));
    let (cell, _) = Tile::find(layout, Lattice::of(facet).size, middle);
    (side, cell)
}

impl<'a> Field<'a> {
    /// The light at the sample points, as far as it decides that at the vertices of these facets.
    pub fn new(solution: &'a Solution, facets: Range<u32>) -> Field<'a> {
        let mesh = &solution.mesh;
        let tolerance = RELATIVE_TOLERANCE * mesh.diagonal;
        let places = Places::new(mesh);
        let held = around::deciding(solution, &places, facets, tolerance);
        let mut first_cell = Vec::with_capacity(mesh.facets.len() + 1);
        let mut next = 0u32;
        for (facet, held) in mesh.facets.iter().zip(&held) {
            first_cell.push(next);
            let sides = if facet.double_sided() { 2 } else { 1 };
            next += if *held { facet.element_count() * sides } else { 0 };
        }
        first_cell.push(next);
        let light = |side: Side, cell: u32| known(solution, element_of(mesh, side, cell)).unwrap_or(UNKNOWN);
        let mut cells = vec![UNKNOWN; next as usize];
        pieces(mesh.facets.len(), |f| first_cell[f] as usize, &mut cells).into_par_iter().for_each(
            |(facets, light_of)| {
                let all = facets.filter(|&f| held[f as usize]).flat_map(|f| {
                    let count = mesh.facets[f as usize].element_count();
                    sides(mesh, f).flat_map(move |side| (0..count).map(move |cell| (side, cell)))
                });
                light_of.iter_mut().zip(all).for_each(|(cell_light, (side, cell))| *cell_light = light(side, cell));
            },
        );
        Field { mesh, places, first_cell, cells, tolerance }
    }

    /// Whether the light of a facet is held.
    pub fn holds(&self, facet: u32) -> bool {
        self.first_cell[facet as usize] < self.first_cell[facet as usize + 1]
    }

    /// Memory that the light takes, bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.cells.as_slice())
    }

    /// The mesh.
    pub fn mesh(&self) -> &'a Mesh {
        self.mesh
    }

    /// Place of a cell among all.
    pub fn index(&self, side: Side, cell: u32) -> usize {
        let back = if side.back { self.mesh.facets[side.facet as usize].element_count() } else { 0 };
        (self.first_cell[side.facet as usize] + back + cell) as usize
    }

    /// Light of the cell at a place.
    pub fn at(&self, index: usize) -> Rgb {
        self.cells[index]
    }

    /// Sets the light of the cell at a place.
    pub fn set(&mut self, index: usize, light: Rgb) {
        self.cells[index] = light;
    }

    /// Whether the light at a place is known.
    pub fn known(&self, index: usize) -> bool {
        !self.cells[index][0].is_nan()
    }

    /// Collects in `work.parts` the cells that meet at a vertex and belong to the same smooth surface, the unknown ones
    /// too if `unknown`.
    pub fn collect(&self, side: Side, vertex: [u32; 2], unknown: bool, work: &mut Work) {
        let facet = &self.mesh.facets[side.facet as usize];
        let lattice = Lattice::of(facet);
        let Work { touches, place, faces, parts } = work;
        parts.clear();
        let mut push = |side: Side, cell: u32, weight: f64| {
            let light = self.at(self.index(side, cell));
            if unknown || !light[0].is_nan() {
                parts.push(Part { side, cell, light, weight });
            }
        };
        if lattice.on_border(vertex) {
            let frame = facet.frame();
            let cell_size = (frame.area_vector().length() / f64::from(lattice.cell_count())).sqrt();
            let tolerance = self.tolerance.min(0.01 * cell_size);
            // Both sides of a facet ask in turn.
            if place.replace((side.facet, vertex)) != Some((side.facet, vertex)) {
                self.places.touching(frame.at(lattice.parameters(vertex)), tolerance, touches);
            }
            self.join_faces(side, touches, faces);
            if faces.iter().any(|f| f.0 == side) {
                let mut rest = faces.as_slice();
                for run in touches.chunk_by(|a, b| a.facet == b.facet) {
                    let count = rest.iter().take_while(|f| f.0.facet == run[0].facet).count();
                    for &(side, ..) in rest[..count].iter().filter(|f| f.2) {
                        run.iter().for_each(|touch| push(side, touch.cell, touch.angle.max(1e-3)));
                    }
                    rest = &rest[count..];
                }
                return;
            }
        }
        lattice.cells_at(vertex).for_each(|cell| push(side, cell, 1.0));
    }

    /// Marks the faces that `own` joins smoothly, directly or through others between.
    fn join_faces(&self, own: Side, touches: &[Touch], faces: &mut Vec<(Side, DVec3, bool)>) {
        faces.clear();
        for run in touches.chunk_by(|a, b| a.facet == b.facet) {
            let normal = self.mesh.facets[run[0].facet as usize].frame().area_vector().normalize();
            for side in sides(self.mesh, run[0].facet) {
                faces.push((side, if side.back { -normal } else { normal }, side == own));
            }
        }
        let passes = if faces.len() > CHAIN_LIMIT { 1 } else { faces.len() };
        for _ in 0..passes {
            let mut grown = false;
            for i in 0..faces.len() {
                let from = if passes == 1 { faces[i].0 == own } else { faces[i].2 };
                if !from {
                    continue;
                }
                for j in 0..faces.len() {
                    if !faces[j].2 && faces[i].1.dot(faces[j].1) >= CREASE {
                        faces[j].2 = true;
                        grown = true;
                    }
                }
            }
            if !grown {
                break;
            }
        }
    }

    /// Light at `point` from parts around it: their mean; where they lie to one side, as at the border of a surface, it
    /// follows their gradient to the point, by no more than half. The gradient is that of all light around the parts: where
    /// a wall stands, take the [`mean`].
    pub fn blend(&self, point: DVec3, parts: &[Part]) -> Rgb {
        let weight: f64 = parts.iter().map(|p| p.weight).sum();
        let mut mean = [0.0; 3];
        let mut centre = DVec3::ZERO;
        let mut size = 0.0;
        for part in parts {
            let facet = &self.mesh.facets[part.side.facet as usize];
            let (frame, lattice) = (facet.frame(), Lattice::of(facet));
            centre += part.weight / weight * frame.at(lattice.middle(part.cell));
            size += part.weight / weight * frame.area_vector().length() / f64::from(lattice.cell_count());
            (0..3).for_each(|c| mean[c] += part.weight / weight * f64::from(part.light[c]));
        }
        let away = point - centre;
        let mut change = [0.0; 3];
        // Surrounded points lie in the middle of their parts.
        if away.length_squared() > 1e-6 * size {
            for part in parts {
                let facet = &self.mesh.facets[part.side.facet as usize];
                let [along_u, along_v] = self.gradient(part.side, part.cell);
                let frame = facet.frame();
                let lattice = Lattice::of(facet);
                let normal = frame.edge_u.cross(frame.edge_v);
                let n2 = normal.length_squared();
                let u = away.cross(frame.edge_v).dot(normal) / n2 * f64::from(lattice.size[0]);
                let v = frame.edge_u.cross(away).dot(normal) / n2 * f64::from(lattice.size[1]);
                (0..3).for_each(|c| change[c] += part.weight / weight * (u * along_u[c] + v * along_v[c]));
            }
        }
        [0, 1, 2].map(|c| (mean[c] + change[c]).clamp(0.5 * mean[c], 1.5 * mean[c]) as f32)
    }

    /// Change of light from cell to cell along u and v.
    fn gradient(&self, side: Side, cell: u32) -> [[f64; 3]; 2] {
        let lattice = Lattice::of(&self.mesh.facets[side.facet as usize]);
        if lattice.size == [1, 1] {
            return Default::default();
        }
        // Triangles take it from the upright ones.
        let [column, row, _] = lattice.position(cell).map(i64::from);
        let light = |column: i64, row: i64| {
            let light = self.at(self.index(side, lattice.cell(column, row, false)?));
            (!light[0].is_nan()).then(|| light.map(f64::from))
        };
        let along_u = |column: i64, row: i64| slope(|step| light(column + step, row));
        let along_v = |column: i64, row: i64| slope(|step| light(column, row + step));
        // At the tip of a triangle a row has one cell: the row below tells.
        [
            along_u(column, row).or_else(|| along_u(column, row - 1)).unwrap_or_default(),
            along_v(column, row).or_else(|| along_v(column - 1, row)).unwrap_or_default(),
        ]
    }
}

/// Weighted mean of the light of some parts.
pub fn mean(parts: &[Part]) -> Rgb {
    let weight: f64 = parts.iter().map(|p| p.weight).sum();
    [0, 1, 2].map(|c| parts.iter().map(|p| p.weight / weight * f64::from(p.light[c])).sum::<f64>() as f32)
}

/// Change per cell at cell 0 of a row: central inside, one-sided at its ends; none across an extremum, no more than
/// twice the next change inwards and no more than the light itself, so that shadow edges do not overshoot.
fn slope(light: impl Fn(i64) -> Option<[f64; 3]>) -> Option<[f64; 3]> {
    let here = light(0)?;
    let end = |direction: i64| {
        let (first, second) = (light(direction)?, light(2 * direction));
        Some([0, 1, 2].map(|c| {
            let near = first[c] - here[c];
            let far = second.map_or(near, |s| 2.0 * (s[c] - first[c]));
            let change = if near * far <= 0.0 { 0.0 } else { near.abs().min(far.abs()).min(here[c]) };
            change.copysign(near) * direction as f64
        }))
    };
    match (light(-1), light(1)) {
        (Some(before), Some(after)) => Some([0, 1, 2].map(|c| {
            let rises = (here[c] - before[c]) * (after[c] - here[c]) > 0.0;
            if rises { (after[c] - before[c]) / 2.0 } else { 0.0 }
        })),
        (None, _) => end(1),
        (_, None) => end(-1),
    }
}
