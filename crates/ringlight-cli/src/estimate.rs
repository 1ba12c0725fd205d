//! How long a solve will take, foretold from counted work.
//!
//! Of plain refinement shots are counted by playing progressive refinement in an enclosure of the scene's patches in which every patch sees all
//! others equally: light is lost only by absorption. Open scenes lose more and need fewer shots. Rays are counted from the
//! share of (patch, element) pairs that face each other. Of group shooting the library counts the rays, and their speed is that
//! of rays over the hemispheres of elements all over the scene.

use rayon::prelude::*;
use ringlight::mesh::{Frame, Mesh, Patch, walk};
use ringlight::shooting::{Glance, spiral};
use ringlight_visibility::Hierarchy;
use std::time::Instant;

/// Patches that stand for all.
const SAMPLES: usize = 1000;

/// A play ends after this many shots of each patch.
const ROUNDS: usize = 100;

/// Work foretold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Work {
    /// Shots until the unshot share is reached.
    pub shots: f64,
    /// Rays of all shots.
    pub rays: f64,
}

/// Foretells the work down to an unshot share of `until` with `cells` cells; `emitters` is the number of lights that are no
/// surfaces.
pub fn work(mesh: &Mesh, emitters: usize, cells: u32, until: f64) -> Work {
    let emitting = (0..mesh.patch_count() as u32).filter(|&id| emits(mesh, &mesh.patch(id))).count();
    let shots = (emitters + emitting) as f64 + reflecting_shots(mesh, until);
    Work { shots, rays: shots * facing_share(mesh) * mesh.element_count() as f64 * f64::from(cells) }
}

fn emits(mesh: &Mesh, patch: &Patch) -> bool {
    patch.elements().any(|element| mesh.colour(patch, element).emits())
}

/// Every n-th patch, and n.
fn sample(mesh: &Mesh, count: usize) -> (impl Iterator<Item = Patch> + '_, f64) {
    let step = mesh.patch_count().div_ceil(count).max(1);
    ((0..mesh.patch_count()).step_by(step).map(|id| mesh.patch(id as u32)), step as f64)
}

/// Shots of reflected light after all emission, of total power 1, has been shot.
fn reflecting_shots(mesh: &Mesh, until: f64) -> f64 {
    let (patches, weight) = sample(mesh, SAMPLES);
    let patches: Vec<[f64; 2]> = patches
        .map(|patch| {
            let returned = mesh.colour(&patch, patch.first_element).returned();
            let reflectance = returned.iter().map(|&r| f64::from(r)).sum::<f64>() / 3.0;
            [patch.area, reflectance * patch.area]
        })
        .collect();
    let area = weight * patches.iter().map(|p| p[0]).sum::<f64>();
    // Irradiance so far, and what it was when each patch shot last.
    let mut irradiance = 1.0 / area;
    let mut shot_at = vec![0.0; patches.len()];
    let mut shots = 0.0;
    for _ in 0..ROUNDS * patches.len() {
        let unshot = |(p, at): (&[f64; 2], &f64)| p[1] * (irradiance - at);
        let powers = || patches.iter().zip(&shot_at).map(unshot);
        if weight * powers().sum::<f64>() <= until {
            break;
        }
        let Some((best, power)) = powers().enumerate().max_by(|a, b| a.1.total_cmp(&b.1)) else { break };
        shot_at[best] = irradiance;
        irradiance += weight * power / area;
        shots += weight;
    }
    shots
}

/// Share of (patch, element) pairs that face each other.
fn facing_share(mesh: &Mesh) -> f64 {
    let middle = |patch: &Patch| patch.frame.at(Frame::middle(patch.frame.layout));
    let (receivers, _) = sample(mesh, SAMPLES);
    let receivers: Vec<_> = receivers.map(|p| (middle(&p), p.normal, f64::from(p.element_count()))).collect();
    let (mut facing, mut all) = (0.0, 0.0);
    for shooter in sample(mesh, SAMPLES / 10).0 {
        let from = middle(&shooter);
        for &(to, normal, elements) in &receivers {
            let way = to - from;
            all += elements;
            if way.dot(shooter.normal) > 0.0 && way.dot(normal) < 0.0 {
                facing += elements;
            }
        }
    }
    if all > 0.0 { facing / all } else { 0.0 }
}

/// Rays that elements follow over their hemispheres, on all threads, per second; measured for `seconds`.
pub fn looks_per_second(mesh: &Mesh, hierarchy: &Hierarchy, seconds: f64) -> f64 {
    let directions = spiral(64);
    let patches: Vec<Patch> = sample(mesh, SAMPLES).0.collect();
    let look = |patch: &Patch, turn: u32| {
        let number = turn % patch.element_count();
        let valid = mesh.valid[(patch.first_element + number) as usize];
        let Some(point) = patch.sample_point(number, valid) else { return 0 };
        for glance in Glance::about(mesh, &[(point, patch.plane)], patch.normal, &directions) {
            walk::run(mesh, hierarchy, glance);
        }
        directions.len() as u64
    };
    let start = Instant::now();
    let mut rays = 0;
    for turn in 0.. {
        rays += patches.par_iter().map(|patch| look(patch, turn)).sum::<u64>();
        if start.elapsed().as_secs_f64() >= seconds {
            break;
        }
    }
    rays as f64 / start.elapsed().as_secs_f64()
}
