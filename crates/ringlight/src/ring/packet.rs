//! What travels: sample points with their masks or rays with their nearest hits so far, and the answers on their way home.

use super::aimed::Aimed;
use ringlight_visibility::{Hit, Points, Ray};

/// Questions that travel and are tested together.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Packet {
    /// The shot that they are asked for.
    pub shot: u64,
    /// Place in the ring of the member that the packet belongs to.
    pub home: u32,
    /// The owner's number of the packet.
    pub ticket: u32,
    /// What is asked, and what the members visited so far have answered.
    pub content: Content,
}

/// What a packet asks.
#[derive(Clone, Debug, PartialEq)]
pub enum Content {
    /// Which of the shot's cells points see.
    Samples(Samples),
    /// Which cells of a shooter of their own points see.
    Aimed(Aimed),
    /// What rays meet first.
    Rays(Rays),
}

/// Sample points with their masks, which the members join by AND.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Samples {
    masks: Vec<u64>,
    /// Four words a point: all coordinates x, all y, all z, all planes.
    words: Vec<u32>,
}

/// Which points of a packet still see something: only they travel, and the others stay at home.
#[derive(Clone, Debug)]
pub(super) struct Seeing {
    /// Number of all points.
    count: usize,
    /// Places of those that travel.
    places: Vec<u32>,
}

/// Rays with their nearest hits so far, which the members join by [`Hit::is_nearer`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rays {
    /// The rays.
    pub rays: Vec<Ray>,
    /// What each ray may hit, in the words of those who ask and test: the ring does not understand them.
    pub rules: Vec<[u32; 2]>,
    /// The nearest hit of each ray, if any, among what has been visited.
    pub hits: Vec<Option<Hit>>,
}

/// What comes home.
#[derive(Clone, Debug, PartialEq)]
pub enum Answers {
    /// Final masks, in the order of the points.
    Masks(Vec<u64>),
    /// Nearest hits, in the order of the rays.
    Hits(Vec<Option<Hit>>),
}

/// Bytes of a sample point with its mask.
pub(super) const SAMPLE: usize = 24;

/// Points that a hierarchy tests together. It would look for neighbours among more of them, at each member anew.
const NEIGHBOURS: usize = 16;

/// A message between members of a ring.
#[derive(Clone, Debug, PartialEq)]
pub enum Parcel {
    /// To be tested by the member it is sent to.
    Onward(Packet),
    /// Tested by all: the answers come home.
    Home {
        /// The shot.
        shot: u64,
        /// The owner's number of the packet.
        ticket: u32,
        /// What the members have answered together.
        answers: Answers,
    },
}

impl Default for Content {
    fn default() -> Content {
        Content::Samples(Samples::default())
    }
}

