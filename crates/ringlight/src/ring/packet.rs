//! What travels: sample points with their masks or rays with their nearest hits so far, and the answers on their way home.

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
    /// What rays meet first.
    Rays(Rays),
}

/// Sample points with their masks, which the members join by AND.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Samples {
    /// Coordinates x, metres.
    pub x: Vec<f32>,
    /// Coordinates y, metres.
    pub y: Vec<f32>,
    /// Coordinates z, metres.
    pub z: Vec<f32>,
    /// Planes of the surfaces the points lie on.
    pub plane: Vec<u32>,
    /// The cells that are still seen from each point.
    pub masks: Vec<u64>,
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
    /// The points.
    pub fn points(&self) -> Points<'_> {
        Points { x: &self.x, y: &self.y, z: &self.z, plane: &self.plane }
    }

    /// Whether no point sees anything any more.
    pub fn is_dark(&self) -> bool {
        self.masks.iter().all(|&mask| mask == 0)
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
            Content::Samples(samples) => Answers::Masks(samples.masks),
            Content::Rays(rays) => Answers::Hits(rays.hits),
        }
    }
}
