//! Arrays that grow with the scene: on the heap, in scratch memory, or shared with other processes.
//!
//! A mesh is larger than what one of many ranks may hold. It is built in scratch memory (a file, as a rule, which the system
//! may write out when memory is short), and shared as a file's bytes, of which each rank touches what it needs.

use bytemuck::Pod;
use std::io;
use std::ops::{Deref, DerefMut, Range};
use std::sync::Arc;

/// Bytes of a file, held or mapped; cheap to clone.
#[derive(Clone)]
pub struct Bytes(Arc<dyn AsRef<[u8]> + Send + Sync>);

impl Bytes {
    /// Bytes from anything that holds them.
    pub fn new(holder: impl AsRef<[u8]> + Send + Sync + 'static) -> Bytes {
        Bytes(Arc::new(holder))
    }
}

impl AsRef<[u8]> for Bytes {
    fn as_ref(&self) -> &[u8] {
        self
    }
}

impl Deref for Bytes {
    type Target = [u8];
    fn deref(&self) -> &[u8] {
        (*self.0).as_ref()
    }
}

impl std::fmt::Debug for Bytes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} bytes", self.len())
    }
}

/// Memory that may be larger than what the process has: a file mapped for writing, as a rule. Its start, where it has a length, is aligned to 64 bytes.
pub trait Memory: Send + Sync {
    /// What is there.
    fn bytes(&self) -> &[u8];
    /// What is there, to be written.
    fn bytes_mut(&mut self) -> &mut [u8];
    /// Makes it at least `length` bytes long; what is there stays.
    fn grow(&mut self, length: usize) -> io::Result<()>;
}

/// Gives scratch memory.
pub trait Scratch: Send + Sync {
    /// New memory, of no length.
    fn memory(&self) -> io::Result<Box<dyn Memory>>;
}

/// Where new columns are kept.
#[derive(Clone, Copy, Default)]
pub enum Store<'a> {
    /// On the heap.
    #[default]
    Heap,
    /// In scratch memory.
    Scratch(&'a dyn Scratch),
}

impl Store<'_> {
    /// An empty column.
    pub fn column<T: Pod>(&self) -> io::Result<Column<T>> {
        Ok(Column(match self {
            Store::Heap => Kept::Heap(Vec::new()),
            Store::Scratch(scratch) => Kept::Scratch(Growing { memory: scratch.memory()?, end: 0 }),
        }))
    }
}

/// An array, wherever it is kept. It reads as a slice; one that is shared is copied to the heap when it is written.
pub struct Column<T>(Kept<T>);

enum Kept<T> {
    Heap(Vec<T>),
    Scratch(Growing),
    Shared(Bytes, Range<usize>),
}

struct Growing {
    memory: Box<dyn Memory>,
    /// Bytes in use.
    end: usize,
}

impl Growing {
    fn reserve(&mut self, bytes: usize) -> io::Result<()> {
        let (wanted, held) = (self.end + bytes, self.memory.bytes().len());
        if wanted > held {
            // Larger steps for larger memory, but no doubling: scratch files are not to be twice what is in them.
            let step = held.clamp(1 << 16, 1 << 26).max(held / 4);
            self.memory.grow(wanted.max(held + step))?;
        }
        Ok(())
    }
}

impl<T: Pod> Column<T> {
    /// The values in `bytes`: shared if they are aligned, else copied. None if they do not fill whole values.
    pub fn shared(bytes: &Bytes, range: Range<usize>) -> Option<Column<T>> {
        let part = bytes.get(range.clone())?;
        if !part.len().is_multiple_of(size_of::<T>().max(1)) {
            return None;
        }
        Some(match bytemuck::try_cast_slice::<u8, T>(part) {
            Ok(_) => Column(Kept::Shared(bytes.clone(), range)),
            Err(_) => bytemuck::pod_collect_to_vec::<u8, T>(part).into(),
        })
    }

    /// The values.
    pub fn as_slice(&self) -> &[T] {
        self
    }

    /// Room for `additional` more values.
    pub fn reserve(&mut self, additional: usize) -> io::Result<()> {
        match &mut self.0 {
            Kept::Scratch(growing) => growing.reserve(additional * size_of::<T>()),
            _ => {
                self.owned().reserve_exact(additional);
                Ok(())
            }
        }
    }

    /// Appends a value.
    pub fn push(&mut self, value: T) -> io::Result<()> {
        match &mut self.0 {
            Kept::Heap(values) => {
                values.push(value);
                Ok(())
            }
            _ => self.extend_from_slice(&[value]),
        }
    }

    /// Appends values.
    pub fn extend_from_slice(&mut self, values: &[T]) -> io::Result<()> {
        match &mut self.0 {
            Kept::Scratch(growing) => {
                growing.reserve(size_of_val(values))?;
                let range = growing.end..growing.end + size_of_val(values);
                growing.memory.bytes_mut()[range.clone()].copy_from_slice(bytemuck::cast_slice(values));
                growing.end = range.end;
            }
            _ => self.owned().extend_from_slice(values),
        }
        Ok(())
    }

    /// Appends values.
    pub fn extend(&mut self, values: impl IntoIterator<Item = T>) -> io::Result<()> {
        values.into_iter().try_for_each(|value| self.push(value))
    }

    /// Appends `value` until there are `length`, or drops what is beyond.
    pub fn resize(&mut self, length: usize, value: T) -> io::Result<()> {
        let added = length.saturating_sub(self.len());
        match &mut self.0 {
            Kept::Scratch(growing) => {
                growing.reserve(added * size_of::<T>())?;
                let old = growing.end / size_of::<T>().max(1);
                growing.end = length * size_of::<T>();
                self[old.min(length)..].fill(value);
            }
            _ => self.owned().resize(length, value),
        }
        Ok(())
    }

