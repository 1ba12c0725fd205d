//! How many cells a receiver needs of a shooter (paper, section 3.2): as many as the light at stake asks for.
//!
//! M cells across the edge of a shadow err by about 0.27 M^(-3/4) of the light E that the shooter gives at most (root of the mean
//! square, DESIGN section 3). Errors of many shots add by their squares; of all M that together err by as much, those in
//! proportion to E^(4/5) cost least.

use super::among::{Among, Levels};
use super::{Solver, State, World};
use crate::mesh::{ALL_VALID, Cluster, Mesh, Patch};
use crate::shooting::{self, ClusterLight, Shot, Source, direction, distance, most_facing, strength};
use glam::Vec3;
use rayon::prelude::*;
use std::f32::consts::PI;
use std::iter;
use std::ops::Range;
use std::sync::Arc;

/// Error of one cell, see above.
const OF_ONE: f32 = 0.27;

/// Shots of equal strength that would add up to a block's light, to the power of 1/6: 300.
const SHOTS: f32 = 2.6;

/// Of a block that is nearly dark, errors are relative to this share of what all emitted light would give if it were spread
/// evenly over a sphere around the scene.
const FLOOR: f32 = 0.02;

/// What light within one of 1, 4 and 16 cells may differ by, as a share of the cell's (root of the mean square). Measured: in two rooms
/// with a door ajar, 0.5 for all errs twice as much as 0.12; in an office, 0.35 for all takes 1.4 times the rays of none.
const UNEVEN: [f32; 3] = [0.2, 0.6, 0.6];

/// Elements of a block, unless one patch has more.
const TOGETHER: u32 = 16;

/// From how many cells receivers need the light of each shot.
pub struct Precision {
    /// Cells along a side from which a patch shoots, for some receivers or others.
    pub sides: Vec<u32>,
    /// Those who are asked together, cluster by cluster: none if all receive from as many.
    blocks: Vec<Vec<Block>>,
    /// Where the patches of each own cluster begin among those of all.
    starts: Arc<[u32]>,
    /// Shares of a receiver's light that ask for more than 1, 4 and 16 cells.
    bounds: [f32; 3],
}

/// Neighbouring patches of a cluster.
struct Block {
    patches: u32,
    /// Within the cluster.
    elements: Range<usize>,
    low: Vec3,
    high: Vec3,
    /// Unit vector about which their normals lie, and the least cosine between it and one of those.
    axis: Vec3,
    cosine: f32,
}

impl Precision {
    /// Of the receivers of this rank.
    pub fn new(world: &World<'_>) -> Precision {
        let (mesh, own) = (world.mesh, &world.share.own);
        let Solver::PlainTo(error) = world.settings.solver else {
            let sides = vec![world.settings.cells.isqrt()];
            return Precision { sides, blocks: Vec::new(), starts: Arc::default(), bounds: [0.0; 3] };
        };
        let mut starts = vec![0];
        for &cluster in own {
            starts.push(starts[starts.len() - 1] + mesh.clusters[cluster as usize].patches.len() as u32);
        }
        Precision {
            sides: vec![1, 2, 4, 8],
            blocks: own.par_iter().map(|&cluster| Block::of(mesh, &mesh.clusters[cluster as usize])).collect(),
            starts: starts.into(),
            bounds: [2.0, 8.0, 32.0].map(|cells| least_share(cells, error as f32)),
        }
    }

    /// Which patches of own clusters receive which of these shots of one patch from more and more cells.
    pub fn among(&self, world: &World<'_>, state: &State, shots: &[Shot]) -> Vec<Among> {
        let (Solver::PlainTo(_), [.., finest]) = (world.settings.solver, shots) else {
            return vec![Among::default(); shots.len()];
        };
        let Source::Patch(source) = &finest.source else { return vec![Among::default(); shots.len()] };
        let mesh = world.mesh;
        let sphere = 4.0 * std::f64::consts::PI * world.radius * world.radius;
        let floor = FLOOR * (state.emitted / 3.0 / sphere) as f32;
        let least = least_level(mesh, &mesh.patch(source.patch), &self.sides).max(level_of_light(shots));
        let of_block = |block: &Block, light: &ClusterLight| {
            let most = block.most_light(finest);
            let elements = &light.elements[block.elements.clone()];
            let own = elements.iter().map(|e| strength(e.mean())).sum::<f32>() / elements.len() as f32;
            let share = most / (own + most).max(floor);
            self.bounds.iter().filter(|&&bound| share > bound).count().max(least) as u8
        };
        let of_cluster = |(blocks, light): (&Vec<Block>, &ClusterLight)| -> Vec<u8> {
            blocks.iter().flat_map(|block| iter::repeat_n(of_block(block, light), block.patches as usize)).collect()
        };
        let of = self.blocks.par_iter().zip(&state.clusters).flat_map_iter(of_cluster).collect();
        Among::of_levels(Levels { starts: self.starts.clone(), of }, shots.len())
    }
}

/// From how many cells a patch shoots at least, for its light: what is dark is often hidden from those who see what is bright, and would
/// hide it from them too if both were one cell. Of cells that each hold the mean of finer ones the mean square tells how much these
/// differ within them.
fn level_of_light(shots: &[Shot]) -> usize {
    let mean_square = |shot: &Shot| {
        let squares = shot.light.iter().map(|&cell| strength(cell) * strength(cell)).sum::<f32>();
        squares / shot.light.len() as f32
    };
    let Some(finest) = shots.last().map(mean_square) else { return 0 };
    let is_even = |(shot, uneven): (&Shot, f32)| finest <= (1.0 + uneven * uneven) * mean_square(shot);
    shots.iter().zip(UNEVEN).position(is_even).unwrap_or(shots.len() - 1)
}

