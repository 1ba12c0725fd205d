//! Light between the elements' sample points.
//!
//! The light at a corner is the mean over the elements that touch it and belong to the same smooth surface: they lie on
//! the same side and their normals turn by less than 30° from one to the next. A corner on the edge of a neighbour's
//! larger element counts that element too, so that grids that do not match show no seam. Four refinements:
//!
//! - elements covered by other geometry, or in closed pockets, take the light of their neighbours (`fill`);
//! - at the border of a surface, light goes on with its gradient instead of stopping at the last element's middle
//!   (`field`);
//! - elements of one plane that differ much are tested for a wall between them, by rays (`walls`); where there is one,
//!   the corner has different light in different elements;
//! - triangles that were paired, and patches of one face that are cut alike, form one grid (`lattice`) and need no search; others
//!   are sheets of their own (`sheet`), whose vertices on the edge of a coarser cell show what that edge shows.
//!
//! Pictures and lit models show the corners' light, interpolated: the eye sees every bead along the edge of a shadow. Probes ask
//! for numbers: light that keeps what the solver found at the sample point (`fan`), and does not pass what stands on the
//! element itself (`standing`).

mod around;
mod divided;
mod fan;
mod field;
mod fill;
mod lattice;
pub(crate) mod places;
pub(crate) mod sheet;
mod standing;
#[cfg(test)]
mod tests;
mod touch;
mod walls;

use crate::mesh::{self, Frame, Inquiry};
use crate::quantity::Rgb;
use crate::solution::Solution;
use crate::solve::Ring;
use crate::transport::{Communicator, Failure};
pub use divided::Divided;
pub(crate) use field::between;
use field::{Field, Work};
use glam::DVec2;
use rayon::prelude::*;
use ringlight_visibility::Layout;
use sheet::{Sheet, Sheets};
pub use standing::SurfaceLight;
use std::ops::Range;
use std::sync::Arc;
use walls::{Split, Walls};

/// Irradiance at the corners of the elements of some facets, interpolated over smooth surfaces but not across edges, creases
/// or walls.
pub struct Smooth<'a> {
    sheets: Arc<Sheets<'a>>,
    /// Irradiance at the vertices of the facets' sheets, W/m² or lux.
    vertices: Vec<Rgb>,
    /// Place of the first of these among the vertices of all sheets.
    begin: usize,
    /// Corners that walls cut off from their vertex, sorted by element.
    splits: Vec<Split>,
}

/// Facets, or sheets, that a thread takes at a time.
const CHUNK: u32 = 64;

impl<'a> Smooth<'a> {
    /// Of all of a solution, on a rank that is alone with it.
    pub fn new(solution: &'a Solution) -> Smooth<'a> {
        let (smooth, field, suspects) = Smooth::without_walls(solution, 0..solution.mesh.facets.len() as u32);
        if suspects.is_empty() {
            return smooth;
        }
        let mut ring = Ring::alone(&solution.mesh, Arc::new(mesh::hierarchy(&solution.mesh)));
        let splits = find_splits(&field, suspects, &mut ring, &mut Communicator::alone());
        Smooth { splits: splits.expect("a rank that is alone hears of no failure"), ..smooth }
    }

    /// Of a solution, as if nothing stood on surfaces.
    pub fn without_rays(solution: &'a Solution) -> Smooth<'a> {
        Smooth::without_walls(solution, 0..solution.mesh.facets.len() as u32).0
    }

    /// Of some facets, as if nothing stood on surfaces, and where something may.
    fn without_walls(solution: &'a Solution, facets: Range<u32>) -> (Smooth<'a>, Field<'a>, Vec<Suspect>) {
        let mut field = Field::new(solution, facets.clone());
        fill::fill(&mut field);
        let sheets = field.sheets().clone();
        let begin = sheets.first_vertex_of(facets.start);
        let mut vertices = vec![[0.0; 3]; sheets.first_vertex_of(facets.end) - begin];
        let first = |k: u32| sheets.first_vertex_of(facets.start + k) - begin;
        let suspects: Vec<Suspect> = pieces(facets.len() as u32, first, &mut vertices)
            .into_par_iter()
            .map_init(Work::default, |work, (piece, vertices)| {
                let mut suspects = Vec::new();
                let piece = facets.start + piece.start..facets.start + piece.end;
                let begin = sheets.first_vertex_of(piece.start);
                for sheet in piece.flat_map(|facet| asked_together(&sheets, facet)) {
                    smooth_sheets(&field, sheet, begin, work, vertices, &mut suspects);
                }
                suspects
            })
            .flatten_iter()
            .collect();
        (Smooth { sheets, vertices, begin, splits: Vec::new() }, field, suspects)
    }

    /// Irradiance at the corners of an element, in the order of [`crate::mesh::Frame::corner_parameters`] of its facet's
    /// layout; a triangle repeats the last one. W/m² or lux.
    pub fn corners(&self, element: u32) -> [Rgb; 4] {
        self.corners_in(element).1
    }

    /// The layout of an element, and the light at its corners.
    fn corners_in(&self, element: u32) -> (Layout, [Rgb; 4]) {
        let (sheet, cell) = self.sheets.locate(element);
        let Sheet { lattice, first_vertex, .. } = self.sheets.get(sheet);
        let first = first_vertex - self.begin;
        let mut corners = lattice.corners(cell).map(|v| self.vertices[first + lattice.vertex_index(v)]);
        for split in self.splits(element) {
            corners[split.corner as usize] = split.light;
        }
        if lattice.layout == Layout::Triangle {
            corners[3] = corners[2];
        }
        (lattice.layout, corners)
    }

    /// Irradiance at parameters `within` of an element: bilinear in quadrilaterals, linear in triangles. W/m² or lux.
    pub fn at(&self, element: u32, within: DVec2) -> Rgb {
        let (layout, corners) = self.corners_in(element);
        interpolate(&corners, layout, within)
    }

    /// Memory that it takes, bytes.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.vertices.as_slice()) + size_of_val(self.splits.as_slice())
    }

    /// Irradiance at a vertex of a sheet, W/m² or lux.
    pub(crate) fn vertex(&self, sheet: u32, vertex: [u32; 2]) -> Rgb {
        let Sheet { lattice, first_vertex, .. } = self.sheets.get(sheet);
        self.vertices[first_vertex - self.begin + lattice.vertex_index(vertex)]
    }

    /// The sheets whose lattices the light is held on.
    pub(crate) fn sheets(&self) -> &Sheets<'a> {
        &self.sheets
    }

