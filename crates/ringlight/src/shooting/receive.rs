//! What a cluster receives from a shot.
//!
//! Three steps: sample points that face the shooter are collected with the mask of cells above their horizon; visibility
//! clears bits; form factors turn masks into light. The middle step knows no light, the others need no occluder:
//! it may be done elsewhere.

use super::gather::{Received, Role, Spread};
use super::light::{ClusterLight, ElementLight, unshot_power};
use super::packet::Packet;
use super::shot::{Shot, Source};
use crate::mesh::{ALL_VALID, Mesh, Patch, area_samples};
use glam::DVec3;
use ringlight_visibility::{Cells, Hierarchy, Layout, PreparedShooter, Tally};

/// Elements nearer to the shooter than this many of their widths also take area samples: the error of a single point's
/// second-order mean is of the order of (width/distance)⁴/100.
const NEAR: f64 = 3.0;

/// Buffers that a thread reuses from cluster to cluster.
#[derive(Debug, Default)]
pub struct Work {
    packet: Packet,
    /// What belongs to each receiver of the packet.
    samples: Vec<Sample>,
}

/// A sample point on its way.
#[derive(Clone, Copy, Debug)]
struct Sample {
    /// Element within the cluster.
    element: u32,
    /// How many area samples follow this point value; for an area sample itself 0.
    followers: u8,
}

/// Adds to `light`, the light of cluster number `cluster`, what those of its patches that are `among` the receivers get of `shot`,
/// whose shooter is `shooter`.
pub fn receive(
    mesh: &Mesh,
    (cluster, among): (usize, impl Fn(usize) -> bool),
    light: &mut ClusterLight,
    shot: &Shot,
    shooter: &PreparedShooter,
    hierarchy: &Hierarchy,
    work: &mut Work,
) -> Tally {
    collect(mesh, (cluster, among), shot, work);
    if work.samples.is_empty() {
        return Tally::default();
    }
    let tally = work.packet.receive(shot, shooter, hierarchy);
    add(mesh, cluster, light, is_hard(shot), work);
    tally
}

/// The last step of [`receive`]: adds what arrives at the points that `work` has collected of this cluster, through what
/// their masks have left open.
pub fn add_received(mesh: &Mesh, cluster: usize, light: &mut ClusterLight, shot: &Shot, work: &mut Work) {
    work.packet.gather(shot);
    add(mesh, cluster, light, is_hard(shot), work);
}

/// The first step of [`receive`]: collects the sample points of a cluster's patches `among` the receivers, by their places in it, that
/// face the shooter, with the cells above their horizon.
pub fn collect(mesh: &Mesh, (cluster, among): (usize, impl Fn(usize) -> bool), shot: &Shot, work: &mut Work) {
    work.clear();
    let hard = is_hard(shot);
    let cluster = &mesh.clusters[cluster];
    if let Source::Patch(source) = &shot.source {
        let (low, high) = (cluster.low.as_dvec3(), cluster.high.as_dvec3());
        let n = source.normal;
        let farthest = DVec3::select(n.cmpgt(DVec3::ZERO), high, low);
        if n.dot(farthest - source.corners[0]) <= 0.0 {
            return;
        }
    }
    for (_, id) in cluster.patches.clone().enumerate().filter(|&(place, _)| among(place)) {
        let patch = mesh.patch(id);
        if !may_face(&patch, shot) {
            continue;
        }
        let first = patch.first_element - cluster.elements.start;
        let elements = (0..patch.element_count()).map(|k| (k, first + k));
        work.collect(mesh, &patch, elements, shot, if hard { f64::INFINITY } else { NEAR });
    }
}

/// How far a patch's elements extend: all alike if it is a triangle or a parallelogram, else those in its middle.
fn spread(patch: &Patch) -> Spread {
    let [columns, rows] = patch.grid.map(f64::from);
    let frame = &patch.frame;
    let (u, v) = ((frame.edge_u + 0.5 * frame.twist) / columns, (frame.edge_v + 0.5 * frame.twist) / rows);
    let vectors = match frame.layout {
        Layout::Quad => [u, v],
        // The covariance of a triangle is (2uuᵀ + 2vvᵀ − uvᵀ − vuᵀ)/36.
        Layout::Triangle => [(u - v) / std::f64::consts::SQRT_2, (u + v) / 6f64.sqrt()],
    };
    Spread(vectors.map(|w| w.as_vec3()))
}

/// False only if no point of the patch can receive light from the shooter.
pub(super) fn may_face(patch: &Patch, shot: &Shot) -> bool {
    let (corners, count) = patch.frame.corners();
    let corners = &corners[..count];
    match &shot.source {
        Source::Patch(source) => {
            patch.plane != shot.shooter.plane
                && corners.iter().any(|&c| source.normal.dot(c - source.corners[0]) > 0.0)
                && source.corners[..source.count].iter().any(|&c| patch.normal.dot(c - corners[0]) > 0.0)
        }
        Source::Point { position, range, .. } => {
            patch.normal.dot(*position - corners[0]) > 0.0
                && corners.iter().map(|c| (*c - *position).length()).fold(f64::INFINITY, f64::min)
                    < range + patch.area.sqrt() * 4.0
        }
        Source::Directions => match &shot.shooter.cells {
            Cells::Directions(directions) => {
                directions.iter().any(|d| patch.normal.dot(DVec3::from(d.map(f64::from))) > 0.0)
            }
            _ => false,
        },
        Source::Group(_) => true,
    }
}

