//! Drives the pipelines of many ranks in a random order, and compares the answers with those of one hierarchy.

#[path = "../../../ringlight-visibility/tests/common/mod.rs"]
mod common;

use super::{
    Action, Aimed, Answers, Bounds, Content, Outlines, Packet, Parcel, Piece, Pipeline, Rays, Rings, Routing, Samples,
    ShardBox, Shards, Sight, deal, outline,
};
use common::{Place, Random, filters, samples, shooter, triangles};
use proptest::prelude::*;
use ringlight_visibility::{Filter, Hierarchy, Hit, NO_PLANE, Points, PreparedShooter, Ray, Shooter, Triangle};
use std::collections::VecDeque;
use std::sync::Arc;

/// A random scene and some shots in it, each with points that have to know what they see, and rays that have to know what
/// they meet.
struct Task {
    triangles: Vec<Triangle>,
    filters: Vec<Filter>,
    shots: Vec<(Shooter, common::Samples, Vec<Inquiry>)>,
}

/// A ray, and a rule: only triangles whose number is congruent to the second word modulo the first count.
type Inquiry = (Ray, [u32; 2]);

/// What a hierarchy says of a ray.
fn nearest_hit(hierarchy: &Hierarchy, ray: &Ray, [modulus, residue]: [u32; 2]) -> Option<Hit> {
    hierarchy.nearest_hit_where(ray, |triangle| triangle.id % modulus == residue)
}

/// How it is done.
#[derive(Clone, Copy, Debug)]
struct Way {
    ranks: usize,
    rings: usize,
    shards: Shards,
    routing: Routing,
    packet_size: usize,
    window: usize,
    /// Boxes that describe a shard.
    boxes: usize,
}

/// One simulated rank.
struct Rank {
    pipeline: Pipeline,
    shard: Hierarchy,
    /// First rank of its ring.
    first: usize,
    outlines: Arc<Outlines>,
    /// Shots it has been told of; they come in order.
    known: usize,
    /// Own packets that wait for their shot and for room.
    waiting: VecDeque<Packet>,
}

/// What the points of a shot see and its rays meet.
type Found = (Vec<u64>, Vec<Option<Hit>>);

/// What a simulation saw.
#[derive(Debug, Default)]
struct Outcome {
    /// Masks of each shot's points, and hits of its rays.
    answers: Vec<Found>,
    packets: u64,
    tested: u64,
    messages: u64,
}

impl Task {
    fn random(seed: u64) -> Task {
        let random = &mut Random(seed);
        let place = Place::random(random);
        let filters = filters(random);
        let triangles = triangles(random, place, 250, filters.len());
        let shots = (0..3)
            .map(|_| {
                let parts: Vec<common::Samples> = (0..4).map(|_| samples(random, place)).collect();
                let points: Vec<[f32; 3]> =
                    parts.iter().flat_map(|s| (0..s.x.len()).map(|i| s.points().at(i))).collect();
                let plane = parts.iter().flat_map(|s| s.plane.clone()).collect();
                let rays = (0..70).map(|_| inquiry(random, place)).collect();
                (shooter(random, place), common::Samples::new(&points, plane), rays)
            })
            .collect();
        Task { triangles, filters, shots }
    }

    /// What one hierarchy says.
    fn expected(&self) -> Vec<Found> {
        let whole = Hierarchy::build(self.triangles.clone(), self.filters.clone());
        let found = |(shooter, samples, rays): &(Shooter, common::Samples, Vec<Inquiry>)| {
            let mut masks = vec![shooter.cells.all(); samples.x.len()];
            whole.clear_blocked(shooter, samples.points(), &mut masks);
            (masks, rays.iter().map(|(ray, rule)| nearest_hit(&whole, ray, *rule)).collect())
        };
        self.shots.iter().map(found).collect()
    }

    /// The hierarchy and the boxes of each member of a ring.
    fn shards(&self, way: &Way, members: usize) -> Vec<(Hierarchy, Vec<ShardBox>)> {
        let piece = |t: &Triangle| Piece { bounds: Bounds::around(t.corners), triangles: 1, plane: t.plane };
        let pieces: Vec<Piece> = self.triangles.iter().map(piece).collect();
        let holders = deal(&pieces, members, way.shards);
        (0..members as u32)
            .map(|member| {
                let held: Vec<_> = (0..pieces.len()).filter(|&i| holders[i] == member).collect();
                let triangles = held.iter().map(|&i| self.triangles[i]).collect();
                let pieces: Vec<_> = held.iter().map(|&i| pieces[i]).collect();
                (Hierarchy::build(triangles, self.filters.clone()), outline(&pieces, way.boxes))
            })
            .collect()
    }

