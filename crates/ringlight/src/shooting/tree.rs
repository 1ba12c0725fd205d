//! The tree of all that emits: nodes are groups of facets' sides, below them pieces of one side, at last its elements.
//!
//! A piece is planar and shoots from a regular grid of cells; a group shoots from cells on some of its members. Which
//! members lie together is decided by the scene alone: halves along the longest extent of (position, normal).

use super::faces::is_face_cluster;
use crate::mesh::{Facet, Frame, Mesh, NONE, Patch, Tile};
use glam::{DVec2, Vec3};
use ringlight_visibility::Layout;
use std::ops::Range;

/// A node of the tree.
#[derive(Clone, Debug)]
pub struct Node {
    /// Box around its surfaces, mesh coordinates, metres.
    pub low: Vec3,
    /// Upper corner of the box.
    pub high: Vec3,
    /// Unit vector about which its surfaces' normals lie.
    pub axis: Vec3,
    /// Least cosine between the axis and a normal; −1 if they point anywhere.
    pub cosine: f32,
    /// Area free of other geometry, m².
    pub area: f32,
    /// What it is.
    pub kind: Kind,
    /// Numbers of its children, which follow it; none for an element.
    pub children: Range<u32>,
}

/// What a node is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// Sides of several facets.
    Group,
    /// Sides of small facets that face alike, lit as one; whatever is near, it is not opened.
    Faces,
    /// A part of one facet's side.
    Piece(Piece),
}

/// A part of a facet's side: one patch of it or a part of that, or some columns and rows of patches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// Number of the facet.
    pub facet: u32,
    /// Whether it lies on the facet's back.
    pub back: bool,
    /// Its tile of the facet.
    pub tile: Tile,
    /// Columns and rows of elements in it, as if all were as fine as the side's finest; equal for triangles.
    pub grid: [u32; 2],
    /// The element, if it is one.
    pub element: Option<u32>,
}

/// The tree over a mesh. Node 0 is the root; children follow their parents.
#[derive(Debug, Default)]
pub struct ShooterTree {
    /// All nodes.
    pub nodes: Vec<Node>,
    /// For each node the end of the nodes below it: these are its children, and those that follow them up to the end.
    ends: Vec<u32>,
    /// For each node within a facet's side that of the side, else the node itself.
    pub sides: Vec<u32>,
}

/// A facet's side on its way into the tree.
struct Item {
    side: (u32, bool),
    /// Middle and unit normal.
    place: [Vec3; 2],
}

/// How much of a group's extent a turn of the normal by 90° counts.
const TURN: f32 = 0.7;

impl ShooterTree {
    /// Over all sides that emit.
    pub fn new(mesh: &Mesh) -> ShooterTree {
        let mut items = Vec::new();
        for (number, facet) in (0..).zip(&mesh.facets) {
            let frame = facet.frame();
            let middle = frame.at(Frame::middle(frame.layout)).as_vec3();
            let normal = frame.area_vector().normalize().as_vec3();
            if emits(mesh, facet, false) {
                items.push(Item { side: (number, false), place: [middle, normal] });
            }
            if facet.double_sided() && emits(mesh, facet, true) {
                items.push(Item { side: (number, true), place: [middle, -normal] });
            }
        }
        let mut tree = ShooterTree { nodes: vec![placeholder()], ..ShooterTree::default() };
        if !items.is_empty() {
            tree.group(mesh, 0, &mut items);
        }
        tree.find_ends_and_sides();
        tree
    }

    fn find_ends_and_sides(&mut self) {
        let count = self.nodes.len() as u32;
        (self.ends, self.sides) = ((1..=count).collect(), (0..count).collect());
        for (i, node) in self.nodes.iter().enumerate().rev() {
            let below = node.children.clone().map(|child| self.ends[child as usize]);
            self.ends[i] = below.fold(self.ends[i], u32::max);
        }
        for (i, node) in self.nodes.iter().enumerate() {
            if matches!(node.kind, Kind::Piece(_)) {
                let side = self.sides[i];
                node.children.clone().for_each(|child| self.sides[child as usize] = side);
            }
        }
    }

    /// The nodes that are sides of facets.
    pub fn sides(&self) -> impl Iterator<Item = u32> {
        let is_side = |&n: &u32| matches!(self.nodes[n as usize].kind, Kind::Piece(_)) && self.sides[n as usize] == n;
        (0..self.nodes.len() as u32).filter(is_side)
    }