/// From how many cells a patch shoots at least: from one that is free, and from 4 if some of it is covered, as then what stands on it
/// sees only the free part.
fn least_level(mesh: &Mesh, patch: &Patch, sides: &[u32]) -> usize {
    let is_free = patch.elements().all(|element| mesh.valid[element as usize] == ALL_VALID);
    let enough = |&side: &u32| is_free || side >= 2 && shooting::has_free_cell(mesh, patch, side);
    sides.iter().position(enough).unwrap_or(sides.len() - 1)
}

/// The least share of a block's light that asks for more than so many cells: M = x^(4/5) (0.27/error)^(4/3) n^(2/15), if n shots make
/// the light, solved for x. The power of 5/3 is 13/8 here: roots are the same bits everywhere.
fn least_share(cells: f32, error: f32) -> f32 {
    let (y, root) = (error / OF_ONE, (error / OF_ONE).sqrt());
    cells * cells.sqrt().sqrt() * y * root * root.sqrt().sqrt() / SHOTS
}

impl Block {
    /// Those of a cluster.
    fn of(mesh: &Mesh, cluster: &Cluster) -> Vec<Block> {
        let mut blocks: Vec<Block> = Vec::new();
        for patch in cluster.patches.clone().map(|id| mesh.patch(id)) {
            let start = (patch.first_element - cluster.elements.start) as usize;
            let elements = start..start + patch.element_count() as usize;
            let is_full = blocks.last().is_none_or(|last| last.elements.len() + elements.len() > TOGETHER as usize);
            if is_full {
                let (low, high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
                blocks.push(Block { patches: 0, elements: start..start, low, high, axis: Vec3::ZERO, cosine: 1.0 });
            }
            let Some(block) = blocks.last_mut() else { continue };
            block.patches += 1;
            block.elements.end = elements.end;
            let (corners, count) = patch.frame.corners();
            for corner in corners[..count].iter().map(|corner| corner.as_vec3()) {
                (block.low, block.high) = (block.low.min(corner), block.high.max(corner));
            }
            let normal = patch.normal.as_vec3();
            if block.patches == 1 {
                block.axis = normal;
            }
            block.cosine = block.cosine.min(block.axis.dot(normal));
        }
        blocks
    }

    /// The light that a patch may give to these: all its power from the nearest point (P·G), or its brightest cell's.
    fn most_light(&self, shot: &Shot) -> f32 {
        let Source::Patch(source) = &shot.source else { return f32::INFINITY };
        let peak = shot.light.iter().map(|&cell| strength(cell)).fold(0.0, f32::max);
        let shooter = (source.low.as_vec3(), source.high.as_vec3());
        let middle = (shooter.0 + shooter.1) / 2.0;
        let Some((towards, away)) = direction(middle, (self.low + self.high) / 2.0) else { return peak };
        let slack = ((self.high - self.low).length() / 2.0 + (shooter.1 - shooter.0).length() / 2.0) / away;
        let leaving = most_facing(source.normal.as_vec3(), 1.0, towards, slack).max(0.0);
        let arriving = most_facing(self.axis, self.cosine, -towards, slack).max(0.0);
        let distance = distance((self.low, self.high), shooter);
        let light = shot.power as f32 / 3.0 * leaving * arriving / (PI * distance * distance);
        if light < peak { light } else { peak }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::fixture;
    use crate::shooting::{Field, Shoot};

    #[test]
    fn what_is_lit_and_what_is_dark_does_not_shoot_from_one_cell() {
        let obj = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nusemtl grey\nf 1 2 3 4\n";
        let solution = fixture::solve(fixture::read(obj), 0.25, 1.0);
        let (mesh, patch) = (&solution.mesh, solution.mesh.patch(0));
        let level = |light: fn(u32, u32) -> f64| {
            let light: Vec<[f64; 3]> = (0..16).map(|k| [light(k % 4, k / 4); 3]).collect();
            let shots = [1, 2, 4, 8].map(|side| Field::new(mesh, &patch, &light).shot(side, Shoot::Elements, 1.0));
            level_of_light(&shots)
        };
        assert_eq!(level(|_, _| 1.0), 0);
        assert_eq!(level(|column, _| 1.0 + 0.02 * f64::from(column)), 0);
        assert_eq!(level(|column, _| f64::from(column / 2)), 1);
        assert_eq!(level(|column, row| f64::from(u32::from(column + row == 0))), 2);
    }

    #[test]
    fn blocks_are_neighbours_and_hold_every_patch_once() {
        let obj = fixture::closed_box("grey");
        let solution = fixture::solve(fixture::read(&obj), 0.1, 1.0);
        let mesh = &solution.mesh;
        for cluster in &mesh.clusters {
            let blocks = Block::of(mesh, cluster);
            let (mut patch, mut element) = (cluster.patches.start, 0);
            for block in &blocks {
                assert_eq!(block.elements.start, element);
                for _ in 0..block.patches {
                    let of = mesh.patch(patch);
                    let middle = of.frame.at(crate::mesh::Frame::middle(of.frame.layout)).as_vec3();
                    assert!(middle.cmpge(block.low).all() && middle.cmple(block.high).all());
                    assert!(block.axis.dot(of.normal.as_vec3()) >= block.cosine);
                    (patch, element) = (patch + 1, element + of.element_count() as usize);
                }
                assert_eq!(block.elements.end, element);
            }
            assert_eq!((patch, element), (cluster.patches.end, cluster.elements.len()));
        }
        assert!(mesh.clusters.len() < mesh.patch_count() / 8);
    }
}
