//! Shards: who of a ring's members holds which triangles, and what the others know of it.

use super::partition::owners;
use ringlight_visibility::NO_PLANE;
use std::collections::BTreeMap;

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Least coordinates, metres.
    pub low: [f32; 3],
    /// Greatest coordinates, metres.
    pub high: [f32; 3],
}

/// A piece of geometry that is held, and moved, as a whole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// Box around its triangles.
    pub bounds: Bounds,
    /// Number of its triangles.
    pub triangles: u32,
    /// The plane in which all of them lie, or [`NO_PLANE`] if they do not lie in one.
    pub plane: u32,
}

/// A box around a part of a shard: what the other members know of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShardBox {
    /// The box.
    pub bounds: Bounds,
    /// The plane in which all its triangles lie, or [`NO_PLANE`]: they hide nothing from points in this plane, and nothing
    /// of shooters in it.
    pub plane: u32,
}

/// How geometry is dealt out to the members of a ring.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shards {
    /// Compact in space, so that many packets pass by most members.
    #[default]
    Spatial,
    /// Pseudo-random (the paper's way): every packet finds the same work everywhere.
    Random,
}

impl Bounds {
    /// Holds nothing.
    pub const EMPTY: Bounds = Bounds { low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3] };

    /// Around both.
    pub fn join(self, other: Bounds) -> Bounds {
        Bounds {
            low: std::array::from_fn(|i| self.low[i].min(other.low[i])),
            high: std::array::from_fn(|i| self.high[i].max(other.high[i])),
        }
    }

    /// Area of the surface, m².
    pub fn area(self) -> f32 {
        let [x, y, z] = std::array::from_fn(|i| (self.high[i] - self.low[i]).max(0.0));
        2.0 * (x * y + y * z + z * x)
    }

    /// Around points.
    pub fn around(points: impl IntoIterator<Item = [f32; 3]>) -> Bounds {
        points.into_iter().fold(Bounds::EMPTY, |bounds, p| bounds.join(Bounds { low: p, high: p }))
    }
}

/// The member, of so many, that holds each piece; about equally many triangles each.
pub fn deal(pieces: &[Piece], members: usize, shards: Shards) -> Vec<u32> {
    match shards {
        Shards::Random => {
            owners(&pieces.iter().map(|p| u64::from(p.triangles)).collect::<Vec<_>>(), &vec![u64::MAX; members])
        }
        Shards::Spatial => {
            let weights: Vec<f64> = pieces.iter().map(|p| f64::from(p.triangles)).collect();
            bisect(pieces, &weights, &vec![1.0; members])
        }
    }
}

/// Deals pieces that weigh so much to members that get so large shares, compact in space: recursive coordinate bisection
/// (Berger & Bokhari 1987).
pub(super) fn bisect(pieces: &[Piece], weights: &[f64], shares: &[f64]) -> Vec<u32> {
    let mut holders = vec![0; pieces.len()];
    let mut order: Vec<u32> = (0..pieces.len() as u32).collect();
    Bisection { pieces, weights, holders: &mut holders }.cut(&mut order, 0, shares);
    holders
}

/// At most so many boxes that together hold the pieces: what all ranks know of a shard. The pieces in the largest planes,
/// such as floors and walls, have a box for each plane, because packets on them need not visit their holder; of the others,
/// near ones are in one box.
pub fn outline(pieces: &[Piece], boxes: usize) -> Vec<ShardBox> {
    let mut planes: BTreeMap<u32, Bounds> = BTreeMap::new();
    for piece in pieces.iter().filter(|piece| piece.plane != NO_PLANE) {
        let bounds = planes.entry(piece.plane).or_insert(Bounds::EMPTY);
        *bounds = bounds.join(piece.bounds);
    }
    let mut largest: Vec<ShardBox> = planes.into_iter().map(|(plane, bounds)| ShardBox { bounds, plane }).collect();
    largest.sort_by(|a, b| b.bounds.area().total_cmp(&a.bounds.area()).then(a.plane.cmp(&b.plane)));
    largest.truncate(boxes / 2);
    let others = pieces.iter().filter(|piece| largest.iter().all(|large| large.plane != piece.plane));
    let others: Vec<Piece> = others.copied().collect();
    let mut near = vec![Bounds::EMPTY; boxes - largest.len()];
    for (&part, piece) in deal(&others, near.len(), Shards::Spatial).iter().zip(&others) {
        near[part as usize] = near[part as usize].join(piece.bounds);
    }
    near.retain(|bounds| *bounds != Bounds::EMPTY);
    largest.extend(near.into_iter().map(|bounds| ShardBox { bounds, plane: NO_PLANE }));
    largest
}

struct Bisection<'a> {
    pieces: &'a [Piece],
    weights: &'a [f64],
    holders: &'a mut [u32],
}

