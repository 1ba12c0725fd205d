//! What the ranks tell each other to choose the next shooter: the master's job (paper, section 2.2) by one reduction.

use super::{Control, StopReason};
use crate::quantity::ExactSum;
use ringlight_visibility::Tally;

/// A patch offered as the next shooter, as a number that is larger for the better one: power first (non-negative floats
/// order like their bits), then the lower id.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Offer(u128);

impl Offer {
    /// Nothing to shoot.
    pub const NONE: Offer = Offer(0);

    /// The unshot power of a patch, W or lm.
    pub fn new(power: f64, patch: u32) -> Offer {
        if power > 0.0 { Offer(u128::from(power.to_bits()) << 32 | u128::from(!patch)) } else { Offer::NONE }
    }

    /// The one that is to shoot first.
    pub fn better(self, other: Offer) -> Offer {
        Offer(self.0.max(other.0))
    }

    /// The patch, if any.
    pub fn patch(self) -> Option<u32> {
        (self != Offer::NONE).then_some(!(self.0 as u32))
    }
}

/// What is known before each shot: of one rank, and joined of all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Summary {
    /// The best patch to shoot.
    pub offer: Offer,
    /// Unshot power of the patches.
    pub unshot: ExactSum,
    /// Work done so far.
    pub tally: Tally,
    /// Whether the emission of some patch has not been shot.
    pub emission_waits: bool,
    /// What the ranks want.
    pub control: Control,
}

/// Bytes of a [`Summary`].
const BYTES: usize = 16 + 16 + 24 + 3;

impl Summary {
    /// Of both.
    pub fn join(self, other: Summary) -> Summary {
        Summary {
            offer: self.offer.better(other.offer),
            unshot: self.unshot.join(other.unshot),
            tally: self.tally.join(other.tally),
            emission_waits: self.emission_waits || other.emission_waits,
            control: self.control.join(other.control),
        }
    }

    /// Of both, as they travel.
    pub fn join_bytes(a: [u8; BYTES], b: [u8; BYTES]) -> [u8; BYTES] {
        Summary::from_bytes(a).join(Summary::from_bytes(b)).to_bytes()
    }

    /// As it travels.
    pub fn to_bytes(self) -> [u8; BYTES] {
        let mut bytes = Vec::with_capacity(BYTES);
        bytes.extend_from_slice(&self.offer.0.to_le_bytes());
        bytes.extend_from_slice(&self.unshot.0.to_le_bytes());
        let Tally { rays, masks, masks_without_rays } = self.tally;
        [rays, masks, masks_without_rays].iter().for_each(|n| bytes.extend_from_slice(&n.to_le_bytes()));
        bytes.push(u8::from(self.emission_waits));
        let Control { checkpoint, show, wait, stop } = self.control;
        bytes.push(u8::from(checkpoint) | u8::from(show) << 1 | u8::from(wait) << 2);
        bytes.push(REASONS.iter().position(|&reason| reason == stop).unwrap_or(0) as u8);
        bytes.try_into().unwrap_or([0; BYTES])
    }

    /// As it has travelled.
    pub fn from_bytes(bytes: [u8; BYTES]) -> Summary {
        fn part<const N: usize>(bytes: &[u8], start: usize) -> [u8; N] {
            std::array::from_fn(|i| bytes[start + i])
        }
        let number = |start| u64::from_le_bytes(part(&bytes, start));
        Summary {
            offer: Offer(u128::from_le_bytes(part(&bytes, 0))),
            unshot: ExactSum(i128::from_le_bytes(part(&bytes, 16))),
            tally: Tally { rays: number(32), masks: number(40), masks_without_rays: number(48) },
            emission_waits: bytes[56] != 0,
            control: Control {
                checkpoint: bytes[57] & 1 != 0,
                show: bytes[57] & 2 != 0,
                wait: bytes[57] & 4 != 0,
                stop: REASONS.get(usize::from(bytes[58])).copied().unwrap_or_default(),
            },
        }
    }
}

/// Reasons to stop by their number on the way.
const REASONS: [Option<StopReason>; 9] = [
    None,
    Some(StopReason::Converged),
    Some(StopReason::NothingLeft),
    Some(StopReason::MaxShots),
    Some(StopReason::Memory),
    Some(StopReason::Stopped),
    Some(StopReason::TimeLimit),
    Some(StopReason::Interrupted),
    Some(StopReason::Terminated),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_power_wins_and_then_the_lower_patch() {
        assert_eq!(Offer::new(2.0, 9).better(Offer::new(1.0, 3)).patch(), Some(9));
        assert_eq!(Offer::new(2.0, 9).better(Offer::new(2.0, 3)).patch(), Some(3));
        assert_eq!(Offer::new(0.0, 9).patch(), None);
        assert_eq!(Offer::new(1e-300, 0).better(Offer::NONE).patch(), Some(0));
    }

    #[test]
    fn summaries_arrive_as_they_were_sent() {
        for (number, stop) in REASONS.into_iter().enumerate() {
            let [checkpoint, show, wait] = [1, 2, 4].map(|bit| number & bit != 0);
            let control = Control { checkpoint, show, wait, stop };
            let summary = Summary {
                offer: Offer::new(3.5, 77),
                unshot: ExactSum(-5),
                tally: Tally { rays: 1 << 50, masks: 2, masks_without_rays: 3 },
                emission_waits: true,
                control,
            };
            assert_eq!(Summary::from_bytes(summary.to_bytes()), summary);
        }
    }

    #[test]
    fn what_any_rank_wants_is_wanted() {
        let stop = |reason| Control { stop: Some(reason), ..Control::default() };
        let joined = stop(StopReason::TimeLimit).join(Control { show: true, ..stop(StopReason::Interrupted) });
        assert_eq!(joined, Control { show: true, ..stop(StopReason::Interrupted) });
        assert!(REASONS.is_sorted());
    }
}
