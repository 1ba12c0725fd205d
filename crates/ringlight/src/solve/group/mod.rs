//! Group shooting: every receiver takes its own cut through the tree of all that shoots.

mod cut;
mod links;

use super::{Control, Observer, Progress, Ring, State, StopReason, World};
use crate::mesh::Mesh;
use crate::shooting::{self, ClusterLight, ElementLight, PatchLight, Radiosity, Receivers, ShooterTree, TreeLight};
use crate::transport::{Communicator, Failure};
use cut::{Cut, Tolerance};
use links::Links;
use rayon::prelude::*;
use ringlight_visibility::Tally;

static DARK: std::sync::atomic::AtomicUsize = std::sync::atomic::AtomicUsize::new(0);
/// Rounds: how much looser than asked each of them cuts.
const ROUNDS: [f32; 2] = [8.0, 1.0];

/// Most passes of light over the links of a round.
const PASSES: usize = 64;

/// Passes end when the light of no element would change by more than this share.
const SETTLED: f32 = 1e-4;

fn tune(name: &'static str, default: f32) -> f32 {
    use std::cell::RefCell;
    thread_local!(static SEEN: RefCell<Vec<(&'static str, f32)>> = const { RefCell::new(Vec::new()) });
    SEEN.with_borrow_mut(|seen| {
        if let Some(&(_, v)) = seen.iter().find(|s| s.0.as_ptr() == name.as_ptr()) {
            return v;
        }
        let v = std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(default);
        seen.push((name, v));
        v
    })
}

/// Solves for all light at once, to a relative error of about `error`.
pub fn group(
    world: &World<'_>,
    ring: &mut Ring<'_>,
    state: &mut State,
    error: f64,
    ranks: &mut Communicator<'_>,
    observer: &mut dyn Observer,
) -> Result<(StopReason, Progress), Failure> {
    let mesh = world.mesh;
    while let Some(emitter) = world.emitters.get(state.emitters_shot as usize) {
        let job = ring.begin(emitter);
        ring.commit(ranks, job, emitter, &mut state.clusters)?;
        state.emitters_shot += 1;
        state.shots += 1;
    }
    let time = std::time::Instant::now();
    let tree = ShooterTree::new(mesh);
    eprintln!("tree {} nodes {:.3}s", tree.nodes.len(), time.elapsed().as_secs_f64());
    let direct: Vec<ElementLight> = state.clusters.iter().flat_map(|c| c.elements.iter().copied()).collect();
    let mut received: Vec<[f32; 3]> = direct.iter().map(ElementLight::mean).collect();
    let mut tally = Tally::default();
    let mut progress = Progress::default();
    for (round, looser) in ROUNDS.into_iter().enumerate() {
        let floor = floor(mesh, &received, &radiosities(mesh, &received));
        // What is not known yet is guessed, so that there are links for it.
        let guessed: Vec<[f32; 3]> = received.iter().map(|e| e.map(|e| if round == 0 { e + floor } else { e })).collect();
        let elements = radiosities(mesh, &guessed);
        let mut light = TreeLight::new(&tree, &elements);
        let reference: Vec<f32> = guessed.iter().map(|&e| shooting::strength(e).max(floor)).collect();
        let tolerance = Tolerance { share: looser * error as f32 * tune("RL_TAU", 0.1), seen: tune("RL_K", 4.0) };
        let time = std::time::Instant::now();
        let cut = Cut { mesh, tree: &tree, light: &light, elements: &elements, hierarchy: ring.hierarchy(), tolerance };
        let links: Vec<(Vec<Links>, Tally)> = (0..mesh.clusters.len())
            .into_par_iter()
            .map_init(cut::Buffers::default, |buffers, cluster| {
                let cluster = &mesh.clusters[cluster];
                let mut tally = Tally::default();
                let links = Receivers::of(mesh, cluster)
                    .into_iter()
                    .map(|receivers| {
                        let own = receivers.elements.iter().map(|e| reference[(cluster.elements.start + e) as usize]);
                        let start = cluster.elements.start;
                        let dark = |e: &u32| received[(start + e) as usize] == [0.0; 3];
                        if round > 0 && receivers.elements.iter().all(dark) {
                            // Who saw nothing of anything is inside something.
                            DARK.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                            return Links::default();
                        }
                        let least = own.fold(f32::INFINITY, f32::min);
                        cut.links(&receivers, cluster.elements.start, least, buffers, &mut tally)
                    })
                    .collect();
                (links, tally)
            })
            .collect();
        tally = links.iter().fold(tally, |a, b| a.join(b.1));
        let links: Vec<Links> = links.into_iter().flat_map(|l| l.0).collect();
        let count: usize = links.iter().map(Links::len).sum();
        let pairs: usize = links.iter().map(Links::pairs).sum();
        eprintln!(
            "round {round}: {count} links, {:.1} per element, {:.1} M rays, {:.2} s",
            pairs as f64 / mesh.element_count() as f64,
            tally.rays as f64 / 1e6,
            time.elapsed().as_secs_f64()
        );
        eprintln!("  probes, blocked, seen but open, seen: {:?}", cut::PROBES.each_ref().map(|p| p.swap(0, std::sync::atomic::Ordering::Relaxed)));
        eprintln!("  dark {}", DARK.swap(0, std::sync::atomic::Ordering::Relaxed));
        let c = |i: usize| cut::COUNTS[i].swap(0, std::sync::atomic::Ordering::Relaxed);
        for (i, n) in ["group far", "group near", "piece far", "piece near", "element far", "element near"].into_iter().enumerate() {
            eprintln!("  {n}: {} links, {:.1} M rays, {} far that see", c(i), c(8 + i) as f64 / 1e6, c(16 + i));
        }
        let time = std::time::Instant::now();
        let mut passes = 0;
        let mut correction = Vec::new();
        for _ in 0..PASSES {
            passes += 1;
            let mut next: Vec<[f32; 3]> = direct.iter().map(ElementLight::mean).collect();
            let found: Vec<Vec<(u32, [f32; 3], [f32; 3])>> = links.par_iter().map(|l| l.gather(&light)).collect();
            correction = vec![[0.0f32; 3]; next.len()];
            for (element, mean, point) in found.into_iter().flatten() {
                (0..3).for_each(|c| next[element as usize][c] += mean[c]);
                correction[element as usize] = point;
            }
            let change = received.iter().zip(&next).map(|(a, b)| (a[0] - b[0]).abs() / b[0].max(1e-12)).fold(0.0, f32::max);
            received = next;
            light.renew(&tree, &radiosities(mesh, &received));
            if change < SETTLED {
                break;
            }
        }
        eprintln!("{passes} passes {:.2} s", time.elapsed().as_secs_f64());
        put(mesh, &mut state.clusters, &direct, &received, &correction);
        progress = Progress {
            shots: state.shots,
            unshot_share: 0.0,
            rays: tally.rays,
            masks: tally.masks,
            masks_without_rays: tally.masks_without_rays,
        };
        observer.observe(&progress);
        if let Control::Stop(reason) = observer.control() {
            return Ok((reason, progress));
        }
    }
    Ok((StopReason::Converged, progress))
}

/// Radiosity of each element that has received so much.
fn radiosities(mesh: &Mesh, received: &[[f32; 3]]) -> Vec<Radiosity> {
    let of_cluster = |cluster: &crate::mesh::Cluster| {
        let patches = cluster.patches.clone().map(|id| mesh.patch(id));
        let all = patches.flat_map(|patch| patch.elements().map(move |e| (patch, e)));
        let radiosity = |(patch, e): (crate::mesh::Patch, u32)| {
            let light = ElementLight { shot: received[e as usize], ..ElementLight::default() };
            shooting::radiosity(mesh, &patch, e, &light).map(|x| x as f32)
        };
        all.map(radiosity).collect::<Vec<_>>()
    };
    mesh.clusters.par_iter().flat_map_iter(of_cluster).collect()
}

/// What the error of each element is relative to: its own light, and a share of what is usual.
fn floor(mesh: &Mesh, received: &[[f32; 3]], elements: &[Radiosity]) -> f32 {
    let mut lit: Vec<f32> = received.iter().map(|&e| shooting::strength(e)).filter(|&e| e > 0.0).collect();
    if lit.len() * 2 > mesh.element_count() {
        let middle = lit.len() / 2;
        *lit.select_nth_unstable_by(middle, f32::total_cmp).1 * tune("RL_FLOOR", 0.1)
    } else {
        // Nobody knows yet: as if all exitance were spread over all surfaces and half of it came back.
        let (mut power, mut area) = (0.0, 0.0);
        for id in 0..mesh.patch_count() as u32 {
            let patch = mesh.patch(id);
            for (k, e) in patch.elements().enumerate() {
                let free = patch.element_area(k as u32) * mesh.valid_share(e);
                power += free * f64::from(shooting::strength(elements[e as usize]));
                area += free;
            }
        }
        (power / area) as f32
    }
}

/// Puts the light in its place: all of it is shot.
fn put(
    mesh: &Mesh,
    clusters: &mut [ClusterLight],
    direct: &[ElementLight],
    received: &[[f32; 3]],
    correction: &[[f32; 3]],
) {
    for (light, cluster) in clusters.iter_mut().zip(&mesh.clusters) {
        for (k, element) in light.elements.iter_mut().enumerate() {
            let e = cluster.elements.start as usize + k;
            element.shot = received[e];
            element.unshot = [0.0; 3];
            element.correction = std::array::from_fn(|c| direct[e].correction[c] + correction[e][c]);
        }
        light.patches.fill(PatchLight::default());
    }
}
