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
pub(super) struct Spill<'a> {
    storage: &'a mut dyn Storage,
    /// For each block, where its chunks begin and how many bytes they have.
    chunks: Vec<Vec<(u64, u64)>>,
    end: u64,
}

/// Row, column, area, error.
const BYTES: usize = 4 + 4 + 8 + 8;

impl<'a> Spill<'a> {
    pub fn new(storage: &'a mut dyn Storage, blocks: usize) -> Spill<'a> {
        Spill { storage, chunks: vec![Vec::new(); blocks], end: 0 }
    }

    /// Keeps (row, entry) for `block`, after what is kept for it already.
    pub fn keep(&mut self, block: usize, entries: &[(u32, Entry)]) -> io::Result<()> {
        let mut bytes = Vec::with_capacity(entries.len() * BYTES);
        for (row, Entry { column, exchange }) in entries {
            bytes.extend_from_slice(&row.to_le_bytes());
            bytes.extend_from_slice(&column.to_le_bytes());
            bytes.extend_from_slice(&exchange.area.to_le_bytes());
            bytes.extend_from_slice(&exchange.error.to_le_bytes());
        }
        self.storage.seek(SeekFrom::Start(self.end))?;
        self.storage.write_all(&bytes)?;
        self.chunks[block].push((self.end, bytes.len() as u64));
        self.end += bytes.len() as u64;
        Ok(())
    }

    /// Calls `sink` with all that is kept for `block`, in the order in which it came.
    pub fn take(&mut self, block: usize, mut sink: impl FnMut(u32, Entry)) -> io::Result<()> {
        let mut bytes = Vec::new();
        for (start, length) in std::mem::take(&mut self.chunks[block]) {
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
