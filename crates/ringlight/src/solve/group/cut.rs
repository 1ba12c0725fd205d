//! The cut that receivers take through the tree of all that emits: the node whose light may be wrong by most is looked at, opened or
//! given more cells, until all together may be wrong by no more than the receivers' share of the error.
//!
//! Nodes err both ways, as their shadows fall, so that their errors add by their squares; those of their shapes add as they are. So few
//! lamps may err by much each, and thousands of glowing surfaces by next to nothing each. What decides about a node are rays
//! of its own: what decides cannot also shine without bias.

use super::passes::Arrived;
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

/// The light of a node that was seen wholly, or not at all, by a few dozen rays may be wrong by this share of all it could give.
const CERTAIN: f32 = 1.0 / 256.0;

/// Of a node in full view, a bound of the error by its shape: this times (radius/distance)².
const SHAPE: f32 = 1.0 / 32.0;

/// Cells and elements are small where they are farther than so many of their widths: then each cell is a disc, of which the
/// second-order error is below 1 %.
const FAR: f32 = 4.0;

/// Cells along a side: of what only tells whether something is seen, and most of what shines.
const PROBE: u32 = 2;
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
    seen: Seen,
    /// Cells along a side that it is to shine from.
    side: u32,
    /// What its light may be wrong by as its shadows fall, and by its shape, W/m² or lux.
    error: f32,
    shape: f32,
}

/// How much of a node was seen.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Seen {
    NotLooked,
    Partly,
    Wholly,
    NotAtAll,
}

