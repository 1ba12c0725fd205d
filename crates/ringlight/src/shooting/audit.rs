//! Where a shooter's light goes, by rays of its own: the audit is measured, never taken from the remainder.

use super::emitter::{range_window, sine_cosine};
use super::shot::{Shot, Source};
use crate::mesh::walk::{self, Query, Rule, Walk};
use crate::mesh::{LookAbout, Mesh, OPAQUE_COVERAGE, Patch, RELATIVE_TOLERANCE, View};
use crate::quantity::ExactSum;
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use ringlight_visibility::{Cells, Hierarchy, Hit, NO_PLANE, Ray};

/// Where the light of some rays of a shot ended, each ray counting 1: sums that do not depend on order, so that anyone may
/// follow any of the rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Fate {
    /// Rays, without those that started where no light leaves.
    pub rays: u64,
    /// Rays that met no surface at all.
    pub escaped_at_once: u64,
    /// Light that hit nothing, also behind see-through surfaces; or is what a lamp's range cuts off.
    pub escaped: ExactSum,
    /// Light that hit the unlit back of a surface.
    pub backs: ExactSum,
}

/// The same as shares of a shot's power.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FateShares {
    /// See [`Fate::escaped`].
    pub escaped: f64,
    /// See [`Fate::escaped_at_once`].
    pub escaped_at_once: f64,
    /// See [`Fate::backs`].
    pub backs: f64,
}

impl Fate {
    /// Of both.
    pub fn join(self, other: Fate) -> Fate {
        Fate {
            rays: self.rays + other.rays,
            escaped_at_once: self.escaped_at_once + other.escaped_at_once,
            escaped: self.escaped.join(other.escaped),
            backs: self.backs.join(other.backs),
        }
    }

    /// Shares of the power; none went anywhere if no ray started.
    pub fn shares(self) -> FateShares {
        let share = |sum: f64| if self.rays > 0 { sum / self.rays as f64 } else { 0.0 };
        FateShares {
            escaped: share(self.escaped.value()),
            escaped_at_once: share(self.escaped_at_once as f64),
            backs: share(self.backs.value()),
        }
    }
}

/// The rays of a shot's audit, spread evenly by the R4 sequence (Roberts 2018) and cut into blocks.
#[derive(Debug)]
pub struct Audit<'a> {
    mesh: &'a Mesh,
    shot: &'a Shot,
    rays: u32,
    centre: DVec3,
    radius: f64,
    /// Light of each cell, and of all.
    weights: Vec<f64>,
    total: f64,
    /// The shooting patch, if it is one.
    patch: Option<Patch>,
}

/// Rays of a block: little enough to share the rays out evenly, enough to be worth a message.
const BLOCK: u32 = 64;

