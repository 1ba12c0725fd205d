//! Parcels as bytes.
//!
//! A header of five words of 64 and 32 bits in the byte order of the machine: shot, home, ticket, kind, number of points or
//! rays; then the shooter, if the points have one of their own; and then array by array. A message may hold many parcels.

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
const SIZES: [usize; 5] = [SAMPLE, 4 * (RAY + 2 + HIT), size_of::<u64>(), 4 * HIT, SAMPLE];

/// Words of a ray.
const RAY: usize = 9;

/// Words of a hit or of none.
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
                rays.rays.iter().for_each(|ray| bytes.extend_from_slice(bytemuck::cast_slice(&ray_words(ray))));
                bytes.extend_from_slice(bytemuck::cast_slice(&rays.rules));
                rays.hits.iter().for_each(|hit| bytes.extend_from_slice(bytemuck::cast_slice(&hit_words(hit))));
            }
            Parcel::Home { answers: Answers::Masks(masks), .. } => {
                begin(MASKS, masks.len());
                bytes.extend_from_slice(bytemuck::cast_slice(masks));
            }
            Parcel::Home { answers: Answers::Hits(hits), .. } => {
                begin(HITS, hits.len());
                hits.iter().for_each(|hit| bytes.extend_from_slice(bytemuck::cast_slice(&hit_words(hit))));
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
        Ok(Some(match (kind, shooter) {
            (_, Some(shooter)) => onward(Content::Aimed(Aimed::new(shooter, Samples::from_bytes(part(SAMPLE))))),
            (SAMPLES, _) => onward(Content::Samples(Samples::from_bytes(part(SAMPLE)))),
            (RAYS, _) => onward(Content::Rays(Rays {
                rays: words(part(4 * RAY)).map(ray).collect(),
                rules: words(part(8)).collect(),
                hits: words(part(4 * HIT)).map(hit).collect(),
            })),
            (MASKS, _) => at_home(Answers::Masks(masks_from(part(8)))),
            _ => at_home(Answers::Hits(words(part(4 * HIT)).map(hit).collect())),
        }))
    }
}

/// Groups of `N` words of 32 bits, wherever they start in memory.
fn words<const N: usize>(bytes: &[u8]) -> impl Iterator<Item = [u32; N]> {
    bytes
        .chunks_exact(4 * N)
        .map(|group| std::array::from_fn(|i| u32::from_ne_bytes(std::array::from_fn(|k| group[4 * i + k]))))
}

fn ray_words(ray: &Ray) -> [u32; RAY] {
    let Ray { origin: [x, y, z], direction: [u, v, w], near, far, plane } = *ray;
    let [x, y, z, u, v, w, near, far] = [x, y, z, u, v, w, near, far].map(f32::to_bits);
    [x, y, z, u, v, w, near, far, plane]
}

fn ray(words: [u32; RAY]) -> Ray {
    let [x, y, z, u, v, w, near, far] = std::array::from_fn(|i| f32::from_bits(words[i]));
    Ray { origin: [x, y, z], direction: [u, v, w], near, far, plane: words[8] }
}

/// The last word says that there is no hit (0), that it is at the back (1) or at the front (2).
fn hit_words(hit: &Option<Hit>) -> [u32; HIT] {
    let Some(hit) = hit else { return [0; HIT] };
    let [s, t] = hit.barycentric.map(f32::to_bits);
    [hit.distance.to_bits(), hit.triangle, s, t, 1 + u32::from(hit.front)]
}

fn hit([distance, triangle, s, t, side]: [u32; HIT]) -> Option<Hit> {
    let barycentric = [s, t].map(f32::from_bits);
    (side > 0).then(|| Hit { distance: f32::from_bits(distance), triangle, barycentric, front: side == 2 })
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
