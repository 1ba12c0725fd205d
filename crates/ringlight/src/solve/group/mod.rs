//! Group shooting: every receiver takes its own cut through the tree of all that shoots, and light goes back and forth over
//! these links until it has settled.
//!
//! With x the light that elements receive, E that of lamps without surface, and F the form factors of the links, x = E + F(Bₑ +
//! ρx). Rays are needed for F alone, so each pair is looked at once for all bounces. Which pairs there are depends on x: a
//! first round with loose links finds it roughly, the next with the accuracy asked for. DESIGN (issue 7) has sweeps of
//! unshot light instead; they need a cut for every bounce.

mod cut;
mod links;
mod passes;

use super::choice::Summary;
use super::plain::Audits;
use super::{Observer, Progress, Ring, State, StopReason, World};
use crate::mesh::Inquiry;
use crate::quantity::Rgb;
use crate::shooting::{self, ClusterLight, Field, Receivers, Shoot, ShooterTree, TreeLight};
use crate::transport::{Communicator, Failure};
use cut::Cut;
use links::Links;
use passes::Exchange;
use rayon::prelude::*;
use ringlight_visibility::Tally;
use std::sync::Arc;

/// How much looser than asked the rounds cut.
const ROUNDS: [f32; 2] = [8.0, 1.0];

/// Error that one link may have, as a share of that which all together may have: hundreds of them err both ways.
const OF_ONE: f32 = 0.1;

/// Receivers whose own light is less than this share of the median are treated as if they had that.
const FLOOR: f32 = 0.02;

/// Parts of a round, between which the observer is asked.
const PARTS: usize = 64;

/// Tag of what the ranks tell each other between the parts of a round.
const ROUND: u32 = 8;

/// Patches of which light is followed for the audit, and rays of each.
const AUDITED: usize = 2048;

/// What lasts over the rounds.
struct Solving<'w, 'a, 'o> {
    world: &'w World<'a>,
    exchange: Exchange<'w>,
    tree: Arc<ShooterTree>,
    /// What own clusters receive of lamps without surface.
    direct: Vec<ClusterLight>,
    tally: Tally,
    observer: &'o mut dyn Observer,
}

/// Solves for all light at once, to a relative error of about `error`; every rank of the world calls it with the same settings. If
/// the observer stops it, the light of the last whole round stands.
pub fn group(
    world: &World<'_>,
    ring: &mut Ring<'_>,
    state: &mut State,
    error: f64,
    ranks: &mut Communicator<'_>,
    observer: &mut dyn Observer,
) -> Result<(StopReason, Progress), Failure> {
    let mesh = world.mesh;
    let direct = shoot_emitters(world, ring, state, ranks)?;
    let exchange = Exchange::new(mesh, &world.share);
    let mut received = exchange.all(ranks, if state.rounds > 0 { &state.clusters } else { &direct })?;
    let tree = Arc::new(ShooterTree::new(mesh));
    let mut solving = Solving { world, exchange, tree, direct, tally: Tally::default(), observer };
    for round in state.rounds as usize..ROUNDS.len() {
        if let (Some(reason), progress) = solving.round(ring, state, (round, error as f32), &mut received, ranks)? {
            return Ok((reason, progress));
        }
    }
    let (_, progress) = solving.tell(ring, state, ranks)?;
    Ok((StopReason::Converged, progress))
}

/// What own clusters receive of lamps that are no surfaces: shot one by one, before all else. Until the first round is over, that
/// is the solution.
fn shoot_emitters(
    world: &World<'_>,
    ring: &mut Ring<'_>,
    state: &mut State,
    ranks: &mut Communicator<'_>,
) -> Result<Vec<ClusterLight>, Failure> {
    let own = world.share.own.par_iter();
    let mut direct: Vec<ClusterLight> = own.map(|&c| ClusterLight::new(world.mesh, c as usize)).collect();
    let mut audits = Audits::default();
    for (number, emitter) in world.emitters.iter().enumerate() {
        let job = ring.begin(emitter);
        ring.commit(ranks, job, emitter, &mut direct)?;
        if number as u64 == state.emitters_shot {
            state.emitters_shot += 1;
            state.shots += 1;
            audits.add(world, ring, state, ranks, emitter.clone())?;
        }
    }
    audits.settle(world, ring, state, ranks)?;
    if state.rounds == 0 {
        state.clusters = direct.clone();
    }
    Ok(direct)
}

