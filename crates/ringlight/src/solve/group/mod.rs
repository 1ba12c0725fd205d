//! Group shooting: all that shines on an element is found at once, what emits by masks and what reflects by rays.
//!
//! With x the light that elements receive, E that of lamps without surface, and F the form factors, x = E + F(Bₑ + ρx). Light of
//! surfaces that emit comes from few places and casts sharp shadows: for F Bₑ each group of receivers takes its own cut through
//! the tree of what emits, with masks of many cells. Light that is reflected comes from everywhere, and so little of it from
//! any one place that pairs of surfaces are not worth looking at: each element's row of F ρ is found by a few hundred rays over
//! its hemisphere, whose cost depends neither on the number of surfaces nor on their size. Rows are found once, and light goes
//! back and forth over them until it has settled: no bounce needs rays of its own, and none is left out.
//!
//! A first round with fewer rays and larger errors tells how much light elements have, which errors are relative to. DESIGN
//! (issue 7) has sweeps of unshot light over one tree for all; measured against links over such a tree, rows came to the same error in
//! a third to a fifth of the time.

mod cut;
mod passes;
mod reach;
mod rows;

use super::choice::Summary;
use super::plain::Audits;
use super::{Among, Observer, Progress, Ring, State, StopReason, World};
use crate::mesh::Inquiry;
use crate::quantity::Rgb;
use crate::shooting::{self, ClusterLight, Faces, Field, Radiosity, Receivers, Shoot, ShooterTree, TreeLight};
use crate::transport::{Communicator, Failure};
use cut::Cut;
use passes::{Arrived, Exchange};
use rayon::prelude::*;
use reach::Reach;
use ringlight_visibility::Tally;
use rows::{Around, Rows};
use std::sync::Arc;

/// How much looser than asked the rounds cut.
const ROUNDS: [f32; 2] = [16.0, 1.0];

/// Error that the light of all that emits may have in each round, as a share of that which all light may have: bounds of it are cautious.
/// What it was found to be wrong by, in an office and a box, is a third of what it may be wrong by, or less.
const OF_LAMPS: [f32; ROUNDS.len()] = [4.0, 2.0];

/// Receivers whose own light is less than this share of the median by area are treated as if they had that: to prove that next to
/// nothing comes to what is dark costs most.
const FLOOR: f32 = 0.1;

/// Where the light of fewer sides of facets goes is asked roughly first, to an error so many times that asked for.
const FEW: usize = 64;
const ROUGHLY: f32 = 8.0;

/// If less than this share of it is hidden from what has light, to find it exactly takes longer than to look at it. Measured: 0.3 in
/// a box, 0.4 in an office, where it does not pay; 0.5 to 0.9 in homes and buildings.
const HIDDEN: f64 = 0.45;

/// Parts of a round, between which the observer is asked.
const PARTS: usize = 64;

/// Tag of what the ranks tell each other between the parts of a round.
const ROUND: u32 = 8;

/// Patches of which light is followed for the audit, and rays of each.
const AUDITED: usize = 2048;

/// Rays that an element with light of its own sends over its hemisphere in each round, as a rule: where
/// what is seen differs more than usual up to four times as many. Rays of the lamps' masks come on top.
pub fn usual_rays(error: f64) -> [f64; ROUNDS.len()] {
    let rough = |round: usize| if round == 0 { 0 } else { rows::ROUGH };
    std::array::from_fn(|round| f64::from(rows::usual_rays(ROUNDS[round] * error as f32)) + f64::from(rough(round)))
}

/// What emits.
struct Lamps {
    tree: ShooterTree,
    /// What its nodes emit.
    light: TreeLight,
    /// What elements emit.
    elements: Vec<Radiosity>,
    /// Where it goes, if that is known from the first.
    reach: Reach,
}

