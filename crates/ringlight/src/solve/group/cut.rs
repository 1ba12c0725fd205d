//! The cut that receivers take through the shooter tree: a node is opened while its light may be wrong by more than their
//! share of the error.

use super::links::Links;
use super::tune;
use crate::mesh::Mesh;
use crate::shooting::{Kind, Node, Radiosity, Receivers, ShooterTree, TreeLight, FarWork, Work, direction, distance, most_facing};
use ringlight_visibility::{Hierarchy, PreparedShooter, Tally};
use std::f32::consts::PI;

/// How exact a cut is.
#[derive(Clone, Copy, Debug)]
pub struct Tolerance {
    /// Error that a link may have, as a share of the receivers' own light.
    pub share: f32,
    /// A node's light is taken to be wrong by this part of it.
    pub seen: f32,
}

/// What cuts are taken through.
pub struct Cut<'a> {
    pub mesh: &'a Mesh,
    pub tree: &'a ShooterTree,
    pub light: &'a TreeLight,
    pub elements: &'a [Radiosity],
    pub hierarchy: &'a Hierarchy,
    pub tolerance: Tolerance,
}

pub static PROBES: [std::sync::atomic::AtomicUsize; 4] = [const { std::sync::atomic::AtomicUsize::new(0) }; 4];
pub static COUNTS: [std::sync::atomic::AtomicUsize; 24] = [const { std::sync::atomic::AtomicUsize::new(0) }; 24];
/// Buffers of a thread.
#[derive(Default)]
pub struct Buffers {
    work: Work,
    far: FarWork,
    stack: Vec<u32>,
}

/// What is known of a node before any ray.
enum Estimate {
    /// It gives no light.
    Nothing,
    /// At most about so much irradiance.
    Light(f32),
}