    /// Whether a wall cuts a corner of an element off from the vertex it shares.
    pub(crate) fn is_split(&self, element: u32) -> bool {
        !self.splits(element).is_empty()
    }

    fn splits(&self, element: u32) -> &[Split] {
        let start = self.splits.partition_point(|s| s.element < element);
        let count = self.splits[start..].iter().take_while(|s| s.element == element).count();
        &self.splits[start..start + count]
    }
}

/// Irradiance at parameters `within` of an element that has these `corners`, see [`Smooth::corners`].
pub fn interpolate(corners: &[Rgb; 4], layout: Layout, within: DVec2) -> Rgb {
    let weights = Frame::corner_weights(layout, within).map(|w| w as f32);
    std::array::from_fn(|c| (0..4).map(|k| weights[k] * corners[k][c]).sum())
}

/// A vertex of a sheet at which a wall may stand.
type Suspect = (u32, [u32; 2]);

/// Cuts what is held of `count` things, in order, into pieces of a few things each; what is held of thing `k` begins at
/// `first(k)`.
fn pieces<T>(count: u32, first: impl Fn(u32) -> usize, mut all: &mut [T]) -> Vec<(Range<u32>, &mut [T])> {
    let mut pieces = Vec::with_capacity(count.div_ceil(CHUNK) as usize);
    for start in (0..count).step_by(CHUNK as usize) {
        let end = count.min(start + CHUNK);
        let length = if end < count { first(end) - first(start) } else { all.len() };
        let (piece, rest) = all.split_at_mut(length);
        pieces.push((start..end, piece));
        all = rest;
    }
    pieces
}

/// The sheets of a facet: both sides together where they are cut alike, because what touches their vertices is the same.
fn asked_together(sheets: &Sheets<'_>, facet: u32) -> impl Iterator<Item = Range<u32>> + use<> {
    let together = if sheets.are_alike(facet) { 2 } else { 1 };
    sheets.of_facet(facet).step_by(together as usize).map(move |first| first..first + together)
}

/// Finds the light at the vertices of sheets that have the same lattice; that of all sheets from vertex `begin` on is in
/// `vertices`. Appends the vertices at which a wall may stand.
fn smooth_sheets(
    field: &Field<'_>,
    numbers: Range<u32>,
    begin: usize,
    work: &mut Work,
    vertices: &mut [Rgb],
    suspects: &mut Vec<Suspect>,
) {
    let sheets = field.sheets();
    for (index, vertex) in sheets.get(numbers.start).lattice.vertices().enumerate() {
        for number in numbers.clone() {
            field.collect(number, vertex, false, work);
            vertices[sheets.get(number).first_vertex - begin + index] = field.light(number, vertex, &work.parts);
            if Walls::suspects(sheets, number, &work.parts) {
                suspects.push((number, vertex));
            }
        }
    }
}

/// Finds the corners that see only some of the parts around their vertex, sorted by element.
fn find_splits<'a>(
    field: &Field<'a>,
    suspects: Vec<Suspect>,
    ring: &mut Ring<'a>,
    ranks: &mut Communicator<'_>,
) -> Result<Vec<Split>, Failure> {
    let sheets = field.sheets();
    let walls = Walls::new(sheets);
    let find = |(number, vertex): Suspect, inquiry: Inquiry<'a>| {
        let walls = &walls;
        async move {
            let mut work = Work::default();
            field.collect(number, vertex, false, &mut work);
            let (sheet, facet) = (sheets.get(number), sheets.facet(number));
            let lattice = sheet.lattice;
            let point = facet.frame().at(sheet.parameters(vertex));
            let mut splits = Vec::new();
            for cell in lattice.cells_at(vertex) {
                let mut seen = work.parts.clone();
                walls.keep_seen(&inquiry, number, cell, point, &mut seen).await;
                if seen.len() < work.parts.len() {
                    let corner = lattice.corners(cell).iter().position(|&v| v == vertex).unwrap_or(0) as u32;
                    splits.push(Split { element: sheets.element(number, cell), corner, light: field::mean(&seen) });
                }
            }
            splits
        }
    };
    let mut splits: Vec<Split> = Vec::new();
    ring.ask(ranks, suspects.into_iter(), find, |found| splits.extend(found))?;
    splits.sort_unstable_by_key(|s: &Split| (s.element, s.corner));
    Ok(splits)
}
