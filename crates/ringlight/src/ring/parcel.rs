//! Parcels as bytes.
//!
//! A header of five words of 64 and 32 bits in the byte order of the machine: shot, home, ticket, kind, number of points or
//! rays; then the shooter, if the points have one of their own; and then array by array. A message may hold many parcels.
//!
//! Rays are most of what travels. They are written without saying anything twice: where they start, by turns, as the points
//! that look about together send them; the directions, each with the number of rays that follow each other in it; and of the hits
//! only those that there are.

use super::aimed::Aimed;
use super::packet::{Answers, Content, Packet, Parcel, Rays, SAMPLE, Samples, masks_from};
use ringlight_visibility::{Hit, Ray};

/// Bytes that are no parcel: the ranks do not run the same program.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0} bytes are no parcels")]
pub struct Malformed(pub usize);

/// Bytes before the arrays.
const HEADER: usize = 24;

/// What the arrays are, and how many bytes they have for each point or ray.
const SAMPLES: u32 = 0;
const RAYS: u32 = 1;
const MASKS: u32 = 2;
const HITS: u32 = 3;
const AIMED: u32 = 4;
const SIZES: [usize; 5] = [SAMPLE, 0, size_of::<u64>(), 0, SAMPLE];

/// Words of a start: all of a ray but its direction, and its rule.
const START: usize = 8;

/// Words of a direction and of how many rays have it.
const DIRECTION: usize = 4;

/// Words of a hit, and of the number of the ray that has it.
const HIT: usize = 5;

impl Parcel {
    /// Appends it to a message.
    pub fn write(&self, bytes: &mut Vec<u8>) {
        let (shot, home, ticket) = match self {
            Parcel::Onward(p) => (p.shot, p.home, p.ticket),
            Parcel::Home { shot, ticket, .. } => (*shot, 0, *ticket),
        };
        bytes.extend_from_slice(&shot.to_ne_bytes());
        let mut begin = |kind: u32, count: usize| {
            bytes.extend_from_slice(bytemuck::cast_slice(&[home, ticket, kind, count as u32]));
        };
        match self {
            Parcel::Onward(Packet { content: Content::Samples(samples), .. }) => {
                begin(SAMPLES, samples.len());
                samples.write(bytes);
            }
            Parcel::Onward(Packet { content: Content::Aimed(aimed), .. }) => {
                begin(AIMED, aimed.samples.len());
                bytes.extend_from_slice(bytemuck::cast_slice(&aimed.words()));
                aimed.samples.write(bytes);
            }
            Parcel::Onward(Packet { content: Content::Rays(rays), .. }) => {
                begin(RAYS, rays.rays.len());
                write_rays(rays, bytes);
                write_hits(&rays.hits, bytes);
            }
            Parcel::Home { answers: Answers::Masks(masks), .. } => {
                begin(MASKS, masks.len());
                bytes.extend_from_slice(bytemuck::cast_slice(masks));
            }
            Parcel::Home { answers: Answers::Hits(hits), .. } => {
                begin(HITS, hits.len());
                write_hits(hits, bytes);
            }
        }
    }

    /// Takes the next parcel off a message; none at its end.
    pub fn read(bytes: &mut &[u8]) -> Result<Option<Parcel>, Malformed> {
        if bytes.is_empty() {
            return Ok(None);
        }
        let malformed = Malformed(bytes.len());
        let (header, mut content) = bytes.split_at_checked(HEADER).ok_or(malformed)?;
        let shot = u64::from_ne_bytes(std::array::from_fn(|k| header[k]));
        let [home, ticket, kind, count] =
            [8, 12, 16, 20].map(|i| u32::from_ne_bytes(std::array::from_fn(|k| header[i + k])));
        let count = count as usize;
        let size = *SIZES.get(kind as usize).ok_or(malformed)?;
        let shooter = if kind == AIMED { Some(Aimed::take_shooter(&mut content).ok_or(malformed)?) } else { None };
        let rays = if kind == RAYS { Some(take_rays(&mut content, count).ok_or(malformed)?) } else { None };
        let hits =
            if kind == RAYS || kind == HITS { take_hits(&mut content, count).ok_or(malformed)? } else { Vec::new() };
        let (mut content, after) =
            content.split_at_checked(count.checked_mul(size).ok_or(malformed)?).ok_or(malformed)?;
        *bytes = after;
        let mut part = |size: usize| {
            let (part, rest) = content.split_at(count * size);
            content = rest;
            part
        };
        let onward = |content| Parcel::Onward(Packet { shot, home, ticket, content });
        let at_home = |answers| Parcel::Home { shot, ticket, answers };
        Ok(Some(match (kind, shooter, rays) {
            (_, Some(shooter), _) => onward(Content::Aimed(Aimed::new(shooter, Samples::from_bytes(part(SAMPLE))))),
            (_, _, Some(rays)) => onward(Content::Rays(Rays { hits, ..rays })),
            (SAMPLES, ..) => onward(Content::Samples(Samples::from_bytes(part(SAMPLE)))),
            (MASKS, ..) => at_home(Answers::Masks(masks_from(part(8)))),
            _ => at_home(Answers::Hits(hits)),
        }))
    }
}

