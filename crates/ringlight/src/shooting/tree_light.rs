//! The light that the nodes of the shooter tree hold, and their shots.

use super::far::{FarCells, intensity};
use super::field::{densities, grid_of, shot_of};
use super::shot::{FAR, Shot, Source};
use super::tree::{Kind, Node, Piece, ShooterTree};
use crate::mesh::{ALL_VALID, Frame, Mesh, Patch, Tile};
use glam::{DVec2, Vec3};
use ringlight_visibility::{Cells, Grid, Layout, NO_PLANE, Shooter};
use std::f32::consts::PI;

/// Radiosity of elements: W/m² or lm/m².
pub type Radiosity = [f32; 3];

/// What the nodes of a tree shoot.
#[derive(Debug, Default)]
pub struct TreeLight {
    /// Average over the free area of each node.
    pub radiosity: Vec<Radiosity>,
    /// Largest [`strength`] of an element.
    pub peak: Vec<f32>,
    /// Where the light is, on average.
    centre: Vec<Vec3>,
}

/// One number for three channels: their mean.
pub fn strength(radiosity: Radiosity) -> f32 {
    (radiosity[0] + radiosity[1] + radiosity[2]) / 3.0
}

/// A piece is a parallelogram if its opposite sides differ by less than this share of its diagonal.
const STRAIGHT: f32 = 1e-5;

/// Elements under a cell that are looked at along each of its sides, at most.
const LOOKS: u32 = 4;

impl TreeLight {
    /// Of elements with these radiosities.
    pub fn new(tree: &ShooterTree, elements: &[Radiosity]) -> TreeLight {
        let count = tree.nodes.len();
        let mut light =
            TreeLight { radiosity: vec![[0.0; 3]; count], peak: vec![0.0; count], centre: vec![Vec3::ZERO; count] };
        for (i, node) in tree.nodes.iter().enumerate().rev() {
            if let Kind::Piece(Piece { element: Some(element), .. }) = node.kind {
                light.radiosity[i] = elements[element as usize];
                light.peak[i] = if node.area > 0.0 { strength(light.radiosity[i]) } else { 0.0 };
                light.centre[i] = node.middle();
                continue;
            }
            light.join(tree, i, node);
        }
        light
    }

    fn join(&mut self, tree: &ShooterTree, i: usize, node: &Node) {
        self.radiosity[i] = average(tree, node, &self.radiosity);
        let (mut total, mut centre) = (0.0, Vec3::ZERO);
        for child in node.children.clone().map(|c| c as usize) {
            let power = tree.nodes[child].area * strength(self.radiosity[child]);
            total += power;
            centre += power * self.centre[child];
            self.peak[i] = self.peak[i].max(self.peak[child]);
        }
        self.centre[i] = if total > 0.0 { centre / total } else { node.middle() };
    }

    /// Power of a node, W or lm: the mean of the channels.
    pub fn power(&self, tree: &ShooterTree, node: u32) -> f32 {
        tree.nodes[node as usize].area * strength(self.radiosity[node as usize])
    }

    /// The shot of a node as if its radiosity were 1: with `side`² cells that share it as its light is shared.
    pub fn shot(&self, mesh: &Mesh, tree: &ShooterTree, elements: &[Radiosity], node: u32, side: u32) -> Shot {
        match tree.nodes[node as usize].kind {
            Kind::Piece(piece) => piece_shot(mesh, &tree.nodes[node as usize], &piece, elements, side),
            Kind::Group | Kind::Faces => {
                let members = self.members(mesh, tree, node, (side * side) as usize);
                let points = members.iter().map(|m| m.0.to_array()).collect();
                let shooter = Shooter { cells: Cells::Points(points), plane: NO_PLANE, far: FAR };
                let light = members.iter().map(|m| [m.2; 3]).collect();
                Shot { shooter, light, source: Source::Group(members.iter().map(|m| m.1).collect()), power: 0.0 }
            }
        }
    }

