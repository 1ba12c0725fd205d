//! The cut that receivers take through the tree of all that emits: the node whose light may be wrong by most is looked at, opened or
//! given more cells, until all together may be wrong by no more than the receivers' share of the error.
//!
//! Nodes err both ways, as their shadows fall, so that their errors add by their squares; those of their shapes add as they are. So few
//! lamps may err by much each, and thousands of glowing surfaces by next to nothing each. What all cells of a node show
//! alike, lit or hidden, is taken from those cells; what shadows cross is opened, and its parts shine from cells of their own.

use super::passes::Arrived;
use super::reach::Reached;
use crate::mesh::{Inquiry, Mesh};
use crate::shooting::{
    FarCells, FarWork, Kind, Node, Radiosity, Receivers, Share, ShooterTree, TreeLight, Work, direction, distance,
    most_facing, strength,
};
use ringlight_visibility::Tally;
use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::f32::consts::PI;

/// Error of the light of M cells, as a share of all that a node seen in part could give, times M^(3/4) (root of the mean square).
const PARTLY: f32 = 0.27;

/// The light of a node of which all M cells were seen, or none, may be wrong by this share of all it could give, times M; however
/// many receivers saw it, as slats near a lamp hide the same of it from all. What many such nodes may be wrong by together is
/// what the worst of them may be: after n rays of which none was blocked, the next one is with a chance of 1/n.
const CERTAIN: f32 = 0.5;

/// Of what touches the receivers, the light that it could give is taken for so many times what it could: more than of anything else, and
/// still a number, lest errors that are added and taken away again leave nothing known of the others.
const TOUCHING: f32 = 1e6;

/// Of a node in full view, a bound of the error by its shape: this times (radius/distance)².
const SHAPE: f32 = 1.0 / 32.0;

/// Cells and elements are small where they are farther than so many of their widths: then each cell is a disc, of which the
/// second-order error is below 1 %.
const FAR: f32 = 4.0;

/// Cells along a side: at least, of groups at most, and of planar pieces at most.
const LEAST: u32 = 2;
const MOST_OF_GROUP: u32 = 4;
const MOST: u32 = 8;

/// What cuts are taken through.
#[derive(Clone, Copy)]
pub struct Cut<'a> {
    /// The scene.
    pub mesh: &'a Mesh,
    /// All that emits.
    pub tree: &'a ShooterTree,
    /// What it emits.
    pub light: &'a TreeLight,
    /// What elements emit.
    pub elements: &'a [Radiosity],
    /// Error that all together may make, as a share of the receivers' own light.
    pub allowed: f32,
}

/// A node that may be part of the cut.
#[derive(Debug)]
struct Part {
    number: u32,
    /// What it could give at most, W/m² or lux.
    estimate: f32,
    /// Cells along a side that it shines from.
    side: u32,
    /// What the receivers get of it by those, if they have been asked.
    glimpse: Option<Glimpse>,
    /// What its light may be wrong by as its shadows fall, and by its shape, W/m² or lux.
    error: f32,
    shape: f32,
}

/// What receivers get of a node.
#[derive(Debug)]
struct Glimpse {
    seen: Seen,
    /// Cells that may light a receiver, on average.
    cells: f32,
    /// Of a radiosity of 1, by name: the mean over the element, and what its sample point gets more than that.
    received: Vec<(u32, f32, f32)>,
}

/// How much of a node was seen.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Seen {
    Partly,
    Wholly,
    NotAtAll,
}

/// One cut on its way.
struct Cutting<'a> {
    cut: &'a Cut<'a>,
    receivers: &'a Receivers,
    reached: Reached<'a>,
    inquiry: &'a Inquiry<'a>,
    /// Error that all together may make, W/m² or lux.
    allowed: f32,
    /// Nodes that may be wrong by less, the one that may be wrong by most first: those which shadows may cross, and others.
    partly: BinaryHeap<Part>,
    certain: BinaryHeap<Part>,
    /// Errors of the former, squared, and errors by shape of all, together.
    errors: [f64; 2],
    /// Nodes that are as good as they can be.
    settled: Vec<Part>,
    /// What the receivers get so far, in the order of their names.
    arrived: Vec<Arrived>,
    tally: Tally,
    work: Work,
    far: FarWork,
}