impl<'a> Audit<'a> {
    /// Of `shot`, with so many rays. For light from infinity they start on the disc of `radius` metres about `centre` that
    /// holds the scene.
    pub fn new(mesh: &'a Mesh, shot: &'a Shot, rays: u32, centre: DVec3, radius: f64) -> Audit<'a> {
        let weights: Vec<f64> = shot.light.iter().map(|l| l.iter().map(|&x| f64::from(x)).sum()).collect();
        let total = weights.iter().sum();
        let patch = match &shot.source {
            Source::Patch(source) => Some(mesh.patch(source.patch)),
            _ => None,
        };
        Audit { mesh, shot, rays, centre, radius, weights, total, patch }
    }

    /// Number of blocks.
    pub fn blocks(&self) -> u32 {
        self.rays.div_ceil(BLOCK)
    }

    /// The rays of a block.
    pub fn walks(&self, block: u32) -> impl Iterator<Item = Following<'_>> {
        (block * BLOCK..self.rays.min((block + 1) * BLOCK)).map(|i| Following::new(self, i))
    }

    /// Follows all rays where all triangles are held.
    pub fn follow(&self, hierarchy: &Hierarchy) -> Fate {
        let follow = |block| {
            let fates = self.walks(block).map(|w| walk::run(self.mesh, hierarchy, w).fate());
            fates.fold(Fate::default(), Fate::join)
        };
        (0..self.blocks()).into_par_iter().map(follow).reduce(Fate::default, Fate::join)
    }

    /// Where ray `i` starts, and its direction; none where no light leaves.
    fn start(&self, i: u32) -> Option<(DVec3, DVec3)> {
        let fraction = |g: f64| (0.5 + g * f64::from(i + 1)).fract();
        // Generators of the R4 sequence.
        let [a, b, c, d] =
            [0.856_674_883_854_502_9, 0.733_891_856_627_126, 0.628_706_721_037_809_5, 0.538_597_257_223_655_8]
                .map(fraction);
        // The cell by its share of the light.
        let mut left = c * self.total;
        let mut cell = self.weights.len() - 1;
        for (k, &w) in self.weights.iter().enumerate() {
            if left < w {
                cell = k;
                break;
            }
            left -= w;
        }
        let disc = |normal: DVec3, r: f64| {
            let (t, u) = normal.any_orthonormal_pair();
            let (s, c) = sine_cosine(b);
            r * (c * t + s * u)
        };
        match (&self.shot.source, &self.shot.shooter.cells) {
            (Source::Patch(source), Cells::Grid(grid)) => {
                // Within the cell along one diagonal is enough to leave the grid's symmetry.
                let inner = DVec2::new(d, (d * 7.0).fract()) - 0.5;
                let step = 1.0 / f64::from(grid.side) / if source.count == 3 { 3.0 } else { 1.0 };
                let [u, v] = grid.layout.centre(grid.side, cell).map(f64::from);
                let (u, v) = (u + inner.x * step, v + inner.y * step);
                if self.patch.as_ref().is_some_and(|patch| patch.is_covered(self.mesh, DVec2::new(u, v))) {
                    return None;
                }
                let edge = |e: [f32; 3]| DVec3::from(e.map(f64::from));
                let origin =
                    edge(grid.origin) + u * edge(grid.edge_u) + v * edge(grid.edge_v) + u * v * edge(grid.twist);
                // Just above the surface, lest rounding lets a flat ray pass under a neighbour's edge.
                let n = source.normal;
                let origin = origin + RELATIVE_TOLERANCE * self.mesh.diagonal * n;
                // Cosine distribution (Malley's method).
                Some((origin, disc(n, a.sqrt()) + (1.0 - a).sqrt() * n))
            }
            (Source::Point { position, cone: None, .. }, _) => {
                let z = 2.0 * a - 1.0;
                Some((*position, disc(DVec3::Y, (1.0 - z * z).sqrt()) + z * DVec3::Y))
            }
            (Source::Point { position, cone: Some((axis, inner, outer)), .. }, _) => {
                let z = 1.0 - a * (1.0 - outer);
                let ramp = ((z - outer) / (inner - outer).max(1e-4)).clamp(0.0, 1.0);
                // By rejection against the cone's squared ramp.
                (d < ramp * ramp).then(|| (*position, disc(*axis, (1.0 - z * z).max(0.0).sqrt()) + z * *axis))
            }
            (Source::Directions, Cells::Directions(directions)) => {
                let towards = DVec3::from(directions[cell].map(f64::from));
                Some((self.centre + 2.0 * self.radius * towards + disc(towards, self.radius * a.sqrt()), -towards))
            }
            _ => None,
        }
    }

    /// How many metres the light reaches.
    fn range(&self) -> f64 {
        match self.shot.source {
            Source::Point { range, .. } => range,
            _ => f64::INFINITY,
        }
    }
}

/// One ray on its way through see-through surfaces to where its light ends.
#[derive(Clone, Debug)]
pub struct Following<'a> {
    audit: &'a Audit<'a>,
    origin: DVec3,
    ray: Ray,
    step: Step<'a>,
    /// Surfaces met.
    surfaces: u32,
    /// What is left of the light.
    weight: f64,
    /// What of it has ended where.
    shares: FateShares,
    /// Whether no light leaves where it started.
    lost: bool,
}

