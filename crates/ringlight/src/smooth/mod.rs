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
//! - triangles that were paired, and patches of one face, form one grid (`lattice`) and need no search.
//!
//! Pictures and lit models show the corners' light, interpolated: the eye sees every bead along the edge of a shadow. Probes ask
//! for numbers: light that keeps what the solver found at the sample point (`fan`), and does not pass what stands on the
//! element itself (`standing`).

mod around;
mod divided;
mod fan;
mod field;
mod fill;
pub(crate) mod lattice;
pub(crate) mod places;
mod standing;
#[cfg(test)]
mod tests;
mod walls;

use crate::mesh::{self, Facet, Frame, Inquiry};
use crate::quantity::Rgb;
use crate::solution::Solution;
use crate::solve::Ring;
use crate::transport::{Communicator, Failure};
pub use divided::Divided;
use field::{Field, Side, Work, element_of, sides};
use glam::DVec2;
use lattice::Lattice;
use rayon::prelude::*;
use ringlight_visibility::Layout;
pub use standing::SurfaceLight;
use std::ops::Range;
use std::sync::Arc;
use walls::{Split, Walls};

/// Irradiance at the corners of the elements of some facets, interpolated over smooth surfaces but not across edges, creases
/// or walls.
pub struct Smooth<'a> {
    solution: &'a Solution,
    /// The facets.
    facets: Range<u32>,
    /// For each of them, where the vertices of its front begin; those of the back follow.
    first_vertex: Vec<u64>,
    /// Irradiance at the vertices of their lattices, W/m² or lux.
    vertices: Vec<Rgb>,
    /// Corners that walls cut off from their vertex, sorted by element.
    splits: Vec<Split>,
}

/// Facets that a thread takes at a time.
const CHUNK: usize = 64;

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

    /// Of some facets, as if nothing stood on surfaces, and where something may.
    fn without_walls(solution: &'a Solution, facets: Range<u32>) -> (Smooth<'a>, Field<'a>, Vec<Suspect>) {
        let mesh = &solution.mesh;
        let mut field = Field::new(solution, facets.clone());
        fill::fill(&mut field);
        let mut first_vertex = Vec::with_capacity(facets.len());
        let mut next = 0;
        for f in facets.clone() {
            first_vertex.push(next);
            next += vertex_count(&mesh.facets[f as usize]) as u64;
        }
        let mut vertices = vec![[0.0; 3]; next as usize];
        let suspects: Vec<Suspect> = pieces(facets.len(), |f| first_vertex[f] as usize, &mut vertices)
            .into_par_iter()
            .map_init(Work::default, |work, (piece, mut vertices)| {
                let mut suspects = Vec::new();
                for f in piece.map(|f| facets.start + f) {
                    let own = vertex_count(&mesh.facets[f as usize]);
                    smooth_facet(&field, f, work, vertices.split_off_mut(..own).unwrap_or_default(), &mut suspects);
                }
                suspects
            })
            .flatten_iter()
            .collect();
        (Smooth { solution, facets, first_vertex, vertices, splits: Vec::new() }, field, suspects)
    }

    /// Irradiance at the corners of an element, in the order of [`crate::mesh::Frame::corner_parameters`] of its facet's
    /// layout; a triangle repeats the last one. W/m² or lux.
    pub fn corners(&self, element: u32) -> [Rgb; 4] {
        let (side, cell) = field::locate(&self.solution.mesh, element);
        self.cell_corners(element, side, cell)
    }

    fn cell_corners(&self, element: u32, side: Side, cell: u32) -> [Rgb; 4] {
        let lattice = Lattice::of(&self.solution.mesh.facets[side.facet as usize]);
        let back = if side.back { lattice.vertex_count() } else { 0 };
        let first = self.first_vertex[(side.facet - self.facets.start) as usize] as usize + back;
        let mut corners = lattice.corners(cell).map(|v| self.vertices[first + lattice.vertex_index(v)]);
        for split in self.splits(element) {
            corners[split.corner as usize] = split.light;
        }
        if lattice.layout == Layout::Triangle {
            corners[3] = corners[2];
        }
        corners
    }

    /// Irradiance at parameters `within` of an element: bilinear in quadrilaterals, linear in triangles. W/m² or lux.
    pub fn at(&self, element: u32, within: DVec2) -> Rgb {
        let (side, cell) = field::locate(&self.solution.mesh, element);
        let corners = self.cell_corners(element, side, cell);
        between(&corners, self.solution.mesh.facets[side.facet as usize].layout(), within)
    }

    /// Memory that it takes, bytes.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.first_vertex.as_slice())
            + size_of_val(self.vertices.as_slice())
            + size_of_val(self.splits.as_slice())
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
pub fn between(corners: &[Rgb; 4], layout: Layout, within: DVec2) -> Rgb {
    let weights = Frame::corner_weights(layout, within).map(|w| w as f32);
    std::array::from_fn(|c| (0..4).map(|k| weights[k] * corners[k][c]).sum())
}

