//! Points dealt out to ranks.

use super::{Point, Reading, Status};
use crate::mesh::Inquiry;
use crate::solve::Ring;
use crate::transport::{Communicator, Failure};

/// Tag of readings on their way to rank 0.
const READINGS: u32 = 50;

/// Readings that a rank sends at a time, about.
const BATCH: usize = 1 << 16;

/// Words of a reading: irradiance and status.
const WORDS: usize = 4;

/// Reads points in chunks of so many, every rank its share of the chunks: rank i of N those whose number is i modulo N.
/// Rank 0 gets all readings, in the order of the points.
pub fn dealt_out<'a, 'p, F>(
    points: &'p [Point],
    chunk: usize,
    task: impl Fn(&'p [Point], Inquiry<'a>) -> F,
    ring: &mut Ring<'a>,
    ranks: &mut Communicator<'_>,
) -> Result<Option<Vec<Reading>>, Failure>
where
    F: Future<Output = Vec<Reading>> + Send,
{
    let (rank, size) = (ranks.rank(), ranks.size());
    let mut own: Vec<Vec<Reading>> = vec![Vec::new(); points.len().div_ceil(chunk).saturating_sub(rank).div_ceil(size)];
    let dealt = points.chunks(chunk).skip(rank).step_by(size).enumerate();
    let numbered = |(place, points), inquiry| {
        let reading = task(points, inquiry);
        async move { (place, reading.await) }
    };
    ring.ask(ranks, dealt, numbered, |(place, readings)| own[place] = readings)?;
    let in_batch = BATCH.div_ceil(chunk);
    let part = |batch: usize| {
        let some = own.iter().skip(batch * in_batch).take(in_batch).flatten();
        bytemuck::cast_slice(&some.map(to_words).collect::<Vec<_>>()).to_vec()
    };
    let mut all = Vec::with_capacity(if rank == 0 { points.len() } else { 0 });
    let take = |_, parts: Vec<Vec<u8>>| {
        let mut parts: Vec<_> = parts.iter().map(|part| part.chunks_exact(4 * WORDS).map(from_bytes)).collect();
        for part in (0..size).cycle().take(in_batch * size) {
            let left = points.len() - all.len();
            all.extend(parts[part].by_ref().take(chunk.min(left)));
        }
        Ok::<(), Failure>(())
    };
    ranks.gather_batches(READINGS, points.len().div_ceil(in_batch * chunk * size), part, take)??;
    Ok((rank == 0).then_some(all))
}

fn to_words(reading: &Reading) -> [u32; WORDS] {
    let [r, g, b] = reading.irradiance.map(f32::to_bits);
    [r, g, b, reading.status as u32]
}

fn from_bytes(bytes: &[u8]) -> Reading {
    let word = |k: usize| u32::from_ne_bytes(std::array::from_fn(|i| bytes[4 * k + i]));
    let statuses = [Status::Ok, Status::Inside, Status::Far];
    let status = statuses.into_iter().find(|&status| status as u32 == word(3)).unwrap_or(Status::Far);
    Reading { irradiance: [0, 1, 2].map(|c| f32::from_bits(word(c))), status }
}
