//! Scratch memory in files: what grows with the scene need not fit into this process's own memory.

use crate::map;
use memmap2::MmapMut;
use ringlight::column::{Memory, Scratch};
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

/// Gives memory in files without a name in a folder; they are gone when the process ends, however it ends.
#[derive(Debug)]
pub struct FileScratch {
    folder: PathBuf,
}

impl FileScratch {
    /// In `folder`.
    pub fn new(folder: &Path) -> FileScratch {
        FileScratch { folder: folder.to_owned() }
    }
}

impl Scratch for FileScratch {
    fn memory(&self) -> io::Result<Box<dyn Memory>> {
        let in_folder = |error: io::Error| io::Error::new(error.kind(), format!("{}: {error}", self.folder.display()));
        let file = tempfile::tempfile_in(&self.folder).map_err(in_folder)?;
        Ok(Box::new(FileMemory { file, map: None, folder: self.folder.clone() }))
    }
}

/// A scratch file, mapped as far as it goes.
struct FileMemory {
    file: File,
    /// None while the file is empty.
    map: Option<MmapMut>,
    folder: PathBuf,
}

impl Memory for FileMemory {
    fn bytes(&self) -> &[u8] {
        self.map.as_deref().unwrap_or_default()
    }

    fn bytes_mut(&mut self) -> &mut [u8] {
        self.map.as_deref_mut().unwrap_or_default()
    }

    fn grow(&mut self, length: usize) -> io::Result<()> {
        let held = self.bytes().len();
        let grown = allocate(&self.file, held as u64, length as u64).and_then(|()| map::writable(&self.file));
        let in_folder = |error: io::Error| io::Error::new(error.kind(), format!("{}: {error}", self.folder.display()));
        self.map = Some(grown.map_err(in_folder)?);
        Ok(())
    }
}

/// Lengthens a file and reserves its place on the disk: a map of what the disk has no room for would end the process.
#[cfg(target_os = "linux")]
fn allocate(file: &File, from: u64, to: u64) -> io::Result<()> {
    use rustix::fs::{FallocateFlags, fallocate};
    match fallocate(file, FallocateFlags::empty(), from, to - from) {
        Err(rustix::io::Errno::OPNOTSUPP) => file.set_len(to),
        done => Ok(done?),
    }
}

/// Lengthens a file.
#[cfg(not(target_os = "linux"))]
fn allocate(file: &File, _from: u64, to: u64) -> io::Result<()> {
    file.set_len(to)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ringlight::column::{Column, Store};

    #[test]
    fn columns_in_files_keep_what_is_written_as_they_grow() {
        let folder = tempfile::tempdir().unwrap();
        let scratch = FileScratch::new(folder.path());
        let mut column: Column<u64> = Store::Scratch(&scratch).column().unwrap();
        assert!(column.is_empty());
        column.extend(0..300_000).unwrap();
        column[299_999] += 1;
        assert!((0..299_999).all(|k| column[k as usize] == k) && column[299_999] == 300_000);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "scratch files have no name");
    }

    #[test]
    fn a_folder_that_is_not_there_is_named() {
        let scratch = FileScratch::new(Path::new("no such folder"));
        let error = Store::Scratch(&scratch).column::<u8>().unwrap_err();
        assert!(error.to_string().starts_with("no such folder: "), "{error}");
    }
}