/// A vertex at which a wall may stand.
type Suspect = (Side, [u32; 2]);

/// Vertices of both lit sides of a facet.
fn vertex_count(facet: &Facet) -> usize {
    Lattice::of(facet).vertex_count() * if facet.double_sided() { 2 } else { 1 }
}

/// Cuts what is held of the facets, in order, into pieces of a few facets each; what is held of facet `f` begins at
/// `first(f)`.
fn pieces<T>(facets: usize, first: impl Fn(usize) -> usize, mut all: &mut [T]) -> Vec<(Range<u32>, &mut [T])> {
    let mut pieces = Vec::with_capacity(facets.div_ceil(CHUNK));
    for start in (0..facets).step_by(CHUNK) {
        let end = facets.min(start + CHUNK);
        let length = if end < facets { first(end) - first(start) } else { all.len() };
        let (piece, rest) = all.split_at_mut(length);
        pieces.push((start as u32..end as u32, piece));
        all = rest;
    }
    pieces
}

/// Finds the light at the vertices of one facet, front then back, and appends those at which a wall may stand.
fn smooth_facet(field: &Field<'_>, number: u32, work: &mut Work, vertices: &mut [Rgb], suspects: &mut Vec<Suspect>) {
    let facet = &field.mesh().facets[number as usize];
    let (frame, lattice) = (facet.frame(), Lattice::of(facet));
    let (front, back) = vertices.split_at_mut(lattice.vertex_count());
    for (index, vertex) in lattice.vertices().enumerate() {
        let point = frame.at(lattice.parameters(vertex));
        for side in sides(field.mesh(), number) {
            field.collect(side, vertex, false, work);
            let light = if work.parts.is_empty() { [0.0; 3] } else { field.blend(point, &work.parts) };
            let of_side = if side.back { &mut *back } else { &mut *front };
            of_side[index] = light;
            if Walls::suspects(field.mesh(), number, &work.parts) {
                suspects.push((side, vertex));
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
    let mesh = field.mesh();
    let walls = Walls::new(mesh);
    let find = |(side, vertex): Suspect, inquiry: Inquiry<'a>| {
        let walls = &walls;
        async move {
            let mut work = Work::default();
            field.collect(side, vertex, false, &mut work);
            let facet = &mesh.facets[side.facet as usize];
            let lattice = Lattice::of(facet);
            let point = facet.frame().at(lattice.parameters(vertex));
            let mut splits = Vec::new();
            for cell in lattice.cells_at(vertex) {
                let mut seen = work.parts.clone();
                walls.keep_seen(&inquiry, side, cell, point, &mut seen).await;
                if seen.len() < work.parts.len() {
                    let corner = lattice.corners(cell).iter().position(|&v| v == vertex).unwrap_or(0) as u32;
                    splits.push(Split { element: element_of(mesh, side, cell), corner, light: field::mean(&seen) });
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
