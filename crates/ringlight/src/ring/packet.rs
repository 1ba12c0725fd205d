//! What travels: sample points with their masks, and masks on their way home.

use ringlight_visibility::Points;

/// Sample points that travel and are tested together.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Packet {
    /// The shot whose cells the masks are of.
    pub shot: u64,
    /// Place in the ring of the member that the packet belongs to.
    pub home: u32,
    /// The owner's number of the packet.
    pub ticket: u32,
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

/// A message between members of a ring.
#[derive(Clone, Debug, PartialEq)]
pub enum Parcel {
    /// To be tested by the member it is sent to.
    Onward(Packet),
    /// Tested by all: the masks come home.
    Home {
        /// The shot.
        shot: u64,
        /// The owner's number of the packet.
        ticket: u32,
        /// Final masks, in the order of the points.
        masks: Vec<u64>,
    },
}

/// Bytes that are no parcel: the ranks do not run the same program.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0} bytes are no parcels")]
pub struct Malformed(pub usize);

/// The home of parcels that are there.
const ARRIVED: u32 = u32::MAX;

impl Packet {
    /// The points.
    pub fn points(&self) -> Points<'_> {
        Points { x: &self.x, y: &self.y, z: &self.z, plane: &self.plane }
    }

    /// Whether no point sees anything any more.
    pub fn is_dark(&self) -> bool {
        self.masks.iter().all(|&mask| mask == 0)
    }
}

impl Parcel {
    /// Appends it to a message, in the byte order of the machine: shot, home, ticket, number of points, and then array by
    /// array. A message may hold many parcels.
    pub fn write(&self, bytes: &mut Vec<u8>) {
        let (shot, home, ticket, masks) = match self {
            Parcel::Onward(p) => (p.shot, p.home, p.ticket, &p.masks),
            Parcel::Home { shot, ticket, masks } => (*shot, ARRIVED, *ticket, masks),
        };
        bytes.extend_from_slice(&shot.to_ne_bytes());
        bytes.extend_from_slice(&home.to_ne_bytes());
        bytes.extend_from_slice(&ticket.to_ne_bytes());
        bytes.extend_from_slice(&(masks.len() as u32).to_ne_bytes());
        bytes.extend_from_slice(bytemuck::cast_slice(masks));
        if let Parcel::Onward(p) = self {
            [&p.x, &p.y, &p.z].into_iter().for_each(|axis| bytes.extend_from_slice(bytemuck::cast_slice(axis)));
            bytes.extend_from_slice(bytemuck::cast_slice(&p.plane));
        }
    }

    /// Takes the next parcel off a message; none at its end.
    pub fn read(bytes: &mut &[u8]) -> Result<Option<Parcel>, Malformed> {
        if bytes.is_empty() {
            return Ok(None);
        }
        let malformed = Malformed(bytes.len());
        let (header, content) = bytes.split_at_checked(HEADER).ok_or(malformed)?;
        let word = |i: usize| u32::from_ne_bytes(std::array::from_fn(|k| header[i + k]));
        let shot = u64::from_ne_bytes(std::array::from_fn(|k| header[k]));
        let (home, ticket, count) = (word(8), word(12), word(16) as usize);
        let size = if home == ARRIVED { size_of::<u64>() } else { POINT };
        let len = count.checked_mul(size).ok_or(malformed)?;
        let (content, after) = content.split_at_checked(len).ok_or(malformed)?;
        *bytes = after;
        let (masks, rest) = content.split_at(count * size_of::<u64>());
        let masks = bytemuck::pod_collect_to_vec(masks);
        if home == ARRIVED {
            return Ok(Some(Parcel::Home { shot, ticket, masks }));
        }
        let part = |i: usize| &rest[i * 4 * count..(i + 1) * 4 * count];
        let [x, y, z] = [0, 1, 2].map(|i| bytemuck::pod_collect_to_vec(part(i)));
        let plane = bytemuck::pod_collect_to_vec(part(3));
        Ok(Some(Parcel::Onward(Packet { shot, home, ticket, x, y, z, plane, masks })))
    }
}

/// Bytes before the arrays.
const HEADER: usize = 20;

/// Bytes per point on the way: mask, coordinates, plane.
const POINT: usize = 8 + 12 + 4;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parcels_come_out_as_they_went_in() {
        let packet = Packet {
            shot: 1 << 40,
            home: 3,
            ticket: 7,
            x: vec![1.5, -0.0],
            y: vec![2.0, f32::MIN_POSITIVE],
            z: vec![3.0, 1e30],
            plane: vec![u32::MAX, 0],
            masks: vec![u64::MAX, 5],
        };
        let home = Parcel::Home { shot: 9, ticket: 1, masks: vec![3, 0, 1] };
        let empty = Parcel::Onward(Packet { shot: 2, ..Packet::default() });
        let parcels = [Parcel::Onward(packet), home, empty];
        // Messages may start anywhere in memory.
        let mut message = vec![0];
        parcels.iter().for_each(|parcel| parcel.write(&mut message));
        let mut rest = &message[1..];
        for parcel in parcels {
            assert_eq!(Parcel::read(&mut rest), Ok(Some(parcel)));
        }
        assert_eq!(Parcel::read(&mut rest), Ok(None));
        assert_eq!(Parcel::read(&mut &[0; 19][..]), Err(Malformed(19)));
        assert_eq!(Parcel::read(&mut &message[1..40]), Err(Malformed(39)));
    }
}
