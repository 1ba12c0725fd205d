//! Decoder for `EXT_meshopt_compression` and `KHR_meshopt_compression`.
//!
//! The bit streams are those of A. Kapoulkine's meshoptimizer, described in the extensions' appendices A (bit streams)
//! and B (filters). Every read is checked, and output grows only as input is consumed.

use super::json::Meshopt;

/// Decodes one buffer view: `count` rows of `byte_stride` bytes.
pub(super) fn decode(data: &[u8], view: &Meshopt) -> Result<Vec<u8>, String> {
    let (count, stride) = match (usize::try_from(view.count), usize::try_from(view.byte_stride)) {
        (Ok(count), Ok(stride)) => (count, stride),
        _ => return Err(format!("{} rows of {} bytes", view.count, view.byte_stride)),
    };
    let wrong_stride = || format!("byteStride {stride} in mode {}", view.mode);
    let damaged = || format!("damaged data in mode {}", view.mode);
    let mut decoded = match view.mode.as_str() {
        "ATTRIBUTES" => {
            if stride == 0 || stride > 256 || !stride.is_multiple_of(4) {
                return Err(wrong_stride());
            }
            attributes(data, count, stride).ok_or_else(damaged)?
        }
        "TRIANGLES" | "INDICES" => {
            if stride != 2 && stride != 4 {
                return Err(wrong_stride());
            }
            let indices = if view.mode == "INDICES" { sequence(data, count) } else { triangles(data, count) };
            let indices = indices.ok_or_else(damaged)?;
            indices.iter().flat_map(|index| index.to_le_bytes().into_iter().take(stride)).collect()
        }
        mode => return Err(format!("mode {mode:?}")),
    };
    match (view.filter.as_deref(), stride) {
        (None | Some("NONE"), _) => {}
        (Some("EXPONENTIAL"), _) => exponential(&mut decoded),
        (Some("QUATERNION"), 8) => quaternion(&mut decoded),
        (Some("COLOR"), 4) => colour::<1>(&mut decoded),
        (Some("COLOR"), 8) => colour::<2>(&mut decoded),
        // Only normals and tangents use the octahedral filter, and neither is ever read.
        (Some(filter), _) => return Err(format!("filter {filter:?} with byteStride {stride}")),
    }
    Ok(decoded)
}

/// Takes bytes from the front of `data`.
fn take<'a>(data: &mut &'a [u8], count: usize) -> Option<&'a [u8]> {
    let (head, tail) = data.split_at_checked(count)?;
    *data = tail;
    Some(head)
}

fn take_byte(data: &mut &[u8]) -> Option<u8> {
    take(data, 1)?.first().copied()
}

const GROUP: usize = 16;
const LARGEST_BLOCK: usize = 256;
type Channel = [u8; LARGEST_BLOCK];

/// Mode `ATTRIBUTES`: blocks of rows; in each, the deltas of every byte of a row are stored together.
fn attributes(data: &[u8], count: usize, stride: usize) -> Option<Vec<u8>> {
    let (header, mut data) = data.split_first()?;
    let version = header & 0x0f;
    if header & 0xf0 != 0xa0 || version > 1 {
        return None;
    }
    // The tail holds the row before the first one and, since version 1, how each group of four bytes is predicted.
    let (tail, least_tail) = if version == 0 { (stride, 32) } else { (stride + stride / 4, 24) };
    let padded = tail.max(least_tail);
    let end = data.len().checked_sub(padded)?;
    let (last, kinds) = data.get(data.len() - tail..)?.split_at_checked(stride)?;
    let mut last = last.to_vec();
    data = data.get(..end)?;
    let block = (8192 / stride / GROUP * GROUP).min(LARGEST_BLOCK);
    let mut rows = Vec::new();
    let mut done = 0;
    while done < count {
        let rows_here = block.min(count - done);
        let controls = take(&mut data, if version == 0 { 0 } else { stride / 4 })?;
        let start = rows.len();
        rows.resize(start + rows_here * stride, 0);
        for quad in 0..stride / 4 {
            let control = controls.get(quad).copied().unwrap_or(0);
            let mut channels: [Channel; 4] = [[0; LARGEST_BLOCK]; 4];
            for (byte, channel) in channels.iter_mut().enumerate() {
                let bits: &[u32; 4] = match (version, control >> (2 * byte) & 3) {
                    (0, _) => &[0, 2, 4, 8],
                    (_, 0) => &[0, 1, 2, 4],
                    (_, 1) => &[1, 2, 4, 8],
                    (_, 2) => continue,
                    _ => {
                        channel.get_mut(..rows_here)?.copy_from_slice(take(&mut data, rows_here)?);
                        continue;
                    }
                };
                groups(&mut data, channel, rows_here.div_ceil(GROUP), bits)?;
            }
            let kind = kinds.get(quad).copied().unwrap_or(0);
            let before = last.get_mut(quad * 4..quad * 4 + 4)?;
            let [first, second, third, fourth] = &channels;
            let deltas = first.iter().zip(second).zip(third.iter().zip(fourth)).take(rows_here);
            for (row, ((a, b), (c, d))) in deltas.enumerate() {
                let now = predict(kind, [*a, *b, *c, *d], before.try_into().ok()?)?;
                before.copy_from_slice(&now);
                let at = start + row * stride + quad * 4;
                rows.get_mut(at..at + 4)?.copy_from_slice(&now);
            }
        }
        done += rows_here;
    }
    data.is_empty().then_some(rows)
}