/// What lasts over the rounds.
struct Solving<'w, 'a, 'o> {
    world: &'w World<'a>,
    exchange: Exchange<'w>,
    lamps: Arc<Lamps>,
    faces: Arc<Faces>,
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
    let tree = ShooterTree::new(mesh);
    let elements = passes::radiosities(mesh, &vec![[0.0; 3]; mesh.element_count()]);
    let light = TreeLight::new(&tree, &elements);
    let mut tally = Tally::default();
    let reach = match tree.sides().count() {
        ..FEW => Reach::default(),
        _ => Reach::new((&tree, &light), error as f32, (ring, &world.share), ranks, &mut tally)?,
    };
    let lamps = Arc::new(Lamps { tree, light, elements, reach });
    let faces = Arc::new(Faces::new(mesh));
    let mut solving = Solving { world, exchange, lamps, faces, direct, tally, observer };
    for round in state.rounds as usize..ROUNDS.len() {
        if let (Some(reason), progress) = solving.round(ring, state, (round, error as f32), &mut received, ranks)? {
            return Ok((reason, progress));
        }
    }
    let (_, progress) = solving.tell(ring, state, 1.0, ranks)?;
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
        let job = ring.begin(emitter, &Among::default());
        ring.commit(ranks, job, (emitter, &Among::default()), &mut direct)?;
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
    /// One round: lamps and rows, then light over the rows until it settles. `received` is what all elements receive.
    fn round<'r>(
        &mut self,
        ring: &mut Ring<'r>,
        state: &mut State,
        (round, error): (usize, f32),
        received: &mut Vec<Rgb>,
        ranks: &mut Communicator<'_>,
    ) -> Result<(Option<StopReason>, Progress), Failure> {
        let (mesh, lamps, faces) = (self.world.mesh, self.lamps.clone(), self.faces.clone());
        let work = usual_rays(f64::from(error));
        let exact = self.exact_reach(ring, (round, error), received, ranks)?;
        let error = ROUNDS[round] * error;
        let floor = passes::floor(mesh, received);
        // While nothing is known of light that is reflected, all may have some.
        let guess = if round == 0 { floor.guess } else { 0.0 };
        let Lamps { tree, light, elements, reach } = &*lamps;
        let reach = exact.as_ref().unwrap_or(reach);
        let cut = Cut { mesh, tree, light, elements, allowed: error * OF_LAMPS[round] };
        let known = if round == 0 { Vec::new() } else { passes::reflected(&passes::returned(mesh), received) };
        let around = Around { mesh, faces: &faces, reflected: &known, error };
        let own_light = |receivers: &Receivers, first: u32| {
            let own = receivers.elements.iter().map(|e| shooting::strength(received[(first + e) as usize]) + guess);
            (own.sum::<f32>() / receivers.elements.len() as f32).max(floor.least)
        };
        // Who got nothing in the first round, and sees nothing that has light, is inside of something.
        let has_light = |e: u32| received[e as usize] != [0.0; 3] || elements[e as usize] != [0.0; 3];
        let may_be_inside = |receivers: &Receivers, first: u32| {
            round > 0 && receivers.elements.iter().all(|e| received[(first + e) as usize] == [0.0; 3])
        };
        let own = self.world.share.own.as_slice();
        let mut found: Vec<(usize, Vec<Arrived>, Rows)> = Vec::new();
        let mut progress = Progress::default();
        for part in 0..PARTS {
            let stop;
            let done = work[..round].iter().sum::<f64>() + work[round] * part as f64 / PARTS as f64;
            (stop, progress) = self.tell(ring, state, done / work.iter().sum::<f64>(), ranks)?;
            if stop.is_some() {
                return Ok((stop, progress));
            }
            let clusters = part * own.len() / PARTS..(part + 1) * own.len() / PARTS;
            let all = clusters.flat_map(|place| {
                let cluster = &mesh.clusters[own[place] as usize];
                let receivers = Receivers::of(mesh, &faces, cluster);
                receivers.into_iter().map(move |receivers| (own[place], cluster.elements.start, receivers))
            });
            let task = |(number, (cluster, first, receivers)), inquiry: Inquiry<'r>| {
                let (cut, around, own_light, has_light, may_be_inside) =
                    (&cut, &around, &own_light, &has_light, &may_be_inside);
                async move {
                    let mut looked = Tally::default();
                    if may_be_inside(&receivers, first)
                        && !around.sees(&receivers, first, has_light, &inquiry, &mut looked).await
                    {
                        return (number, Vec::new(), Rows::default(), looked);
                    }
                    let own = own_light(&receivers, first);
                    let reached = reach.of(cluster);
                    let (lamps, rays) = cut.light(&receivers, (first, own), reached, &inquiry).await;
                    let (rows, more) = around.rows(&receivers, first, own, &inquiry).await;
                    (number, lamps, rows, looked.join(rays).join(more))
                }
            };
            let before = found.len();
            let tally = &mut self.tally;
            ring.ask(ranks, all.enumerate(), task, |(number, lamps, rows, asked)| {
                *tally = tally.join(asked);
                found.push((before + number, lamps, rows));
            })?;
        }
        found.sort_unstable_by_key(|(number, ..)| *number);
        let (lamps, rows): (Vec<_>, Vec<Rows>) = found.into_iter().map(|(_, lamps, rows)| (lamps, rows)).unzip();
        let lamps: Vec<Arrived> = lamps.into_iter().flatten().collect();
        state.clusters = passes::settle(&self.exchange, &faces, (&lamps, &rows), &self.direct, received, ranks)?;
        state.rounds += 1;
        if state.rounds as usize == ROUNDS.len() {
            self.audit(ring, state, received, ranks)?;
        }
        Ok((None, progress))
    }

    /// Where the light of what emits goes, in the last round, if that is not known yet and worth knowing.
    fn exact_reach(
        &mut self,
        ring: &mut Ring<'_>,
        (round, error): (usize, f32),
        received: &[Rgb],
        ranks: &mut Communicator<'_>,
    ) -> Result<Option<Reach>, Failure> {
        let Lamps { tree, light, .. } = &*self.lamps;
        let share = &self.world.share;
        if round + 1 < ROUNDS.len() || tree.sides().count() >= FEW {
            return Ok(None);
        }
        // What this hides could be wrong by too much: it tells only how much there is to hide.
        let rough = Reach::new((tree, light), ROUGHLY * error, (ring, share), ranks, &mut self.tally)?;
        if rough.hidden_share(self.world.mesh, tree, received, (share, ranks))? < HIDDEN {
            return Ok(None);
        }
        Reach::new((tree, light), error, (ring, share), ranks, &mut self.tally).map(Some)
    }

    /// Tells the observer how far it is, and does what any rank wants; gives the reason to stop, if any. `done` is the share of
    /// the work that is done, as rows tell.
    fn tell(
        &mut self,
        ring: &Ring<'_>,
        state: &State,
        done: f64,
        ranks: &mut Communicator<'_>,
    ) -> Result<(Option<StopReason>, Progress), Failure> {
        loop {
            let summary = Summary { tally: self.tally, control: self.observer.control(), ..Summary::default() };
            let joined = ranks.all_reduce(ROUND, summary.to_bytes(), Summary::join_bytes)?;
            let Summary { tally, control, .. } = Summary::from_bytes(joined);
            let progress = Progress {
                shots: state.shots,
                unshot_share: if state.rounds == 0 { 1.0 } else { 0.0 },
                done: Some(done),
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
