//! Irradiance at any point: what all patches, lamps, the sun and the sky send there, through what stands between.
//!
//! A patch is a shooter that carries its whole radiosity. For each point it gets as many cells as its share of the point's
//! light deserves; a patch whose share is not certain enough with all of them is cut in four, again and again. So near
//! patches are seen as the interpolated light of their elements, lamps behind edges through thousands of cells, and far
//! dim ones through one. What a point gets does not depend on the other points.

use super::dealt_out::dealt_out;
use super::nearest::closest_point;
use super::place::{Place, Surroundings};
use super::sides::Sides;
use super::{Point, Reading, Status};
use crate::form_factor::contour;
use crate::mesh::{Inquiry, Mesh, Patch, Tile};
use crate::shooting::{self, Emitter, FAR, Field, Packet, PatchSource, Shoot, Shot, Source, WHOLE, radiosity};
use crate::solution::Solution;
use crate::solve::Ring;
use crate::transport::{Communicator, Failure};
use glam::DVec3;
use rayon::prelude::*;
use ringlight_visibility::{Cells, Points, Shooter};

/// How finely light is gathered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GatherOptions {
    /// Most cells of a patch, or of a part of one: 1, 4, 16 or 64.
    pub cells: u32,
    /// Share of a point's light by which a patch, or a part of one, may be off before it is cut into parts.
    pub tolerance: f64,
}

impl Default for GatherOptions {
    fn default() -> GatherOptions {
        GatherOptions { cells: 64, tolerance: 2e-5 }
    }
}

/// Points that share their shots.
const CHUNK: usize = 64;

/// Points of a patch's border that tell whether shadows cross it.
const BORDER: u32 = 64;

/// A patch is cut in four at most this many times in a row.
const DEEPEST: u32 = 6;

/// The irradiance at each point: gathered from the radiosity of all patches (exitance + reflectance × irradiance of their
/// elements), from punctual lights and from the sky, obstructed by what stands between.
///
/// Radiosity that the solver has not shot yet counts in full; an ambient term for light that has not even arrived does not.
///
/// Every rank calls it with the same points; the readings are on rank 0.
pub fn gather<'a, 'p>(
    solution: &'a Solution,
    points: &'p [Point],
    options: &GatherOptions,
    ring: &mut Ring<'a>,
    ranks: &mut Communicator<'_>,
) -> Result<Option<Vec<Reading>>, Failure> {
    let around = Surroundings::new(solution);
    let gatherer = Gatherer::new(solution, options);
    let (around, gatherer, origin) = (&around, &gatherer, DVec3::from(solution.mesh.origin));
    let task = |points: &'p [Point], inquiry: Inquiry<'a>| async move {
        let mut places: Vec<Option<Place>> = Vec::with_capacity(points.len());
        for point in points {
            let (position, normal) = (DVec3::from(point.position) - origin, DVec3::from(point.normal).normalize());
            places.push(around.stand(&inquiry, position, normal).await);
        }
        let open: Vec<Place> = places.iter().flatten().copied().collect();
        let mut found = gatherer.irradiances(&open, inquiry).await.into_iter();
        let reading = |place: &Option<Place>| match place.and_then(|_| found.next()) {
            Some(irradiance) => Reading { irradiance: irradiance.map(|e| e as f32), status: Status::Ok },
            None => Reading::without_light(Status::Inside),
        };
        places.iter().map(reading).collect()
    };
    dealt_out(points, CHUNK, task, ring, ranks)
}

/// The solution as a set of shooters.
struct Gatherer<'a> {
    solution: &'a Solution,
    mesh: &'a Mesh,
    /// Patches that are not dark.
    shining: Vec<Shining>,
    emitters: Vec<Emitter>,
    /// Most cells along a side.
    side: u32,
    tolerance: f64,
}

/// A patch that is not dark.
struct Shining {
    patch: u32,
    /// The brightest radiosity on it, summed over channels.
    brightest: f64,
}

/// What bounds the light that a shooter can give.
struct Extent {
    corners: [DVec3; 4],
    count: usize,
    /// A ball that holds it.
    centre: DVec3,
    radius: f64,
    normal: DVec3,
    area: f64,
    /// The brightest radiosity on it, summed over channels.
    brightest: f64,
}

/// Points on their way through all shooters.
struct Chunk<'a> {
    inquiry: Inquiry<'a>,
    places: &'a [Place],
    /// Irradiance so far.
    sum: Vec<[f64; 3]>,
    /// A rough irradiance, summed over channels.
    rough: Vec<f64>,
    packet: Packet,
}

