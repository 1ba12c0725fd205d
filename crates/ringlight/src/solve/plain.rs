//! Plain progressive refinement (paper, sections 1.1 and 2.2; Cohen et al. 1988).

use super::among::Among;
use super::choice::{Offer, Summary};
use super::precision::Precision;
use super::ring::Job;
use super::{Control, Observer, Progress, Ring, State, StopReason, StopRule, World};
use crate::shooting::{self, Audit, ClusterLight, PatchLight, Shot};
use crate::transport::{Communicator, Failure};
use rayon::prelude::*;
use ringlight_visibility::Cells;
use std::collections::VecDeque;
use std::sync::Arc;

/// Tag of the messages that choose the next shooter.
const CHOOSE: u32 = 1;

/// Tag of the messages that tell of it.
const SHOT: u32 = 5;

/// A shot under way: it has been chosen, and has not yet been committed.
struct Chosen {
    /// The same light from more and more cells, and who receives each.
    shots: Vec<(Arc<Shot>, Among)>,
    /// The patch, if it is one.
    patch: Option<u32>,
    /// What its elements had unshot when it was chosen; empty but at its owner.
    unshot: Vec<[f32; 3]>,
}

/// Shots that have been chosen and not committed, in order.
type UnderWay = VecDeque<(Vec<Job>, Chosen)>;

/// Shoots until `stop` or the observer ends it; every rank of the world calls it with the same settings. An error says
/// which rank failed.
///
/// Up to `shooters_in_flight` shots are under way at once: shot j is chosen when shot j − K has been committed, its light
/// is that of this moment, and it leaves the unshot light when it is committed, in the order of choice. Shots under way
/// when the run ends are dropped, and nothing is lost: their light is unshot still.
pub fn plain(
    world: &World<'_>,
    ring: &mut Ring<'_>,
    state: &mut State,
    stop: &StopRule,
    ranks: &mut Communicator<'_>,
    observer: &mut dyn Observer,
) -> Result<(StopReason, Progress), Failure> {
    let precision = Precision::new(world);
    let mut under_way = UnderWay::new();
    let mut audits = Audits::default();
    // Whether the observer is to be asked: it has waited, or a shot has been committed since.
    let mut news = true;
    loop {
        let control = if news { observer.control() } else { Control::default() };
        let summary = summarise(ring, state, &under_way, control);
        let joined = ranks
            .all_reduce_meanwhile(CHOOSE, summary.to_bytes(), Summary::join_bytes, &mut |ranks| ring.serve(ranks))?;
        let joined = Summary::from_bytes(joined);
        let progress = progress(world, state, &joined);
        if news {
            observer.observe(&progress);
            news = false;
        }
        let end = reason_to_stop(world, state, stop, &joined, &progress);
        if end.is_some() || joined.control.checkpoint {
            audits.settle(world, ring, state, ranks)?;
        }
        if joined.control.checkpoint {
            observer.checkpoint(state, ranks)?;
        }
        if joined.control.show {
            observer.show(state, ring, ranks)?;
        }
        if let Some(reason) = end {
            return Ok((reason, progress));
        }
        if joined.control.wait {
            news = true;
            continue;
        }
        let number = state.shots + under_way.len() as u64;
        let room = (under_way.len() as u64) < u64::from(world.settings.shooters_in_flight);
        let next = if room && stop.max_shots.is_none_or(|n| number < n) {
            choose((world, &precision), ring, state, &under_way, joined.offer, ranks)?
        } else {
            None
        };
        if let Some(next) = next {
            let jobs = next.shots.iter().map(|(shot, among)| ring.begin(shot, among)).collect();
            under_way.push_back((jobs, next));
            if (under_way.len() as u64) < u64::from(world.settings.shooters_in_flight) {
                continue;
            }
        }
        let Some((jobs, first)) = under_way.pop_front() else {
            audits.settle(world, ring, state, ranks)?;
            return Ok((StopReason::NothingLeft, progress));
        };
        for (job, (shot, among)) in jobs.into_iter().zip(&first.shots) {
            ring.commit(ranks, job, (shot, among), &mut state.clusters)?;
        }
        commit(world, state, &first);
        state.shots += 1;
        if let Some((finest, _)) = first.shots.last() {
            audits.add(world, ring, state, ranks, finest.clone())?;
        }
        news = true;
    }
}