impl Samples {
    /// The points of several runs, with the cells that are still seen from each point.
    pub fn of(runs: &[(Points<'_>, &[u64])]) -> Samples {
        let count: usize = runs.iter().map(|(_, masks)| masks.len()).sum();
        let (mut all, mut words) = (Vec::with_capacity(count), Vec::with_capacity(4 * count));
        runs.iter().for_each(|(_, masks)| all.extend_from_slice(masks));
        for axis in 0..3 {
            runs.iter().for_each(|(p, _)| words.extend_from_slice(bytemuck::cast_slice([p.x, p.y, p.z][axis])));
        }
        runs.iter().for_each(|(points, _)| words.extend_from_slice(points.plane));
        Samples { masks: all, words }
    }

    /// From bytes as they travel, a multiple of [`SAMPLE`].
    pub(super) fn from_bytes(bytes: &[u8]) -> Samples {
        assert!(bytes.len().is_multiple_of(SAMPLE));
        let (masks, words) = bytes.split_at(bytes.len() / SAMPLE * size_of::<u64>());
        // Memory that is written but once: not filled with zeros before.
        let word = |word: &[u8]| u32::from_ne_bytes(std::array::from_fn(|i| word[i]));
        Samples { masks: masks_from(masks), words: words.chunks_exact(4).map(word).collect() }
    }

    /// Appends them to a message.
    pub(super) fn write(&self, bytes: &mut Vec<u8>) {
        bytes.extend_from_slice(bytemuck::cast_slice(&self.masks));
        bytes.extend_from_slice(bytemuck::cast_slice(&self.words));
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.masks.len()
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.masks.is_empty()
    }

    /// The points.
    pub fn points(&self) -> Points<'_> {
        points(&self.words)
    }

    /// The cells that are still seen from each point.
    pub fn masks(&self) -> &[u64] {
        &self.masks
    }

    /// The points, and the cells that are still seen from each, for occluders to clear bits.
    pub fn split_mut(&mut self) -> (Points<'_>, &mut [u64]) {
        (points(&self.words), &mut self.masks)
    }

    /// The same by sixteen neighbours, which are tested together: points come in the order of their elements.
    pub fn neighbours_mut(&mut self) -> impl Iterator<Item = (Points<'_>, &mut [u64])> {
        let all = points(&self.words);
        self.masks.chunks_mut(NEIGHBOURS).enumerate().map(move |(i, masks)| {
            let some = i * NEIGHBOURS..i * NEIGHBOURS + masks.len();
            let [x, y, z] = [all.x, all.y, all.z].map(|axis| &axis[some.clone()]);
            (Points { x, y, z, plane: &all.plane[some] }, masks)
        })
    }

    /// Whether no point sees anything any more.
    pub fn is_dark(&self) -> bool {
        self.masks.iter().all(|&mask| mask == 0)
    }

    /// The plane that all points lie on, if it is one.
    pub fn plane(&self) -> Option<u32> {
        let plane = self.points().plane;
        plane.first().copied().filter(|first| plane.iter().all(|p| p == first))
    }

    /// Takes out the points that see nothing any more; none if there are no such points.
    pub(super) fn leave_dark(&mut self) -> Option<Seeing> {
        let count = self.len();
        if self.masks.iter().all(|&mask| mask != 0) {
            return None;
        }
        let places: Vec<u32> = (0..count as u32).filter(|&i| self.masks[i as usize] != 0).collect();
        for part in 0..4 {
            for (to, &from) in places.iter().enumerate() {
                // Never behind what is still to be read.
                self.words[part * places.len() + to] = self.words[part * count + from as usize];
            }
        }
        self.words.truncate(4 * places.len());
        self.masks.retain(|&mask| mask != 0);
        Some(Seeing { count, places })
    }
}

/// Coordinates and planes from their words.
fn points(words: &[u32]) -> Points<'_> {
    let (floats, count): (&[f32], usize) = (bytemuck::cast_slice(words), words.len() / 4);
    Points {
        x: &floats[..count],
        y: &floats[count..2 * count],
        z: &floats[2 * count..3 * count],
        plane: &words[3 * count..],
    }
}

impl Seeing {
    /// The answers for all points, from those for the points that have travelled.
    pub fn answers(&self, travelled: Answers) -> Answers {
        let Answers::Masks(found) = travelled else { return travelled };
        let mut masks = vec![0; self.count];
        self.places.iter().zip(found).for_each(|(&place, mask)| masks[place as usize] = mask);
        Answers::Masks(masks)
    }
}

/// Masks from bytes as they travel.
pub(super) fn masks_from(bytes: &[u8]) -> Vec<u64> {
    bytes.chunks_exact(8).map(|mask| u64::from_ne_bytes(std::array::from_fn(|i| mask[i]))).collect()
}

impl Rays {
    /// None yet, with room for so many.
    pub fn with_capacity(count: usize) -> Rays {
        let (rays, rules, hits) = (Vec::with_capacity(count), Vec::with_capacity(count), Vec::with_capacity(count));
        Rays { rays, rules, hits }
    }

    /// Adds a ray that has not met anything yet.
    pub fn push(&mut self, ray: Ray, rule: [u32; 2]) {
        self.rays.push(ray);
        self.rules.push(rule);
        self.hits.push(None);
    }

    /// Asks a member: `nearest_hits` finds the nearest hits of rays by their rules in what the member holds. What lies beyond the
    /// hits so far need not be looked for, so the rays end there.
    pub fn test(&mut self, nearest_hits: impl Fn(&[Ray], &[[u32; 2]]) -> Vec<Option<Hit>>) {
        let end = |(ray, hit): (&Ray, &Option<Hit>)| Ray { far: hit.map_or(ray.far, |hit| hit.distance), ..*ray };
        let rays: Vec<Ray> = self.rays.iter().zip(&self.hits).map(end).collect();
        for (hit, best) in nearest_hits(&rays, &self.rules).into_iter().zip(&mut self.hits) {
            *best = hit.filter(|hit| hit.is_nearer(best)).or(*best);
        }
    }
}

impl Content {
    /// Takes out the points that see nothing any more; none if there are no such points.
    pub(super) fn leave_dark(&mut self) -> Option<Seeing> {
        match self {
            Content::Samples(samples) | Content::Aimed(Aimed { samples, .. }) => samples.leave_dark(),
            Content::Rays(_) => None,
        }
    }

    /// What remains when nobody is left to be asked.
    pub fn into_answers(self) -> Answers {
        match self {
            Content::Samples(samples) | Content::Aimed(Aimed { samples, .. }) => Answers::Masks(samples.masks),
            Content::Rays(rays) => Answers::Hits(rays.hits),
        }
    }
}
