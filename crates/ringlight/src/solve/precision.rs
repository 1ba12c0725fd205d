//! How many cells a receiver needs of a shooter (paper, section 3.2): as many as the light at stake asks for.
//!
//! M cells across the edge of a shadow err by about 0.27 M^(-3/4) of the light E that the shooter gives at most (root of the mean
//! square, DESIGN section 3). Errors of many shots add by their squares; of all M that together err by as much, those in
//! proportion to E^(4/5) cost least.

use super::ring::Among;
use super::{SolveSettings, Solver, State, World};
use crate::mesh::{ALL_VALID, Mesh, Patch};
use crate::shooting::{self, ClusterLight, Shot, Source, direction, distance, most_facing, strength};
use glam::Vec3;
use rayon::prelude::*;
use std::f32::consts::PI;
use std::sync::Arc;

/// Error of one cell, see above.
const OF_ONE: f32 = 0.27;

/// Shots of equal strength that would add up to a cluster's light, to the power of 1/6: 300.
const SHOTS: f32 = 2.6;

/// Of a cluster that is nearly dark, errors are relative to this share of what all emitted light would give if it were spread
/// evenly over a sphere around the scene.
const FLOOR: f32 = 0.02;

/// Cells along a side from which a patch shoots, for some receivers or others.
pub fn sides(settings: &SolveSettings) -> Vec<u32> {
    match settings.solver {
        Solver::PlainTo(_) => vec![1, 2, 4, 8],
        _ => vec![settings.cells.isqrt()],
    }
}

/// Which own clusters receive which of these shots of one patch from more and more cells.
pub fn among(world: &World<'_>, state: &State, shots: &[Shot]) -> Vec<Among> {
    let (Solver::PlainTo(error), [.., finest]) = (world.settings.solver, shots) else { return vec![None; shots.len()] };
    let mesh = world.mesh;
    let sphere = 4.0 * std::f64::consts::PI * world.radius * world.radius;
    let floor = FLOOR * (state.emitted / 3.0 / sphere) as f32;
    let bounds = [2.0, 8.0, 32.0].map(|cells| least_share(cells, error as f32));
    let own = world.share.own.par_iter().zip(&state.clusters);
    let Source::Patch(source) = &finest.source else { return vec![None; shots.len()] };
    let least = least_level(mesh, &mesh.patch(source.patch), &sides(&world.settings));
    let of_cluster = |(&cluster, light): (&u32, &ClusterLight)| {
        let cluster = &mesh.clusters[cluster as usize];
        let most = most_light(finest, (cluster.low, cluster.high));
        let own = light.elements.iter().map(|e| strength(e.mean())).sum::<f32>() / light.elements.len() as f32;
        let share = most / (own + most).max(floor);
        bounds.iter().filter(|&&bound| share > bound).count().max(least)
    };
    let levels: Vec<usize> = own.map(of_cluster).collect();
    (0..shots.len()).map(|level| Some(Arc::from_iter(levels.iter().map(|&of| of == level)))).collect()
}

/// From how many cells a patch shoots at least: from one that is free, and from 4 if some of it is covered, as then what stands on it
/// sees only the free part.
fn least_level(mesh: &Mesh, patch: &Patch, sides: &[u32]) -> usize {
    let is_free = patch.elements().all(|element| mesh.valid[element as usize] == ALL_VALID);
    let enough = |&side: &u32| is_free || side >= 2 && shooting::has_free_cell(mesh, patch, side);
    sides.iter().position(enough).unwrap_or(sides.len() - 1)
}

/// The least share of a cluster's light that asks for more than so many cells: M = x^(4/5) (0.27/error)^(4/3) n^(2/15), if n shots make
/// the light, solved for x. The power of 5/3 is 13/8 here: roots are the same bits everywhere.
fn least_share(cells: f32, error: f32) -> f32 {
    let (y, root) = (error / OF_ONE, (error / OF_ONE).sqrt());
    cells * cells.sqrt().sqrt() * y * root * root.sqrt().sqrt() / SHOTS
}

/// The light that a patch may give within a box: all its power from the nearest point (P·G), or its brightest cell's.
fn most_light(shot: &Shot, (low, high): (Vec3, Vec3)) -> f32 {
    let Source::Patch(source) = &shot.source else { return f32::INFINITY };
    let peak = shot.light.iter().map(|&cell| strength(cell)).fold(0.0, f32::max);
    let shooter = (source.low.as_vec3(), source.high.as_vec3());
    let middle = (shooter.0 + shooter.1) / 2.0;
    let Some((towards, away)) = direction(middle, (low + high) / 2.0) else { return peak };
    let slack = ((high - low).length() / 2.0 + (shooter.1 - shooter.0).length() / 2.0) / away;
    let leaving = most_facing(source.normal.as_vec3(), 1.0, towards, slack).max(0.0);
    let distance = distance((low, high), shooter);
    let light = shot.power as f32 / 3.0 * leaving / (PI * distance * distance);
    if light < peak { light } else { peak }
}