fn reason_to_stop(
    world: &World<'_>,
    state: &State,
    stop: &StopRule,
    joined: &Summary,
    progress: &Progress,
) -> Option<StopReason> {
    if joined.control.stop.is_some() {
        return joined.control.stop;
    }
    if stop.max_shots.is_some_and(|n| state.shots >= n) {
        return Some(StopReason::MaxShots);
    }
    // Each emitter is shot before the stop rule may end a run.
    let emission_waits = (state.emitters_shot as usize) < world.emitters.len() || joined.emission_waits;
    (progress.unshot_share <= stop.until && !emission_waits).then_some(StopReason::Converged)
}

/// This rank's part of what is known before a shot.
fn summarise(ring: &Ring<'_>, state: &State, under_way: &UnderWay, control: Control) -> Summary {
    let mesh = ring.mesh();
    let own = ring.share().own.par_iter().zip(&state.clusters);
    let of_cluster = |(&cluster, light): (&u32, &ClusterLight)| {
        let mut summary = Summary::default();
        for (patch, id) in light.patches.iter().zip(mesh.clusters[cluster as usize].patches.start..) {
            if !under_way.iter().any(|(_, chosen)| chosen.patch == Some(id)) {
                summary.offer = summary.offer.better(Offer::new(patch.unshot_power, id));
            }
            summary.unshot.add(patch.unshot_power);
            summary.emission_waits |= patch.emission_waits && patch.unshot_power > 0.0;
        }
        summary
    };
    let joined = own.map(of_cluster).reduce(Summary::default, Summary::join);
    Summary { tally: ring.tally(), control, ..joined }
}

fn progress(world: &World<'_>, state: &State, joined: &Summary) -> Progress {
    let unshot = joined.unshot.join(world.unshot(state.emitters_shot)).value();
    Progress {
        shots: state.shots,
        unshot_share: if state.emitted > 0.0 { unshot / state.emitted } else { 0.0 },
        done: None,
        rays: joined.tally.rays,
        masks: joined.tally.masks,
        masks_without_rays: joined.tally.masks_without_rays,
    }
}

