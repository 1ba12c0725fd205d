//! Rows of the matrix from rows of polygons, which come in order and hold what is above the diagonal.

use super::matrix::Row;
use super::spill::{Entry, Spill, Storage};
use super::{Exchange, Faces};
use std::io;

/// Numbers held at once, about; bounds memory and changes nothing else.
const HELD: usize = 1 << 21;

/// Puts rows together, block by block.
pub(super) struct Assembly<'a> {
    faces: &'a Faces,
    least: f64,
    spill: Spill<'a>,
    rows: &'a mut dyn FnMut(Row<'_>) -> io::Result<()>,
    /// Rows of a block.
    in_block: usize,
    /// The row under way.
    number: usize,
    /// What is known of the rows of its block.
    entries: Vec<Vec<Entry>>,
    /// What the row under way exchanges with each, so far.
    sums: Vec<Exchange>,
    left_out: Vec<Exchange>,
    /// What waits for later blocks.
    later: Vec<Vec<(u32, Entry)>>,
}

impl<'a> Assembly<'a> {
    pub fn new(
        faces: &'a Faces,
        least: f64,
        storage: &'a mut dyn Storage,
        rows: &'a mut dyn FnMut(Row<'_>) -> io::Result<()>,
    ) -> Assembly<'a> {
        let groups = faces.groups.len();
        let in_block = (HELD / groups.max(1)).clamp(1, groups.max(1));
        let blocks = groups.div_ceil(in_block);
        Assembly {
            faces,
            least,
            spill: Spill::new(storage, blocks),
            rows,
            in_block,
            number: 0,
            entries: Vec::new(),
            sums: vec![Exchange::default(); groups],
            left_out: vec![Exchange::default(); groups],
            later: vec![Vec::new(); blocks],
        }
    }

    /// Adds what polygon `p` exchanges with those after it.
    pub fn add(&mut self, p: usize, entries: &[Entry]) -> io::Result<()> {
        while self.faces.groups[self.number].polygons.end <= p {
            self.finish_row()?;
        }
        entries.iter().for_each(|entry| self.sums[entry.column as usize].add(entry.exchange));
        Ok(())
    }

    /// Hands over what is left.
    pub fn finish(&mut self) -> io::Result<()> {
        while self.number < self.faces.groups.len() {
            self.finish_row()?;
        }
        Ok(())
    }

    fn finish_row(&mut self) -> io::Result<()> {
        let Assembly { faces, in_block, number, entries, sums, left_out, later, .. } = self;
        let (groups, in_block, number) = (&faces.groups, *in_block, *number);
        let (block, first) = (number / in_block, number / in_block * in_block);
        if number == first {
            *entries = vec![Vec::new(); in_block.min(groups.len() - first)];
            self.spill.take(block, |row, entry| entries[row as usize - first].push(entry))?;
        }
        // Within the group every pair counts from both of its ends.
        sums[number] = Exchange { area: 2.0 * sums[number].area, error: 2.0 * sums[number].error };
        for (column, sum) in sums.iter_mut().enumerate().skip(number) {
            let exchange = std::mem::take(sum);
            if exchange == Exchange::default() {
                continue;
            }
            if exchange.area < self.least * groups[number].area.min(groups[column].area) {
                left_out[number].add(exchange);
                if column > number {
                    left_out[column].add(exchange);
                }
                continue;
            }
            entries[number - first].push(Entry { column: column as u32, exchange });
            let transposed = Entry { column: number as u32, exchange };
            if column > number && column / in_block == block {
                entries[column - first].push(transposed);
            } else if column > number {
                later[column / in_block].push((column as u32, transposed));
            }
        }
        let row = std::mem::take(&mut entries[number - first]);
        (self.rows)(Row { number, entries: &row, left_out: left_out[number] })?;
        self.number += 1;
        if self.number == first + entries.len() {
            for (block, waiting) in later.iter_mut().enumerate().filter(|(_, waiting)| !waiting.is_empty()) {
                self.spill.keep(block, waiting)?;
                waiting.clear();
            }
        }
        Ok(())
    }
}
