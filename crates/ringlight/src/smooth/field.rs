//! The elements' light in the order of their lattices, and what it amounts to at a vertex.

use super::around;
use super::pieces;
use super::places::Places;
use super::sheet::{Sheet, Sheets};
use super::touch::{Touch, touching, touching_side};
use crate::mesh::{Frame, Mesh, RELATIVE_TOLERANCE, Tile};
use crate::quantity::Rgb;
use crate::solution::Solution;
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// Cosine of the crease angle, 30°: surfaces that meet at less count as one smooth surface.
const CREASE: f64 = 0.866_025_403_784_438_6;

/// Where more faces than this meet, each joins only those that face like itself.
const CHAIN_LIMIT: usize = 64;

/// What has no neighbours to tell how light changes counts by this share where others have.
const GUESSED: f64 = 1e-3;

/// Light that is still to be found.
pub const UNKNOWN: Rgb = [f32::NAN; 3];

/// Light of elements, side by side in the order of sheets and their lattices: of those facets that decide the light at the
/// vertices of some.
pub struct Field<'a> {
    sheets: Arc<Sheets<'a>>,
    places: Places<'a>,
    /// Where the cells of each sheet begin; the next sheet's begin there too if they are not held.
    first_cell: Vec<u32>,
    cells: Vec<Rgb>,
    /// Cells whose light is that of their neighbours.
    filled: Vec<bool>,
    tolerance: f64,
}

/// An element that counts at a vertex.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// Number of the sheet on which it lies.
    pub sheet: u32,
    /// Cell of the sheet's lattice.
    pub cell: u32,
    /// Its light; never unknown.
    pub light: Rgb,
    /// How much it counts: the angle it spans at the vertex.
    pub weight: f64,
}

/// A side of a facet that meets others at a vertex.
struct Face {
    facet: u32,
    back: bool,
    normal: DVec3,
    /// Whether the surface in question goes on in it.
    joined: bool,
}

/// Buffers reused from vertex to vertex.
#[derive(Default)]
pub struct Work {
    /// What touches `place`, to a tolerance.
    touches: Vec<Touch>,
    place: Option<(DVec3, f64)>,
    faces: Vec<Face>,
    /// The elements that count.
    pub parts: Vec<Part>,
}

/// The light at an element's sample point. Unknown for elements without a free sample, and for partly covered ones that got
/// no light at all: their sample point lies in a closed pocket.
pub fn known(solution: &Solution, element: u32) -> Option<Rgb> {
    let (valid, light) = (solution.mesh.valid[element as usize], solution.irradiance(element));
    let pocket = valid != crate::mesh::ALL_VALID && light == [0.0; 3];
    (valid != 0 && !pocket && light.iter().all(|x| x.is_finite())).then_some(light)
}

impl<'a> Field<'a> {
    /// The light at the sample points, as far as it decides that at the vertices of these facets.
    pub fn new(solution: &'a Solution, facets: Range<u32>) -> Field<'a> {
        let mesh = &solution.mesh;
        let tolerance = RELATIVE_TOLERANCE * mesh.diagonal;
        let (sheets, places) = (Arc::new(Sheets::new(mesh)), Places::new(mesh));
        let held = around::deciding(solution, &places, facets, tolerance);
        let is_held = |number: u32| held[sheets.get(number).facet as usize];
        let mut first_cell = Vec::with_capacity(sheets.len() as usize + 1);
        let mut next = 0;
        for number in 0..sheets.len() {
            first_cell.push(next);
            next += if is_held(number) { sheets.get(number).lattice.cell_count() } else { 0 };
        }
        first_cell.push(next);
        let mut cells = vec![UNKNOWN; next as usize];
        let first = |sheet: u32| first_cell[sheet as usize] as usize;
        pieces(sheets.len(), first, &mut cells).into_par_iter().for_each(|(numbers, light_of)| {
            let count = |number: u32| sheets.get(number).lattice.cell_count();
            let all = numbers
                .filter(|&number| is_held(number))
                .flat_map(|number| (0..count(number)).map(move |cell| (number, cell)));
            let light = |number, cell| known(solution, sheets.element(number, cell)).unwrap_or(UNKNOWN);
            light_of.iter_mut().zip(all).for_each(|(cell_light, (number, cell))| *cell_light = light(number, cell));
        });
        let filled = vec![false; cells.len()];
        Field { sheets, places, first_cell, cells, filled, tolerance }
    }

    /// Whether the light of a sheet is held.
    pub fn holds(&self, sheet: u32) -> bool {
        self.first_cell[sheet as usize] < self.first_cell[sheet as usize + 1]
    }

    /// Memory that the light takes, bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.cells.as_slice()) + size_of_val(self.filled.as_slice())
    }

