//! Plain progressive refinement (paper, sections 1.1 and 2.2; Cohen et al. 1988).

use super::{Control, Progress, State, StopReason, StopRule, World};
use crate::shooting::{self, Shot, Work};
use crate::transport::{Communicator, Failure};
use rayon::prelude::*;

/// Tag of the messages that choose the next shooter.
const CHOOSE: u32 = 1;

/// Shoots until `stop` or the observer ends it. The observer is called before the first shot and after every shot. An error
/// says which rank failed.
pub fn plain(
    world: &World<'_>,
    state: &mut State,
    stop: &StopRule,
    ranks: &mut Communicator<'_>,
    observer: &mut dyn FnMut(&State, &Progress) -> Control,
) -> Result<(StopReason, Progress), Failure> {
    let mut progress = Progress::default();
    loop {
        progress.shots = state.shots;
        progress.unshot_share = if state.emitted > 0.0 { state.unshot(world) / state.emitted } else { 0.0 };
        if let Control::Stop(reason) = observer(state, &progress) {
            return Ok((reason, progress));
        }
        if stop.max_shots.is_some_and(|n| state.shots >= n) {
            return Ok((StopReason::MaxShots, progress));
        }
        if progress.unshot_share <= stop.until && !emission_waits(world, state) {
            return Ok((StopReason::Converged, progress));
        }
        let Some(shot) = take_next(world, state, ranks)? else {
            return Ok((StopReason::NothingLeft, progress));
        };
        receive_everywhere(world, state, &shot, &mut progress);
        audit(world, state, &shot);
        state.shots += 1;
    }
}

/// Whether some emitter has not been shot yet: each is, before the stop rule may end a run.
fn emission_waits(world: &World<'_>, state: &State) -> bool {
    (state.emitters_shot as usize) < world.emitters.len()
        || state.clusters.par_iter().any(|c| c.patches.iter().any(|p| p.emission_waits && p.unshot_power > 0.0))
}

/// Takes the next shot out of the unshot light: first the lights that are no surfaces, then always the patch with the most
/// unshot power, the lower id among equals.
fn take_next(world: &World<'_>, state: &mut State, ranks: &mut Communicator<'_>) -> Result<Option<Shot>, Failure> {
    if let Some(emitter) = world.emitters.get(state.emitters_shot as usize) {
        state.emitters_shot += 1;
        return Ok(Some(emitter.clone()));
    }
    let mesh = world.mesh;
    let best = state
        .clusters
        .par_iter()
        .enumerate()
        .map(|(c, light)| {
            let first = mesh.clusters[c].patches.start;
            light
                .patches
                .iter()
                .zip(first..)
                .fold(Offer::NONE, |best, (p, id)| best.better(Offer::new(p.unshot_power, id)))
        })
        .reduce(|| Offer::NONE, Offer::better);
    let best = Offer(u128::from_le_bytes(ranks.all_reduce(CHOOSE, best.0.to_le_bytes(), |a, b| {
        Offer(u128::from_le_bytes(a)).better(Offer(u128::from_le_bytes(b))).0.to_le_bytes()
    })?));
    let Some(id) = best.patch() else { return Ok(None) };
    let cluster = mesh.cluster_of(id);
    let index = (id - mesh.clusters[cluster].patches.start) as usize;
    let patch = mesh.patch(id);
    let light = &mut state.clusters[cluster];
    let side = f64::from(world.settings.cells).sqrt() as u32;
    let shot = shooting::patch_shot(mesh, &patch, light, index, side, world.settings.shoot);
    light.patches[index] = Default::default();
    let first = (patch.first_element - mesh.clusters[cluster].elements.start) as usize;
    for element in &mut light.elements[first..first + patch.element_count() as usize] {
        element.shot = element.mean();
        element.unshot = [0.0; 3];
    }
    Ok(Some(shot))
}

/// A patch offered as the next shooter, as a number that is larger for the better one: power first (non-negative floats
/// order like their bits), then the lower id.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Offer(u128);

impl Offer {
    const NONE: Offer = Offer(0);

    fn new(power: f64, patch: u32) -> Offer {
        if power > 0.0 { Offer(u128::from(power.to_bits()) << 32 | u128::from(!patch)) } else { Offer::NONE }
    }

    fn better(self, other: Offer) -> Offer {
        Offer(self.0.max(other.0))
    }

    fn patch(self) -> Option<u32> {
        (self != Offer::NONE).then_some(!(self.0 as u32))
    }
}

/// Every cluster receives the shot, in parallel; each computes its light alone.
fn receive_everywhere(world: &World<'_>, state: &mut State, shot: &Shot, progress: &mut Progress) {
    let tally = state
        .clusters
        .par_iter_mut()
        .enumerate()
        .with_min_len(4)
        .map_init(Work::default, |work, (c, light)| {
            shooting::receive(world.mesh, c, light, shot, world.hierarchy, work)
        })
        .reduce(Default::default, |a, b| ringlight_visibility::Tally {
            rays: a.rays + b.rays,
            masks: a.masks + b.masks,
            masks_without_rays: a.masks_without_rays + b.masks_without_rays,
        });
    progress.rays += tally.rays;
    progress.masks += tally.masks;
    progress.masks_without_rays += tally.masks_without_rays;
}

/// Follows the shot's light with rays of its own: the more power, the more rays.
fn audit(world: &World<'_>, state: &mut State, shot: &Shot) {
    let share = if state.emitted > 0.0 { shot.power / state.emitted } else { 0.0 };
    let rays = (share * 65_536.0).clamp(16.0, 16_384.0) as u32;
    let audit = shooting::Audit::new(world.mesh, shot, rays, world.centre, world.radius);
    let fate = audit.follow(world.hierarchy).shares();
    // Light from infinity that misses the scene was never counted as emitted.
    let (escaped, meeting) = match shot.shooter.cells {
        ringlight_visibility::Cells::Directions(_) => (fate.escaped - fate.escaped_at_once, 1.0 - fate.escaped_at_once),
        _ => (fate.escaped, 1.0),
    };
    if meeting > 0.0 {
        state.escaped += shot.power * escaped / meeting;
        state.absorbed_by_backs += shot.power * fate.backs / meeting;
    }
}

#[cfg(test)]
mod tests {
    use super::Offer;

    #[test]
    fn more_power_wins_and_then_the_lower_patch() {
        assert_eq!(Offer::new(2.0, 9).better(Offer::new(1.0, 3)).patch(), Some(9));
        assert_eq!(Offer::new(2.0, 9).better(Offer::new(2.0, 3)).patch(), Some(3));
        assert_eq!(Offer::new(0.0, 9).patch(), None);
        assert_eq!(Offer::new(1e-300, 0).better(Offer::NONE).patch(), Some(0));
    }
}