    /// Ranks that know no shot yet; every packet belongs to a random one.
    fn ranks(&self, way: &Way, random: &mut Random) -> Vec<Rank> {
        let rings = Rings::new(way.ranks, way.rings).expect("so many rings can be");
        let mut ranks = Vec::new();
        for ring in 0..way.rings {
            let members = rings.members(ring);
            let (shards, outlines): (Vec<_>, Vec<_>) = self.shards(way, members.len()).into_iter().unzip();
            let outlines = Arc::new(Outlines::new(&outlines));
            ranks.extend(shards.into_iter().enumerate().map(|(place, shard)| Rank {
                pipeline: Pipeline::new(place, way.routing, way.window),
                shard,
                first: members.start,
                outlines: outlines.clone(),
                known: 0,
                waiting: VecDeque::new(),
            }));
        }
        for (shot, (shooter, samples, rays)) in self.shots.iter().enumerate() {
            for start in (0..samples.x.len()).step_by(way.packet_size) {
                let range = start..samples.x.len().min(start + way.packet_size);
                let points = Points {
                    x: &samples.x[range.clone()],
                    y: &samples.y[range.clone()],
                    z: &samples.z[range.clone()],
                    plane: &samples.plane[range.clone()],
                };
                let masks = vec![shooter.cells.all(); range.len()];
                let samples = Samples::of(&[(points, &masks)]);
                // Every other packet brings the shooter along.
                let content = match start / way.packet_size % 2 {
                    0 => Content::Samples(samples),
                    _ => Content::Aimed(Aimed::new(shooter.clone(), samples)),
                };
                let packet = Packet { shot: shot as u64, home: 0, ticket: start as u32, content };
                ranks[random.below(way.ranks)].waiting.push_back(packet);
            }
            for (i, chunk) in rays.chunks(way.packet_size).enumerate() {
                let mut asked = Rays::default();
                chunk.iter().for_each(|&(ray, rule)| asked.push(ray, rule));
                let content = Content::Rays(asked);
                let packet = Packet { shot: shot as u64, home: 0, ticket: (i * way.packet_size) as u32, content };
                ranks[random.below(way.ranks)].waiting.push_back(packet);
            }
        }
        ranks
    }

    /// Lets the ranks work, in a random order of everything, until nothing is left to do.
    fn simulate(&self, way: &Way, random: &mut Random) -> Outcome {
        let mut ranks = self.ranks(way, random);
        let nothing =
            |(_, samples, rays): &(_, common::Samples, Vec<_>)| (vec![0; samples.x.len()], vec![None; rays.len()]);
        let mut answered: Vec<Found> = self.shots.iter().map(nothing).collect();
        // Messages may even overtake each other.
        let mut under_way: Vec<(usize, Vec<u8>)> = Vec::new();
        let mut outcome = Outcome::default();
        let packets: usize = ranks.iter().map(|rank| rank.waiting.len()).sum();
        let mut turns = 0;
        while outcome.packets < packets as u64 {
            turns += 1;
            // Some thousand turns per packet are usual at most: shots become known late, packets wait for room.
            assert!(turns < 1_000_000 + 10_000 * packets, "the ranks wait for each other: {way:?}");
            let number = random.below(ranks.len());
            if random.below(2) == 0 && !under_way.is_empty() {
                let (to, bytes) = under_way.swap_remove(random.below(under_way.len()));
                let parcel = Parcel::read(&mut bytes.as_slice()).expect("it is as it was written");
                ranks[to].pipeline.receive(parcel.expect("there is one"));
                continue;
            }
            let rank = &mut ranks[number];
            if rank.known < self.shots.len() && random.below(10) == 0 {
                let shooter = self.shots[rank.known].0.clone();
                rank.pipeline.begin(
                    rank.known as u64,
                    Sight::new(Arc::new(PreparedShooter::new(&shooter)), rank.outlines.clone()),
                );
                rank.known += 1;
            }
            if let Some(packet) = rank.waiting.front()
                && packet.shot < rank.known as u64
                && rank.pipeline.has_room()
            {
                rank.pipeline.submit(rank.waiting.pop_front().expect("there is one"));
            }
            let members = rank.outlines.members();
            assert!(rank.pipeline.held() <= members * way.window, "more packets than all windows let through");
            assert!(rank.pipeline.in_flight() <= way.window);
            let Some(action) = rank.pipeline.poll() else { continue };
            match action {
                Action::Send { to, parcel } => {
                    let mut bytes = Vec::new();
                    parcel.write(&mut bytes);
                    under_way.push((rank.first + to, bytes));
                }
                Action::Test(mut packet) => {
                    match &mut packet.content {
                        Content::Samples(samples) => {
                            let shooter = &self.shots[packet.shot as usize].0;
                            for (points, masks) in samples.neighbours_mut() {
                                rank.shard.clear_blocked(shooter, points, masks);
                            }
                        }
                        Content::Aimed(aimed) => {
                            let (shooter, points, masks) = aimed.split_mut();
                            rank.shard.clear_blocked_of(shooter, points, masks);
                        }
                        Content::Rays(rays) => rays.test(|rays, rules| {
                            rays.iter().zip(rules).map(|(ray, rule)| nearest_hit(&rank.shard, ray, *rule)).collect()
                        }),
                    }
                    rank.pipeline.tested(packet);
                }
                Action::Finish { shot, ticket, answers } => {
                    let (start, (masks, hits)) = (ticket as usize, &mut answered[shot as usize]);
                    match answers {
                        Answers::Masks(found) => masks[start..start + found.len()].copy_from_slice(&found),
                        Answers::Hits(found) => hits[start..start + found.len()].copy_from_slice(&found),
                    }
                    outcome.packets += 1;
                }
            }
        }
        assert!(under_way.is_empty());
        for rank in &ranks {
            assert!(rank.waiting.is_empty() && rank.pipeline.held() == 0 && rank.pipeline.in_flight() == 0);
            outcome.tested += rank.pipeline.visits().tested;
            outcome.messages += rank.pipeline.visits().sent;
        }
        assert_eq!(outcome.packets, ranks.iter().map(|rank| rank.pipeline.visits().own).sum::<u64>());
        Outcome { answers: answered, ..outcome }
    }
}

