//! Walls that stand on a surface: light on one side of them says nothing about the other.

use super::field::Part;
use super::sheet::Sheets;
use crate::mesh::walk::{Query, Rule};
use crate::mesh::{self, Inquiry};
use crate::quantity::{Rgb, photometric};
use glam::{DVec2, DVec3};
use ringlight_visibility::Ray;
use std::sync::Arc;

/// Elements whose light differs by less than this ratio are averaged without looking for a wall between them.
const CONTRAST: f32 = 1.5;

/// How far from a corner towards the middle of its element the corner is judged.
const INSET: f64 = 0.25;

/// How high above the surface walls are looked for, relative to the distance of the element's middle from its corner.
const LIFT: f64 = 0.05;

/// Finds walls by rays just above the surface.
pub struct Walls<'a> {
    sheets: Arc<Sheets<'a>>,
}

impl<'a> Walls<'a> {
    /// Among the occluders of a mesh, which has these sheets.
    pub fn new(sheets: &Arc<Sheets<'a>>) -> Walls<'a> {
        Walls { sheets: sheets.clone() }
    }

    /// Whether the light of the parts in the plane of a sheet differs so much that something may stand between them.
    pub fn suspects(sheets: &Sheets<'_>, sheet: u32, parts: &[Part]) -> bool {
        let plane = |sheet: u32| sheets.facet(sheet).plane;
        let (mut least, mut most) = (f32::INFINITY, 0.0f32);
        for part in parts.iter().filter(|p| p.sheet == sheet || plane(p.sheet) == plane(sheet)) {
            let light = photometric(part.light);
            (least, most) = (least.min(light), most.max(light));
        }
        most > CONTRAST * least
    }

    /// Keeps the parts that the corner at `point` of cell `cell` of a sheet sees; all if it sees none. Parts in other
    /// planes always stay: over a bend, a straight line tells nothing.
    pub async fn keep_seen(&self, inquiry: &Inquiry<'_>, sheet: u32, cell: u32, point: DVec3, parts: &mut Vec<Part>) {
        let (facet, normal) = (self.sheets.facet(sheet), self.normal(sheet));
        let inward = facet.frame().at(self.sheets.get(sheet).middle(cell)) - point;
        let lift = LIFT * inward.length() * normal;
        let from = point + INSET * inward + lift;
        let seen = self.seen(inquiry, facet.plane, from, lift, parts).await;
        if seen.contains(&true) {
            keep(parts, &seen);
        }
    }

    /// Keeps the parts whose light is seen from `place`, parameters within cell `cell` of a sheet. Parts in other planes stay
    /// if any of this plane does.
    pub async fn keep_seen_from(
        &self,
        inquiry: &Inquiry<'_>,
        sheet: u32,
        cell: u32,
        place: DVec2,
        parts: &mut Vec<Part>,
    ) {
        let facet = self.sheets.facet(sheet);
        let (frame, tile) = (facet.frame(), self.sheets.get(sheet).tile(cell));
        let reach = frame.at(self.sheets.get(sheet).middle(cell)) - frame.at(tile.at(DVec2::ZERO));
        let lift = LIFT * reach.length() * self.normal(sheet);
        let from = frame.at(tile.at(place)) + lift;
        let seen = self.seen(inquiry, facet.plane, from, lift, parts).await;
        if parts.iter().zip(&seen).any(|(part, &seen)| seen && self.plane(part) == facet.plane) {
            keep(parts, &seen);
        } else {
            parts.clear();
        }
    }

    /// Which parts in `plane` are seen from a place; those in other planes count as seen.
    async fn seen(&self, inquiry: &Inquiry<'_>, plane: u32, from: DVec3, lift: DVec3, parts: &[Part]) -> Vec<bool> {
        let mut seen = vec![true; parts.len()];
        let (mut queries, mut asked) = (Vec::new(), Vec::new());
        for (k, part) in parts.iter().enumerate().filter(|(_, part)| self.plane(part) == plane) {
            match self.sample_point(part).map(|to| to + lift) {
                None => seen[k] = false,
                Some(to) if from == to => {}
                Some(to) => {
                    let (origin, direction) = (from.as_vec3().to_array(), (to - from).as_vec3().to_array());
                    let ray = Ray { origin, direction, near: 0.0, far: 1.0, plane };
                    queries.push(Query { ray, rule: Rule::All });
                    asked.push(k);
                }
            }
        }
        let hits = inquiry.nearest_hits(&queries).await;
        asked.into_iter().zip(hits).for_each(|(k, hit)| seen[k] = hit.is_none());
        seen
    }

    fn plane(&self, part: &Part) -> u32 {
        self.sheets.facet(part.sheet).plane
    }

    fn normal(&self, sheet: u32) -> DVec3 {
        let normal = self.sheets.facet(sheet).frame().area_vector().normalize();
        if self.sheets.get(sheet).back { -normal } else { normal }
    }

    /// Where the light of a part was found; none if it was taken from neighbours.
    fn sample_point(&self, part: &Part) -> Option<DVec3> {
        let (mesh, element) = (self.sheets.mesh(), self.sheets.element(part.sheet, part.cell));
        let patch = mesh.patch(mesh.patch_of(element));
        patch.sample_point(element - patch.first_element, mesh.valid[element as usize])
    }

    /// Whether `place`, parameters within an element, is covered or lies in a crack while the element's light is from
    /// outside.
    pub async fn hides(&self, inquiry: &Inquiry<'_>, element: u32, place: DVec2) -> bool {
        let mesh = self.sheets.mesh();
        let patch = mesh.patch(mesh.patch_of(element));
        let k = element - patch.first_element;
        let point = patch.frame.at(patch.element_tile(k).at(place));
        let sample = patch.sample_point(k, mesh.valid[element as usize]);
        match sample {
            None => true,
            Some(sample) => mesh::is_hidden_beside(mesh, inquiry, &patch, point, sample).await,
        }
    }
}

/// Keeps the parts of which `kept` says so.
fn keep(parts: &mut Vec<Part>, kept: &[bool]) {
    let mut kept = kept.iter();
    parts.retain(|_| kept.next() == Some(&true));
}

/// The light of a corner that differs from that of the vertex it shares.
#[derive(Clone, Copy, Debug)]
pub struct Split {
    /// Element.
    pub element: u32,
    /// Number of its corner.
    pub corner: u32,
    /// Light there.
    pub light: Rgb,
}
