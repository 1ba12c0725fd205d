//! Sheets: parts of facets whose elements form one grid. A sheet is a whole side of a facet where all its patches are cut
//! alike, otherwise each patch of that side by itself.

use super::lattice::Lattice;
use crate::mesh::{Facet, Frame, Mesh, Tile};
use glam::DVec2;
use std::ops::Range;

/// A side of a facet or a patch of it. Its cells are elements, and numbered as [`Tile::of`] numbers tiles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sheet {
    /// Number of the facet.
    pub facet: u32,
    /// Whether it lies on the facet's back.
    pub back: bool,
    /// The grid of its elements.
    pub lattice: Lattice,
    /// The grid that the facet's side would have if all of it were cut as this sheet is: the same if this sheet is all of it.
    pub grid: Lattice,
    /// The grid's vertex at which the lattice begins.
    origin: [u32; 2],
    /// Whether the lattice runs against the grid from there, as in inverted triangles.
    inverted: bool,
    /// The first, or only, patch.
    first_patch: u32,
    /// Place of its first vertex among all sheets' vertices.
    pub first_vertex: usize,
}

/// The sheets of a mesh, in the order of facets, of each the front before the back.
pub struct Sheets<'a> {
    mesh: &'a Mesh,
    /// For each facet its first sheet, and at the end their number.
    of_facets: Vec<u32>,
    stored: Vec<Stored>,
    vertices: usize,
}

/// What is kept of a sheet.
struct Stored {
    first_patch: u32,
    patches: u32,
    first_vertex: usize,
}

/// A vertex of a sheet on an edge of a cell of another.
pub struct Hanging {
    /// Share of the way from the edge's first end to its second.
    pub along: f64,
    /// Number of the sheet to which the vertex belongs.
    pub sheet: u32,
    /// The vertex in that sheet's lattice.
    pub vertex: [u32; 2],
}

/// An edge of a cell of a sheet, on which a vertex of a finer one lies.
pub struct CoarseEdge {
    /// Number of the coarser sheet.
    pub sheet: u32,
    /// The edge's ends in the lattice of that sheet.
    pub ends: [[u32; 2]; 2],
    /// Share of the way from the first end to the second.
    pub along: f64,
}

impl Sheet {
    /// Whether it is a whole side of a facet.
    pub fn is_whole(&self) -> bool {
        self.lattice == self.grid
    }

    fn in_grid(&self, [column, row]: [u32; 2]) -> [u32; 2] {
        let [first, bottom] = self.origin;
        if self.inverted { [first - column, bottom - row] } else { [first + column, bottom + row] }
    }

    fn out_of_grid(&self, [column, row]: [u32; 2]) -> [u32; 2] {
        let [first, bottom] = self.origin;
        if self.inverted { [first - column, bottom - row] } else { [column - first, row - bottom] }
    }

    /// Whether a vertex lies on the facet's border, not only on the sheet's.
    pub fn on_facet_border(&self, vertex: [u32; 2]) -> bool {
        self.grid.on_border(self.in_grid(vertex))
    }

    /// Parameters of a vertex in the facet: of the same place they are the same in all sheets, to the bit.
    pub fn parameters(&self, vertex: [u32; 2]) -> DVec2 {
        self.grid.parameters(self.in_grid(vertex))
    }

    /// The cell of [`Sheet::grid`] over a cell.
    pub fn cell_in_grid(&self, cell: u32) -> u32 {
        if self.is_whole() {
            return cell;
        }
        let [column, row, turned] = self.upright_in_grid(cell);
        let inverted = self.lattice.position(cell)[2] == 1;
        self.grid.cell(column, row, inverted != (turned == 1)).expect("a sheet lies within its facet")
    }

    /// Position in [`Sheet::grid`] of a cell, or if it is inverted in the sheet's lattice, of the upright one beside it: column,
    /// row, and 1 for cells that are inverted in the grid.
    pub fn upright_in_grid(&self, cell: u32) -> [i64; 3] {
        let [column, row, _] = self.lattice.position(cell).map(i64::from);
        let [first, bottom] = self.origin.map(i64::from);
        if self.inverted { [first - column - 1, bottom - row - 1, 1] } else { [first + column, bottom + row, 0] }
    }

    /// Tile of a cell in the facet.
    pub fn tile(&self, cell: u32) -> Tile {
        Tile::of(self.grid.layout, self.grid.size, self.cell_in_grid(cell))
    }

    /// Parameters of the middle of a cell in the facet.
    pub fn middle(&self, cell: u32) -> DVec2 {
        self.grid.middle(self.cell_in_grid(cell))
    }
}

