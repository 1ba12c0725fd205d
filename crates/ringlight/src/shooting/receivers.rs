//! Neighbouring elements that look at the shooter tree together.

use super::faces::Faces;
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

/// Least cosine between the normals of those that go together.
const ALIKE: f32 = 0.5;

/// So many elements of a cluster that face the same way go together, and with no others: what they look at is the same, and they
/// look in the same directions.
const MANY: u32 = 4;

/// Least cosine between the normals of those that face the same way.
const PARALLEL: f32 = 0.9999;

/// Elements nearer to the shooter than this many of their widths also take area samples: the second-order mean of one point errs
/// by (width/distance)⁴/100 of what comes from one element.
const NEAR: f64 = 1.5;

/// Some elements of neighbouring patches.
#[derive(Clone, Debug)]
pub struct Receivers {
    /// Patches, the numbers of their elements that belong here, and what the first is called; names are consecutive.
    patches: Vec<(Patch, Vec<u32>, u32)>,
    /// Elements of the cluster, in the order of names.
    pub elements: Vec<u32>,
    /// Their sample points; elements without one are left out.
    pub points: FarReceivers,
    /// Width of the widest element, metres.
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

/// Elements of a cluster that face the same way.
struct Facing {
    normal: Vec3,
    elements: u32,
    /// The last group of them.
    group: Option<usize>,
}

impl Facing {
    /// Which of these a patch has.
    fn of(facings: &[Facing], patch: &Patch) -> Option<usize> {
        facings.iter().position(|facing| facing.normal.dot(patch.normal.as_vec3()) >= PARALLEL)
    }
}

impl Receivers {
    /// Those of a cluster that have light of their own. Elements are numbered within it.
    pub fn of(mesh: &Mesh, faces: &Faces, cluster: &Cluster) -> Vec<Receivers> {
        let own = cluster.patches.clone().map(|id| mesh.patch(id)).filter(|patch| faces.is_own(patch.first_element));
        let own: Vec<Patch> = own.collect();
        let mut facings: Vec<Facing> = Vec::new();
        for patch in &own {
            let at = Facing::of(&facings, patch).unwrap_or(facings.len());
            if at == facings.len() {
                facings.push(Facing { normal: patch.normal.as_vec3(), elements: 0, group: None });
            }
            facings[at].elements += patch.element_count();
        }
        let mut all: Vec<Receivers> = Vec::new();
        // What others that face roughly alike may join.
        let mut mixed = None;
        for patch in &own {
            let facing =
                Facing::of(&facings, patch).map(|at| &mut facings[at]).filter(|facing| facing.elements >= MANY);
            let group = facing.map_or(&mut mixed, |facing| &mut facing.group);
            let first = patch.first_element - cluster.elements.start;
            for block in blocks(patch) {
                let joins = |&k: &usize| {
                    let Receivers { elements, axis, .. } = &all[k];
                    elements.len() + block.len() <= TOGETHER as usize && axis.dot(patch.normal.as_vec3()) >= ALIKE
                };
                let place = group.filter(joins).unwrap_or_else(|| {
                    all.push(Receivers::none());
                    all.len() - 1
                });
                *group = Some(place);
                all[place].push(mesh, patch, first, block);
            }
        }
        all.iter_mut().for_each(Receivers::close);
        all
    }

    fn none() -> Receivers {
        let (low, high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        Receivers {
            patches: Vec::new(),
            elements: Vec::new(),
            points: FarReceivers::default(),
            width: 0.0,
            low,
            high,
            axis: Vec3::ZERO,
            cosine: 1.0,
        }
    }

    fn push(&mut self, mesh: &Mesh, patch: &Patch, first: u32, block: Vec<u32>) {
        for (&k, name) in block.iter().zip(self.elements.len() as u32..) {
            if let Some(point) = patch.sample_point(k, mesh.valid[(patch.first_element + k) as usize]) {
                self.points.push(point, patch.normal, patch.plane, name);
            }
            self.width = self.width.max(patch.element_area(k).sqrt() as f32);
            let (corners, count) = patch.frame.tile(patch.element_tile(k)).corners();
            for corner in &corners[..count] {
                (self.low, self.high) = (self.low.min(corner.as_vec3()), self.high.max(corner.as_vec3()));
            }
        }
        if self.patches.is_empty() {
            self.axis = patch.normal.as_vec3();
        }
        let name = self.elements.len() as u32;
        self.elements.extend(block.iter().map(|k| first + k));
        self.patches.push((*patch, block, name));
    }

    fn close(&mut self) {
        let sum: DVec3 = self.patches.iter().map(|(patch, ..)| patch.normal).sum();
        self.axis = sum.try_normalize().unwrap_or(DVec3::Z).as_vec3();
        self.cosine = self.patches.iter().map(|(patch, ..)| patch.normal.as_vec3().dot(self.axis)).fold(1.0, f32::min);
    }

    /// Patches, the numbers of their elements that belong here, and what the first is called; names are consecutive.
    pub fn patches(&self) -> &[(Patch, Vec<u32>, u32)] {
        &self.patches
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