/// The next shot: first the lights that are no surfaces, then always the patch with the most unshot power, which its owner
/// tells of.
fn choose(
    (world, precision): (&World<'_>, &Precision),
    ring: &mut Ring<'_>,
    state: &State,
    under_way: &UnderWay,
    best: Offer,
    ranks: &mut Communicator<'_>,
) -> Result<Option<Chosen>, Failure> {
    let emitters = under_way.iter().filter(|(_, chosen)| chosen.patch.is_none()).count();
    if let Some(emitter) = world.emitters.get(state.emitters_shot as usize + emitters) {
        return Ok(Some(Chosen { shots: vec![(emitter.clone(), Among::default())], patch: None, unshot: Vec::new() }));
    }
    let Some(id) = best.patch() else { return Ok(None) };
    let (mesh, share) = (world.mesh, ring.share().clone());
    let cluster = mesh.cluster_of(id);
    let owner = share.owners[cluster] as usize;
    let own = share.place(cluster).map(|place| {
        let light = &state.clusters[place];
        let patch = mesh.patch(id);
        let index = (id - mesh.clusters[cluster].patches.start) as usize;
        let shot = |&side: &u32| shooting::patch_shot(mesh, &patch, light, index, side, world.settings.shoot);
        let unshot = light.patch(mesh, &patch).iter().map(|e| e.unshot).collect();
        (precision.sides.iter().map(shot).collect::<Vec<Shot>>(), unshot)
    });
    let bytes = own.as_ref().map_or(Vec::new(), |(shots, _)| shots.iter().flat_map(Shot::to_bytes).collect());
    let bytes = ranks.broadcast_meanwhile(owner, SHOT, bytes, &mut |ranks| ring.serve(ranks))?;
    let (shots, unshot) = match own {
        Some(own) => own,
        None => {
            let message = format!("from rank {owner}: {} bytes are no shot", bytes.len());
            let mut rest = bytes.as_slice();
            let told = |side: &u32| {
                let (bytes, others) = rest.split_at_checked(Shot::bytes_from(side * side))?;
                rest = others;
                Shot::from_bytes(mesh, bytes)
            };
            let shots: Option<Vec<Shot>> = precision.sides.iter().map(told).collect();
            (shots.ok_or(Failure { rank: share.rank, message })?, Vec::new())
        }
    };
    let among = precision.among(world, state, &shots);
    let shots = shots.into_iter().map(Arc::new).zip(among).collect();
    Ok(Some(Chosen { shots, patch: Some(id), unshot }))
}

/// What has been shot is unshot no longer; what came since it was chosen is.
fn commit(world: &World<'_>, state: &mut State, chosen: &Chosen) {
    let mesh = world.mesh;
    let Some(id) = chosen.patch else {
        state.emitters_shot += 1;
        return;
    };
    let cluster = mesh.cluster_of(id);
    let Some(place) = world.share.place(cluster) else { return };
    let (patch, light) = (mesh.patch(id), &mut state.clusters[place]);
    let elements = light.patch_mut(mesh, &patch);
    for (element, unshot) in elements.iter_mut().zip(&chosen.unshot) {
        (0..3).for_each(|c| element.shot[c] += unshot[c]);
        (0..3).for_each(|c| element.unshot[c] -= unshot[c]);
    }
    let unshot_power = shooting::unshot_power(mesh, &patch, elements, false);
    let index = (id - mesh.clusters[cluster].patches.start) as usize;
    light.patches[index] = PatchLight { unshot_power, emission_waits: false };
}

/// Shots whose light has still to be followed for the audit. Nothing waits for it: it is done for many at a time.
#[derive(Default)]
pub(super) struct Audits(Vec<Arc<Shot>>);

/// Shots that are audited together.
const AUDITED: usize = 16;

impl Audits {
    /// Adds a shot.
    pub(super) fn add(
        &mut self,
        world: &World<'_>,
        ring: &mut Ring<'_>,
        state: &mut State,
        ranks: &mut Communicator<'_>,
        shot: Arc<Shot>,
    ) -> Result<(), Failure> {
        self.0.push(shot);
        if self.0.len() < AUDITED { Ok(()) } else { self.settle(world, ring, state, ranks) }
    }

    /// Follows the shots' light with rays of its own: the more power, the more rays.
    pub(super) fn settle(
        &mut self,
        world: &World<'_>,
        ring: &mut Ring<'_>,
        state: &mut State,
        ranks: &mut Communicator<'_>,
    ) -> Result<(), Failure> {
        let rays = |shot: &Shot| {
            let share = if state.emitted > 0.0 { shot.power / state.emitted } else { 0.0 };
            (share * 65_536.0).clamp(16.0, 16_384.0) as u32
        };
        let audit = self.0.iter().map(|shot| Audit::new(world.mesh, shot, rays(shot), world.centre, world.radius));
        let audits: Vec<Audit<'_>> = audit.collect();
        let fates = ring.follow(ranks, &audits)?;
        for (shot, fate) in self.0.iter().zip(fates) {
            let fate = fate.shares();
            // Light from infinity that misses the scene was never counted as emitted.
            let (escaped, meeting) = match shot.shooter.cells {
                Cells::Directions(_) => (fate.escaped - fate.escaped_at_once, 1.0 - fate.escaped_at_once),
                _ => (fate.escaped, 1.0),
            };
            if meeting > 0.0 {
                state.escaped += shot.power * escaped / meeting;
                state.absorbed_by_backs += shot.power * fate.backs / meeting;
            }
        }
        self.0.clear();
        Ok(())
    }
}