impl<'a> Sheets<'a> {
    /// Of a mesh.
    pub fn new(mesh: &'a Mesh) -> Sheets<'a> {
        let of_facets = Vec::with_capacity(mesh.facets.len() + 1);
        let mut sheets = Sheets { mesh, of_facets, stored: Vec::new(), vertices: 0 };
        for facet in &mesh.facets {
            sheets.of_facets.push(sheets.stored.len() as u32);
            for back in facet.sides() {
                let patches = facet.patch_range(back);
                match mesh.common_subdivision(facet, back) {
                    Some(_) => sheets.push(patches),
                    None => patches.for_each(|patch| sheets.push(patch..patch + 1)),
                }
            }
        }
        sheets.of_facets.push(sheets.stored.len() as u32);
        sheets
    }

    fn push(&mut self, patches: Range<u32>) {
        let (first_patch, patches) = (patches.start, patches.len() as u32);
        self.stored.push(Stored { first_patch, patches, first_vertex: self.vertices });
        let lattice = self.get(self.stored.len() as u32 - 1).lattice;
        self.vertices += lattice.vertex_count();
    }

    /// The mesh.
    pub fn mesh(&self) -> &'a Mesh {
        self.mesh
    }

    /// Number of sheets.
    pub fn len(&self) -> u32 {
        self.stored.len() as u32
    }

    /// Number of vertices of all sheets.
    pub fn vertex_count(&self) -> usize {
        self.vertices
    }