    /// The cells of a node as those see them who are far from it.
    pub fn far_cells(&self, mesh: &Mesh, tree: &ShooterTree, elements: &[Radiosity], node: u32, side: u32) -> FarCells {
        let of = &tree.nodes[node as usize];
        match of.kind {
            Kind::Piece(piece) => {
                let patch = piece.patch(mesh);
                let (weights, density) = piece_weights(mesh, of, &piece, &patch, elements, side);
                let grid = turned(grid_of(&patch.frame, side));
                let area = (patch.area / f64::from(side * side)) as f32;
                let mut cells = FarCells::new(Cells::Grid(grid), patch.plane);
                for (k, (weight, density)) in weights.iter().zip(density).enumerate() {
                    let intensity = intensity(area * density, *weight as f32);
                    cells.push(grid.point(k).into(), of.axis, intensity, 0.0);
                }
                cells
            }
            Kind::Group | Kind::Faces => {
                let members = self.members(mesh, tree, node, (side * side) as usize);
                let points = members.iter().map(|m| m.0.to_array()).collect();
                let mut cells = FarCells::new(Cells::Points(points), NO_PLANE);
                // Of a group that is never too near to be opened, cells are points; of faces they are discs.
                let disc = if of.kind == Kind::Faces { of.area / members.len() as f32 } else { 0.0 };
                members.iter().for_each(|&(point, normal, intensity)| cells.push(point, normal, intensity, disc));
                cells
            }
        }
    }

    /// Cells on the members of a group: it is opened where most power is, and each part shoots from the element nearest to
    /// its light's centre.
    fn members(&self, mesh: &Mesh, tree: &ShooterTree, node: u32, cells: usize) -> Vec<(Vec3, Vec3, f32)> {
        let mut parts = vec![node];
        while parts.len() < cells {
            let splittable = |&i: &usize| !tree.nodes[parts[i] as usize].children.is_empty();
            let power = |&i: &usize| self.power(tree, parts[i]);
            let next = (0..parts.len()).filter(splittable).max_by(|a, b| power(a).total_cmp(&power(b)).then(b.cmp(a)));
            let Some(next) = next.filter(|i| power(i) > 0.0) else { break };
            let children = tree.nodes[parts[next] as usize].children.clone();
            if parts.len() + children.len() > cells.max(2) + 2 {
                break;
            }
            parts.swap_remove(next);
            parts.extend(children.filter(|&child| self.power(tree, child) > 0.0));
        }
        parts.truncate(64);
        let total: f32 = parts.iter().map(|&part| self.power(tree, part)).sum();
        let area = tree.nodes[node as usize].area;
        let mut members = Vec::with_capacity(parts.len());
        for part in parts {
            let leaf = &tree.nodes[self.nearest_element(tree, part) as usize];
            if let Kind::Piece(piece) = leaf.kind {
                members.push((middle(mesh, &piece), leaf.axis, area * self.power(tree, part) / total / PI));
            }
        }
        members
    }

    /// The element under a node that lies nearest to its light's centre, as the way down finds it.
    fn nearest_element(&self, tree: &ShooterTree, mut node: u32) -> u32 {
        let target = self.centre[node as usize];
        loop {
            let lit = tree.nodes[node as usize].children.clone().filter(|&child| self.power(tree, child) > 0.0);
            let away = |child: &u32| (self.centre[*child as usize] - target).length_squared();
            let Some(next) = lit.min_by(|a, b| away(a).total_cmp(&away(b))) else { return node };
            node = next;
        }
    }
}

/// Average radiosity of a node's children over their free area.
fn average(tree: &ShooterTree, node: &Node, radiosity: &[Radiosity]) -> Radiosity {
    let mut sum = [0.0f64; 3];
    for child in node.children.clone().map(|c| c as usize) {
        let area = f64::from(tree.nodes[child].area);
        (0..3).for_each(|c| sum[c] += area * f64::from(radiosity[child][c]));
    }
    let area = f64::from(node.area);
    if area > 0.0 { sum.map(|s| (s / area) as f32) } else { [0.0; 3] }
}

