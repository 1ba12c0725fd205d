//! What a cluster receives from a shot.
//!
//! Three steps: sample points that face the shooter are collected with the mask of cells above their horizon; visibility
//! clears bits; form factors turn masks into light. The middle step knows no light, the others need no occluder.

use super::emitter::range_window;
use super::light::{ClusterLight, ElementLight, unshot_power};
use super::shot::{PatchSource, Shot, Source};
use crate::form_factor;
use crate::mesh::{Mesh, Patch};
use glam::DVec3;
use ringlight_visibility::{Cells, Hierarchy, Points, Tally};

/// Elements nearer to the shooter than this many of their widths also take area samples: the error of a single point is
/// of the order of (width/distance)²/24.
const NEAR: f64 = 3.0;

/// Lanes of the cell loop.
const LANES: usize = 16;

/// Buffers that a thread reuses from cluster to cluster.
#[derive(Debug, Default)]
pub struct Work {
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    plane: Vec<u32>,
    masks: Vec<u64>,
    samples: Vec<Sample>,
    received: Vec<[f64; 3]>,
}

/// A sample point on its way.
#[derive(Clone, Copy, Debug)]
struct Sample {
    point: DVec3,
    normal: DVec3,
    /// Element within the cluster.
    element: u32,
    /// How many area samples follow this point value; for an area sample itself 0.
    followers: u8,
}

/// The cells of a patch shooter, structure of arrays, padded with cells of no weight.
struct CellTable {
    x: [f32; 64],
    y: [f32; 64],
    z: [f32; 64],
    density: [f32; 64],
    light: [[f32; 64]; 3],
    count: usize,
    /// Area of a cell, m².
    area: f32,
}

/// Adds to `light`, the light of cluster number `cluster`, what it receives from `shot`.
pub fn receive(
    mesh: &Mesh,
    cluster: usize,
    light: &mut ClusterLight,
    shot: &Shot,
    hierarchy: &Hierarchy,
    work: &mut Work,
) -> Tally {
    collect(mesh, cluster, shot, work);
    if work.samples.is_empty() {
        return Tally::default();
    }
    let points = Points { x: &work.x, y: &work.y, z: &work.z, plane: &work.plane };
    let tally = hierarchy.clear_blocked(&shot.shooter, points, &mut work.masks);
    gather(shot, work);
    add(mesh, cluster, light, is_hard(shot), work);
    tally
}

/// Collects the sample points of a cluster that face the shooter.
fn collect(mesh: &Mesh, cluster: usize, shot: &Shot, work: &mut Work) {
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
    for id in cluster.patches.clone() {
        let patch = mesh.patch(id);
        if !may_face(&patch, shot) {
            continue;
        }
        for k in 0..patch.element_count() {
            let element = patch.first_element + k;
            let valid = mesh.valid[element as usize];
            let Some(point) = patch.sample_point(k, valid) else { continue };
            let index = element - cluster.elements.start;
            let near = hard || is_near(&patch, point, shot);
            let mask = horizon_mask(shot, point, patch.normal);
            if mask == 0 && !near {
                continue;
            }
            let head = work.samples.len();
            work.push(&patch, point, index, mask);
            if near {
                let tile = patch.element_tile(k);
                for s in (0..16).filter(|s| valid >> s & 1 == 1) {
                    let point = patch.area_sample(&tile, s);
                    work.push(&patch, point, index, horizon_mask(shot, point, patch.normal));
                }
                work.samples[head].followers = valid.count_ones() as u8;
            }
        }
    }
}

/// False only if no point of the patch can receive light from the shooter.
fn may_face(patch: &Patch, shot: &Shot) -> bool {
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
    }
}

/// Whether the shot casts hard shadows: then every element takes area samples, and shows their mean.
fn is_hard(shot: &Shot) -> bool {
    shot.light.len() == 1 && !matches!(shot.source, Source::Patch(_))
}

fn is_near(patch: &Patch, point: DVec3, shot: &Shot) -> bool {
    let Source::Patch(source) = &shot.source else { return false };
    let reach = NEAR * (patch.area / f64::from(patch.element_count())).sqrt();
    let away = (source.low - point).max(point - source.high).max(DVec3::ZERO);
    away.length_squared() < reach * reach
}