    /// The sheets.
    pub fn sheets(&self) -> &Arc<Sheets<'a>> {
        &self.sheets
    }

    /// Place of a cell in the field.
    pub fn index(&self, sheet: u32, cell: u32) -> usize {
        (self.first_cell[sheet as usize] + cell) as usize
    }

    /// The mesh.
    pub fn mesh(&self) -> &'a Mesh {
        self.sheets.mesh()
    }

    /// Light of the cell at a place.
    pub fn at(&self, index: usize) -> Rgb {
        self.cells[index]
    }

    /// Gives the cell at a place light of its neighbours.
    pub fn fill(&mut self, index: usize, light: Rgb) {
        (self.cells[index], self.filled[index]) = (light, true);
    }

    /// Whether the light at a place is known.
    pub fn known(&self, index: usize) -> bool {
        !self.cells[index][0].is_nan()
    }

    /// Collects in `work.parts` the cells that meet at a vertex of a sheet and belong to the same smooth surface, the unknown
    /// ones too if `unknown`.
    pub fn collect(&self, number: u32, vertex: [u32; 2], unknown: bool, work: &mut Work) {
        let sheet = self.sheets.get(number);
        let Work { touches, place, faces, parts } = work;
        parts.clear();
        let mut push = |sheet: u32, cell: u32, weight: f64| {
            let light = self.at(self.index(sheet, cell));
            if unknown || !light[0].is_nan() {
                parts.push(Part { sheet, cell, light, weight });
            }
        };
        if sheet.lattice.on_border(vertex) {
            let (own, at) = ((sheet.facet, sheet.back), sheet.parameters(vertex));
            let frame = self.sheets.facet(number).frame();
            let cell_size = (frame.area_vector().length() / f64::from(sheet.grid.cell_count())).sqrt();
            let tolerance = self.tolerance.min(0.01 * cell_size);
            if sheet.on_facet_border(vertex) {
                let point = frame.at(at);
                // Both sides of a facet ask in turn.
                if place.replace((point, tolerance)) != Some((point, tolerance)) {
                    touching(&self.sheets, &self.places, point, tolerance, touches);
                }
                self.join_faces(own, touches, faces);
            } else {
                *place = None;
                touches.clear();
                touching_side(&self.sheets, sheet.facet, sheet.back, at, tolerance, touches);
                faces.clear();
                faces.push(Face { facet: sheet.facet, back: sheet.back, normal: DVec3::ZERO, joined: true });
            }
            if faces.iter().any(|face| (face.facet, face.back) == own) {
                for (run, _) in runs(touches).zip(&*faces).filter(|(_, face)| face.joined) {
                    run.iter().for_each(|touch| push(touch.sheet, touch.cell, touch.angle.max(1e-3)));
                }
                return;
            }
        }
        sheet.lattice.cells_at(vertex).for_each(|cell| push(number, cell, 1.0));
    }

    /// Finds the faces of some touches, a run of them each, and marks those that `own` joins smoothly, directly or through others
    /// between.
    fn join_faces(&self, own: (u32, bool), touches: &[Touch], faces: &mut Vec<Face>) {
        faces.clear();
        faces.extend(runs(touches).map(|run| {
            let Touch { facet, back, .. } = run[0];
            let normal = self.mesh().facets[facet as usize].frame().area_vector().normalize();
            Face { facet, back, normal: if back { -normal } else { normal }, joined: (facet, back) == own }
        }));
        let passes = if faces.len() > CHAIN_LIMIT { 1 } else { faces.len() };
        for _ in 0..passes {
            let mut grown = false;
            for i in 0..faces.len() {
                let from = if passes == 1 { (faces[i].facet, faces[i].back) == own } else { faces[i].joined };
                if !from {
                    continue;
                }
                for j in 0..faces.len() {
                    if !faces[j].joined && faces[i].normal.dot(faces[j].normal) >= CREASE {
                        faces[j].joined = true;
                        grown = true;
                    }
                }
            }
            if !grown {
                break;
            }
        }
    }

    /// Light at a vertex around which are these parts. Where a coarser sheet of the same side has it on an edge of a cell, it is what
    /// that edge shows there, so that there is no seam.
    pub fn light(&self, number: u32, vertex: [u32; 2], parts: &[Part]) -> Rgb {
        if let Some(edge) = self.sheets.coarse_edge(number, vertex) {
            let mut work = Work::default();
            let [from, to] = edge.ends.map(|end| {
                self.collect(edge.sheet, end, false, &mut work);
                self.light(edge.sheet, end, &work.parts)
            });
            return between(from, to, edge.along);
        }
        let at = self.sheets.get(number).parameters(vertex);
        if parts.is_empty() { [0.0; 3] } else { self.blend(self.sheets.facet(number).frame().at(at), parts) }
    }

    /// Light at `point` from parts around it: their mean; where they do not surround it within one facet, as at the border of a
    /// surface or where light breaks, the mean of what follows the gradient of each to the point. Those that have no neighbours
    /// to tell it hardly count beside others. The gradient is that of all light around the parts: where a wall stands, take the
    /// [`mean`].
    fn blend(&self, point: DVec3, parts: &[Part]) -> Rgb {
        let weight: f64 = parts.iter().map(|p| p.weight).sum();
        let (mut centre, mut size) = (DVec3::ZERO, 0.0);
        for part in parts {
            let (frame, sheet) = (self.sheets.facet(part.sheet).frame(), self.sheets.get(part.sheet));
            centre += part.weight / weight * frame.at(sheet.middle(part.cell));
            size += part.weight / weight * frame.area_vector().length() / f64::from(sheet.grid.cell_count());
        }
        let facet = |part: &Part| self.sheets.get(part.sheet).facet;
        let is_surrounded = (point - centre).length_squared() <= 1e-6 * size;
        if is_surrounded && parts.iter().all(|part| facet(part) == facet(&parts[0])) {
            return mean(parts);
        }
        let (mut light, mut total) = ([0.0; 3], 0.0);
        for part in parts {
            let (followed, trust) = self.followed(point, part);
            let weight = trust * part.weight;
            (0..3).for_each(|c| light[c] += weight * followed[c]);
            total += weight;
        }
        light.map(|x| (x / total) as f32)
    }

    /// Light of a part, followed along its gradient to a point by no more than itself, and how far it is to be trusted: less if
    /// not all of the gradient that counts is known, least if the part took the light of its neighbours.
    fn followed(&self, point: DVec3, part: &Part) -> ([f64; 3], f64) {
        let (frame, sheet) = (self.sheets.facet(part.sheet).frame(), self.sheets.get(part.sheet));
        let middle = sheet.middle(part.cell);
        let away = point - frame.at(middle);
        let (along_u, along_v) = (frame.edge_u + middle.y * frame.twist, frame.edge_v + middle.x * frame.twist);
        let normal = along_u.cross(along_v);
        let n2 = normal.length_squared();
        let u = away.cross(along_v).dot(normal) / n2 * f64::from(sheet.grid.size[0]);
        let v = along_u.cross(away).dot(normal) / n2 * f64::from(sheet.grid.size[1]);
        let own = part.light.map(f64::from);
        if self.filled[self.index(part.sheet, part.cell)] {
            return (own, GUESSED * GUESSED);
        }
        let mut light = own;
        let mut trust = 1.0;
        for (cells, slope) in [u, v].into_iter().zip(self.gradient(part.sheet, part.cell)) {
            let slope = slope.unwrap_or_else(|| {
                if cells.abs() > 0.1 {
                    trust = GUESSED;
                }
                [0.0; 3]
            });
            (0..3).for_each(|c| light[c] += cells * slope[c]);
        }
        ([0, 1, 2].map(|c| light[c].clamp(0.0, 2.0 * own[c])), trust)
    }

    /// Change of light from cell to cell along u and v of the sheet's grid, where neighbours tell it.
    fn gradient(&self, number: u32, cell: u32) -> [Option<[f64; 3]>; 2] {
        let sheet = self.sheets.get(number);
        let grid = sheet.grid;
        if grid.size == [1, 1] {
            return [None; 2];
        }
        // Triangles take it from those that are turned as their sheet is: upright ones in a whole side.
        let [column, row, turned] = sheet.upright_in_grid(cell);
        let light = |column: i64, row: i64| self.light_in_grid(number, &sheet, grid.cell(column, row, turned == 1)?);
        let along_u = |column: i64, row: i64| slope(|step| light(column + step, row));
        let along_v = |column: i64, row: i64| slope(|step| light(column, row + step));
        // At the tip of a triangle a row has one cell: the row below tells.
        let below = 2 * turned - 1;
        [
            along_u(column, row).or_else(|| along_u(column, row + below)),
            along_v(column, row).or_else(|| along_v(column + below, row)),
        ]
    }

    /// Light of a cell of a sheet's grid: of the element there, or the mean of several where another sheet is finer; none where it
    /// is unknown or the other is coarser.
    fn light_in_grid(&self, number: u32, sheet: &Sheet, cell: u32) -> Option<[f64; 3]> {
        let known = |index: usize| self.known(index).then(|| self.at(index).map(f64::from));
        if sheet.is_whole() {
            return known(self.index(number, cell));
        }
        let (mesh, facet, layout) = (self.mesh(), self.sheets.facet(number), sheet.grid.layout);
        let tile = Tile::of(layout, sheet.grid.size, cell);
        let find = |at: DVec2| mesh.find_element(facet, sheet.back, at);
        let (patch, ..) = find(tile.at(Frame::middle(layout)));
        let (own, other) = (sheet.lattice.size[0], self.sheets.get(self.sheets.of_patch(patch)).lattice.size[0]);
        if !other.is_multiple_of(own) {
            return None;
        }
        let parts = other / own;
        let mut sum = [0.0; 3];
        for k in 0..parts * parts {
            let (_, element, _) = find(tile.compose(Tile::of(layout, [parts; 2], k)).at(Frame::middle(layout)));
            let (sheet, cell) = self.sheets.locate(element);
            let light = known(self.index(sheet, cell))?;
            (0..3).for_each(|c| sum[c] += light[c] / f64::from(parts * parts));
        }
        Some(sum)
    }
}

