//! How much memory a rank needs, and what follows for the number of rings.

use super::{Rings, ShardBox};

/// What a job keeps in memory, bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Demand {
    /// On every rank.
    pub everywhere: u64,
    /// Divided among all ranks: what each owns.
    pub owned: u64,
    /// Triangles, which the members of a ring divide among them.
    pub triangles: u64,
    /// For each triangle that a member holds: its part of the hierarchy.
    pub held: u64,
    /// The same, but only while a hierarchy is built.
    pub building: u64,
    /// The same, but only while geometry moves: what shots under way still see as it was.
    pub moved: u64,
    /// On every rank, but only while light is written when all is solved.
    pub writing: u64,
    /// Likewise, but while geometry is held: as it is solved.
    pub saving: u64,
    /// For each member of a ring, on every rank: the boxes around its shard.
    pub outline: u64,
    /// For each member of a ring, on every rank: packets of points that may be under way.
    pub packets: u64,
    /// The same for packets of rays, before there is light.
    pub rays: u64,
    /// On every rank, likewise: the walks that wait for them.
    pub walks: u64,
}

/// Most triangles that a member of a ring may come to hold, however busy the others are: an eighth more than its share, and
/// where that is little, so many more.
pub(super) fn most_held(triangles: u64, members: usize) -> u64 {
    const FEW: u64 = 1 << 14;
    let share = triangles.div_ceil(members as u64);
    (share + FEW.max(share / 8)).min(triangles)
}

/// Bytes of a point with its mask in a packet: three coordinates, a plane, 64 cells.
const POINT: u64 = 24;

/// Bytes of a ray with its rule and its hit in a packet.
const RAY: u64 = 64;

/// Bytes of a walk that waits, and of its ray as it is packed.
const WALK: u64 = 200;

/// Bytes of a box with its plane.
const BOX: u64 = size_of::<ShardBox>() as u64;

impl Demand {
    /// With so many packets of so many points under way from each rank, and so many boxes around each shard.
    pub fn with_packets(self, window: usize, points: usize, boxes: usize) -> Demand {
        let most = (window * points) as u64;
        Demand { packets: most * POINT, rays: most * RAY, walks: most * WALK, outline: boxes as u64 * BOX, ..self }
    }

    /// What the rank needs that needs most, a member of the ring that has the fewest, if all own as much.
    pub fn of_a_rank(&self, rings: Rings) -> u64 {
        let [before, beside] = self.of_rings(rings);
        before.max(beside + self.owned.div_ceil(rings.ranks() as u64))
    }

    /// What such a rank needs before it owns anything, and beside what it owns.
    fn of_rings(&self, rings: Rings) -> [u64; 2] {
        let ranks = rings.ranks() as u64;
        let triangles = most_held(self.triangles, rings.ranks() / rings.rings());
        let [held, building, moved] = [self.held, self.building, self.moved].map(|bytes| bytes * triangles);
        let needs = if rings.rings() == rings.ranks() {
            // Built once, when nothing is owned yet; pictures want the geometry to the end.
            [held + building, held + self.writing.max(self.saving)]
        } else {
            let members = ranks.div_ceil(rings.rings() as u64);
            let looking = self.walks + members * (self.rays + self.outline);
            let solving = members * (self.packets + self.outline) + self.saving.max(building + moved);
            [held + looking, (held + solving).max(self.writing)]
        };
        needs.map(|bytes| self.everywhere + bytes)
    }

    /// Of what all own together, for how many bytes each rank has room, if `available` is what it may use. None if that is too
    /// little.
    pub fn rooms(&self, rings: Rings, available: &[u64]) -> Option<Vec<u64>> {
        let [before, beside] = self.of_rings(rings);
        let room = |&bytes: &u64| if bytes < before { None } else { bytes.checked_sub(beside) };
        let rooms: Vec<u64> = available.iter().map(room).collect::<Option<_>>()?;
        (rooms.iter().fold(0, |sum: u64, &room| sum.saturating_add(room)) >= self.owned).then_some(rooms)
    }

    /// The largest number of rings with which no rank needs more than is `available` to it: more rings mean fewer stops.
    pub fn most_rings(&self, available: &[u64]) -> Option<Rings> {
        let ranks = available.len();
        let fits = |rings: &Rings| self.rooms(*rings, available).is_some();
        (1..=ranks).rev().filter_map(|rings| Rings::new(ranks, rings)).find(fits)
    }

