//! Which elements touch a place: those of the same facet, and where the place lies on facets' borders those of others. One
//! question answers both shared corners and T-junctions, where a corner lies on the edge of a neighbour's element.

use super::lattice::Lattice;
use super::places::Places;
use super::sheet::{Sheets, of_patches};
use crate::form_factor::atan2;
use crate::mesh::{Facet, Frame};
use glam::{DVec2, DVec3};

/// An element that touches a place.
#[derive(Clone, Copy, Debug)]
pub struct Touch {
    /// Number of the facet.
    pub facet: u32,
    /// Whether it lies on the facet's back.
    pub back: bool,
    /// Number of the sheet.
    pub sheet: u32,
    /// Cell of its lattice.
    pub cell: u32,
    /// The angle that the cell spans at the place, radians.
    pub angle: f64,
}

/// Collects the elements of both lit sides of the facets on whose borders `point` lies, within `tolerance` metres, in the order
/// of facets, of each the front before the back.
pub fn touching(sheets: &Sheets<'_>, places: &Places<'_>, point: DVec3, tolerance: f64, found: &mut Vec<Touch>) {
    found.clear();
    places.visit(point, tolerance, &mut |number| {
        let facet = &sheets.mesh().facets[number as usize];
        let Some(at) = on_border(facet, point, tolerance) else { return };
        let start = found.len();
        touching_side(sheets, number, false, at, tolerance, found);
        if sheets.are_alike(number) {
            for k in start..found.len() {
                found.push(Touch { back: true, sheet: found[k].sheet + 1, ..found[k] });
            }
        } else if facet.double_sided() {
            touching_side(sheets, number, true, at, tolerance, found);
        }
    });
}

/// Adds the elements of one side of a facet that touch the place at parameters `at`.
pub fn touching_side(sheets: &Sheets<'_>, number: u32, back: bool, at: DVec2, tolerance: f64, found: &mut Vec<Touch>) {
    let facet = &sheets.mesh().facets[number as usize];
    let frame = facet.frame();
    let lengths = DVec2::new(frame.edge_u.length(), frame.edge_v.length());
    let first = sheets.of_patch(facet.patch_range(back).start);
    if sheets.get(first).is_whole() {
        return add(sheets, first, &frame, at, slack(lengths, sheets.get(first).lattice, tolerance), found);
    }
    let patches = of_patches(facet);
    patches.holding(at, slack(lengths, patches, tolerance), |place, within| {
        let sheet = sheets.of_patch(facet.patch_at(back, place));
        add(sheets, sheet, &frame, within, slack(lengths, sheets.get(sheet).grid, tolerance), found);
    });
}

/// The tolerance in cells.
fn slack(lengths: DVec2, lattice: Lattice, tolerance: f64) -> DVec2 {
    let size = DVec2::new(lattice.size[0].into(), lattice.size[1].into());
    (2.0 * tolerance / lengths * size).clamp(DVec2::splat(1e-9), DVec2::splat(0.02))
}

/// Adds the cells of a sheet that touch the place at parameters `at` of it.
fn add(sheets: &Sheets<'_>, number: u32, frame: &Frame, at: DVec2, slack: DVec2, found: &mut Vec<Touch>) {
    let sheet = sheets.get(number);
    let parameters = Frame::corner_parameters(sheet.lattice.layout);
    sheet.lattice.holding(at, slack, |cell, within| {
        let corner = parameters.iter().position(|&p| (within - p).abs().cmple(slack).all());
        // On an edge of the cell, it spans half a turn.
        let angle = corner.map_or(std::f64::consts::PI, |k| {
            let vertices = sheet.lattice.corners(cell).map(|v| frame.at(sheet.parameters(v)));
            let n = parameters.len();
            let (a, b) = (vertices[(k + 1) % n] - vertices[k], vertices[(k + n - 1) % n] - vertices[k]);
            atan2(a.cross(b).length(), a.dot(b))
        });
        found.push(Touch { facet: sheet.facet, back: sheet.back, sheet: number, cell, angle });
    });
}

/// Parameters of a point of a facet's border, which is straight between corners; none if it does not lie on it.
fn on_border(facet: &Facet, point: DVec3, tolerance: f64) -> Option<DVec2> {
    let parameters = Frame::corner_parameters(facet.layout());
    let n = parameters.len();
    (0..n).find_map(|k| {
        let next = (k + 1) % n;
        let (from, to) = (facet.corners[k].as_dvec3(), facet.corners[next].as_dvec3());
        let edge = to - from;
        let t = ((point - from).dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
        let near = (from + t * edge - point).length_squared() <= tolerance * tolerance;
        near.then(|| parameters[k] + t * (parameters[next] - parameters[k]))
    })
}