impl Solving<'_, '_, '_> {
    /// One round: links, then light over them until it settles. `received` is what all elements receive.
    fn round<'r>(
        &mut self,
        ring: &mut Ring<'r>,
        state: &mut State,
        (round, error): (usize, f32),
        received: &mut Vec<Rgb>,
        ranks: &mut Communicator<'_>,
    ) -> Result<(Option<StopReason>, Progress), Failure> {
        let (mesh, tree) = (self.world.mesh, self.tree.clone());
        let floor = passes::floor(mesh, received);
        // What is not known yet is guessed, so that there are links for it.
        let guess = if round == 0 { floor.guess } else { 0.0 };
        let guessed: Vec<Rgb> = received.iter().map(|e| e.map(|e| e + guess)).collect();
        let elements = passes::radiosities(mesh, &guessed);
        let mut light = TreeLight::new(&tree, &elements);
        let cut =
            Cut { mesh, tree: &tree, light: &light, elements: &elements, allowed: ROUNDS[round] * error * OF_ONE };
        let least = |receivers: &Receivers, first: u32| {
            let own = receivers.elements.iter().map(|e| shooting::strength(guessed[(first + e) as usize]));
            own.fold(f32::INFINITY, f32::min).max(floor.least)
        };
        // Who saw nothing of anything in the first round is inside of something.
        let sees = |receivers: &Receivers, first: u32| {
            round == 0 || receivers.elements.iter().any(|e| received[(first + e) as usize] != [0.0; 3])
        };
        let own = self.world.share.own.as_slice();
        let mut links: Vec<(usize, Links)> = Vec::new();
        let mut progress = Progress::default();
        for part in 0..PARTS {
            let stop;
            (stop, progress) = self.tell(ring, state, ranks)?;
            if stop.is_some() {
                return Ok((stop, progress));
            }
            let clusters = part * own.len() / PARTS..(part + 1) * own.len() / PARTS;
            let all = clusters.flat_map(|place| {
                let cluster = &mesh.clusters[own[place] as usize];
                let first = cluster.elements.start;
                Receivers::of(mesh, cluster).into_iter().map(move |receivers| (place, first, receivers))
            });
            let wanted = all.filter(|(_, first, receivers)| sees(receivers, *first)).enumerate();
            let task = |(number, (_, first, receivers)): (usize, (usize, u32, Receivers)), inquiry: Inquiry<'r>| {
                let (cut, least) = (&cut, &least);
                async move {
                    let (links, tally) = cut.links(&receivers, first, least(&receivers, first), &inquiry).await;
                    (number, links, tally)
                }
            };
            let before = links.len();
            let tally = &mut self.tally;
            ring.ask(ranks, wanted, task, |(number, found, asked)| {
                *tally = tally.join(asked);
                links.push((before + number, found));
            })?;
        }
        links.sort_unstable_by_key(|(number, _)| *number);
        let links: Vec<Links> = links.into_iter().map(|(_, links)| links).collect();
        let clusters = passes::settle(&self.exchange, &tree, &links, &self.direct, &mut light, received, ranks)?;
        state.clusters = clusters;
        state.rounds += 1;
        if state.rounds as usize == ROUNDS.len() {
            self.audit(ring, state, received, ranks)?;
        }
        Ok((None, progress))
    }

    /// Tells the observer how far it is, and does what any rank wants; gives the reason to stop, if any.
    fn tell(
        &mut self,
        ring: &Ring<'_>,
        state: &State,
        ranks: &mut Communicator<'_>,
    ) -> Result<(Option<StopReason>, Progress), Failure> {
        loop {
            let summary = Summary { tally: self.tally, control: self.observer.control(), ..Summary::default() };
            let joined = ranks.all_reduce(ROUND, summary.to_bytes(), Summary::join_bytes)?;
            let Summary { tally, control, .. } = Summary::from_bytes(joined);
            let progress = Progress {
                shots: state.shots,
                unshot_share: if state.rounds == 0 { 1.0 } else { 0.0 },
                rays: tally.rays,
                masks: tally.masks,
                masks_without_rays: tally.masks_without_rays,
            };
            self.observer.observe(&progress);
            if control.checkpoint {
                self.observer.checkpoint(state, ranks)?;
            }
            if control.show {
                self.observer.show(state, ring, ranks)?;
            }
            if control.stop.is_some() || !control.wait {
                return Ok((control.stop, progress));
            }
        }
    }

    /// Follows what patches send out: of patches at equal steps of power, so that each stands for as much.
    fn audit(
        &self,
        ring: &mut Ring<'_>,
        state: &mut State,
        received: &[Rgb],
        ranks: &mut Communicator<'_>,
    ) -> Result<(), Failure> {
        let mesh = self.world.mesh;
        let elements = passes::radiosities(mesh, received);
        let power = |id: u32| {
            let patch = mesh.patch(id);
            let of = |(k, e): (usize, u32)| {
                let radiosity: f64 = elements[e as usize].iter().map(|&b| f64::from(b)).sum();
                patch.element_area(k as u32) * mesh.valid_share(e) * radiosity
            };
            patch.elements().enumerate().map(of).sum::<f64>()
        };
        let powers: Vec<f64> = (0..mesh.patch_count() as u32).into_par_iter().map(power).collect();
        let step = powers.iter().sum::<f64>() / AUDITED as f64;
        let mut audits = Audits::default();
        let mut passed = -step / 2.0;
        for (id, power) in (0..).zip(powers) {
            passed += power;
            let steps = (passed / step).floor();
            if steps.is_nan() || steps < 1.0 {
                continue;
            }
            passed -= steps * step;
            let patch = mesh.patch(id);
            let of_patch: Vec<[f64; 3]> = patch.elements().map(|e| elements[e as usize].map(f64::from)).collect();
            let shot = Field::new(mesh, &patch, &of_patch).shot(4, Shoot::Elements, steps * step);
            audits.add(self.world, ring, state, ranks, Arc::new(shot))?;
        }
        audits.settle(self.world, ring, state, ranks)
    }
}