impl Cut<'_> {
    /// The links of some receivers, whose elements are numbered from `first`; their light is `own` at least.
    pub fn links(&self, receivers: &Receivers, first: u32, own: f32, buffers: &mut Buffers, tally: &mut Tally) -> Links {
        let mut links = Links::new(receivers.elements.iter().map(|e| first + e));
        let allowed = self.tolerance.share * own;
        let Buffers { work, far, stack } = buffers;
        stack.clear();
        stack.push(0);
        while let Some(number) = stack.pop() {
            let node = &self.tree.nodes[number as usize];
            let Estimate::Light(estimate) = self.estimate(receivers, number, node) else { continue };
            let is_element = node.children.is_empty();
            if !is_element && (is_near(receivers, node) || self.is_open(receivers, number, node, estimate, allowed, far, tally)) {
                stack.extend(node.children.clone().rev());
                continue;
            }
            self.link(receivers, number, node, estimate.min(self.light.peak[number as usize]), allowed, (work, far), tally, &mut links);
        }
        links
    }

    /// Links the receivers to a node: with few cells first, with more where the edge of a shadow may err by more than is allowed.
    fn link(
        &self,
        receivers: &Receivers,
        number: u32,
        node: &Node,
        estimate: f32,
        allowed: f32,
        (work, far): (&mut Work, &mut FarWork),
        tally: &mut Tally,
        links: &mut Links,
    ) {
        let kind = match (node.kind, node.children.is_empty()) { (Kind::Group, _) => 0, (_, false) => 1, _ => 2 };
        for side in [1, 2, 4, 8] {
            if side < if kind == 0 { tune("RL_GSIDE", 4.0) as u32 } else { tune("RL_SIDE", 2.0) as u32 } {
                continue;
            }
            let rays = tally.rays;
            // 0.27 M^(-3/4) is the error of M cells under the edge of a shadow (root of the mean square).
            let enough = 0.27 * estimate <= tune("RL_VIS", 1.0) * allowed * (side * side) as f32 / (side as f32).sqrt();
            let last = enough || side as f32 >= tune("RL_MAX", 8.0);
            if self.is_far(receivers, node, side) {
                let cells = self.light.far_cells(self.mesh, self.tree, self.elements, number, side);
                let Some(share) = far.receive(&receivers.points, &cells, self.hierarchy, tally) else { return };
                COUNTS[kind * 2].fetch_add(1, std::sync::atomic::Ordering::Relaxed); COUNTS[8 + kind * 2].fetch_add((tally.rays - rays) as usize, std::sync::atomic::Ordering::Relaxed);
                if last || share.seen == 0.0 || share.seen >= 0.9999 * share.open {
                    if share.seen > 0.0 {
                        COUNTS[16 + kind * 2].fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                        links.push_far(number, &receivers.points.names, &far.received);
                    }
                    return;
                }
            } else {
                let shot = self.light.shot(self.mesh, self.tree, self.elements, number, side);
                receivers.collect(self.mesh, &shot, work);
                if work.packet().points().is_empty() {
                    return;
                }
                let open: u32 = work.packet().masks().iter().map(|m| m.count_ones()).sum();
                let shooter = PreparedShooter::new(&shot.shooter);
                *tally = tally.join(work.packet_mut().receive(&shot, &shooter, self.hierarchy));
                let seen: u32 = work.packet().masks().iter().map(|m| m.count_ones()).sum();
                COUNTS[1+kind * 2].fetch_add(1, std::sync::atomic::Ordering::Relaxed); COUNTS[9 + kind * 2].fetch_add((tally.rays - rays) as usize, std::sync::atomic::Ordering::Relaxed);
                if last || seen == 0 || seen == open {
                    links.push(number, work.received());
                    return;
                }
            }
        }
    }

    /// Whether a node's light may be wrong by more than is allowed. Where it depends on what stands between, a few rays tell: to
    /// cells that are not those of the link.
    fn is_open(
        &self,
        receivers: &Receivers,
        number: u32,
        node: &Node,
        estimate: f32,
        allowed: f32,
        far: &mut FarWork,
        tally: &mut Tally,
    ) -> bool {
        let allowed = self.tolerance.seen * allowed;
        let certain = 1.0 / tune("RL_CERTAIN", 48.0);
        if estimate <= allowed {
            return false;
        }
        if estimate * certain > allowed {
            return true;
        }
        PROBES[0].fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        let cells = self.light.far_cells(self.mesh, self.tree, self.elements, number, tune("RL_PROBE", 2.0) as u32);
        let Some(share) = far.receive(&receivers.points, &cells, self.hierarchy, tally) else { return false };
        if share.seen == 0.0 {
            PROBES[1].fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            return false;
        }
        if share.seen >= 0.9999 * share.open {
            let distance = distance((receivers.low, receivers.high), (node.low, node.high));
            let size = node.radius() / distance;
            let open = estimate * (certain + tune("RL_GEO", 0.5) * size * size) > allowed;
            PROBES[if open { 2 } else { 3 }].fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            return open;
        }
        true
    }

    /// Whether the node's cells and the receivers' elements are small at their distance.
    fn is_far(&self, receivers: &Receivers, node: &Node, side: u32) -> bool {
        let distance = distance((receivers.low, receivers.high), (node.low, node.high));
        let cell = if matches!(node.kind, Kind::Group) { 0.0 } else { 2.0 * node.radius() / side as f32 };
        distance > tune("RL_FAR", 4.0) * cell.max(receivers.width)
    }

    /// How much light may come from a node: what all of it would give from its nearest point (P·G), but no more than its
    /// brightest element could; between the two where it is very near.
    fn estimate(&self, receivers: &Receivers, number: u32, node: &Node) -> Estimate {
        let power = self.light.power(self.tree, number);
        if power <= 0.0 {
            return Estimate::Nothing;
        }
        let peak = self.light.peak[number as usize];
        let middle = (receivers.low + receivers.high) / 2.0;
        let Some((towards, away)) = direction(middle, node.middle()) else { return Estimate::Light(peak) };
        let radius = (receivers.high - receivers.low).length() / 2.0;
        let slack = (radius + node.radius()) / away;
        let arriving = most_facing(receivers.axis, receivers.cosine, towards, slack);
        let leaving = most_facing(node.axis, node.cosine, -towards, slack);
        if arriving <= 0.0 || leaving <= 0.0 {
            return Estimate::Nothing;
        }
        let distance = distance((receivers.low, receivers.high), (node.low, node.high));
        let light = power * arriving * leaving / (PI * distance * distance);
        Estimate::Light(if light < peak { light } else { (light * peak).sqrt() })
    }
}

/// Whether a group fills so much of some receiver's view that a few of its members cannot stand for it, however dark it is.
fn is_near(receivers: &Receivers, node: &Node) -> bool {
    let distance = distance((receivers.low, receivers.high), (node.low, node.high));
    matches!(node.kind, Kind::Group) && node.area > 0.25 * PI * distance * distance
}