/// A place on an element that is free of other geometry: its sample point.
fn middle(mesh: &Mesh, piece: &Piece) -> Vec3 {
    let patch = piece.patch(mesh);
    let valid = piece.element.map_or(ALL_VALID, |element| mesh.valid[element as usize]);
    let at = crate::mesh::sample_parameters(patch.frame.layout, valid).unwrap_or(Frame::middle(patch.frame.layout));
    patch.frame.at(at).as_vec3()
}

/// The shot of a planar piece with radiosity 1 over its free area: its cells share it as the elements under them hold light.
fn piece_shot(mesh: &Mesh, node: &Node, piece: &Piece, elements: &[Radiosity], side: u32) -> Shot {
    let patch = piece.patch(mesh);
    let (weights, density) = piece_weights(mesh, node, piece, &patch, elements, side);
    let weights: Vec<[f64; 3]> = weights.iter().map(|&w| [w; 3]).collect();
    let mut shot = shot_of(&patch, &patch.frame, &weights, density, 0.0);
    if let Cells::Grid(grid) = &mut shot.shooter.cells {
        *grid = turned(*grid);
    }
    shot
}

/// The same cells of a parallelogram, seen not at their centres but at places that are turned about its middle by a step for each
/// `side` of them. So no two lie in one line along its sides: the shadow of an edge that is parallel to a side, as most are in rooms,
/// passes over one cell after the other and not over a row of them at once. Each place stays within its cell, and their mean in the
/// middle.
fn turned(grid: Grid) -> Grid {
    let [origin, u, v, twist] = [grid.origin, grid.edge_u, grid.edge_v, grid.twist].map(Vec3::from);
    if grid.layout == Layout::Triangle || twist.length() > STRAIGHT * (u + v).length() {
        return grid;
    }
    let step = 1.0 / grid.side as f32;
    let origin = origin + step / 2.0 * (v - u);
    Grid { origin: origin.into(), edge_u: (u - step * v).into(), edge_v: (v + step * u).into(), ..grid }
}

/// Radiosity of the cells of a piece that is 1 on average over its free area, and their densities.
fn piece_weights(
    mesh: &Mesh,
    node: &Node,
    piece: &Piece,
    patch: &Patch,
    elements: &[Radiosity],
    side: u32,
) -> (Vec<f64>, [f32; 64]) {
    let layout = patch.frame.layout;
    let density = densities(&patch.frame, side);
    if piece.element.is_some_and(|element| mesh.valid[element as usize] == ALL_VALID) {
        return (vec![1.0; (side * side) as usize], density);
    }
    let looks = piece.grid.map(|n| n.div_ceil(side).min(LOOKS));
    let looks = if layout == Layout::Triangle { [looks[0]; 2] } else { looks };
    let at = |at: DVec2| {
        let (element, within) = piece.find_element(mesh, at);
        let covered = mesh.valid[element as usize] >> Tile::find(layout, [4, 4], within).0 & 1 == 0;
        if covered { 0.0 } else { f64::from(strength(elements[element as usize])) }
    };
    let mut weights: Vec<f64> = (0..side * side)
        .map(|k| {
            let cell = Tile::of(layout, [side; 2], k);
            let place = |s| cell.compose(Tile::of(layout, looks, s)).at(Frame::middle(layout));
            (0..looks[0] * looks[1]).map(|s| at(place(s))).sum()
        })
        .collect();
    let sum = |weights: &[f64]| weights.iter().zip(&density).map(|(w, &d)| w * f64::from(d)).sum::<f64>();
    if sum(&weights) <= 0.0 {
        weights.fill(1.0);
    }
    let cells = density[..weights.len()].iter().map(|&d| f64::from(d)).sum::<f64>();
    let scale = cells * f64::from(node.area) / patch.area / sum(&weights);
    weights.iter_mut().for_each(|w| *w *= scale);
    (weights, density)
}