    /// All nodes below one.
    pub fn below(&self, node: u32) -> Range<u32> {
        let children = self.nodes[node as usize].children.clone();
        if children.is_empty() { children } else { children.start..self.ends[node as usize] }
    }

    /// Makes node `number` of some items.
    fn group(&mut self, mesh: &Mesh, number: usize, items: &mut [Item]) {
        if let [Item { side: (facet, back), .. }] = *items {
            let whole = Tile { origin: DVec2::ZERO, size: DVec2::ONE };
            let of = &mesh.facets[facet as usize];
            // Where patches are cut differently, the grid is that of the finest, and pieces end at patches until they are one.
            let finest = of.patch_range(back).map(|id| mesh.subdivision(id)).max().unwrap_or(1);
            let in_patch = of.elements.map(|n| u32::from(n) * finest);
            let grid = [0, 1].map(|i| u32::from(of.patches[i]) * in_patch[i]);
            let step = if mesh.common_subdivision(of, back).is_some() { [1, 1] } else { in_patch };
            return self.piece(mesh, number, of, Piece { facet, back, tile: whole, grid, element: None }, step);
        }
        let extent = |i: usize| {
            let none = (Vec3::INFINITY, Vec3::NEG_INFINITY);
            let (low, high) =
                items.iter().fold(none, |(low, high), item| (low.min(item.place[i]), high.max(item.place[i])));
            high - low
        };
        let (position, normal) = (extent(0), extent(1));
        let normal = normal * (TURN * position.length());
        let extents = [position.to_array(), normal.to_array()].concat();
        let axis = (0..6).rev().max_by(|&a, &b| extents[a].total_cmp(&extents[b])).unwrap_or(0);
        let key = |item: &Item| item.place[axis / 3][axis % 3];
        let half = items.len() / 2;
        items.select_nth_unstable_by(half, |a, b| key(a).total_cmp(&key(b)).then(a.side.cmp(&b.side)));
        let first = self.nodes.len();
        self.nodes.extend([placeholder(), placeholder()]);
        let (left, right) = items.split_at_mut(half);
        self.group(mesh, first, left);
        self.group(mesh, first + 1, right);
        self.join(number, first as u32..first as u32 + 2, Kind::Group);
        let Node { low, high, cosine, .. } = self.nodes[number];
        let small = |node: &Node| match node.kind {
            Kind::Group => false,
            Kind::Faces => true,
            Kind::Piece(piece) => piece.element.is_some(),
        };
        if self.nodes[first..first + 2].iter().all(small) && is_face_cluster(mesh, low, high, cosine) {
            self.nodes[number].kind = Kind::Faces;
        }
    }

    /// Makes node `number` of a piece that is cut at every `step` columns and rows of its grid: at elements, or at patches.
    fn piece(&mut self, mesh: &Mesh, number: usize, facet: &Facet, piece: Piece, step: [u32; 2]) {
        if piece.grid == step && step != [1, 1] {
            let patch = mesh.find_element(facet, piece.back, piece.tile.at(Frame::middle(facet.layout()))).0;
            let grid = facet.element_grid(mesh.elements_of(patch).len() as u32);
            return self.piece(mesh, number, facet, Piece { grid, ..piece }, [1, 1]);
        }
        if piece.grid == [1, 1] {
            return self.element(mesh, number, facet, piece);
        }
        let parts = parts(&facet.frame(), &piece, step);
        let first = self.nodes.len();
        self.nodes.resize_with(first + parts.len(), placeholder);
        for (i, part) in parts.iter().enumerate() {
            self.piece(mesh, first + i, facet, *part, step);
        }
        debug_assert!(facet.layout() == Layout::Quad || piece.grid[0] == piece.grid[1]);
        self.join(number, first as u32..(first + parts.len()) as u32, Kind::Piece(piece));
    }

    fn element(&mut self, mesh: &Mesh, number: usize, facet: &Facet, piece: Piece) {
        let (element, _) = piece.find_element(mesh, Frame::middle(facet.layout()));
        let frame = facet.frame().tile(piece.tile);
        let (corners, count) = frame.corners();
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for corner in &corners[..count] {
            (low, high) = (low.min(corner.as_vec3()), high.max(corner.as_vec3()));
        }
        let vector = frame.area_vector();
        let area = vector.length();
        let normal = (if piece.back { -vector } else { vector } / area).as_vec3();
        self.nodes[number] = Node {
            low,
            high,
            axis: normal,
            cosine: 1.0,
            area: (area * mesh.valid_share(element)) as f32,
            kind: Kind::Piece(Piece { element: Some(element), ..piece }),
            children: 0..0,
        };
    }

