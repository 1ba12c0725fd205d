//! Neighbouring elements that look at the shooter tree together.

use super::far::FarReceivers;
use super::receive::{Work, may_face};
use super::shot::Shot;
use crate::mesh::{Cluster, Mesh, Patch};
use glam::{DVec3, Vec3};
use ringlight_visibility::Layout;

/// Elements along a side of those of one patch that go together.
const SIDE: u32 = 4;

/// Elements that go together, if so many are near; those of a patch may be up to twice as many.
const TOGETHER: u32 = 16;

/// Elements nearer to the shooter than this many of their widths also take area samples: the second-order mean of one point errs
/// by (width/distance)⁴/100 of what comes from one element.
const NEAR: f64 = 1.5;

/// Some elements of neighbouring patches. Light is found for *rows*: one for each element, but that elements much smaller than
/// wanted share a row with others beside them that face alike, so that work follows the wanted resolution, not the number of
/// triangles.
#[derive(Clone, Debug)]
pub struct Receivers {
    /// Patches, the numbers of their elements that have rows, and the first of these, which are consecutive.
    patches: Vec<(Patch, Vec<u32>, u32)>,
    /// Elements of the cluster.
    pub elements: Vec<u32>,
    /// The row of each of these; none if it is covered by other geometry.
    pub rows: Vec<Option<u32>>,
    /// Where rows are and the way they face.
    places: Vec<(DVec3, DVec3)>,
    /// The sample points of rows.
    pub points: FarReceivers,
    /// Width of the widest row, metres.
    pub width: f32,
    /// Box around the elements, metres.
    pub low: Vec3,
    /// Upper corner of the box.
    pub high: Vec3,
    /// Unit vector about which their normals lie.
    pub axis: Vec3,
    /// Least cosine between the axis and a normal.
    pub cosine: f32,
}

/// How elements share rows.
#[derive(Clone, Copy, Debug)]
pub struct Sharing {
    /// Elements narrower than this do, metres.
    below: f64,
    /// With a row no farther than this, metres.
    reach: f64,
}

impl Sharing {
    /// For the light that is asked for: an element of half the wanted width is a row of its own.
    pub fn fine(mesh: &Mesh) -> Sharing {
        Sharing { below: 0.5 * mesh.sizes.element, reach: 0.5 * mesh.sizes.element }
    }

    /// For a first impression: a row for some ten elements.
    pub fn coarse(mesh: &Mesh) -> Sharing {
        Sharing { below: 2.0 * mesh.sizes.element, reach: 2.0 * mesh.sizes.element }
    }
}

/// Least cosine between the normals of elements that share a row.
const ALIKE: f64 = 0.9;

impl Receivers {
    /// Those of a cluster. Elements are numbered within it.
    pub fn of(mesh: &Mesh, cluster: &Cluster, sharing: Sharing) -> Vec<Receivers> {
        let mut all: Vec<Receivers> = Vec::new();
        for id in cluster.patches.clone() {
            let patch = mesh.patch(id);
            let first = patch.first_element - cluster.elements.start;
            for block in blocks(&patch) {
                let normal = patch.normal.as_vec3();
                let full = |r: &Receivers| r.places.len() + block.len() > TOGETHER as usize || r.axis.dot(normal) < 0.5;
                if all.last().is_none_or(full) {
                    all.push(Receivers::none(normal));
                }
                if let Some(last) = all.last_mut() {
                    last.push(mesh, &patch, first, &block, sharing);
                }
            }
        }
        all.iter_mut().for_each(Receivers::close);
        all
    }

    fn none(axis: Vec3) -> Receivers {
        Receivers {
            patches: Vec::new(),
            elements: Vec::new(),
            rows: Vec::new(),
            places: Vec::new(),
            points: FarReceivers::default(),
            width: 0.0,
            low: Vec3::INFINITY,
            high: Vec3::NEG_INFINITY,
            axis,
            cosine: 1.0,
        }
    }

    fn push(&mut self, mesh: &Mesh, patch: &Patch, first: u32, block: &[u32], sharing: Sharing) {
        let first_row = self.places.len() as u32;
        let mut with_rows = Vec::new();
        for &k in block {
            self.elements.push(first + k);
            let (corners, count) = patch.frame.tile(patch.element_tile(k)).corners();
            for corner in &corners[..count] {
                (self.low, self.high) = (self.low.min(corner.as_vec3()), self.high.max(corner.as_vec3()));
            }
            let Some(point) = patch.sample_point(k, mesh.valid[(patch.first_element + k) as usize]) else {
                self.rows.push(None);
                continue;
            };
            let width = patch.element_area(k).sqrt();
            if width < sharing.below {
                self.width = self.width.max(2.0 * sharing.reach as f32);
                let near = |&(place, normal): &(DVec3, DVec3)| {
                    (point - place).length_squared() <= sharing.reach * sharing.reach
                        && normal.dot(patch.normal) >= ALIKE
                };
                if let Some(row) = self.places.iter().position(near) {
                    self.rows.push(Some(row as u32));
                    continue;
                }
            }
            self.width = self.width.max(width as f32);
            let row = self.places.len() as u32;
            self.rows.push(Some(row));
            self.places.push((point, patch.normal));
            self.points.push(point, patch.normal, patch.plane, row);
            with_rows.push(k);
        }
        if !with_rows.is_empty() {
            self.patches.push((*patch, with_rows, first_row));
        }
    }

    fn close(&mut self) {
        let sum: DVec3 = self.places.iter().map(|place| place.1).sum();
        self.axis = sum.try_normalize().map_or(self.axis, |sum| sum.as_vec3());
        self.cosine = self.places.iter().map(|place| place.1.as_vec3().dot(self.axis)).fold(1.0, f32::min);
    }

    /// Collects the sample points that face the shooter, with the cells above their horizon.
    pub fn collect(&self, mesh: &Mesh, shot: &Shot, work: &mut Work) {
        work.clear();
        for (patch, block, name) in &self.patches {
            if may_face(patch, shot) {
                work.collect(mesh, patch, block.iter().copied().zip(*name..), shot, NEAR);
            }
        }
    }
}

/// The elements of a patch in blocks of neighbours.
fn blocks(patch: &Patch) -> Vec<Vec<u32>> {
    let [columns, rows] = patch.grid;
    if patch.frame.layout == Layout::Triangle || columns * rows <= TOGETHER {
        let all: Vec<u32> = (0..patch.element_count()).collect();
        return all.chunks(TOGETHER as usize).map(<[u32]>::to_vec).collect();
    }
    let starts = |n: u32| (0..n).step_by(SIDE as usize);
    let block = |row: u32, column: u32| {
        let columns_here = column..columns.min(column + SIDE);
        (row..rows.min(row + SIDE)).flat_map(|r| columns_here.clone().map(move |c| r * columns + c)).collect()
    };
    starts(rows).flat_map(|row| starts(columns).map(move |column| block(row, column))).collect()
}
