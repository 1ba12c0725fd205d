//! Large facets cut along lines into convex parts, which are facets like any other.

use super::Line;
use crate::column::{Column, Store};
use crate::mesh::{Facet, Mesh, NONE, size};
use bytemuck::Pod;
use glam::{DVec2, DVec3};
use std::io;

/// Lines cut off no less than this share of an element: what is nearer to an edge is as good as on it.
const NARROW: f64 = 1.0 / 16.0;

/// Lines that cross less than this share of an element of a part do not cut it.
const SHORT: f64 = 0.25;

/// Corners of parts have sines of at least this, as those of paired triangles: others would be slivers.
const SHARP: f64 = 0.05;

/// A facet is cut into this many parts at most.
const MOST_PARTS: usize = 4096;

/// A corner of a part.
#[derive(Clone, Copy, Debug)]
struct Corner {
    /// Place in the facet's plane, metres.
    at: DVec2,
    /// How much each corner of the facet counts there.
    weights: [f64; 4],
}

/// The plane of a facet with coordinates in it, metres.
#[derive(Clone, Copy, Debug)]
pub struct Ground {
    /// Its first corner.
    pub origin: DVec3,
    /// Unit normal of the front.
    pub normal: DVec3,
    axes: [DVec3; 2],
}

impl Ground {
    /// Of a facet.
    pub fn of(facet: &Facet) -> Ground {
        let frame = facet.frame();
        let (origin, normal, x) = (frame.origin, frame.area_vector().normalize(), frame.edge_u.normalize());
        Ground { origin, normal, axes: [x, normal.cross(x)] }
    }

    /// Coordinates of the foot of a point.
    pub fn coordinates(&self, point: DVec3) -> DVec2 {
        DVec2::from(self.axes.map(|axis| axis.dot(point - self.origin)))
    }

    /// The point at coordinates.
    pub fn at(&self, at: DVec2) -> DVec3 {
        self.origin + at.x * self.axes[0] + at.y * self.axes[1]
    }
}

/// Cuts facets, whose patches are not numbered yet, along lines, sorted by facet, and gives all of them their grids.
pub fn cut(mesh: &mut Mesh, lines: &[Line], store: Store<'_>) -> io::Result<()> {
    if lines.is_empty() {
        let sizes = mesh.sizes;
        for facet in &mut mesh.facets {
            let lengths = size::lengths(facet);
            (facet.patches, facet.elements) = size::grids(lengths, &sizes, size::scale(lengths, &sizes));
        }
        return Ok(());
    }
    let whole = std::mem::replace(&mut mesh.facets, store.column()?);
    mesh.facets.reserve(whole.len())?;
    let mut lines = lines.chunk_by(|a, b| a.facet == b.facet).peekable();
    for (number, facet) in (0..).zip(whole.iter()) {
        let scale = size::scale(size::lengths(facet), &mesh.sizes);
        let parts = match lines.next_if(|lines| lines[0].facet == number) {
            Some(lines) => parts(facet, lines, scale * mesh.sizes.element),
            None => Vec::new(),
        };
        if parts.len() < 2 {
            let (patches, elements) = size::grids(size::lengths(facet), &mesh.sizes, scale);
            mesh.facets.push(Facet { patches, elements, ..*facet })?;
            continue;
        }
        for corners in parts.iter().flat_map(|part| quadrilaterals(part)) {
            let facet = take_part(mesh, facet, &corners)?;
            let (patches, elements) = size::grids(size::lengths(&facet), &mesh.sizes, scale);
            mesh.facets.push(Facet { patches, elements, ..facet })?;
        }
    }
    Ok(())
}

/// The convex parts of a facet with elements of this size, metres, between lines; the longest lines cut first.
fn parts(facet: &Facet, lines: &[Line], element: f64) -> Vec<Vec<Corner>> {
    let ground = Ground::of(facet);
    let corner = |(k, corner): (usize, &glam::Vec3)| {
        let weights = std::array::from_fn(|i| if i == k { 1.0 } else { 0.0 });
        Corner { at: ground.coordinates(corner.as_dvec3()), weights }
    };
    let mut parts = vec![facet.outline().iter().enumerate().map(corner).collect::<Vec<_>>()];
    let mut lines: Vec<[DVec2; 2]> = lines.iter().map(|line| line.ends.map(|end| ground.coordinates(end))).collect();
    let length = |[a, b]: &[DVec2; 2]| (*b - *a).length();
    lines.sort_by(|a, b| length(b).total_cmp(&length(a)));
    for line in lines {
        for k in 0..parts.len() {
            if parts.len() < MOST_PARTS
                && let Some([left, right]) = divide(&parts[k], line, element)
            {
                parts[k] = left;
                parts.push(right);
            }
        }
    }
    parts
}