    /// Makes a node of its children.
    fn join(&mut self, number: usize, children: Range<u32>, kind: Kind) {
        let nodes = &self.nodes[children.start as usize..children.end as usize];
        let (mut low, mut high, mut area) = (Vec3::INFINITY, Vec3::NEG_INFINITY, 0.0);
        let mut sum = Vec3::ZERO;
        for node in nodes {
            (low, high) = (low.min(node.low), high.max(node.high));
            sum += node.axis * node.area.max(f32::MIN_POSITIVE);
            area += node.area;
        }
        let axis = sum.try_normalize().unwrap_or(Vec3::Z);
        let cosine = nodes.iter().map(|node| widest(axis, node)).fold(1.0, f32::min);
        self.nodes[number] = Node { low, high, axis, cosine, area, kind, children };
    }
}

/// Whether some element of a facet's side emits.
fn emits(mesh: &Mesh, facet: &Facet, back: bool) -> bool {
    match facet.colours[usize::from(back)] {
        NONE => mesh.surface_colours[facet.surface as usize].emits(),
        _ => facet.patch_range(back).any(|id| {
            let patch = mesh.patch(id);
            patch.elements().any(|e| mesh.colour(&patch, e).emits())
        }),
    }
}

fn placeholder() -> Node {
    let zero = Vec3::ZERO;
    Node { low: zero, high: zero, axis: Vec3::Z, cosine: 1.0, area: 0.0, kind: Kind::Group, children: 0..0 }
}

/// Least cosine between `axis` and a normal of the node: of the sum of the angle to its axis and that of its cone.
fn widest(axis: Vec3, node: &Node) -> f32 {
    let c = axis.dot(node.axis).clamp(-1.0, 1.0);
    let (s, cone) = ((1.0 - c * c).sqrt(), (1.0 - node.cosine * node.cosine).max(0.0).sqrt());
    // Beyond half a turn the cosine would rise again.
    if c <= -node.cosine { -1.0 } else { (c * node.cosine - s * cone).clamp(-1.0, 1.0) }
}

/// A piece's parts: halves along its longer side, or the similar triangles of a triangle by the least factor of its grid, of
/// which `step` columns and rows stay together.
fn parts(frame: &Frame, piece: &Piece, step: [u32; 2]) -> Vec<Piece> {
    let [columns, rows] = [0, 1].map(|i| piece.grid[i] / step[i]);
    if frame.layout == Layout::Triangle {
        let factor = (2..=columns).find(|f| columns.is_multiple_of(*f)).unwrap_or(columns);
        let grid = piece.grid.map(|n| n / factor);
        let tile = |k| piece.tile.compose(Tile::of(Layout::Triangle, [factor; 2], k));
        return (0..factor * factor).map(|k| Piece { tile: tile(k), grid, ..*piece }).collect();
    }
    let size = piece.tile.size * DVec2::new(frame.edge_u.length(), frame.edge_v.length());
    let along = if rows == 1 || columns > 1 && size.x >= size.y { 0 } else { 1 };
    let whole = [columns, rows][along];
    let half = whole / 2;
    [(0, half), (half, whole)]
        .map(|(start, end)| {
            let mut part = *piece;
            part.grid[along] = (end - start) * step[along];
            part.tile.origin[along] += piece.tile.size[along] * f64::from(start) / f64::from(whole);
            part.tile.size[along] *= f64::from(end - start) / f64::from(whole);
            part
        })
        .to_vec()
}

impl Piece {
    /// The piece as a patch of its own, without a number.
    pub fn patch(&self, mesh: &Mesh) -> Patch {
        let facet = &mesh.facets[self.facet as usize];
        let frame = facet.frame().tile(self.tile);
        let vector = frame.area_vector();
        let area = vector.length();
        let normal = if self.back { -vector } else { vector } / area;
        Patch {
            id: crate::mesh::NONE,
            facet: self.facet,
            back: self.back,
            tile: self.tile,
            frame,
            normal,
            area,
            plane: facet.plane,
            first_element: self.element.unwrap_or(crate::mesh::NONE),
            grid: self.grid,
        }
    }

    /// The element at parameters `at` of the piece, and the parameters within it.
    pub fn find_element(&self, mesh: &Mesh, at: DVec2) -> (u32, DVec2) {
        let facet = &mesh.facets[self.facet as usize];
        let (_, element, within) = mesh.find_element(facet, self.back, self.tile.at(at));
        (element, within)
    }
}