impl Cut<'_> {
    /// What some receivers get, whose elements are numbered from `first`, and which these lamps reach; their light is `own` at least.
    pub async fn light(
        &self,
        receivers: &Receivers,
        (first, own): (u32, f32),
        reached: Reached<'_>,
        inquiry: &Inquiry<'_>,
    ) -> (Vec<Arrived>, Tally) {
        let mut cutting = Cutting {
            cut: self,
            receivers,
            reached,
            inquiry,
            allowed: self.allowed * own,
            partly: BinaryHeap::new(),
            certain: BinaryHeap::new(),
            errors: [0.0; 2],
            settled: Vec::new(),
            arrived: receivers.elements.iter().map(|e| Arrived::none(first + e)).collect(),
            tally: Tally::default(),
            work: Work::default(),
            far: FarWork::default(),
        };
        cutting.add(0);
        while !cutting.is_good() {
            let Some(part) = cutting.take() else { break };
            cutting.refine(part).await;
        }
        let mut parts = std::mem::take(&mut cutting.settled);
        parts.extend(std::mem::take(&mut cutting.partly));
        parts.extend(std::mem::take(&mut cutting.certain));
        parts.sort_unstable_by_key(|part| part.number);
        for part in parts {
            let glimpse = match part.glimpse {
                None => cutting.look(part.number, part.side).await,
                glimpse => glimpse,
            };
            for (name, mean, more) in glimpse.into_iter().flat_map(|glimpse| glimpse.received) {
                cutting.arrived[name as usize].add(self.light.radiosity[part.number as usize], mean, more);
            }
        }
        (cutting.arrived, cutting.tally)
    }

    /// How much light may come from a node: what all of it would give from its nearest point (P·G), but no more than its
    /// brightest element could; between the two where it is very near. None if it gives none.
    fn estimate(&self, receivers: &Receivers, number: u32) -> Option<f32> {
        let node = &self.tree.nodes[number as usize];
        let power = self.light.power(self.tree, number);
        if power <= 0.0 {
            return None;
        }
        let peak = self.light.peak[number as usize];
        let Some((towards, away)) = direction((receivers.low + receivers.high) / 2.0, node.middle()) else {
            return Some(peak);
        };
        let slack = ((receivers.high - receivers.low).length() / 2.0 + node.radius()) / away;
        let arriving = most_facing(receivers.axis, receivers.cosine, towards, slack);
        let leaving = most_facing(node.axis, node.cosine, -towards, slack);
        if arriving <= 0.0 || leaving <= 0.0 {
            return None;
        }
        let distance = between(receivers, node);
        let light = power * arriving * leaving / (PI * distance * distance);
        Some(if light < peak { light } else { (light.min(TOUCHING * peak) * peak).sqrt() })
    }
}

impl Cut<'_> {
    /// About how much light comes from a node that is in full view.
    fn in_view(&self, receivers: &Receivers, number: u32) -> f32 {
        let node = &self.tree.nodes[number as usize];
        let Some((towards, away)) = direction((receivers.low + receivers.high) / 2.0, node.middle()) else {
            return 0.0;
        };
        // Normals that point anywhere show a quarter of their area each way.
        let alike = node.cosine.max(0.0);
        let leaving = alike * node.axis.dot(-towards).max(0.0) + (1.0 - alike) / 4.0;
        let apart =
            away * away + (receivers.high - receivers.low).length_squared() / 4.0 + node.radius() * node.radius();
        self.light.power(self.tree, number) * receivers.axis.dot(towards).max(0.0) * leaving / (PI * apart)
    }
}

