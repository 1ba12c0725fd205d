//! Operations in which every rank takes part.
//!
//! They may follow each other without a pause, and other messages may be under way: each step waits for one rank, and
//! messages from one rank with one tag come in order.

use super::{Communicator, Failure, Message};

/// Does a piece of other work while a collective operation waits; says whether there was any.
pub type Serve<'a> = dyn FnMut(&mut Communicator<'_>) -> Result<bool, Failure> + 'a;

impl Communicator<'_> {
    /// Joins one value of each rank into the same result on all; `join` must be commutative and associative. Takes
    /// log₂ of the number of ranks messages from each (recursive doubling: Thakur, Rabenseifner & Gropp 2005, section 4).
    pub fn all_reduce<const N: usize>(
        &mut self,
        tag: u32,
        value: [u8; N],
        join: impl Fn([u8; N], [u8; N]) -> [u8; N],
    ) -> Result<[u8; N], Failure> {
        self.all_reduce_meanwhile(tag, value, join, &mut |_| Ok(false))
    }

    /// The same, with `serve` called while it waits: it does a piece of other work and says whether there was any.
    pub fn all_reduce_meanwhile<const N: usize>(
        &mut self,
        tag: u32,
        value: [u8; N],
        join: impl Fn([u8; N], [u8; N]) -> [u8; N],
        serve: &mut Serve<'_>,
    ) -> Result<[u8; N], Failure> {
        let (rank, size) = (self.rank(), self.size());
        // The largest power of two; ranks beyond it hand their value in and get the result back.
        let core = 1 << size.ilog2();
        if rank >= core {
            self.send(rank - core, tag, value.to_vec());
            return self.wait_for_value(rank - core, tag, serve);
        }
        let mut joined = value;
        if rank + core < size {
            joined = join(joined, self.wait_for_value(rank + core, tag, serve)?);
        }
        let mut distance = 1;
        while distance < core {
            let partner = rank ^ distance;
            self.send(partner, tag, joined.to_vec());
            joined = join(joined, self.wait_for_value(partner, tag, serve)?);
            distance *= 2;
        }
        if rank + core < size {
            self.send(rank + core, tag, joined.to_vec());
        }
        Ok(joined)
    }

    /// Gives the bytes of rank `root` to all (along a binomial tree); what others pass is ignored.
    pub fn broadcast(&mut self, root: usize, tag: u32, bytes: Vec<u8>) -> Result<Vec<u8>, Failure> {
        self.broadcast_meanwhile(root, tag, bytes, &mut |_| Ok(false))
    }

    /// The same, with other work done while it waits, see [`Communicator::all_reduce_meanwhile`].
    pub fn broadcast_meanwhile(
        &mut self,
        root: usize,
        tag: u32,
        bytes: Vec<u8>,
        serve: &mut Serve<'_>,
    ) -> Result<Vec<u8>, Failure> {
        let size = self.size();
        let place = (self.rank() + size - root) % size;
        let rank_of = |place: usize| (place + root) % size;
        let mut bytes = bytes;
        // The lowest set bit of a place says from where it gets the bytes; it passes them on along the bits below.
        let mut bit = 1;
        while bit < size && place & bit == 0 {
            bit *= 2;
        }
        if place != 0 {
            bytes = self.wait_for_meanwhile(rank_of(place - bit), tag, serve)?;
        }
        while bit > 1 {
            bit /= 2;
            if place + bit < size {
                self.send(rank_of(place + bit), tag, bytes.clone());
            }
        }
        Ok(bytes)
    }

    /// Brings the bytes of every rank to `root`: there in the order of ranks, nothing elsewhere.
    pub fn gather(&mut self, root: usize, tag: u32, bytes: Vec<u8>) -> Result<Option<Vec<Vec<u8>>>, Failure> {
        self.send(root, tag, bytes);
        if self.rank() != root {
            return Ok(None);
        }
        (0..self.size()).map(|from| self.wait_for(from, tag)).collect::<Result<_, _>>().map(Some)
    }

    /// Brings the bytes of every rank to all, in the order of ranks.
    pub fn all_gather(&mut self, tag: u32, bytes: Vec<u8>) -> Result<Vec<Vec<u8>>, Failure> {
        // Lengths first, then the bytes of all in a row.
        let packed = self.gather(0, tag, bytes)?.map_or_else(Vec::new, |parts| {
            let lengths = parts.iter().flat_map(|part| (part.len() as u64).to_le_bytes());
            lengths.chain(parts.iter().flatten().copied()).collect()
        });
        let packed = self.broadcast(0, tag, packed)?;
        let unpack = || {
            let (lengths, mut rest) = packed.split_at_checked(8 * self.size())?;
            let mut parts = Vec::with_capacity(self.size());
            for length in lengths.chunks_exact(8) {
                let length = u64::from_le_bytes(length.try_into().ok()?);
                let (part, others) = rest.split_at_checked(usize::try_from(length).ok()?)?;
                parts.push(part.to_vec());
                rest = others;
            }
            Some(parts)
        };
        unpack().ok_or_else(|| Failure {
            rank: self.rank(),
            message: format!("{} bytes with tag {tag} are not what all ranks have given", packed.len()),
        })
    }

    /// Gives every rank its part, and brings what all have given to this one, in the order of ranks.
    pub fn exchange(&mut self, tag: u32, parts: Vec<Vec<u8>>) -> Result<Vec<Vec<u8>>, Failure> {
        parts.into_iter().enumerate().for_each(|(to, part)| self.send(to, tag, part));
        (0..self.size()).map(|from| self.wait_for(from, tag)).collect()
    }

    fn wait_for_value<const N: usize>(
        &mut self,
        from: usize,
        tag: u32,
        serve: &mut Serve<'_>,
    ) -> Result<[u8; N], Failure> {
        let bytes = self.wait_for_meanwhile(from, tag, serve)?;
        <[u8; N]>::try_from(bytes.as_slice()).map_err(|_| Failure {
            rank: self.rank(),
            message: format!("a message from rank {from} with tag {tag} has {} bytes, expected {N}", bytes.len()),
        })
    }

    fn wait_for_meanwhile(&mut self, from: usize, tag: u32, serve: &mut Serve<'_>) -> Result<Vec<u8>, Failure> {
        let fits = |message: &Message| message.from == from && message.tag == tag;
        loop {
            if let Some(message) = self.receive_where(fits)? {
                return Ok(message.bytes);
            }
            // Serving takes in what has arrived, which may be the message.
            if !serve(self)? && !self.has_set_aside(fits) {
                self.wait_for_more()?;
            }
        }
    }
}