/// The cells that lie above the point's horizon and face it.
fn horizon_mask(shot: &Shot, point: DVec3, normal: DVec3) -> u64 {
    let above = |cells: &mut dyn Iterator<Item = DVec3>| {
        cells.enumerate().fold(0u64, |mask, (k, to)| mask | u64::from(normal.dot(to) > 0.0) << k)
    };
    match (&shot.source, &shot.shooter.cells) {
        (Source::Patch(source), Cells::Grid(grid)) => {
            if source.normal.dot(point - source.corners[0]) <= 0.0 {
                return 0;
            }
            if source.corners[..source.count].iter().all(|&c| normal.dot(c - point) > 0.0) {
                return shot.shooter.cells.all();
            }
            above(&mut (0..grid.len()).map(|k| DVec3::from(grid.point(k).map(f64::from)) - point))
        }
        (_, Cells::Directions(d)) => above(&mut d.iter().map(|d| DVec3::from(d.map(f64::from)))),
        (_, Cells::Points(p)) => above(&mut p.iter().map(|p| DVec3::from(p.map(f64::from)) - point)),
        (_, Cells::Grid(_)) => 0,
    }
}

/// Turns masks into irradiance.
fn gather(shot: &Shot, work: &mut Work) {
    let Work { masks, samples, received, .. } = work;
    match &shot.source {
        Source::Patch(source) => {
            let table = CellTable::new(shot, source);
            pulp::Arch::new().dispatch(|| {
                for (sample, &mask) in samples.iter().zip(masks.iter()) {
                    received.push(if mask == 0 { [0.0; 3] } else { from_patch(source, &table, sample, mask) });
                }
            });
        }
        Source::Point { position, cone, range } => {
            for (sample, &mask) in samples.iter().zip(masks.iter()) {
                let factor = if mask == 0 { 0.0 } else { from_point(sample, *position, *cone, *range) };
                received.push(shot.light[0].map(|i| f64::from(i) * factor));
            }
        }
        Source::Directions => {
            let Cells::Directions(directions) = &shot.shooter.cells else { return };
            for (sample, &mask) in samples.iter().zip(masks.iter()) {
                let mut sum = [0.0; 3];
                for (k, d) in directions.iter().enumerate().filter(|(k, _)| mask >> k & 1 == 1) {
                    let cosine = sample.normal.dot(DVec3::from(d.map(f64::from)));
                    (0..3).for_each(|c| sum[c] += cosine * f64::from(shot.light[k][c]));
                }
                received.push(sum);
            }
        }
    }
}

/// Irradiance from the visible part of a patch: the contour of the whole shooter, weighted by the visible share of the
/// light of its cells, Σ cosθᵣ cosθₛ ΔB / (πr² + A) (DESIGN section 3; Wallace, Elmquist & Haines 1989 for the disc form).
#[inline(always)]
fn from_patch(source: &PatchSource, table: &CellTable, sample: &Sample, mask: u64) -> [f64; 3] {
    let factor = form_factor::contour(sample.point, sample.normal, &source.corners[..source.count]);
    let (x, n) = (sample.point.as_vec3(), sample.normal.as_vec3());
    let s = source.normal.as_vec3();
    let mut total = [0.0f32; LANES];
    let mut light = [[0.0f32; LANES]; 3];
    for chunk in 0..table.count.div_ceil(LANES) {
        let first = chunk * LANES;
        let bits = (mask >> first) as u32;
        for l in 0..LANES {
            let k = first + l;
            let (dx, dy, dz) = (table.x[k] - x.x, table.y[k] - x.y, table.z[k] - x.z);
            let r2 = dx * dx + dy * dy + dz * dz;
            let receiver = (dx * n.x + dy * n.y + dz * n.z).max(0.0);
            let shooter = (-(dx * s.x + dy * s.y + dz * s.z)).max(0.0);
            let disc = receiver * shooter / (r2 * (std::f32::consts::PI * r2 + table.area)) * table.density[k];
            let seen = (bits >> l & 1) as f32 * disc;
            total[l] += disc;
            light[0][l] += seen * table.light[0][k];
            light[1][l] += seen * table.light[1][k];
            light[2][l] += seen * table.light[2][k];
        }
    }
    let sum = |lanes: &[f32; LANES]| lanes.iter().map(|&x| f64::from(x)).sum::<f64>();
    let total = sum(&total);
    if total > 0.0 { [0, 1, 2].map(|c| factor * sum(&light[c]) / total) } else { [0.0; 3] }
}

