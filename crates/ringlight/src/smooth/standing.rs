//! Light at any place of a surface: as it is displayed, but exact at sample points, and not from behind what stands there.
//!
//! Corners know walls where they matter to the eye; a place inside an element may lie beyond one all the same, as under the
//! leg of a chair. So the samples around a place are asked one by one whether it sees them.

use super::fan::Fan;
use super::field::{self, Field, Part, Work};
use super::walls::Walls;
use crate::mesh::{self, Frame, Inquiry};
use crate::quantity::Rgb;
use crate::solution::Solution;
use glam::DVec2;

/// Light of a solution's surfaces at any place.
pub struct SurfaceLight<'a> {
    solution: &'a Solution,
    field: Field<'a>,
    walls: Walls<'a>,
}

impl<'a> SurfaceLight<'a> {
    /// Of a solution.
    pub fn new(solution: &'a Solution) -> SurfaceLight<'a> {
        let field = Field::new(solution, 0..solution.mesh.facets.len() as u32);
        let walls = Walls::new(field.sheets());
        SurfaceLight { solution, field, walls }
    }

    /// Irradiance at parameters `within` of an element, W/m² or lux. None where no light is known: where other geometry
    /// covers the surface and it takes no light (under a box, in the crack between two books), and where no sample around
    /// is seen.
    pub async fn at(&self, inquiry: &Inquiry<'_>, element: u32, within: DVec2) -> Option<Rgb> {
        let (sheet, cell) = self.field.sheets().locate(element);
        let lattice = self.field.sheets().get(sheet).lattice;
        if self.walls.hides(inquiry, element, within).await {
            return None;
        }
        let vertices = lattice.corners(cell);
        let mut work = Work::default();
        let mut corners = [None; 4];
        for (corner, vertex) in corners.iter_mut().zip(vertices) {
            self.field.collect(sheet, vertex, false, &mut work);
            let around = work.parts.len();
            self.walls.keep_seen_from(inquiry, sheet, cell, within, &mut work.parts).await;
            *corner = match work.parts.len() {
                0 => None,
                seen if seen < around => Some(field::mean(&work.parts)),
                _ => Some(self.field.light(sheet, vertex, &work.parts)),
            };
        }
        let layout = lattice.layout;
        match self.own(inquiry, element, sheet, cell, within).await {
            Some((light, middle)) => {
                let corners = corners.map(|corner| corner.unwrap_or(light));
                Some(Fan { layout, corners, middle, light }.at(within))
            }
            None => mean(&corners, Frame::corner_weights(layout, within)),
        }
    }

    /// The light at the element's own sample point and where that is, if it is seen from `within`.
    async fn own(
        &self,
        inquiry: &Inquiry<'_>,
        element: u32,
        sheet: u32,
        cell: u32,
        within: DVec2,
    ) -> Option<(Rgb, DVec2)> {
        let light = field::known(self.solution, element)?;
        let mut parts = vec![Part { sheet, cell, light, weight: 1.0 }];
        self.walls.keep_seen_from(inquiry, sheet, cell, within, &mut parts).await;
        let layout = self.field.sheets().get(sheet).lattice.layout;
        let middle = mesh::sample_parameters(layout, self.solution.mesh.valid[element as usize])?;
        (!parts.is_empty()).then_some((light, middle))
    }
}

/// Weighted mean of those corners that have light.
fn mean(corners: &[Option<Rgb>; 4], weights: [f64; 4]) -> Option<Rgb> {
    let (mut sum, mut total) = ([0.0; 3], 0.0);
    for (corner, weight) in corners.iter().zip(weights) {
        if let Some(light) = corner {
            // A place at one corner may have light only from another.
            let weight = weight.max(1e-6);
            (0..3).for_each(|c| sum[c] += weight * f64::from(light[c]));
            total += weight;
        }
    }
    (total > 0.0).then(|| sum.map(|s| (s / total) as f32))
}