    /// The facet of sheet `number`.
    pub fn facet(&self, number: u32) -> &'a Facet {
        &self.mesh.facets[self.mesh.side_of(self.stored[number as usize].first_patch).0 as usize]
    }

    /// Sheet `number`.
    pub fn get(&self, number: u32) -> Sheet {
        let Stored { first_patch, patches, first_vertex, .. } = self.stored[number as usize];
        let (number, back) = self.mesh.side_of(first_patch);
        let facet = &self.mesh.facets[number as usize];
        let in_patch = facet.element_grid(self.mesh.elements_of(first_patch).len() as u32);
        let grid = of_patches(facet).refined(in_patch);
        let mut sheet = Sheet {
            facet: number,
            back,
            lattice: grid,
            grid,
            origin: [0; 2],
            inverted: false,
            first_patch,
            first_vertex,
        };
        if patches < facet.patch_count() {
            let place = facet.place_in_grid(first_patch - facet.patch_range(back).start);
            let [column, row, inverted] = of_patches(facet).position(place);
            sheet.lattice.size = in_patch;
            sheet.origin = [(column + inverted) * in_patch[0], (row + inverted) * in_patch[1]];
            sheet.inverted = inverted == 1;
        }
        sheet
    }

    /// The sheets of a facet.
    pub fn of_facet(&self, facet: u32) -> Range<u32> {
        self.of_facets[facet as usize]..self.of_facets[facet as usize + 1]
    }

    /// Place of the first vertex of a facet's sheets among all sheets' vertices; their number after the last facet.
    pub fn first_vertex_of(&self, facet: u32) -> usize {
        self.stored.get(self.of_facets[facet as usize] as usize).map_or(self.vertices, |sheet| sheet.first_vertex)
    }

    /// Whether both sides of a facet are lit and have the same grid, one sheet each.
    pub fn are_alike(&self, facet: u32) -> bool {
        let Range { start, end } = self.of_facet(facet);
        end - start == 2 && self.get(start).lattice == self.get(start + 1).lattice
    }

    /// The sheet that holds a patch.
    pub fn of_patch(&self, patch: u32) -> u32 {
        let (number, back) = self.mesh.side_of(patch);
        let count = self.mesh.facets[number as usize].patch_count();
        let sheets = |first: u32| count / self.stored[first as usize].patches;
        let mut first = self.of_facets[number as usize];
        if back {
            first += sheets(first);
        }
        if sheets(first) == 1 { first } else { first + patch - self.stored[first as usize].first_patch }
    }

    /// The element over a cell.
    pub fn element(&self, number: u32, cell: u32) -> u32 {
        let sheet = self.get(number);
        if sheet.is_whole() {
            self.mesh.find_element(&self.mesh.facets[sheet.facet as usize], sheet.back, sheet.middle(cell)).1
        } else {
            self.mesh.elements_of(sheet.first_patch).start + cell
        }
    }

    /// The sheet that an element lies on, and its cell.
    pub fn locate(&self, element: u32) -> (u32, u32) {
        let patch = self.mesh.patch_of(element);
        let number = self.of_patch(patch);
        let (sheet, facet) = (self.get(number), self.facet(number));
        let (elements, layout) = (self.mesh.elements_of(patch), facet.layout());
        if !sheet.is_whole() {
            return (number, element - elements.start);
        }
        let within = Tile::of(layout, facet.element_grid(elements.len() as u32), element - elements.start);
        let middle = facet.patch_tile(patch - sheet.first_patch).at(within.at(Frame::middle(layout)));
        (number, Tile::find(layout, sheet.lattice.size, middle).0)
    }

    /// The edge of a coarser sheet of the same side that has a vertex of sheet `number` between its ends.
    pub fn coarse_edge(&self, number: u32, vertex: [u32; 2]) -> Option<CoarseEdge> {
        let sheet = self.get(number);
        if sheet.is_whole() || !sheet.lattice.on_border(vertex) || sheet.on_facet_border(vertex) {
            return None;
        }
        let fine = self.mesh.subdivision(sheet.first_patch);
        let place = sheet.in_grid(vertex);
        self.patches_at(&sheet, sheet.parameters(vertex)).find_map(|patch| {
            let coarse = self.mesh.subdivision(patch);
            if coarse >= fine {
                return None;
            }
            // The place in the coarser sheet's grid is `scaled` / `fine`.
            let scaled = place.map(|x| u64::from(x) * u64::from(coarse));
            let floor = scaled.map(|x| (x / u64::from(fine)) as u32);
            let rest = scaled.map(|x| (x % u64::from(fine)) as u32);
            let [column, row] = floor;
            let (ends, axis) = match rest {
                [0, 0] => return None,
                [_, 0] => ([floor, [column + 1, row]], 0),
                [0, _] => ([floor, [column, row + 1]], 1),
                // Along a triangle's longest side.
                _ => ([[column, row + 1], [column + 1, row]], 0),
            };
            let other = self.of_patch(patch);
            let ends = ends.map(|end| self.get(other).out_of_grid(end));
            Some(CoarseEdge { sheet: other, ends, along: f64::from(rest[axis]) / f64::from(fine) })
        })
    }

    /// Vertices of a sheet's neighbours on the same side that lie on the edge of a cell between two of its vertices `ends`, in the
    /// order in which they lie.
    pub fn hanging(&self, sheet: &Sheet, ends: [[u32; 2]; 2]) -> Vec<Hanging> {
        let middle = (sheet.parameters(ends[0]) + sheet.parameters(ends[1])) / 2.0;
        let on_border = ends.iter().all(|&end| sheet.lattice.on_border(end));
        if sheet.is_whole() || !on_border {
            return Vec::new();
        }
        let own = i64::from(self.mesh.subdivision(sheet.first_patch));
        let Some(patch) = self.patches_at(sheet, middle).find(|&patch| patch != sheet.first_patch) else {
            return Vec::new();
        };
        let theirs = i64::from(self.mesh.subdivision(patch));
        let number = self.of_patch(patch);
        let other = self.get(number);
        // In their grid the ends lie at `from` / `own` and `to` / `own`.
        let [from, to] = ends.map(|end| sheet.in_grid(end).map(|x| i64::from(x) * theirs));
        let axis = if from[0] == to[0] { 1 } else { 0 };
        let (low, high) = (from[axis].min(to[axis]), from[axis].max(to[axis]));
        let hanging = |line: i64| {
            let mut place = [line; 2];
            // Edges run along an axis, or in triangles across, with the sum of both coordinates the same.
            place[1 - axis] = match from[1 - axis] == to[1 - axis] {
                true => from[1 - axis] / own,
                false => (from[0] + from[1]) / own - line,
            };
            let along = (line * own - from[axis]) as f64 / (to[axis] - from[axis]) as f64;
            Hanging { along, sheet: number, vertex: other.out_of_grid(place.map(|x| x as u32)) }
        };
        let mut found: Vec<Hanging> = (low / own + 1..(high + own - 1) / own).map(hanging).collect();
        found.sort_unstable_by(|a, b| a.along.total_cmp(&b.along));
        found
    }

    /// The patches of a sheet's side that touch a place of the facet.
    fn patches_at(&self, sheet: &Sheet, at: DVec2) -> impl Iterator<Item = u32> + use<> {
        let facet = &self.mesh.facets[sheet.facet as usize];
        let mut found = Vec::new();
        of_patches(facet).holding(at, TOUCH, |place, _| found.push(facet.patch_at(sheet.back, place)));
        found.into_iter()
    }
}

/// A place nearer than this to a cell, relative to its size, touches it.
pub const TOUCH: DVec2 = DVec2::splat(1e-9);

/// The grid of patches of a facet.
pub fn of_patches(facet: &Facet) -> Lattice {
    Lattice { layout: facet.layout(), size: facet.patches.map(u32::from) }
}