/// Irradiance per intensity from a point or spot light (KHR_lights_punctual for cone and range).
fn from_point(sample: &Sample, position: DVec3, cone: Option<(DVec3, f64, f64)>, range: f64) -> f64 {
    let to = position - sample.point;
    let r2 = to.length_squared();
    let r = r2.sqrt();
    if !(r > 0.0 && r < range) {
        return 0.0;
    }
    let mut factor = to.dot(sample.normal).max(0.0) / (r * r2);
    factor *= range_window(r, range);
    if let Some((axis, inner, outer)) = cone {
        let cosine = -to.dot(axis) / r;
        let ramp = ((cosine - outer) / (inner - outer).max(1e-4)).clamp(0.0, 1.0);
        factor *= ramp * ramp;
    }
    factor
}

/// Adds what was received to the elements, and renews the unshot power of their patches.
fn add(mesh: &Mesh, cluster: usize, light: &mut ClusterLight, hard: bool, work: &Work) {
    let mut i = 0;
    let mut lit: Option<(u32, u32)> = None;
    while i < work.samples.len() {
        let sample = &work.samples[i];
        let followers = usize::from(sample.followers);
        let point = work.received[i];
        let mean: [f64; 3] = if followers == 0 {
            point
        } else {
            let sum = work.received[i + 1..=i + followers]
                .iter()
                .fold([0.0; 3], |a, b| [a[0] + b[0], a[1] + b[1], a[2] + b[2]]);
            sum.map(|x| x / followers as f64)
        };
        let (area, point) = if hard { (mean, mean) } else { (mean, point) };
        if area != [0.0; 3] || point != [0.0; 3] {
            let element: &mut ElementLight = &mut light.elements[sample.element as usize];
            element.add(area, point);
            lit = Some(lit.map_or((sample.element, sample.element), |(first, _)| (first, sample.element)));
        }
        i += 1 + followers;
    }
    if let Some((first, last)) = lit {
        renew_power(mesh, cluster, light, first, last);
    }
}

/// Renews the unshot power of the patches that hold elements `first` to `last` of the cluster.
fn renew_power(mesh: &Mesh, cluster: usize, light: &mut ClusterLight, first: u32, last: u32) {
    let cluster = &mesh.clusters[cluster];
    for (index, id) in cluster.patches.clone().enumerate() {
        let patch = mesh.patch(id);
        let range = patch.elements();
        let (start, end) = (range.start - cluster.elements.start, range.end - cluster.elements.start);
        if start <= last && end > first {
            let state = &mut light.patches[index];
            let elements = &light.elements[start as usize..end as usize];
            state.unshot_power = unshot_power(mesh, &patch, elements, state.emission_waits);
        }
    }
}

impl Work {
    fn clear(&mut self) {
        self.x.clear();
        self.y.clear();
        self.z.clear();
        self.plane.clear();
        self.masks.clear();
        self.samples.clear();
        self.received.clear();
    }

    fn push(&mut self, patch: &Patch, point: DVec3, element: u32, mask: u64) {
        let single = point.as_vec3();
        self.x.push(single.x);
        self.y.push(single.y);
        self.z.push(single.z);
        self.plane.push(patch.plane);
        self.masks.push(mask);
        self.samples.push(Sample { point, normal: patch.normal, element, followers: 0 });
    }
}

impl CellTable {
    fn new(shot: &Shot, source: &PatchSource) -> CellTable {
        let mut table = CellTable {
            // Lanes without a cell lie so far away that they add 0, also for a point at the origin.
            x: [1e15; 64],
            y: [0.0; 64],
            z: [0.0; 64],
            density: [0.0; 64],
            light: [[0.0; 64]; 3],
            count: shot.light.len(),
            area: (source.area / shot.light.len() as f64) as f32,
        };
        let Cells::Grid(grid) = &shot.shooter.cells else { return table };
        for (k, light) in shot.light.iter().enumerate() {
            [table.x[k], table.y[k], table.z[k]] = grid.point(k);
            table.density[k] = source.density[k];
            (0..3).for_each(|c| table.light[c][k] = light[c]);
        }
        table
    }
}