impl<'a> Gatherer<'a> {
    fn new(solution: &'a Solution, options: &GatherOptions) -> Gatherer<'a> {
        let mesh = &solution.mesh;
        let shining = (0..mesh.patch_count() as u32)
            .into_par_iter()
            .filter_map(|id| {
                let patch = mesh.patch(id);
                let lit = patch.elements().filter(|&e| mesh.valid[e as usize] != 0);
                let bright = |e: u32| total(radiosity(mesh, &patch, e, solution.light(e)));
                let brightest = lit.map(bright).fold(0.0, f64::max);
                (brightest > 0.0).then_some(Shining { patch: id, brightest })
            })
            .collect();
        let low = mesh.clusters.iter().fold(DVec3::INFINITY, |a, c| a.min(c.low.as_dvec3()));
        let high = mesh.clusters.iter().fold(DVec3::NEG_INFINITY, |a, c| a.max(c.high.as_dvec3()));
        let radius = (high - low).length() / 2.0;
        let side = f64::from(options.cells).sqrt() as u32;
        let mut emitters = shooting::emitters(&solution.description.lights, mesh.origin, radius);
        if let Some(radiance) = solution.settings.sky {
            emitters.extend(shooting::skies(radiance, side, radius));
        }
        Gatherer { solution, mesh, shining, emitters, side, tolerance: options.tolerance }
    }

    async fn irradiances(&self, places: &[Place], inquiry: Inquiry<'_>) -> Vec<[f64; 3]> {
        let (sum, rough) = (vec![[0.0; 3]; places.len()], vec![0.0; places.len()]);
        let mut chunk = Chunk { inquiry, places, sum, rough, packet: Packet::default() };
        let all: Vec<u32> = (0..places.len() as u32).collect();
        for emitter in &self.emitters {
            let lit = chunk.receive(emitter, &all).await;
            chunk.add(&lit, &[]);
        }
        self.estimate(&mut chunk, &all).await;
        for shining in &self.shining {
            self.add_patch(&mut chunk, shining).await;
        }
        chunk.sum
    }

    /// A rough irradiance, each patch seen through one cell.
    async fn estimate(&self, chunk: &mut Chunk<'_>, all: &[u32]) {
        chunk.rough = chunk.sum.iter().map(|&e| total(e)).collect();
        for shining in &self.shining {
            let patch = self.mesh.patch(shining.patch);
            let radiosity = self.radiosity(&patch);
            let shot = Field::new(self.mesh, &patch, &radiosity).shot(1, Shoot::Average, 0.0);
            for (place, i) in chunk.receive(&shot, all).await.into_iter().zip(0..) {
                chunk.rough[place as usize] += total(chunk.packet.received()[i].point);
            }
        }
    }

    /// Of the free part of each element of a patch.
    fn radiosity(&self, patch: &Patch) -> Vec<[f64; 3]> {
        patch.elements().map(|e| radiosity(self.mesh, patch, e, self.solution.light(e))).collect()
    }

    /// Adds what a patch gives to the points, each with the cells that its share of their light deserves.
    async fn add_patch(&self, chunk: &mut Chunk<'_>, shining: &Shining) {
        let patch = self.mesh.patch(shining.patch);
        let extent = Extent::new(patch.frame.corners(), patch.normal, patch.area, shining.brightest);
        let mut by_side: [Vec<u32>; 4] = Default::default();
        for (i, place) in chunk.places.iter().enumerate() {
            let share = chunk.share(i, extent.most(place));
            if share > 0.0 {
                by_side[self.side_for(share, extent.straddles(place)).ilog2() as usize].push(i as u32);
            }
        }
        if by_side.iter().all(|points| points.is_empty()) {
            return;
        }
        let radiosity = self.radiosity(&patch);
        let field = Field::new(self.mesh, &patch, &radiosity);
        for (k, points) in by_side.iter().enumerate().filter(|(_, points)| !points.is_empty()) {
            let side = 1 << k;
            if side == self.side {
                let sides = self.suspect(chunk, &patch, points).await;
                self.add_part(chunk, &field, field.scale(), WHOLE, (points, &sides), 0).await;
            } else {
                let lit = chunk.receive(&field.shot(side, Shoot::Elements, 0.0), points).await;
                chunk.add(&lit, &[]);
            }
        }
    }

    /// The fewest cells along a side that keep a shadow's error below the tolerance.
    fn side_for(&self, share: f64, straddles: bool) -> u32 {
        let error = |side: u32| if straddles { share } else { share * shadow_error(side) };
        [1, 2, 4].into_iter().find(|&side| side < self.side && error(side) <= self.tolerance).unwrap_or(self.side)
    }

    /// All sides for those of `points` that see a part of the border of a patch only: an edge of shadow may run between it
    /// and the outermost cells.
    async fn suspect(&self, chunk: &Chunk<'_>, patch: &Patch, points: &[u32]) -> Vec<Sides> {
        let (corners, count) = patch.frame.corners();
        let border = (0..BORDER).map(|k| {
            let along = f64::from(k * count as u32) / f64::from(BORDER);
            let edge = along as usize;
            corners[edge].lerp(corners[(edge + 1) % count], along.fract()).as_vec3().to_array()
        });
        let border: Vec<[f32; 3]> = border.collect();
        let above = |place: &Place| {
            let rises = |p: &[f32; 3]| place.normal.dot(DVec3::from(p.map(f64::from)) - place.point) > 0.0;
            border.iter().enumerate().fold(0u64, |mask, (k, p)| mask | u64::from(rises(p)) << k)
        };
        let places = || points.iter().map(|&i| &chunk.places[i as usize]);
        let whole: Vec<u64> = places().map(above).collect();
        let mut seen = whole.clone();
        let [x, y, z] = [0, 1, 2].map(|axis| places().map(|p| p.point.as_vec3()[axis]).collect::<Vec<f32>>());
        let plane: Vec<u32> = places().map(|p| p.plane).collect();
        let shooter = Shooter { cells: Cells::Points(border.clone()), plane: patch.plane, far: FAR };
        let points = Points { x: &x, y: &y, z: &z, plane: &plane };
        chunk.inquiry.clear_blocked(&shooter, points, &mut seen).await;
        let sides = seen.iter().zip(&whole).map(|(&s, &w)| if s == w || s == 0 { Sides::NONE } else { Sides::ALL });
        sides.collect()
    }

    /// Adds what the part of a patch over `tile` gives to `points`, which come with the sides of the part along which an edge
    /// of shadow may run; cuts it in four for those that need it.
    async fn add_part(
        &self,
        chunk: &mut Chunk<'_>,
        field: &Field<'_>,
        scale: [f64; 3],
        tile: Tile,
        (points, sides): (&[u32], &[Sides]),
        depth: u32,
    ) {
        let shot = field.part(tile, self.side, scale);
        let Source::Patch(source) = &shot.source else { return };
        let lights = || shot.light.iter().map(|&l| total(l.map(f64::from)));
        let (dimmest, brightest) = lights().fold((f64::INFINITY, 0.0), |(a, b), l| (l.min(a), l.max(b)));
        if brightest == 0.0 {
            return;
        }
        let extent = Extent::new((source.corners, source.count), source.normal, source.area, brightest);
        let lit = chunk.receive(&shot, points).await;
        // Those for which the part is to be cut, with the cells that they see, those below the horizon counted as seen.
        let mut cut: Vec<(u32, u64, Sides)> = Vec::new();
        for (&i, &sides) in points.iter().zip(sides).filter(|_| depth < DEEPEST) {
            let place = &chunk.places[i as usize];
            let share = chunk.share(i as usize, extent.most(place));
            if share <= self.tolerance {
                continue;
            }
            // Where all cells are below the horizon, the rest of it is not known at all.
            let Ok(k) = lit.binary_search(&i) else {
                cut.push((i, u64::MAX, sides));
                continue;
            };
            let (seen, above) = (chunk.packet.masks()[k], shot.above_horizon(place.point, place.normal));
            let shadow = match sides {
                _ if seen != above && seen != 0 => shadow_error(self.side),
                Sides::NONE => 0.0,
                // The edge runs within half a cell of the border: uniformly distributed there.
                _ => 0.5 / f64::from(self.side) / 3f64.sqrt(),
            };
            let vague = match seen {
                0 => 0.0,
                _ if seen == above => 1.0 - dimmest / brightest,
                _ => 1.0,
            };
            if share * (shadow + vague * nearness(source, self.side, place.point)) > self.tolerance {
                cut.push((i, seen | !above, sides));
            }
        }
        let without: Vec<u32> = cut.iter().map(|&(i, ..)| i).collect();
        chunk.add(&lit, &without);
        if let (Cells::Grid(grid), false) = (&shot.shooter.cells, cut.is_empty()) {
            for quarter in 0..4 {
                let part = tile.compose(Tile::of(grid.layout, [2, 2], quarter));
                let sides: Vec<Sides> = cut
                    .iter()
                    .map(|&(_, seen, sides)| sides.of_quarter(quarter, grid.layout, self.side, seen))
                    .collect();
                Box::pin(self.add_part(chunk, field, scale, part, (&without, &sides), depth + 1)).await;
            }
        }
    }
}

/// What rises less than this above a plane, seen from a point of it, lies in the plane; radians. Its form factor is of the
/// order of the square.
const IN_PLANE: f64 = 1e-6;

/// Error of the visible share of a shooter across a straight shadow edge, rms, for `side`² cells: 0.27·M^(−3/4) (DESIGN
/// section 3).
fn shadow_error(side: u32) -> f64 {
    let root = f64::from(side).sqrt();
    0.27 / (root * root * root)
}

/// By how much the weights of cells, of discs in place of contours, may be off at a point: (cell/distance)², at most 1.
fn nearness(source: &PatchSource, side: u32, point: DVec3) -> f64 {
    let mut corners = source.corners;
    let corners = &mut corners[..source.count];
    // Counter-clockwise about the normal of the lit side.
    if (corners[1] - corners[0]).cross(corners[2] - corners[0]).dot(source.normal) < 0.0 {
        corners.reverse();
    }
    let distance = (closest_point(corners, source.normal, point) - point).length_squared();
    let cell = source.diameter / f64::from(side);
    if distance > cell * cell { cell * cell / distance } else { 1.0 }
}

fn total(rgb: [f64; 3]) -> f64 {
    rgb[0] + rgb[1] + rgb[2]
}

impl Extent {
    fn new((corners, count): ([DVec3; 4], usize), normal: DVec3, area: f64, brightest: f64) -> Extent {
        let centre = corners[..count].iter().sum::<DVec3>() / count as f64;
        let radius = corners[..count].iter().map(|&c| (c - centre).length()).fold(0.0, f64::max);
        Extent { corners, count, centre, radius, normal, area, brightest }
    }