/// The two parts of a part on either side of a line, unless one would be too narrow or what the line crosses is too short.
fn divide(part: &[Corner], [from, to]: [DVec2; 2], element: f64) -> Option<[Vec<Corner>; 2]> {
    let along = (to - from).normalize();
    let height = |corner: &Corner| along.perp_dot(corner.at - from);
    let (lowest, highest) = part.iter().map(height).fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x), h.max(x)));
    if lowest > -NARROW * element || highest < NARROW * element {
        return None;
    }
    let heights: Vec<f64> = part.iter().map(height).collect();
    let mut sides = [Vec::new(), Vec::new()];
    let mut crossings = Vec::new();
    // What lies next to the line lies on it: no part gets a corner that it can do without.
    let near = |height: f64| height.abs() < 0.25 * NARROW * element;
    for (k, corner) in part.iter().enumerate() {
        let next = (k + 1) % part.len();
        let [here, there] = [heights[k], heights[next]];
        if near(here) {
            crossings.push(along.dot(corner.at - from));
            sides.iter_mut().for_each(|side| side.push(*corner));
            continue;
        }
        sides[usize::from(here > 0.0)].push(*corner);
        if !near(there) && here * there < 0.0 {
            let between = corner.between(&part[next], here / (here - there));
            crossings.push(along.dot(between.at - from));
            sides.iter_mut().for_each(|side| side.push(between));
        }
    }
    let [a, b] = crossings[..] else { return None };
    let crossed = a.max(b).min((to - from).length()) - a.min(b).max(0.0);
    let is_sound = |side: &Vec<Corner>| side.len() > 2 && quadrilaterals(side).all(|corners| !is_sliver(&corners));
    (crossed >= SHORT * element && sides.iter().all(is_sound)).then_some(sides)
}

/// Whether a quadrilateral, or a triangle that repeats its first corner, has a corner that is too sharp or too flat.
fn is_sliver(corners: &[Corner; 4]) -> bool {
    let count = if corners[3].at == corners[0].at { 3 } else { 4 };
    (0..count).any(|k| {
        let [before, here, after] = [k + count - 1, k, k + 1].map(|k| corners[k % count].at);
        let [a, b] = [before - here, after - here];
        b.perp_dot(a) < SHARP * a.length() * b.length()
    })
}

impl Corner {
    /// The corner at a share of the way to another.
    fn between(&self, other: &Corner, share: f64) -> Corner {
        let weights = std::array::from_fn(|i| self.weights[i] + share * (other.weights[i] - self.weights[i]));
        Corner { at: self.at.lerp(other.at, share), weights }
    }
}

/// A convex part as quadrilaterals and at most one triangle, which repeats its first corner.
fn quadrilaterals(part: &[Corner]) -> impl Iterator<Item = [Corner; 4]> {
    let corner = |i: usize| if i < part.len() { part[i] } else { part[0] };
    (1..part.len() - 1).step_by(2).map(move |i| [part[0], part[i], part[i + 1], corner(i + 2)])
}

/// A part of a facet as a facet.
fn take_part(mesh: &mut Mesh, facet: &Facet, corners: &[Corner; 4]) -> io::Result<Facet> {
    fn mix<const N: usize>(weights: &[f64; 4], of: &[[f32; N]; 4]) -> [f32; N] {
        std::array::from_fn(|i| (0..4).map(|k| weights[k] * f64::from(of[k][i])).sum::<f64>() as f32)
    }
    fn keep<const N: usize>(values: &mut Column<[[f32; N]; 4]>, index: u32, corners: &[Corner; 4]) -> io::Result<u32>
    where
        [[f32; N]; 4]: Pod,
    {
        if index == NONE {
            return Ok(index);
        }
        let of = values[index as usize];
        values.push(corners.map(|corner| mix(&corner.weights, &of)))?;
        Ok(values.len() as u32 - 1)
    }
    let whole = facet.corners.map(|corner| corner.to_array());
    Ok(Facet {
        corners: corners.map(|corner| mix(&corner.weights, &whole).into()),
        base_uv: keep(&mut mesh.base_uv, facet.base_uv, corners)?,
        emission_uv: keep(&mut mesh.emission_uv, facet.emission_uv, corners)?,
        vertex_colour: keep(&mut mesh.vertex_colours, facet.vertex_colour, corners)?,
        part: 1,
        ..*facet
    })
}