/// Appends rays without their hits: the number of starts and of directions, and these.
fn write_rays(Rays { rays, rules, .. }: &Rays, bytes: &mut Vec<u8>) {
    let start = |i: usize| start_words(&rays[i], rules[i]);
    let again = (1..rays.len()).find(|&i| start(i) == start(0)).unwrap_or(rays.len());
    let by_turns = (again..rays.len()).all(|i| start(i) == start(i % again));
    let starts = if by_turns { again } else { rays.len() };
    let parallel = |a: &Ray, b: &Ray| a.direction.map(f32::to_bits) == b.direction.map(f32::to_bits);
    let directions = rays.chunk_by(parallel);
    bytes.extend_from_slice(bytemuck::cast_slice(&[starts as u32, directions.clone().count() as u32]));
    (0..starts).for_each(|i| bytes.extend_from_slice(bytemuck::cast_slice(&start(i))));
    for some in directions {
        let [u, v, w] = some[0].direction.map(f32::to_bits);
        bytes.extend_from_slice(bytemuck::cast_slice(&[u, v, w, some.len() as u32]));
    }
}

/// Takes so many rays, without hits; none if they are not there.
fn take_rays(bytes: &mut &[u8], count: usize) -> Option<Rays> {
    let [starts, directions] = words::<2>(take(bytes, 8)?).next()?.map(|n| n as usize);
    let starts: Vec<[u32; START]> = words(take(bytes, starts.checked_mul(4 * START)?)?).collect();
    let directions = words::<DIRECTION>(take(bytes, directions.checked_mul(4 * DIRECTION)?)?);
    let mut rays = Rays::with_capacity(count.min(starts.len().checked_mul(directions.len())?));
    for [u, v, w, parallel] in directions {
        if parallel as usize > count - rays.rays.len() || starts.is_empty() {
            return None;
        }
        for _ in 0..parallel {
            let (ray, rule) = ray(starts[rays.rays.len() % starts.len()], [u, v, w]);
            rays.push(ray, rule);
        }
    }
    (rays.rays.len() == count).then_some(rays)
}

/// Appends those hits that there are, each with the number of its ray.
fn write_hits(hits: &[Option<Hit>], bytes: &mut Vec<u8>) {
    let found = (0..).zip(hits).filter_map(|(number, hit)| hit.map(|hit| (number, hit)));
    bytes.extend_from_slice(&(found.clone().count() as u32).to_ne_bytes());
    found.for_each(|(number, hit)| bytes.extend_from_slice(bytemuck::cast_slice(&hit_words(number, &hit))));
}

/// Takes the hits of so many rays; none if they are not there.
fn take_hits(bytes: &mut &[u8], count: usize) -> Option<Vec<Option<Hit>>> {
    let [found] = words::<1>(take(bytes, 4)?).next()?.map(|n| n as usize);
    let mut hits = vec![None; count];
    for words in words::<HIT>(take(bytes, found.checked_mul(4 * HIT)?)?) {
        let (number, hit) = hit(words);
        *hits.get_mut(number)? = Some(hit);
    }
    Some(hits)
}

/// Takes so many bytes.
fn take<'b>(bytes: &mut &'b [u8], count: usize) -> Option<&'b [u8]> {
    let (some, rest) = bytes.split_at_checked(count)?;
    *bytes = rest;
    Some(some)
}

/// Groups of `N` words of 32 bits, wherever they start in memory.
fn words<const N: usize>(bytes: &[u8]) -> impl ExactSizeIterator<Item = [u32; N]> {
    bytes
        .chunks_exact(4 * N)
        .map(|group| std::array::from_fn(|i| u32::from_ne_bytes(std::array::from_fn(|k| group[4 * i + k]))))
}

fn start_words(ray: &Ray, [kind, patch]: [u32; 2]) -> [u32; START] {
    let Ray { origin: [x, y, z], near, far, plane, .. } = *ray;
    let [x, y, z, near, far] = [x, y, z, near, far].map(f32::to_bits);
    [x, y, z, near, far, plane, kind, patch]
}