    /// Drops all values and keeps the room.
    pub fn clear(&mut self) {
        match &mut self.0 {
            Kept::Heap(values) => values.clear(),
            Kept::Scratch(growing) => growing.end = 0,
            Kept::Shared(..) => *self = Column::default(),
        }
    }

    /// Gives back what a column on the heap has reserved and does not use.
    pub fn shrink_to_fit(&mut self) {
        if let Kept::Heap(values) = &mut self.0 {
            values.shrink_to_fit();
        }
    }

    /// The values on the heap, copied there if they are shared.
    fn owned(&mut self) -> &mut Vec<T> {
        if !matches!(self.0, Kept::Heap(_)) {
            self.0 = Kept::Heap(self.to_vec());
        }
        match &mut self.0 {
            Kept::Heap(values) => values,
            _ => unreachable!("they are on the heap now"),
        }
    }
}

impl<T: Pod> Deref for Column<T> {
    type Target = [T];
    #[inline]
    fn deref(&self) -> &[T] {
        match &self.0 {
            Kept::Heap(values) => values,
            // Memory of no length need not be aligned.
            Kept::Scratch(Growing { end: 0, .. }) => &[],
            Kept::Scratch(growing) => bytemuck::cast_slice(&growing.memory.bytes()[..growing.end]),
            Kept::Shared(bytes, range) => bytemuck::cast_slice(&bytes[range.clone()]),
        }
    }
}

impl<T: Pod> DerefMut for Column<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        if !matches!(self.0, Kept::Scratch(_)) {
            return self.owned();
        }
        match &mut self.0 {
            Kept::Scratch(Growing { memory, end }) if *end > 0 => {
                bytemuck::cast_slice_mut(&mut memory.bytes_mut()[..*end])
            }
            _ => &mut [],
        }
    }
}

impl<T> Default for Column<T> {
    fn default() -> Self {
        Column(Kept::Heap(Vec::new()))
    }
}

impl<T> From<Vec<T>> for Column<T> {
    fn from(values: Vec<T>) -> Self {
        Column(Kept::Heap(values))
    }
}

impl<T: Pod> Clone for Column<T> {
    fn clone(&self) -> Self {
        match &self.0 {
            Kept::Shared(bytes, range) => Column(Kept::Shared(bytes.clone(), range.clone())),
            _ => self.to_vec().into(),
        }
    }
}

impl<T: Pod + PartialEq> PartialEq for Column<T> {
    fn eq(&self, other: &Self) -> bool {
        self[..] == other[..]
    }
}

impl<T: Pod + std::fmt::Debug> std::fmt::Debug for Column<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self[..].fmt(f)
    }
}

impl<'a, T: Pod> IntoIterator for &'a Column<T> {
    type Item = &'a T;
    type IntoIter = std::slice::Iter<'a, T>;
    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl<'a, T: Pod> IntoIterator for &'a mut Column<T> {
    type Item = &'a mut T;
    type IntoIter = std::slice::IterMut<'a, T>;
    fn into_iter(self) -> Self::IntoIter {
        self.iter_mut()
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Scratch memory on the heap, for tests of what goes to files elsewhere.
    pub(crate) struct HeapScratch;

    #[derive(Clone, Copy, Pod, bytemuck::Zeroable)]
    #[repr(C, align(64))]
    struct Line([u8; 64]);

    struct Lines(Vec<Line>);

    impl Scratch for HeapScratch {
        fn memory(&self) -> io::Result<Box<dyn Memory>> {
            Ok(Box::new(Lines(Vec::new())))
        }
    }

    impl Memory for Lines {
        fn bytes(&self) -> &[u8] {
            bytemuck::cast_slice(&self.0)
        }

        fn bytes_mut(&mut self) -> &mut [u8] {
            bytemuck::cast_slice_mut(&mut self.0)
        }

        fn grow(&mut self, length: usize) -> io::Result<()> {
            self.0.resize(length.div_ceil(64), Line([0; 64]));
            Ok(())
        }
    }

    #[test]
    fn columns_are_the_same_wherever_they_are_kept() {
        for store in [Store::Heap, Store::Scratch(&HeapScratch)] {
            let mut column: Column<[u32; 3]> = store.column().unwrap();
            column.extend((0..100_000).map(|k| [k, k + 1, k + 2])).unwrap();
            column.extend_from_slice(&[[7; 3]; 2]).unwrap();
            column.resize(100_003, [9; 3]).unwrap();
            column.resize(100_005, [8; 3]).unwrap();
            column[5] = [0; 3];
            assert_eq!((column.len(), column[5], column[99_999]), (100_005, [0; 3], [99_999, 100_000, 100_001]));
            assert_eq!(column[100_000..], [[7; 3], [7; 3], [9; 3], [8; 3], [8; 3]]);
            let mut copy = column.clone();
            assert_eq!(copy, column);
            copy.resize(1, [0; 3]).unwrap();
            assert_eq!(copy[..], [[0, 1, 2]]);
            column.clear();
            assert!(column.is_empty());
        }
    }

    #[test]
    fn shared_columns_are_copied_when_they_are_written() {
        let bytes = Bytes::new(bytemuck::cast_slice::<u64, u8>(&[1, 2, 3]).to_vec());
        let mut column: Column<u8> = Column::shared(&bytes, 8..16).unwrap();
        let same = column.clone();
        column[0] = 9;
        column.push(1).unwrap();
        assert_eq!((column.len(), column[0], same[0], bytes[8]), (9, 9, 2, 2));
        assert!(Column::<u16>::shared(&bytes, 8..15).is_none() && Column::<u16>::shared(&bytes, 20..26).is_none());
        assert_eq!(Column::<u16>::shared(&bytes, 7..13).unwrap().len(), 3);
    }
}