impl Bisection<'_> {
    /// Deals the pieces of `order` to the members from `first` on: cuts along the longest extent of the pieces' middles, so
    /// that both sides weigh in proportion to their members' shares.
    fn cut(&mut self, order: &mut [u32], first: u32, shares: &[f64]) {
        if shares.len() <= 1 || order.is_empty() {
            order.iter().for_each(|&p| self.holders[p as usize] = first);
            return;
        }
        let middle = |p: u32| {
            let Bounds { low, high } = self.pieces[p as usize].bounds;
            std::array::from_fn::<f32, 3, _>(|i| 0.5 * low[i] + 0.5 * high[i])
        };
        let Bounds { low, high } = Bounds::around(order.iter().map(|&p| middle(p)));
        let axis = (0..3).max_by(|&a, &b| (high[a] - low[a]).total_cmp(&(high[b] - low[b]))).unwrap_or(0);
        order.sort_unstable_by(|&a, &b| middle(a)[axis].total_cmp(&middle(b)[axis]).then(a.cmp(&b)));
        let (left_shares, right_shares) = shares.split_at(shares.len() / 2);
        let left: f64 = left_shares.iter().sum();
        let total: f64 = order.iter().map(|&p| self.weights[p as usize]).sum();
        let share = total * left / shares.iter().sum::<f64>();
        let mut sum = 0.0;
        // A piece on the cut goes where most of it lies.
        let is_left = |&&p: &&u32| {
            let weight = self.weights[p as usize];
            sum += weight;
            sum <= share + 0.5 * weight
        };
        let cut = order.iter().take_while(is_left).count();
        let (left, right) = order.split_at_mut(cut);
        self.cut(left, first, left_shares);
        self.cut(right, first + left_shares.len() as u32, right_shares);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn piece(low: [f32; 3], size: f32, triangles: u32) -> Piece {
        let plane = if triangles.is_multiple_of(3) { triangles % 7 } else { NO_PLANE };
        Piece { bounds: Bounds { low, high: low.map(|c| c + size) }, triangles, plane }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn every_member_holds_its_share(
            pieces in prop::collection::vec((prop::array::uniform3(-9f32..9.0), 0f32..2.0, 1u32..64), 0..600),
            members in 1usize..20,
            random: bool,
        ) {
            let pieces: Vec<Piece> = pieces.into_iter().map(|(low, size, n)| piece(low, size, n)).collect();
            let holders = deal(&pieces, members, if random { Shards::Random } else { Shards::Spatial });
            let mut held = vec![0u32; members];
            holders.iter().zip(&pieces).for_each(|(&m, p)| held[m as usize] += p.triangles);
            let total: u32 = pieces.iter().map(|p| p.triangles).sum();
            prop_assert_eq!(held.iter().sum::<u32>(), total);
            // Each of the cuts, of which a member has at most log₂ of their number, may be off by half a piece.
            let mean = f64::from(total) / members as f64;
            let slack = 64.0 * (1.0 + f64::from(members.ilog2()) / 2.0);
            prop_assert!(held.iter().all(|&n| (f64::from(n) - mean).abs() <= slack), "{:?}", held);
        }

        #[test]
        fn outlines_hold_their_pieces(
            pieces in prop::collection::vec((prop::array::uniform3(-9f32..9.0), 0f32..2.0, 1u32..64), 0..200),
            boxes in 1usize..20,
        ) {
            let pieces: Vec<Piece> = pieces.into_iter().map(|(low, size, n)| piece(low, size, n)).collect();
            let outline = outline(&pieces, boxes);
            prop_assert!(outline.len() <= boxes);
            let holds = |b: &Bounds, p: &Bounds| (0..3).all(|i| b.low[i] <= p.low[i] && b.high[i] >= p.high[i]);
            let serves = |b: &ShardBox, p: &Piece| holds(&b.bounds, &p.bounds) && [NO_PLANE, p.plane].contains(&b.plane);
            prop_assert!(pieces.iter().all(|p| outline.iter().any(|b| serves(b, p))));
        }
    }

    #[test]
    fn spatial_shards_are_compact() {
        let pieces: Vec<Piece> =
            (0..4096).map(|i| piece([i % 16, i / 16 % 16, i / 256].map(|c| c as f32), 1.0, 2)).collect();
        let holders = deal(&pieces, 8, Shards::Spatial);
        for member in 0..8 {
            let held = pieces.iter().zip(&holders).filter(|(_, m)| **m == member);
            let Bounds { low, high } = held.fold(Bounds::EMPTY, |b, (p, _)| b.join(p.bounds));
            assert_eq!(std::array::from_fn::<_, 3, _>(|i| high[i] - low[i]), [8.0; 3]);
        }
    }
}