impl Node {
    /// Middle of its box, metres.
    pub fn middle(&self) -> Vec3 {
        (self.low + self.high) / 2.0
    }

    /// Half the diagonal of its box, metres.
    pub fn radius(&self) -> f32 {
        (self.high - self.low).length() / 2.0
    }
}

/// Distance between two boxes, metres; 0 if they meet.
pub fn distance(a: (Vec3, Vec3), b: (Vec3, Vec3)) -> f32 {
    (a.0 - b.1).max(b.0 - a.1).max(Vec3::ZERO).length()
}

/// The largest cosine between a direction and a normal of a cone about `axis`, over all directions that turn from `towards`
/// (unit) by an angle of sine `slack` at most.
pub fn most_facing(axis: Vec3, cone: f32, towards: Vec3, slack: f32) -> f32 {
    let mut cosine = axis.dot(towards).clamp(-1.0, 1.0);
    if slack >= 1.0 {
        return 1.0;
    }
    // Turn towards the axis by the cone's angle, then by the slack's; not past it.
    for (c, s) in [(cone, (1.0 - cone * cone).max(0.0).sqrt()), ((1.0 - slack * slack).sqrt(), slack)] {
        if cosine >= c {
            return 1.0;
        }
        cosine = cosine * c + (1.0 - cosine * cosine).max(0.0).sqrt() * s;
    }
    cosine
}

/// Direction from one place to another, or none if they are the same.
pub fn direction(from: Vec3, to: Vec3) -> Option<(Vec3, f32)> {
    let away = (to - from).as_dvec3();
    let length = away.length();
    (length > 0.0).then(|| ((away / length).as_vec3(), length as f32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::fixture;

    #[test]
    fn the_most_facing_cosine_is_that_of_the_least_angle() {
        let axis = Vec3::Z;
        let towards = |angle: f32| Vec3::new(angle.sin(), 0.0, angle.cos());
        for (cone, slack, angle) in [(0.3f32, 0.2f32, 1.0f32), (0.0, 0.0, 1.2), (1.0, 0.5, 0.7), (0.1, 0.05, 3.0)] {
            let found = most_facing(axis, cone.cos(), towards(angle), slack.sin());
            let exact = (angle - cone - slack).max(0.0).cos();
            assert!((found - exact).abs() < 1e-5, "{cone} {slack} {angle}: {found} {exact}");
        }
        assert_eq!(most_facing(axis, 1.0, Vec3::X, 1.0), 1.0);
    }

    #[test]
    fn leaves_are_all_elements_that_emit_once_also_where_patches_are_cut_differently() {
        let obj = "v 0 0 0\nv 3 0 0\nv 3 2 0\nv 0 2.5 0\nv 5 0 0\nv 8 0 0\nv 5 3 0\nv 9 9 5\nusemtl glow\nf 1 2 3 4\nf 5 6 7\n\
            usemtl grey\nf 6 7 8\n";
        for sizes in [[1.0, 0.5], [0.5, 0.5], [4.0, 0.25]] {
            let solution = fixture::solve_refined(fixture::read(obj), sizes, 1.0, fixture::mixed([1, 2, 3]));
            let mesh = &solution.mesh;
            let tree = ShooterTree::new(mesh);
            let mut found = vec![0; mesh.element_count()];
            for (number, node) in (0..).zip(&tree.nodes) {
                if let Kind::Piece(piece @ Piece { element: Some(element), .. }) = node.kind {
                    found[element as usize] += 1;
                    let patch = mesh.patch(mesh.patch_of(element));
                    let area = patch.element_area(element - patch.first_element);
                    assert!((piece.patch(mesh).area / area - 1.0).abs() < 1e-9);
                }
                for child in node.children.clone() {
                    let (below, inner) = (tree.below(number), tree.below(child));
                    assert!(below.contains(&child) && inner.clone().all(|n| below.contains(&n)));
                    let child = &tree.nodes[child as usize];
                    assert!(node.low.cmple(child.low).all() && node.high.cmpge(child.high).all());
                }
            }
            let emits = |(element, &count): (u32, &u32)| {
                let patch = mesh.patch(mesh.patch_of(element));
                count == u32::from(mesh.colour(&patch, element).emits())
            };
            assert!((0..).zip(&found).all(emits), "{sizes:?}");
            // Both sides of a trapezoid of 6.75 m² and a triangle of 4.5 m².
            assert!((tree.nodes[0].area - 22.5).abs() < 1e-4, "{sizes:?}: {}", tree.nodes[0].area);
        }
    }
}
