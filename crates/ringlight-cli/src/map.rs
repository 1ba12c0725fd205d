//! Files as memory.

use memmap2::{Mmap, MmapMut};
use ringlight::resources::Bytes;
use std::fs::File;
use std::io;

/// Maps a whole file for reading.
#[allow(unsafe_code)]
pub fn whole(file: &File) -> io::Result<Bytes> {
    // SAFETY: the map is only read, as bytes that may hold anything. What Rust cannot rule out is that another program
    // changes or cuts the file meanwhile; as for any program that maps its input, the user must not do that.
    let map = unsafe { Mmap::map(file)? };
    Ok(Bytes::new(map))
}

/// Maps a whole file for reading and writing; what is written is the file's.
#[allow(unsafe_code)]
pub fn writable(file: &File) -> io::Result<MmapMut> {
    // SAFETY: for scratch files, which have no name, so that no other program finds them.
    unsafe { MmapMut::map_mut(file) }
}