/// A ray from somewhere to somewhere, short or without end, which may hit all triangles or every second.
fn inquiry(random: &mut Random, place: Place) -> Inquiry {
    let (from, to) = if random.below(3) == 0 {
        (place.at(random.lattice()), place.at(random.lattice()))
    } else {
        (place.at(random.vector()), place.at(random.vector()))
    };
    let ray = Ray {
        origin: from,
        direction: std::array::from_fn(|i| to[i] - from[i]),
        near: if random.below(4) == 0 { 0.1 } else { 0.0 },
        far: if random.below(2) == 0 { 1.0 } else { f32::INFINITY },
        plane: if random.below(2) == 0 { random.below(4) as u32 } else { NO_PLANE },
    };
    let modulus = 1 + random.below(2);
    (ray, [modulus as u32, random.below(modulus) as u32])
}

const RINGS: [(usize, usize); 11] =
    [(1, 1), (2, 1), (2, 2), (3, 1), (3, 2), (4, 1), (4, 2), (6, 4), (8, 1), (8, 3), (16, 5)];

proptest! {
    #![proptest_config(ProptestConfig { cases: 16, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn answers_are_those_of_one_hierarchy(seed: u64) {
        answers_are_those_of_one(seed)?;
    }
}

/// Rays come home before the samples with their ticket, of which some have stayed at home.
#[test]
fn rays_and_samples_may_have_one_ticket() {
    answers_are_those_of_one(147789047624458548).expect("answers agree");
}

fn answers_are_those_of_one(seed: u64) -> Result<(), TestCaseError> {
    let task = Task::random(seed);
    let expected = task.expected();
    let random = &mut Random(seed ^ 1);
    for (ranks, rings) in RINGS {
        for packet_size in [1, 7, 200] {
            let shards = [Shards::Spatial, Shards::Random][random.below(2)];
            let routing = [Routing::Boxes, Routing::All][random.below(2)];
            let (window, boxes) = (1 + random.below(5), 1 + random.below(9));
            let way = Way { ranks, rings, shards, routing, packet_size, window, boxes };
            let outcome = task.simulate(&way, random);
            prop_assert_eq!(&outcome.answers, &expected, "seed {}, {:?}", seed, way);
            let members = ranks.div_ceil(rings) as u64;
            prop_assert!(outcome.tested <= members * outcome.packets, "{:?}", outcome);
            if members == 1 {
                prop_assert_eq!(outcome.messages, 0);
            }
        }
    }
    Ok(())
}

/// The paper's way visits every member while anything is seen; ours passes by many.
#[test]
fn boxes_spare_visits() {
    let (mut all, mut boxes, mut packets) = (0, 0, 0);
    for seed in 0..10 {
        let task = Task::random(seed);
        let way = Way {
            ranks: 8,
            rings: 1,
            shards: Shards::Spatial,
            routing: Routing::All,
            packet_size: 7,
            window: 3,
            boxes: 8,
        };
        let random = &mut Random(seed);
        let outcomes = [Routing::All, Routing::Boxes].map(|routing| task.simulate(&Way { routing, ..way }, random));
        assert_eq!(outcomes[0].answers, outcomes[1].answers);
        all += outcomes[0].tested;
        boxes += outcomes[1].tested;
        packets += outcomes[0].packets;
    }
    assert!(all > 4 * packets, "{all} visits of {packets} packets");
    assert!(boxes < all, "{boxes} visits with boxes, {all} without");
}