/// One cut on its way.
struct Cutting<'a> {
    cut: &'a Cut<'a>,
    receivers: &'a Receivers,
    inquiry: &'a Inquiry<'a>,
    /// Error that all together may make, W/m² or lux.
    allowed: f32,
    /// Nodes that may be wrong by less, the one that may be wrong by most first.
    parts: BinaryHeap<Part>,
    /// The squares of their errors, and their errors by shape, together.
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
    /// What some receivers get, whose elements are numbered from `first`; their light is `own` at least.
    pub async fn light(
        &self,
        receivers: &Receivers,
        first: u32,
        own: f32,
        inquiry: &Inquiry<'_>,
    ) -> (Vec<Arrived>, Tally) {
        let mut cutting = Cutting {
            cut: self,
            receivers,
            inquiry,
            allowed: self.allowed * own,
            parts: BinaryHeap::new(),
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
        parts.extend(std::mem::take(&mut cutting.parts));
        parts.sort_unstable_by_key(|part| part.number);
        let of_one = cutting.allowed / (parts.len() as f32).sqrt();
        for part in parts {
            cutting.shine(&part, of_one).await;
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
        Some(if light < peak { light } else { (light * peak).sqrt() })
    }
}

impl Cutting<'_> {
    /// Whether all together may be wrong by no more than is allowed.
    fn is_good(&self) -> bool {
        self.errors[1] + self.errors[0].max(0.0).sqrt() <= f64::from(self.allowed)
    }

    /// Adds a node, or those of its parts that give light.
    fn add(&mut self, number: u32) {
        let Some(estimate) = self.cut.estimate(self.receivers, number) else { return };
        let node = &self.cut.tree.nodes[number as usize];
        if is_near(self.receivers, node) {
            return node.children.clone().for_each(|child| self.add(child));
        }
        let side = if is_opened(node) { 2 * PROBE } else { PROBE };
        self.put(Part { number, estimate, seen: Seen::NotLooked, side, error: 0.0, shape: 0.0 });
    }

    /// Puts a node back with what is known of it now.
    fn put(&mut self, mut part: Part) {
        let node = &self.cut.tree.nodes[part.number as usize];
        part.error = match part.seen {
            Seen::Wholly | Seen::NotAtAll => part.estimate * CERTAIN,
            Seen::Partly | Seen::NotLooked => part.partly(part.side),
        };
        let size = node.radius() / between(self.receivers, node);
        part.shape = match part.seen {
            Seen::NotAtAll => 0.0,
            Seen::Wholly if self.is_exact(part.number, node) => 0.0,
            _ => (part.estimate * SHAPE * size * size).min(part.estimate),
        };
        self.errors[0] += f64::from(part.error) * f64::from(part.error);
        self.errors[1] += f64::from(part.shape);
        self.parts.push(part);
    }

    /// Takes the node that may be wrong by most.
    fn take(&mut self) -> Option<Part> {
        let part = self.parts.pop()?;
        self.errors[0] -= f64::from(part.error) * f64::from(part.error);
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

    /// Makes a node's light better: looks at it, opens it, or gives it more cells.
    async fn refine(&mut self, mut part: Part) {
        let node = &self.cut.tree.nodes[part.number as usize];
        let opened = is_opened(node);
        if part.seen == Seen::NotLooked {
            // Who would be opened whatever is seen is not looked at.
            if !opened || part.estimate * CERTAIN + part.shape <= self.allowed {
                let Some(share) = self.look(part.number, PROBE).await else { return };
                part.seen = match share {
                    Share { seen: 0.0, .. } => Seen::NotAtAll,
                    share if share.is_certain() => Seen::Wholly,
                    _ => Seen::Partly,
                };
                if !opened && part.seen == Seen::Partly {
                    part.side *= 2;
                }
                return self.put(part);
            }
        }
        if opened {
            node.children.clone().for_each(|child| self.add(child));
        } else if part.seen == Seen::Partly && part.side < MOST {
            part.side *= 2;
            self.put(part);
        } else {
            self.settled.push(part);
        }
    }

    /// What the receivers get of a far node by `side`² cells; none if it cannot light them.
    async fn look(&mut self, number: u32, side: u32) -> Option<Share> {
        let Cut { mesh, tree, light, elements, .. } = self.cut;
        let cells: FarCells = light.far_cells(mesh, tree, elements, number, side);
        let points = &self.receivers.points;
        if !self.far.face(points, &cells) {
            return None;
        }
        self.tally = self.tally.join(asked(&self.far.masks));
        self.inquiry.clear_blocked(&cells.shooter, points.points(), &mut self.far.masks).await;
        Some(self.far.gather(&cells))
    }

    /// Adds the light of a node: from more cells than planned where a shadow falls that may make more than the error of one.
    async fn shine(&mut self, part: &Part, of_one: f32) {
        let mut side = part.side;
        while !self.shine_from(part.number, side, side == MOST || part.partly(side) <= of_one).await {
            side *= 2;
        }
    }

    /// Adds the light of a node from so many cells; false if only a part is seen and that is not the last try.
    async fn shine_from(&mut self, number: u32, side: u32, is_last: bool) -> bool {
        let Cut { mesh, tree, light, elements, .. } = self.cut;
        let node = &tree.nodes[number as usize];
        let radiosity = light.radiosity[number as usize];
        if node.kind == Kind::Faces || self.is_far(node, side) {
            let Some(share) = self.look(number, side).await else { return true };
            let is_good = is_last || share.is_certain();
            if is_good && share.seen > 0.0 {
                for (&name, &received) in self.receivers.points.names.iter().zip(&self.far.received) {
                    self.arrived[name as usize].add(radiosity, received, 0.0);
                }
            }
            return is_good;
        }
        let shot = light.shot(mesh, tree, elements, number, side);
        self.receivers.collect(mesh, &shot, &mut self.work);
        let packet = self.work.packet_mut();
        let (points, masks) = packet.split_mut();
        let open = asked(masks);
        self.tally = self.tally.join(open);
        if open.rays > 0 {
            self.inquiry.clear_blocked(&shot.shooter, points, masks).await;
        }
        let seen = asked(masks).rays;
        let is_good = is_last || seen == 0 || seen == open.rays;
        if is_good {
            packet.gather(&shot);
            for (name, mean, point) in self.work.received() {
                self.arrived[name as usize].add(radiosity, mean[0] as f32, (point[0] - mean[0]) as f32);
            }
        }
        is_good
    }

    /// Whether the node's cells and the receivers' elements are small at their distance.
    fn is_far(&self, node: &Node, side: u32) -> bool {
        let cell = if node.kind == Kind::Group { 0.0 } else { 2.0 * node.radius() / side as f32 };
        between(self.receivers, node) > FAR * cell.max(self.receivers.width)
    }
}

impl Part {
    /// What its light may be wrong by if it is seen in part, from so many cells.
    fn partly(&self, side: u32) -> f32 {
        self.estimate * PARTLY / (side as f32 * (side as f32).sqrt())
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