/// Four bytes of a row from their delta and the row before.
fn predict(kind: u8, delta: [u8; 4], before: [u8; 4]) -> Option<[u8; 4]> {
    let half = |at: usize| {
        let delta = u16::from_le_bytes([delta[at], delta[at + 1]]);
        let unzigzagged = (delta >> 1) ^ (delta & 1).wrapping_neg();
        unzigzagged.wrapping_add(u16::from_le_bytes([before[at], before[at + 1]])).to_le_bytes()
    };
    Some(match kind & 3 {
        0 => std::array::from_fn(|at| {
            let unzigzagged = (delta[at] >> 1) ^ (delta[at] & 1).wrapping_neg();
            unzigzagged.wrapping_add(before[at])
        }),
        1 => {
            let ([a, b], [c, d]) = (half(0), half(2));
            [a, b, c, d]
        }
        2 => {
            let turned = u32::from_le_bytes(delta).rotate_right(u32::from(kind >> 4));
            (turned ^ u32::from_le_bytes(before)).to_le_bytes()
        }
        _ => return None,
    })
}

/// Groups of 16 deltas. Two header bits choose each group's bits per delta; the largest value means "a byte follows".
fn groups(data: &mut &[u8], channel: &mut Channel, count: usize, bits: &[u32; 4]) -> Option<()> {
    let header = take(data, count.div_ceil(4))?;
    for (number, group) in channel.chunks_exact_mut(GROUP).take(count).enumerate() {
        let choice = header.get(number / 4)? >> (2 * (number % 4)) & 3;
        match bits[usize::from(choice)] {
            0 => group.fill(0),
            8 => group.copy_from_slice(take(data, GROUP)?),
            bits => {
                let packed = take(data, 2 * bits as usize)?;
                let escape = (1_u8 << bits) - 1;
                let per_byte = 8 / bits as usize;
                for (at, delta) in group.iter_mut().enumerate() {
                    let place = (at % per_byte) as u32;
                    // One-bit groups start at the low end of a byte, the others at the high end.
                    let shift = if bits == 1 { place } else { 8 - bits * (place + 1) };
                    let value = packed.get(at / per_byte)? >> shift & escape;
                    *delta = if value == escape { take_byte(data)? } else { value };
                }
            }
        }
    }
    Some(())
}

/// A number in base 128, low digits first, at most five of them.
fn variable_length(data: &mut &[u8]) -> Option<u32> {
    let mut value = 0_u32;
    for digit in 0..5 {
        let byte = take_byte(data)?;
        value |= u32::from(byte & 127) << (7 * digit);
        if byte < 128 {
            break;
        }
    }
    Some(value)
}

fn unzigzag(value: u32) -> u32 {
    (value >> 1) ^ (value & 1).wrapping_neg()
}

/// The last 16 values, most recent first by number.
struct Recent<T> {
    values: [T; 16],
    next: usize,
}

impl<T: Copy> Recent<T> {
    fn push(&mut self, value: T) {
        self.values[self.next & 15] = value;
        self.next = (self.next + 1) & 15;
    }

    /// The value pushed `age` pushes ago; 0 is the latest.
    fn get(&self, age: usize) -> T {
        self.values[self.next.wrapping_sub(1 + age) & 15]
    }
}

/// Mode `TRIANGLES`: each triangle continues a recent edge or starts anew, with recent, next or free vertices.
fn triangles(data: &[u8], count: usize) -> Option<Vec<u32>> {
    let (header, data) = data.split_first()?;
    let version = header & 0x0f;
    if header & 0xf0 != 0xe0 || version > 1 || !count.is_multiple_of(3) {
        return None;
    }
    let (codes, data) = data.split_at_checked(count / 3)?;
    let (mut data, table) = data.split_at_checked(data.len().checked_sub(16)?)?;
    let data = &mut data;
    let largest_recent = if version >= 1 { 13 } else { 15 };
    let mut edges = Recent { values: [(u32::MAX, u32::MAX); 16], next: 0 };
    let mut vertices = Recent { values: [u32::MAX; 16], next: 0 };
    let (mut next, mut last) = (0_u32, 0_u32);
    let mut indices = Vec::with_capacity(count);
    let take_next = |next: &mut u32| {
        let value = *next;
        *next = next.wrapping_add(1);
        value
    };
    for &code in codes {
        let (high, low) = (usize::from(code >> 4), usize::from(code & 15));
        if high < 15 {
            let (a, b) = edges.get(high);
            let c = if low < largest_recent {
                if low == 0 { take_next(&mut next) } else { vertices.get(low) }
            } else {
                last = match low {
                    13 => last.wrapping_sub(1),
                    14 => last.wrapping_add(1),
                    _ => last.wrapping_add(unzigzag(variable_length(data)?)),
                };
                last
            };
            if low == 0 || low >= largest_recent {
                vertices.push(c);
            }
            edges.push((c, b));
            edges.push((a, c));
            indices.extend([a, b, c]);
            continue;
        }
        let codes = if low < 14 { *table.get(low)? } else { take_byte(data)? };
        let from_table = low < 14;
        // A zero that is not from the table restarts the numbering.
        if !from_table && codes == 0 {
            next = 0;
        }
        let choices = [if low == 15 { 15 } else { 0 }, usize::from(codes >> 4), usize::from(codes & 15)];
        // Ages count from before the triangle's own vertices, the first of which is numbered, not pushed, before.
        let mut corners = [0; 3];
        for (corner, choice) in corners.iter_mut().zip(choices) {
            *corner = match choice {
                0 => take_next(&mut next),
                15 if !from_table => 0,
                age => vertices.get(age - 1),
            };
        }
        if !from_table {
            for (corner, choice) in corners.iter_mut().zip(choices) {
                if choice == 15 {
                    last = last.wrapping_add(unzigzag(variable_length(data)?));
                    *corner = last;
                }
            }
        }
        let [a, b, c] = corners;
        for (place, (corner, choice)) in corners.into_iter().zip(choices).enumerate() {
            if place == 0 || choice == 0 || choice == 15 && !from_table {
                vertices.push(corner);
            }
        }
        edges.push((b, a));
        edges.push((c, b));
        edges.push((a, c));
        indices.extend([a, b, c]);
    }
    data.is_empty().then_some(indices)
}