    /// The least number of ranks that would do, in one ring; none if no number up to 65536 does.
    pub fn fewest_ranks(&self, available: u64) -> Option<usize> {
        (1..=1 << 16).find(|&ranks| self.of_a_rank(Rings::one(ranks)) <= available)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const DEMAND: Demand = Demand {
        everywhere: 10,
        owned: 800,
        triangles: 80 << 20,
        held: 3,
        building: 2,
        moved: 0,
        writing: 20,
        saving: 0,
        outline: 0,
        packets: 0,
        rays: 0,
        walks: 0,
    };

    #[test]
    fn geometry_is_there_once_in_each_ring_and_light_once_in_all() {
        let of = |ranks, rings| DEMAND.of_a_rank(Rings::new(ranks, rings).unwrap());
        // An eighth more than a half, a quarter, an eighth of the triangles.
        let [half, quarter, eighth] = [45 << 20, 45 << 19, 45 << 18];
        assert_eq!(of(1, 1), 10 + (80 << 20) * (3 + 2));
        assert_eq!(of(8, 1), 10 + eighth * (3 + 2) + 100);
        assert_eq!(of(8, 8), 10 + (80 << 20) * (3 + 2));
        assert_eq!(of(8, 4), 10 + half * (3 + 2) + 100);
        // Rings of 3, 3 and 2 members: the smallest counts.
        assert_eq!(of(8, 3), of(2, 1) - 400 + 100);
        let two_rings = Rings::new(8, 2).unwrap();
        let without_building = Demand { building: 0, ..DEMAND };
        assert_eq!(without_building.of_a_rank(two_rings), 10 + quarter * 3 + 100);
        assert_eq!(Demand { saving: 20, ..without_building }.of_a_rank(two_rings), 10 + quarter * 3 + 100 + 20);
        let writing = quarter * 3 + 20;
        assert_eq!(Demand { writing, ..without_building }.of_a_rank(two_rings), 10 + 100 + writing);
        let with_shots_under_way = Demand { moved: 3, ..DEMAND };
        assert_eq!(with_shots_under_way.of_a_rank(two_rings), 10 + quarter * (3 + 2 + 3) + 100);
        assert_eq!(with_shots_under_way.of_a_rank(Rings::one(1)), of(1, 1));
    }

    #[test]
    fn packets_and_boxes_count_where_there_are_others() {
        let demand = Demand::default().with_packets(16, 200, 8);
        let of = |ranks, rings| demand.of_a_rank(Rings::new(ranks, rings).unwrap());
        assert_eq!(of(4, 4), 0);
        // Before there is light, rays: more than points later.
        let (rays, walks) = (16 * 200 * 64, 16 * 200 * 200);
        assert_eq!(of(4, 1), walks + 4 * (rays + 8 * 28));
        assert_eq!(of(5, 2), walks + 3 * (rays + 8 * 28));
        let lit = Demand { owned: 1 << 40, ..demand }.of_a_rank(Rings::one(4));
        assert_eq!(lit, (1 << 38) + 4 * (16 * 200 * 24 + 8 * 28));
    }

    #[test]
    fn who_has_less_memory_owns_less() {
        let one = Rings::one(4);
        let [before, beside] = DEMAND.of_rings(one);
        let most = before.max(beside + 200);
        assert_eq!(DEMAND.rooms(one, &[most; 4]).unwrap(), [most - beside; 4]);
        assert!(DEMAND.rooms(one, &[most, most, before - 1, most + 1000]).is_none());
        let roomy = Demand { building: 0, ..DEMAND };
        let [_, beside] = roomy.of_rings(one);
        let available = [400, 50, 300, 50].map(|room| beside + room);
        assert_eq!(roomy.rooms(one, &available).unwrap(), [400, 50, 300, 50]);
        assert!(roomy.rooms(one, &available.map(|bytes| bytes - 1)).is_none());
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn the_most_rings_and_the_fewest_ranks_fit_and_no_others(
            everywhere in 0u64..500, owned in 0u64..5000, triangles in 0u64..1 << 22, held in 0u64..3,
            building in 0u64..3, ranks in 1usize..40, available in 0u64..1 << 22,
        ) {
            let demand = Demand { everywhere, owned, triangles, held, building, ..Demand::default() };
            let fits = |rings: Rings| demand.of_a_rank(rings) <= available;
            match demand.most_rings(&vec![available; ranks]) {
                Some(rings) => {
                    prop_assert!(fits(rings));
                    let more = rings.rings() + 1..=ranks;
                    prop_assert!(more.into_iter().all(|r| !fits(Rings::new(ranks, r).unwrap())));
                }
                None => prop_assert!(!fits(Rings::new(ranks, 1).unwrap())),
            }
            if let Some(fewest) = demand.fewest_ranks(available) {
                prop_assert!(fits(Rings::new(fewest, 1).unwrap()));
                prop_assert!(fewest == 1 || !fits(Rings::new(fewest - 1, 1).unwrap()));
            } else {
                prop_assert!(!fits(Rings::one(1 << 16)));
            }
        }
    }
}
