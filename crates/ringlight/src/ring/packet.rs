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
    /// Three words a point, as they travel: all masks; then, two to a word, all coordinates x, y, z and planes.
    words: Vec<u64>,
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
        let mut words = vec![0; 3 * count];
        let (all, rest) = words.split_at_mut(count);
        let halves: &mut [u32] = bytemuck::cast_slice_mut(rest);
        let mut start = 0;
        for (points, masks) in runs {
            all[start..][..masks.len()].copy_from_slice(masks);
            let parts = [points.x, points.y, points.z].map(bytemuck::cast_slice::<f32, u32>);
            for (i, part) in parts.into_iter().chain([points.plane]).enumerate() {
                halves[i * count + start..][..part.len()].copy_from_slice(part);
            }
            start += masks.len();
        }
        Samples { words }
    }

    /// From words as they travel; they are a multiple of three.
    pub(super) fn from_words(words: Vec<u64>) -> Samples {
        assert!(words.len().is_multiple_of(3));
        Samples { words }
    }

    /// As they travel.
    pub(super) fn words(&self) -> &[u64] {
        &self.words
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.words.len() / 3
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.words.is_empty()
    }

    /// The points.
    pub fn points(&self) -> Points<'_> {
        points(&self.words[self.len()..])
    }

    /// The cells that are still seen from each point.
    pub fn masks(&self) -> &[u64] {
        &self.words[..self.len()]
    }

    /// The points, and the cells that are still seen from each, for occluders to clear bits.
    pub fn split_mut(&mut self) -> (Points<'_>, &mut [u64]) {
        let count = self.len();
        let (masks, rest) = self.words.split_at_mut(count);
        (points(rest), masks)
    }

    /// Whether no point sees anything any more.
    pub fn is_dark(&self) -> bool {
        self.masks().iter().all(|&mask| mask == 0)
    }

    /// The plane that all points lie on, if it is one.
    pub fn plane(&self) -> Option<u32> {
        let plane = self.points().plane;
        plane.first().copied().filter(|first| plane.iter().all(|p| p == first))
    }
}

/// Coordinates and planes from their words.
fn points(words: &[u64]) -> Points<'_> {
    let (floats, planes): (&[f32], &[u32]) = (bytemuck::cast_slice(words), bytemuck::cast_slice(words));
    let count = words.len() / 2;
    Points {
        x: &floats[..count],
        y: &floats[count..2 * count],
        z: &floats[2 * count..3 * count],
        plane: &planes[3 * count..],
    }
}

impl Rays {
    /// Adds a ray that has not met anything yet.
    pub fn push(&mut self, ray: Ray, rule: [u32; 2]) {
        self.rays.push(ray);
        self.rules.push(rule);
        self.hits.push(None);
    }

    /// Asks a member: `nearest_hit` finds the nearest hit of a ray by a rule in what the member holds. What lies beyond the
    /// hits so far need not be looked for, so the rays end there.
    pub fn test(&mut self, nearest_hit: impl Fn(&Ray, [u32; 2]) -> Option<Hit>) {
        for ((ray, &rule), best) in self.rays.iter().zip(&self.rules).zip(&mut self.hits) {
            let far = best.map_or(ray.far, |hit| hit.distance);
            if let Some(hit) = nearest_hit(&Ray { far, ..*ray }, rule)
                && hit.is_nearer(best)
            {
                *best = Some(hit);
            }
        }
    }
}

impl Content {
    /// What remains when nobody is left to be asked.
    pub fn into_answers(self) -> Answers {
        match self {
            Content::Samples(samples) | Content::Aimed(Aimed { samples, .. }) => {
                let mut words = samples.words;
                words.truncate(words.len() / 3);
                Answers::Masks(words)
            }
            Content::Rays(rays) => Answers::Hits(rays.hits),
        }
    }
}