/// What is asked next.
#[derive(Clone, Debug)]
enum Step<'a> {
    /// What the ray meets.
    Follow,
    /// Whether it started on a covered place: a patch's free samples are known to a sixteenth of an element only.
    LookBack(LookAbout<'a>),
    /// Nothing more.
    Over,
}

/// Surfaces behind each other after which a ray is given up.
const MOST_SURFACES: u32 = 64;

impl<'a> Following<'a> {
    fn new(audit: &'a Audit<'a>, i: u32) -> Following<'a> {
        let start = audit.start(i);
        let (origin, direction) = start.unwrap_or_default();
        let ray = Ray {
            origin: origin.as_vec3().to_array(),
            direction: direction.as_vec3().to_array(),
            near: 0.0,
            far: f32::INFINITY,
            plane: audit.shot.shooter.plane,
        };
        let (step, lost) = if start.is_some() { (Step::Follow, false) } else { (Step::Over, true) };
        Following { audit, origin, ray, step, surfaces: 0, weight: 1.0, shares: FateShares::default(), lost }
    }

    /// Where its light went, once the walk is over.
    pub fn fate(&self) -> Fate {
        let mut fate = Fate::default();
        if !self.lost {
            fate.rays = 1;
            fate.escaped_at_once = self.shares.escaped_at_once as u64;
            fate.escaped.add(self.shares.escaped);
            fate.backs.add(self.shares.backs);
        }
        fate
    }

    /// Takes what the ray meets; says whether it goes on.
    fn meet(&mut self, hit: Option<Hit>) -> bool {
        let Some(hit) = hit else {
            self.shares.escaped += self.weight;
            if self.weight == 1.0 {
                self.shares.escaped_at_once = 1.0;
            }
            return false;
        };
        if self.surfaces == 0 {
            let reaching = range_window(f64::from(hit.distance), self.audit.range());
            self.shares.escaped += 1.0 - reaching;
            self.weight = reaching;
        }
        let mesh = self.audit.mesh;
        let number = hit.triangle >> 1;
        let facet = &mesh.facets[number as usize];
        // A cut-out blocks wholly where it is hit.
        let cutout = mesh.occluder.cutout[facet.surface as usize].is_some();
        let coverage = if cutout { 1.0 } else { mesh.occluder.coverage(number, facet) };
        let blocked = if coverage >= OPAQUE_COVERAGE { 1.0 } else { f64::from(coverage) };
        if !hit.front && !facet.double_sided() {
            self.shares.backs += self.weight * blocked;
        }
        self.weight *= 1.0 - blocked;
        self.surfaces += 1;
        self.ray.near = hit.distance.next_up();
        self.ray.plane = NO_PLANE;
        self.weight >= 1e-3 && self.surfaces < MOST_SURFACES
    }
}

impl Walk for Following<'_> {
    fn query(&self) -> Option<Query> {
        match &self.step {
            Step::Follow => Some(Query { ray: self.ray, rule: Rule::All }),
            Step::LookBack(look) => look.query(),
            Step::Over => None,
        }
    }

    fn answer(&mut self, hit: Option<Hit>) {
        match &mut self.step {
            Step::Follow => {
                if !self.meet(hit) {
                    // Light that stays in the scene was received by somebody: where it matters, look again.
                    self.step = match &self.audit.patch {
                        Some(patch) if self.shares != FateShares::default() => {
                            Step::LookBack(LookAbout::new(self.audit.mesh, patch, self.origin))
                        }
                        _ => Step::Over,
                    };
                }
            }
            Step::LookBack(look) => {
                look.answer(hit);
                if look.query().is_none() {
                    self.lost = look.view() == View::Covered;
                    self.step = Step::Over;
                }
            }
            Step::Over => {}
        }
    }
}