impl Cutting<'_> {
    /// Whether all together may be wrong by no more than is allowed.
    fn is_good(&self) -> bool {
        let certain = self.certain.peek().map_or(0.0, |part| f64::from(part.error));
        self.errors[1] + (self.errors[0].max(0.0) + certain * certain).sqrt() <= f64::from(self.allowed)
    }

    /// Adds a node, or those of its parts that give light.
    fn add(&mut self, number: u32) {
        let Some(estimate) = self.cut.estimate(self.receivers, number) else { return };
        if self.reached.hides(self.cut.tree, number, self.cut.in_view(self.receivers, number)) {
            return;
        }
        let node = &self.cut.tree.nodes[number as usize];
        if is_near(self.receivers, node) {
            return node.children.clone().for_each(|child| self.add(child));
        }
        self.put(Part { number, estimate, side: LEAST, glimpse: None, error: 0.0, shape: 0.0 });
    }

    /// Puts a node back with what is known of it now.
    fn put(&mut self, mut part: Part) {
        let node = &self.cut.tree.nodes[part.number as usize];
        let seen = part.glimpse.as_ref().map_or(Seen::Partly, |glimpse| glimpse.seen);
        let cells = part.glimpse.as_ref().map_or((part.side * part.side) as f32, |glimpse| glimpse.cells);
        let size = node.radius() / between(self.receivers, node);
        part.shape = match seen {
            Seen::NotAtAll => 0.0,
            Seen::Wholly if self.is_exact(part.number, node) => 0.0,
            _ => (part.estimate * SHAPE * size * size).min(part.estimate),
        };
        self.errors[1] += f64::from(part.shape);
        if seen == Seen::Partly {
            part.error = part.estimate * PARTLY / (cells.sqrt() * cells.sqrt().sqrt());
            self.errors[0] += f64::from(part.error) * f64::from(part.error);
            self.partly.push(part);
        } else {
            part.error = part.estimate * CERTAIN / cells;
            self.certain.push(part);
        }
    }

    /// Takes the node that may be wrong by most.
    fn take(&mut self) -> Option<Part> {
        let of_certain = self.certain.peek().map_or(-1.0, |part| part.error + part.shape);
        if self.partly.peek().is_some_and(|part| part.error + part.shape >= of_certain) {
            let part = self.partly.pop()?;
            self.errors[0] -= f64::from(part.error) * f64::from(part.error);
            self.errors[1] -= f64::from(part.shape);
            return Some(part);
        }
        let part = self.certain.pop()?;
        self.errors[1] -= f64::from(part.shape);
        Some(part)
    }

    /// Whether a node is flat and all of it emits alike: in full view, its form factor is exact.
    fn is_exact(&self, number: u32, node: &Node) -> bool {
        let Cut { mesh, light, .. } = self.cut;
        let Kind::Piece(piece) = node.kind else { return false };
        let mean = strength(light.radiosity[number as usize]);
        let whole = node.area >= 0.999 * piece.patch(mesh).area as f32;
        piece.element.is_some() || whole && light.peak[number as usize] <= 1.001 * mean
    }

    /// Makes a node's light better: takes more cells, looks whether shadows cross it, and opens it if they do.
    async fn refine(&mut self, mut part: Part) {
        let node = &self.cut.tree.nodes[part.number as usize];
        let (opened, most) = (is_opened(node), if matches!(node.kind, Kind::Piece(_)) { MOST } else { MOST_OF_GROUP });
        let hopeless = opened && part.shape + part.estimate * CERTAIN / ((most * most) as f32) > self.allowed;
        if part.glimpse.is_none() && part.side < most {
            part.side *= 2;
            self.put(part);
        } else if part.glimpse.is_none() && !hopeless {
            part.glimpse = self.look(part.number, part.side).await;
            if part.glimpse.is_some() {
                self.put(part);
            }
        } else if opened {
            node.children.clone().for_each(|child| self.add(child));
        } else {
            self.settled.push(part);
        }
    }

    /// What the receivers get of a node by `side`² cells; none if it cannot light them.
    async fn look(&mut self, number: u32, side: u32) -> Option<Glimpse> {
        let node = &self.cut.tree.nodes[number as usize];
        if node.kind == Kind::Faces || self.is_far(node, side) {
            return self.look_far(number, side).await;
        }
        let Cut { mesh, tree, light, elements, .. } = self.cut;
        let shot = light.shot(mesh, tree, elements, number, side);
        self.receivers.collect(mesh, &shot, &mut self.work);
        let packet = self.work.packet_mut();
        let (points, masks) = packet.split_mut();
        let open = asked(masks);
        if open.rays == 0 {
            return None;
        }
        self.tally = self.tally.join(open);
        self.inquiry.clear_blocked(&shot.shooter, points, masks).await;
        let seen = match asked(masks).rays {
            0 => Seen::NotAtAll,
            rays if rays == open.rays => Seen::Wholly,
            _ => Seen::Partly,
        };
        let cells = open.rays as f32 / masks.len() as f32;
        packet.gather(&shot);
        let received = self.work.received();
        let received =
            received.map(|(name, mean, point)| (name, mean[0] as f32, (point[0] - mean[0]) as f32)).collect();
        Some(Glimpse { seen, cells, received })
    }

    /// The same of a node that is far.
    async fn look_far(&mut self, number: u32, side: u32) -> Option<Glimpse> {
        let Cut { mesh, tree, light, elements, .. } = self.cut;
        let cells: FarCells = light.far_cells(mesh, tree, elements, number, side);
        let points = &self.receivers.points;
        if !self.far.face(points, &cells) {
            return None;
        }
        let open = asked(&self.far.masks);
        self.tally = self.tally.join(open);
        self.inquiry.clear_blocked(&cells.shooter, points.points(), &mut self.far.masks).await;
        let seen = match self.far.gather(&cells) {
            Share { seen: 0.0, .. } => Seen::NotAtAll,
            share if share.is_full() => Seen::Wholly,
            _ => Seen::Partly,
        };
        let cells = open.rays as f32 / self.far.masks.len() as f32;
        let received = points.names.iter().zip(&self.far.received).filter(|(_, received)| **received > 0.0);
        Some(Glimpse { seen, cells, received: received.map(|(&name, &mean)| (name, mean, 0.0)).collect() })
    }

    /// Whether the node's cells and the receivers' elements are small at their distance.
    fn is_far(&self, node: &Node, side: u32) -> bool {
        let cell = if node.kind == Kind::Group { 0.0 } else { 2.0 * node.radius() / side as f32 };
        between(self.receivers, node) > FAR * cell.max(self.receivers.width)
    }
}

