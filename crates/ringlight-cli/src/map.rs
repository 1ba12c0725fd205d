//! Files as memory.

use ringlight::resources::Bytes;
use std::fs::File;
use std::io;

/// Maps a whole file for reading.
#[allow(unsafe_code)]
pub fn whole(file: &File) -> io::Result<Bytes> {
    // SAFETY: the map is only read, as bytes that may hold anything. What Rust cannot rule out is that another program
    // changes or cuts the file meanwhile; as for any program that maps its input, the user must not do that.
    let map = unsafe { memmap2::Mmap::map(file)? };
    Ok(Bytes::new(map))
}