/// Mode `INDICES`: deltas to one of two earlier indices.
fn sequence(data: &[u8], count: usize) -> Option<Vec<u32>> {
    let (header, data) = data.split_first()?;
    if header & 0xf0 != 0xd0 || header & 0x0f > 1 {
        return None;
    }
    // Four bytes of padding end the stream.
    let mut data = data.get(..data.len().checked_sub(4)?)?;
    let mut last = [0_u32; 2];
    let mut indices = Vec::with_capacity(count.min(data.len()));
    for _ in 0..count {
        let value = variable_length(&mut data)?;
        let base = &mut last[(value & 1) as usize];
        *base = base.wrapping_add(unzigzag(value >> 1));
        indices.push(*base);
    }
    data.is_empty().then_some(indices)
}

/// Filter `EXPONENTIAL`: 24 bits of mantissa and 8 of exponent become a float.
fn exponential(rows: &mut [u8]) {
    for word in rows.as_chunks_mut::<4>().0 {
        let value = i32::from_le_bytes(*word);
        let (exponent, mantissa) = (value >> 24, value << 8 >> 8);
        let power = f32::from_bits(((exponent + 127) as u32) << 23);
        *word = (power * mantissa as f32).to_le_bytes();
    }
}

/// Filter `QUATERNION`: three components and the place of the largest, which is left out.
fn quaternion(rows: &mut [u8]) {
    for row in rows.as_chunks_mut::<8>().0 {
        let [x, y, z, w] = [0, 2, 4, 6].map(|at| i16::from_le_bytes([row[at], row[at + 1]]));
        let one = f32::from(w | 3);
        let [x, y, z] = [x, y, z].map(f32::from);
        let largest = (2.0 * one * one - x * x - y * y - z * z).max(0.0).sqrt();
        let scale = 32767.0 / std::f32::consts::SQRT_2 / one;
        let place = (w & 3) as usize;
        for (component, value) in [largest, x, y, z].into_iter().enumerate() {
            let at = 2 * ((place + component) & 3);
            let rounded = round(value * scale) as i16;
            row[at..at + 2].copy_from_slice(&rounded.to_le_bytes());
        }
    }
}

/// Filter `COLOR` (only in the Khronos extension): luma and two chroma values, scaled by the bits of alpha.
fn colour<const BYTES: usize>(rows: &mut [u8]) {
    let largest = ((1_u32 << (8 * BYTES)) - 1) as f32;
    for row in rows.chunks_exact_mut(4 * BYTES) {
        let read = |at: usize| match BYTES {
            1 => i32::from(row[at]),
            _ => i32::from(u16::from_le_bytes([row[2 * at], row[2 * at + 1]])),
        };
        let signed = |value: i32| if BYTES == 1 { i32::from(value as i8) } else { i32::from(value as i16) };
        let (luma, orange, green, alpha) = (read(0), signed(read(1)), signed(read(2)), read(3));
        // All bits below the highest bit of alpha.
        let mut scale = alpha;
        for shift in [1, 2, 4, 8] {
            scale |= scale >> shift;
        }
        let alpha = alpha << 1 & scale | alpha & 1;
        let values = [luma + orange - green, luma + green, luma - orange - green, alpha];
        for (at, value) in values.into_iter().enumerate() {
            let scaled = (value as f32 * (largest / scale as f32) + 0.5) as i32;
            row[BYTES * at..BYTES * (at + 1)].copy_from_slice(&scaled.to_le_bytes()[..BYTES]);
        }
    }
}

fn round(value: f32) -> i32 {
    (value + if value >= 0.0 { 0.5 } else { -0.5 }) as i32
}

#[cfg(test)]
mod tests;