/// Whether the shot casts hard shadows: then every element takes area samples, and shows their mean.
fn is_hard(shot: &Shot) -> bool {
    shot.light.len() == 1 && !matches!(shot.source, Source::Patch(_))
}

fn is_near(patch: &Patch, point: DVec3, shot: &Shot, widths: f64) -> bool {
    let Source::Patch(source) = &shot.source else { return widths == f64::INFINITY };
    let reach = widths * (patch.area / f64::from(patch.element_count())).sqrt();
    let away = (source.low - point).max(point - source.high).max(DVec3::ZERO);
    away.length_squared() < reach * reach
}

/// Adds what was received to the elements, and renews the unshot power of their patches.
fn add(mesh: &Mesh, cluster: usize, light: &mut ClusterLight, hard: bool, work: &Work) {
    let mut lit: Option<(u32, u32)> = None;
    for (name, mean, point) in work.received() {
        let (area, point) = if hard { (mean, mean) } else { (mean, point) };
        if area != [0.0; 3] || point != [0.0; 3] {
            let element: &mut ElementLight = &mut light.elements[name as usize];
            element.add(area, point);
            lit = Some(lit.map_or((name, name), |(first, _)| (first, name)));
        }
    }
    if let Some((first, last)) = lit {
        renew_power(mesh, cluster, light, first, last);
    }
}

/// Renews the unshot power of the patches that hold elements `first` to `last` of the cluster.
fn renew_power(mesh: &Mesh, cluster: usize, light: &mut ClusterLight, first: u32, last: u32) {
    let cluster = &mesh.clusters[cluster];
    for (index, id) in cluster.patches.clone().enumerate() {
        let range = mesh.elements_of(id);
        let (start, end) = (range.start - cluster.elements.start, range.end - cluster.elements.start);
        if start <= last && end > first {
            let state = &mut light.patches[index];
            let elements = &light.elements[start as usize..end as usize];
            state.unshot_power = unshot_power(mesh, &mesh.patch(id), elements, state.emission_waits);
        }
    }
}

impl Work {
    /// Adds the sample points of some elements of `patch` that face the shooter: their numbers within it, and what they are to
    /// be called. Those nearer to the shooter than `near` of their widths also take area samples.
    pub(super) fn collect(
        &mut self,
        mesh: &Mesh,
        patch: &Patch,
        elements: impl Iterator<Item = (u32, u32)>,
        shot: &Shot,
        near: f64,
    ) {
        let alone = self.packet.push_spread(spread(patch));
        for (k, name) in elements {
            let valid = mesh.valid[(patch.first_element + k) as usize];
            let Some(point) = patch.sample_point(k, valid) else { continue };
            let near = is_near(patch, point, shot, near);
            let mask = shot.above_horizon(point, patch.normal);
            if mask == 0 && !near {
                continue;
            }
            let head = self.samples.len();
            let role = match (near, valid) {
                (true, _) => Role::Near,
                (false, ALL_VALID) => alone,
                (false, _) => Role::Point,
            };
            self.push(patch, role, point, name, mask);
            if near {
                let tile = patch.element_tile(k);
                for s in area_samples(valid) {
                    let point = patch.area_sample(&tile, s);
                    self.push(patch, Role::Near, point, name, shot.above_horizon(point, patch.normal));
                }
                self.samples[head].followers = area_samples(valid).count() as u8;
            }
        }
    }

    /// What has been received by each element of which points were collected: its name, its area average and the value at its
    /// sample point.
    pub fn received(&self) -> impl Iterator<Item = (u32, [f64; 3], [f64; 3])> {
        let mut i = 0;
        std::iter::from_fn(move || {
            let sample = self.samples.get(i)?;
            let followers = usize::from(sample.followers);
            let Received { point, mean } = self.packet.received()[i];
            let mean: [f64; 3] = if followers == 0 {
                mean
            } else {
                let sum = self.packet.received()[i + 1..=i + followers]
                    .iter()
                    .fold([0.0; 3], |a, b| [a[0] + b.point[0], a[1] + b.point[1], a[2] + b.point[2]]);
                sum.map(|x| x / followers as f64)
            };
            i += 1 + followers;
            Some((sample.element, mean, point))
        })
    }

    /// The points collected, with masks.
    pub fn packet(&self) -> &Packet {
        &self.packet
    }

    /// The same, for masks to be cleared.
    pub fn packet_mut(&mut self) -> &mut Packet {
        &mut self.packet
    }

    /// Removes all points.
    pub fn clear(&mut self) {
        self.packet.clear();
        self.samples.clear();
    }

    fn push(&mut self, patch: &Patch, role: Role, point: DVec3, element: u32, mask: u64) {
        self.packet.push_as(role, point, patch.normal, patch.plane, mask);
        self.samples.push(Sample { element, followers: 0 });
    }
}
