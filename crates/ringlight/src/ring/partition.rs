//! Who owns what, and which ranks form which ring. Pure functions: every rank computes the same.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::ops::Range;

/// The owner of each cluster, pseudo-random by the cluster's number: neighbours, which tend to be lit or dark together,
/// go to different ranks. Balanced by `elements`, the number of elements of each cluster: largest clusters first, each
/// to the rank that has least (Graham 1969), so that no two ranks differ by more than one cluster, unless there is no room for it:
/// `rooms` are the most elements that each rank may have. The last that has room takes what no rank has room for.
pub fn owners(elements: &[u64], rooms: &[u64]) -> Vec<u32> {
    let mut order: Vec<usize> = (0..elements.len()).collect();
    order.sort_unstable_by_key(|&c| (Reverse(elements[c]), scatter(c as u64)));
    let mut loads: BinaryHeap<Reverse<(u64, u32)>> = (0..rooms.len() as u32).map(|rank| Reverse((0, rank))).collect();
    let mut owners = vec![0; elements.len()];
    for cluster in order {
        let full = |&Reverse((load, rank)): &Reverse<(u64, u32)>| load + elements[cluster] > rooms[rank as usize];
        while loads.len() > 1 && loads.peek().is_some_and(full) {
            loads.pop();
        }
        let Some(mut least) = loads.peek_mut() else { break };
        let Reverse((load, rank)) = &mut *least;
        owners[cluster] = *rank;
        *load += elements[cluster];
    }
    owners
}

/// Numbers scattered as if at random, the same always (the finaliser of SplitMix64: Steele, Lea & Flood 2014).
pub(super) fn scatter(number: u64) -> u64 {
    let z = number.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ z >> 31
}

/// Ranks in rings of consecutive ranks, which launchers tend to put on one machine. Rings differ by at most one member.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rings {
    ranks: usize,
    rings: usize,
}

impl Rings {
    /// So many rings; between 1, the paper's single ring, and the number of ranks, its replicated scheme.
    pub fn new(ranks: usize, rings: usize) -> Option<Rings> {
        (1..=ranks).contains(&rings).then_some(Rings { ranks, rings })
    }

    /// One ring of so many ranks, at least one.
    pub fn one(ranks: usize) -> Rings {
        Rings { ranks: ranks.max(1), rings: 1 }
    }

    /// Number of ranks.
    pub fn ranks(self) -> usize {
        self.ranks
    }

    /// Number of rings.
    pub fn rings(self) -> usize {
        self.rings
    }

    /// The ring of a rank.
    pub fn ring_of(self, rank: usize) -> usize {
        ((rank + 1) * self.rings - 1) / self.ranks
    }

    /// The ranks of a ring; their places in it are counted from the first.
    pub fn members(self, ring: usize) -> Range<usize> {
        ring * self.ranks / self.rings..(ring + 1) * self.ranks / self.rings
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn ownership_is_balanced(sizes in prop::collection::vec(1u64..200, 1..3000), ranks in 1usize..40) {
            let owners = owners(&sizes, &vec![u64::MAX; ranks]);
            let mut loads = vec![0u64; ranks];
            owners.iter().zip(&sizes).for_each(|(&rank, size)| loads[rank as usize] += size);
            let (least, most) = (loads.iter().min().unwrap(), loads.iter().max().unwrap());
            prop_assert!(most - least <= *sizes.iter().max().unwrap());
            if sizes.len() >= 100 * ranks {
                let mean = sizes.iter().sum::<u64>() as f64 / ranks as f64;
                prop_assert!(*most as f64 <= 1.02 * mean, "{} of {}", most, mean);
            }
        }

        #[test]
        fn rooms_are_kept_and_the_rest_is_balanced(
            sizes in prop::collection::vec(1u64..200, 1000..3000), ranks in 2usize..9, part in 0.0..0.9,
        ) {
            let (total, largest) = (sizes.iter().sum::<u64>(), *sizes.iter().max().unwrap());
            let small = (part * total as f64 / ranks as f64) as u64;
            let rooms: Vec<u64> = (0..ranks).map(|rank| if rank == 1 { small } else { u64::MAX }).collect();
            let owners = owners(&sizes, &rooms);
            let load = |rank: usize| owners.iter().zip(&sizes).filter(|(o, _)| **o as usize == rank).map(|(_, s)| s).sum();
            let loads: Vec<u64> = (0..ranks).map(load).collect();
            prop_assert!(loads[1] <= small && loads[1] + largest > small);
            let others = || (0..ranks).filter(|&rank| rank != 1).map(|rank| loads[rank]);
            prop_assert!(others().max().unwrap() - others().min().unwrap() <= largest);
        }

        #[test]
        fn rings_share_the_ranks_out(ranks in 1usize..300, rings in 1usize..300) {
            let Some(cut) = Rings::new(ranks, rings) else {
                prop_assert!(rings > ranks);
                return Ok(());
            };
            let mut next = 0;
            for ring in 0..rings {
                let members = cut.members(ring);
                prop_assert_eq!(members.start, next);
                prop_assert!(members.len() == ranks / rings || members.len() == ranks.div_ceil(rings));
                prop_assert!(members.clone().all(|rank| cut.ring_of(rank) == ring));
                next = members.end;
            }
            prop_assert_eq!(next, ranks);
        }
    }

    /// Runs of neighbours on one rank would be rare if ranks were drawn at random: one in `ranks`.
    #[test]
    fn neighbours_are_scattered() {
        let owners = owners(&[64; 10_000], &[u64::MAX; 8]);
        let together = owners.windows(2).filter(|pair| pair[0] == pair[1]).count();
        assert!((1000..1500).contains(&together), "{together} of 9999 neighbours, 1250 expected");
    }

    /// Clusters of very different sizes: here a few hold most of the elements.
    #[test]
    fn uneven_clusters_are_balanced_too() {
        let sizes: Vec<u64> = (0..1000u64).map(|i| if i % 10 == 0 { 640 } else { 64 - i % 40 }).collect();
        let owners = owners(&sizes, &[u64::MAX; 8]);
        let load = |rank| owners.iter().zip(&sizes).filter(|(o, _)| **o == rank).map(|(_, s)| s).sum::<u64>();
        let most = (0..8).map(load).max().unwrap();
        assert!(most as f64 <= 1.02 * (sizes.iter().sum::<u64>() as f64 / 8.0), "{most}");
    }
}