impl Ord for Part {
    fn cmp(&self, other: &Part) -> Ordering {
        (self.error + self.shape).total_cmp(&(other.error + other.shape)).then(other.number.cmp(&self.number))
    }
}

impl PartialOrd for Part {
    fn partial_cmp(&self, other: &Part) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Part {
    fn eq(&self, other: &Part) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Part {}

/// Distance of a node, metres.
fn between(receivers: &Receivers, node: &Node) -> f32 {
    distance((receivers.low, receivers.high), (node.low, node.high))
}

/// Whether a node may be opened.
fn is_opened(node: &Node) -> bool {
    !node.children.is_empty() && node.kind != Kind::Faces
}

/// Whether a group fills so much of some receiver's view that a few of its members cannot stand for it, however dark it is.
fn is_near(receivers: &Receivers, node: &Node) -> bool {
    let distance = between(receivers, node);
    node.kind == Kind::Group && node.area > 0.25 * PI * distance * distance
}

/// What masks ask for.
fn asked(masks: &[u64]) -> Tally {
    let rays = masks.iter().map(|mask| u64::from(mask.count_ones())).sum();
    Tally {
        rays,
        masks: masks.len() as u64,
        masks_without_rays: masks.iter().filter(|&&mask| mask == 0).count() as u64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::fixture;
    use crate::shooting::Faces;
    use crate::solve::group::passes;

    #[test]
    fn what_stands_on_its_receivers_may_give_a_number() {
        // A lamp that stands on a floor.
        let scene = "v 0 0 0\nv 0 0 4\nv 4 0 4\nv 4 0 0\nv 1 0 1\nv 3 0 1\nv 3 1 1\nv 1 1 1\n\
            usemtl grey\nf 1 2 3 4\nusemtl lamp\nf 5 6 7 8\n";
        let solution = fixture::solve(fixture::read(scene), 0.25, 1.0);
        let mesh = &solution.mesh;
        let tree = ShooterTree::new(mesh);
        let elements = passes::radiosities(mesh, &vec![[0.0; 3]; mesh.element_count()]);
        let light = TreeLight::new(&tree, &elements);
        let cut = Cut { mesh, tree: &tree, light: &light, elements: &elements, allowed: 0.01 };
        let faces = Faces::new(mesh);
        let receivers = mesh.clusters.iter().flat_map(|cluster| Receivers::of(mesh, &faces, cluster));
        let (mut touching, mut others) = (0, 0);
        for receivers in receivers {
            for (number, node) in (0..).zip(&tree.nodes) {
                let Some(estimate) = cut.estimate(&receivers, number) else { continue };
                assert!(estimate.is_finite());
                let of = if between(&receivers, node) == 0.0 { &mut touching } else { &mut others };
                *of += 1;
            }
        }
        assert!(touching > 10 && others > 100, "{touching} {others}");
    }
}