/// The touches of each facet's side.
fn runs(touches: &[Touch]) -> impl Iterator<Item = &[Touch]> {
    touches.chunk_by(|a, b| (a.facet, a.back) == (b.facet, b.back))
}

/// Light at a share of the way from one place to another.
pub fn between(from: Rgb, to: Rgb, along: f64) -> Rgb {
    [0, 1, 2].map(|c| (f64::from(from[c]) * (1.0 - along) + f64::from(to[c]) * along) as f32)
}

/// Weighted mean of the light of some parts.
pub fn mean(parts: &[Part]) -> Rgb {
    let weight: f64 = parts.iter().map(|p| p.weight).sum();
    [0, 1, 2].map(|c| parts.iter().map(|p| p.weight / weight * f64::from(p.light[c])).sum::<f64>() as f32)
}

/// Change per cell at cell 0 of a row: central inside, one-sided at its ends; none across an extremum, no more than
/// twice the next change inwards and no more than what takes all light over half a cell, so that shadow edges do not overshoot.
fn slope(light: impl Fn(i64) -> Option<[f64; 3]>) -> Option<[f64; 3]> {
    let here = light(0)?;
    let end = |direction: i64| {
        let (first, second) = (light(direction)?, light(2 * direction));
        Some([0, 1, 2].map(|c| {
            let near = first[c] - here[c];
            let far = second.map_or(near, |s| 2.0 * (s[c] - first[c]));
            let change = if near * far <= 0.0 { 0.0 } else { near.abs().min(far.abs()).min(2.0 * here[c]) };
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