/// A ray and its rule.
fn ray([x, y, z, near, far, plane, kind, patch]: [u32; START], direction: [u32; 3]) -> (Ray, [u32; 2]) {
    let [x, y, z, near, far] = [x, y, z, near, far].map(f32::from_bits);
    (Ray { origin: [x, y, z], direction: direction.map(f32::from_bits), near, far, plane }, [kind, patch])
}

/// The first word is twice the number of the ray, and one more if it hit the front.
fn hit_words(number: u32, hit: &Hit) -> [u32; HIT] {
    let [s, t] = hit.barycentric.map(f32::to_bits);
    [number << 1 | u32::from(hit.front), hit.distance.to_bits(), hit.triangle, s, t]
}

/// The number of a ray, and its hit.
fn hit([number, distance, triangle, s, t]: [u32; HIT]) -> (usize, Hit) {
    let (distance, barycentric) = (f32::from_bits(distance), [s, t].map(f32::from_bits));
    ((number >> 1) as usize, Hit { distance, triangle, barycentric, front: number & 1 == 1 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use ringlight_visibility::{Cells, Grid, Layout, Points, Shooter};

    #[test]
    fn parcels_come_out_as_they_went_in() {
        let (x, y, z, plane) = ([1.5, -0.0], [2.0, f32::MIN_POSITIVE], [3.0, 1e30], [u32::MAX, 0]);
        let points = Points { x: &x, y: &y, z: &z, plane: &plane };
        let samples = Samples::of(&[(points, &[u64::MAX, 5])]);
        let hit = Hit { distance: 2.5, triangle: 77, barycentric: [0.25, -0.0], front: true };
        let mut rays = Rays::default();
        for (i, hit) in [None, Some(hit), Some(Hit { front: false, ..hit })].into_iter().enumerate() {
            let [x, far] = [i as f32, 1.0 / i as f32];
            rays.push(Ray { origin: [x, 2.0, -3.0], direction: [0.0, -0.0, 1e-30], near: x, far, plane: 9 }, [4, 7]);
            rays.hits[i] = hit;
        }
        // Two points that look in three directions, cut off before the last.
        let mut fan = Rays::default();
        for i in 0..5 {
            let (origin, turn) = ([(i % 2) as f32, 0.5, 0.0], (i / 2) as f32);
            let ray = Ray { origin, direction: [1.0, turn, 0.0], near: 0.0, far: f32::INFINITY, plane: i % 2 };
            fan.push(ray, [0, 0]);
        }
        fan.hits[3] = Some(hit);
        let grid = |layout| {
            let (origin, edge_u, edge_v, twist) = ([1.0, -2.0, 3.0], [0.5, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0; 3]);
            Cells::Grid(Grid { origin, edge_u, edge_v, twist, layout, side: 8 })
        };
        let aimed = |cells| Content::Aimed(Aimed::new(Shooter { cells, plane: 5, far: 0.75 }, samples.clone()));
        let home = |answers| Parcel::Home { shot: 9, ticket: 1, answers };
        let onward = |content| Parcel::Onward(Packet { shot: 1 << 40, home: 3, ticket: 7, content });
        let parcels = [
            onward(Content::Samples(samples.clone())),
            home(Answers::Masks(samples.masks().to_vec())),
            Parcel::Onward(Packet { shot: 2, ..Packet::default() }),
            onward(aimed(grid(Layout::Quad))),
            onward(aimed(grid(Layout::Triangle))),
            onward(aimed(Cells::Points(vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]))),
            onward(aimed(Cells::Directions(vec![[0.0, 1.0, 0.0]]))),
            onward(Content::Rays(rays.clone())),
            home(Answers::Hits(rays.hits)),
            onward(Content::Rays(Rays::default())),
            onward(Content::Rays(fan)),
        ];
        // Messages may start anywhere in memory.
        let mut message = vec![0];
        parcels.iter().for_each(|parcel| parcel.write(&mut message));
        let mut rest = &message[1..];
        for parcel in parcels {
            assert_eq!(Parcel::read(&mut rest), Ok(Some(parcel)));
        }
        assert_eq!(Parcel::read(&mut rest), Ok(None));
        assert_eq!(Parcel::read(&mut &[0; 23][..]), Err(Malformed(23)));
        assert_eq!(Parcel::read(&mut &[9; 24][..]), Err(Malformed(24)));
        assert_eq!(Parcel::read(&mut &message[1..40]), Err(Malformed(39)));
    }
}
