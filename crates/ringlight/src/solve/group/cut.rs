//! The cut that receivers take through the tree of all that emits: a node is opened while its light may be wrong by more than
//! their share of the error.

use super::passes::Arrived;
use crate::mesh::{Inquiry, Mesh};
use crate::shooting::{
    FarCells, FarWork, Kind, Node, Radiosity, Receivers, Share, ShooterTree, TreeLight, Work, direction, distance,
    most_facing,
};
use ringlight_visibility::Tally;
use std::f32::consts::PI;

/// The light of a node that some receivers see in part is taken to be wrong by this share of all it could give them.
const UNCERTAIN: f32 = 1.0 / 16.0;

/// What a few dozen rays did not find is taken to be this share at most.
const UNSEEN: f32 = 1.0 / 48.0;

/// Of a node in full view, a bound of the error by its shape: this times (radius/distance)².
const SHAPE: f32 = 0.5;

/// Cells and elements are small where they are farther than so many of their widths: then each cell is a disc, of which the
/// second-order error is below 1 %.
const FAR: f32 = 4.0;

/// Cells along a side: of what only tells whether something is seen, and of what shines, in turn, until the edge of a shadow is found
/// well enough. What shines has other cells than what decided about it, because what decides cannot also tell without bias.
const PROBE: u32 = 2;
const SIDES: [u32; 3] = [2, 4, 8];

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
    /// Error that one node may make, as a share of the receivers' own light.
    pub allowed: f32,
}

/// One cut on its way.
struct Cutting<'a> {
    cut: &'a Cut<'a>,
    receivers: &'a Receivers,
    inquiry: &'a Inquiry<'a>,
    /// Error that one node may make, W/m² or lux.
    allowed: f32,
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
            arrived: receivers.elements.iter().map(|e| Arrived::none(first + e)).collect(),
            tally: Tally::default(),
            work: Work::default(),
            far: FarWork::default(),
        };
        let mut stack = vec![0];
        while let Some(number) = stack.pop() {
            let Some(estimate) = self.estimate(receivers, number) else { continue };
            let node = &self.tree.nodes[number as usize];
            if is_opened(node) && (is_near(receivers, node) || cutting.is_open(number, node, estimate).await) {
                stack.extend(node.children.clone().rev());
            } else {
                cutting.shine(number, node, estimate.min(self.light.peak[number as usize])).await;
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
        Some(if light < peak { light } else { (light * peak).sqrt() })
    }
}

impl Cutting<'_> {
    /// Whether a node's light may be wrong by more than is allowed. Where that depends on what stands between, a few rays tell.
    async fn is_open(&mut self, number: u32, node: &Node, estimate: f32) -> bool {
        if estimate * UNCERTAIN <= self.allowed {
            return false;
        }
        if estimate * UNCERTAIN * UNSEEN > self.allowed {
            return true;
        }
        let Some(share) = self.look(number, PROBE).await else { return false };
        if share.is_full() {
            let size = node.radius() / between(self.receivers, node);
            return estimate * UNCERTAIN * (UNSEEN + SHAPE * size * size) > self.allowed;
        }
        share.seen > 0.0
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

    /// Adds the light of a node: with few cells first, with more where the edge of a shadow may err by more than is
    /// allowed: 0.27 M^(-3/4) of the light is the error of M cells (root of the mean square).
    async fn shine(&mut self, number: u32, node: &Node, estimate: f32) {
        // Cells that have been looked at do not count again.
        let light = self.cut.light;
        for side in SIDES.into_iter().filter(|&side| side > PROBE || !is_opened(node)) {
            let cells = (side * side) as f32;
            let is_last = side == 8 || 0.27 * estimate <= self.allowed * cells.sqrt() * cells.sqrt().sqrt();
            if node.kind == Kind::Faces || self.is_far(node, side) {
                let Some(share) = self.look(number, side).await else { return };
                if is_last || share.is_certain() && self.is_far(node, side) {
                    if share.seen > 0.0 {
                        let radiosity = light.radiosity[number as usize];
                        for (&name, &received) in self.receivers.points.names.iter().zip(&self.far.received) {
                            self.arrived[name as usize].add(radiosity, received, 0.0);
                        }
                    }
                    return;
                }
            } else if self.shine_near(number, side, is_last).await {
                return;
            }
        }
    }

    /// Adds the light of a near node by its contour, unless more cells are needed.
    async fn shine_near(&mut self, number: u32, side: u32, is_last: bool) -> bool {
        let Cut { mesh, tree, light, elements, .. } = self.cut;
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
        if is_last || seen == 0 || seen == open.rays {
            packet.gather(&shot);
            let radiosity = light.radiosity[number as usize];
            for (name, mean, point) in self.work.received() {
                self.arrived[name as usize].add(radiosity, mean[0] as f32, (point[0] - mean[0]) as f32);
            }
            return true;
        }
        false
    }

    /// Whether the node's cells and the receivers' elements are small at their distance.
    fn is_far(&self, node: &Node, side: u32) -> bool {
        let cell = if node.kind == Kind::Group { 0.0 } else { 2.0 * node.radius() / side as f32 };
        between(self.receivers, node) > FAR * cell.max(self.receivers.width)
    }
}

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