    /// No less than the irradiance that it gives to a place when nothing stands between, summed over channels: exact when
    /// it is near; else by F ≤ A cosθᵣ cosθₛ / (πr²) for the nearest and best aligned point of its ball.
    fn most(&self, place: &Place) -> f64 {
        let to = self.centre - place.point;
        let (height, rise, away) = (-self.normal.dot(to), self.heights(place).1, to.length());
        if height <= IN_PLANE * away || rise <= IN_PLANE * away {
            return 0.0;
        }
        let nearest = away - self.radius;
        if nearest <= self.radius {
            return self.brightest * contour(place.point, place.normal, &self.corners[..self.count]);
        }
        let cosines = (height / nearest).min(1.0) * (rise / nearest).min(1.0);
        self.brightest * (self.area * cosines / (std::f64::consts::PI * nearest * nearest)).min(1.0)
    }

    /// Whether a part of it lies below the horizon of a place.
    fn straddles(&self, place: &Place) -> bool {
        self.heights(place).0 <= 0.0
    }

    /// Lowest and highest corner above the horizon of a place, metres.
    fn heights(&self, place: &Place) -> (f64, f64) {
        let above = self.corners[..self.count].iter().map(|&c| place.normal.dot(c - place.point));
        above.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
    }
}

impl Chunk<'_> {
    /// An irradiance as a share of all that a point receives.
    fn share(&self, point: usize, irradiance: f64) -> f64 {
        let all = self.rough[point].max(total(self.sum[point]));
        if irradiance == 0.0 { 0.0 } else { irradiance / all }
    }

    /// Computes what those of `points` (sorted) receive that have the shot above their horizon; gives these.
    async fn receive(&mut self, shot: &Shot, points: &[u32]) -> Vec<u32> {
        self.packet.clear();
        let mut lit = Vec::with_capacity(points.len());
        for &i in points {
            let place = &self.places[i as usize];
            let mask = shot.above_horizon(place.point, place.normal);
            if mask != 0 {
                self.packet.push(place.point, place.normal, place.plane, mask);
                lit.push(i);
            }
        }
        let (points, masks) = self.packet.split_mut();
        self.inquiry.clear_blocked(&shot.shooter, points, masks).await;
        self.packet.gather(shot);
        lit
    }

    /// Adds what was received last to the points that received it, except for those in `without`, which is sorted.
    fn add(&mut self, lit: &[u32], without: &[u32]) {
        for (i, received) in lit.iter().zip(self.packet.received()) {
            if without.binary_search(i).is_err() {
                (0..3).for_each(|c| self.sum[*i as usize][c] += received.point[c]);
            }
        }
    }
}
