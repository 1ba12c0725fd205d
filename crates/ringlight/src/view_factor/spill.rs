//! The matrix is computed above its diagonal and written row by row; what a later row needs of earlier ones waits here.

use super::Exchange;
use std::io::{self, Read, Seek, SeekFrom, Write};

/// Where numbers may wait: a file without a name, or a `Cursor` over a vector.
pub trait Storage: Read + Write + Seek {}

impl<T: Read + Write + Seek> Storage for T {}

/// A value of the matrix, as the exchange area of its row and column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Number of the column's group.
    pub column: u32,
    /// Exchange area.
    pub exchange: Exchange,
}

/// Entries of blocks of rows, kept until their block is due.
///
/// Of every block only its last chunk's place is in memory; each chunk begins with the place of the one before. There are as many
/// chunks as pairs of blocks, too many for memory where there are many rows.
pub(super) struct Spill<'a> {
    storage: &'a mut dyn Storage,
    /// Where the last chunk of each block begins.
    last: Vec<Option<u64>>,
    end: u64,
}

/// Row, column, area, error.
const BYTES: usize = 4 + 4 + 8 + 8;

/// Where the chunk before begins, and how many bytes follow.
const HEADER: usize = 8 + 8;

/// In place of where the chunk before begins: there is none.
const NONE_BEFORE: u64 = u64::MAX;

impl<'a> Spill<'a> {
    pub fn new(storage: &'a mut dyn Storage, blocks: usize) -> Spill<'a> {
        Spill { storage, last: vec![None; blocks], end: 0 }
    }

    /// Keeps (row, entry) for `block`, after what is kept for it already.
    pub fn keep(&mut self, block: usize, entries: &[(u32, Entry)]) -> io::Result<()> {
        let length = entries.len() * BYTES;
        let mut bytes = Vec::with_capacity(HEADER + length);
        bytes.extend_from_slice(&self.last[block].unwrap_or(NONE_BEFORE).to_le_bytes());
        bytes.extend_from_slice(&(length as u64).to_le_bytes());
        for (row, Entry { column, exchange }) in entries {
            bytes.extend_from_slice(&row.to_le_bytes());
            bytes.extend_from_slice(&column.to_le_bytes());
            bytes.extend_from_slice(&exchange.area.to_le_bytes());
            bytes.extend_from_slice(&exchange.error.to_le_bytes());
        }
        self.storage.seek(SeekFrom::Start(self.end))?;
        self.storage.write_all(&bytes)?;
        self.last[block] = Some(self.end);
        self.end += bytes.len() as u64;
        Ok(())
    }

    /// Calls `sink` with all that is kept for `block`, in the order in which it came.
    pub fn take(&mut self, block: usize, mut sink: impl FnMut(u32, Entry)) -> io::Result<()> {
        let mut chunks = Vec::new();
        let mut next = self.last[block].take();
        while let Some(start) = next {
            let mut header = [0; HEADER];
            self.storage.seek(SeekFrom::Start(start))?;
            self.storage.read_exact(&mut header)?;
            let integer = |at: usize| u64::from_le_bytes(std::array::from_fn(|i| header[at + i]));
            chunks.push((start + HEADER as u64, integer(8)));
            next = Some(integer(0)).filter(|&before| before != NONE_BEFORE);
        }
        let mut bytes = Vec::new();
        for (start, length) in chunks.into_iter().rev() {
            bytes.resize(length as usize, 0);
            self.storage.seek(SeekFrom::Start(start))?;
            self.storage.read_exact(&mut bytes)?;
            for entry in bytes.as_chunks::<BYTES>().0 {
                let integer = |at: usize| u32::from_le_bytes(std::array::from_fn(|i| entry[at + i]));
                let float = |at: usize| f64::from_le_bytes(std::array::from_fn(|i| entry[at + i]));
                let exchange = Exchange { area: float(8), error: float(16) };
                sink(integer(0), Entry { column: integer(4), exchange });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_come_back_in_order_and_their_index_does_not_grow_with_the_chunks() {
        let mut storage = io::Cursor::new(Vec::new());
        let mut spill = Spill::new(&mut storage, 3);
        let entry = |k: u32| Entry { column: k, exchange: Exchange { area: f64::from(k), error: 0.5 * f64::from(k) } };
        for k in 0..300 {
            spill.keep(k as usize % 2, &[(k, entry(k)), (k + 1, entry(k + 1))]).unwrap();
        }
        // One place for a block, however many chunks it has.
        assert_eq!((spill.last.len(), spill.last.capacity()), (3, 3));
        for block in 0..3 {
            let mut found = Vec::new();
            spill.take(block, |row, entry| found.push((row, entry))).unwrap();
            let kept = (0..300).filter(|k| *k as usize % 2 == block);
            let expected: Vec<_> = kept.flat_map(|k| [(k, entry(k)), (k + 1, entry(k + 1))]).collect();
            assert_eq!(found, expected);
            spill.take(block, |_, _| panic!("taken already")).unwrap();
        }
    }
}
