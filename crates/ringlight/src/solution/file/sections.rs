//! The sections of a file that is read: found at once, checked and unpacked when they are asked for.

use super::{ARRAYS, FileError, HEADER, LIGHT, MAGIC, NAME, SECTION, VERSION, damaged};
use crate::column::{Column, Store};
use bytemuck::Pod;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// A section as it is stored.
#[derive(Clone, Copy)]
pub struct Section<'a> {
    /// Bytes once it is unpacked.
    pub raw: u64,
    hash: &'a [u8],
    stored: &'a [u8],
}

/// The sections of a file, by name.
pub struct Sections<'a>(BTreeMap<String, Section<'a>>);

impl<'a> Sections<'a> {
    /// Finds the sections, and makes sure that none is there that does not belong.
    pub fn find(bytes: &'a [u8]) -> Result<Sections<'a>, FileError> {
        let version = match bytes.strip_prefix(MAGIC) {
            Some([a, b, c, d, ..]) => u32::from_le_bytes([*a, *b, *c, *d]),
            _ => return Err(FileError::NotASolution),
        };
        if version != VERSION {
            return Err(FileError::Version(version));
        }
        let mut rest = &bytes[12..];
        let mut take = |n: u64| -> Result<&'a [u8], FileError> {
            match usize::try_from(n).ok().and_then(|n| rest.split_at_checked(n)) {
                Some((head, tail)) => {
                    rest = tail;
                    Ok(head)
                }
                None => Err(damaged("directory", "the file ends early")),
            }
        };
        let number = |b: &[u8]| b.iter().rev().fold(0u64, |n, &x| n << 8 | u64::from(x));
        let count = number(take(4)?);
        let mut sections = Sections(BTreeMap::new());
        for _ in 0..count {
            let name = String::from_utf8_lossy(take(NAME as u64)?).trim_end_matches('\0').to_string();
            let (raw, stored) = (number(take(8)?), number(take(8)?));
            let section = Section { raw, hash: take(32)?, stored: take(stored)? };
            if sections.0.insert(name.clone(), section).is_some() {
                return Err(damaged(&name, "it is there twice"));
            }
        }
        if !rest.is_empty() {
            return Err(damaged("directory", "the file goes on after its last section"));
        }
        sections.check_names()?;
        Ok(sections)
    }

    /// Every section belongs to an array of which it and all before it are there.
    fn check_names(&self) -> Result<(), FileError> {
        let counts: BTreeMap<&str, usize> =
            [&HEADER].into_iter().chain(&ARRAYS).chain([&LIGHT]).map(|&name| (name, self.of(name).count())).collect();
        let belongs = |name: &str| {
            name.rsplit_once('-').is_some_and(|(array, number)| {
                number.parse().is_ok_and(|number: usize| counts.get(array).is_some_and(|&count| number < count))
            })
        };
        match self.0.keys().find(|name| !belongs(name)) {
            Some(name) => Err(damaged(name, "it does not belong here, or one before it is missing")),
            None => Ok(()),
        }
    }

    /// The sections of an array, in order, with their names.
    pub fn of(&self, array: &str) -> impl Iterator<Item = (String, Section<'a>)> {
        (0..).map_while(move |number| {
            let name = format!("{array}-{number}");
            let section = *self.0.get(&name)?;
            Some((name, section))
        })
    }

    /// An array, kept in `store`.
    pub fn array<T: Pod + Send>(&self, name: &str, store: Store<'_>) -> Result<Column<T>, FileError> {
        let sections: Vec<(String, Section<'_>)> = self.of(name).collect();
        let mut total = 0;
        for (name, section) in &sections {
            if section.raw > SECTION as u64 || !section.raw.is_multiple_of(size_of::<T>() as u64) {
                return Err(damaged(name, "its length is wrong"));
            }
            total += section.raw as usize / size_of::<T>();
        }
        let mut array = store.column()?;
        array.resize(total, T::zeroed())?;
        let mut rest = &mut array[..];
        let mut parts = Vec::with_capacity(sections.len());
        for (name, section) in &sections {
            let (part, after) = rest.split_at_mut(section.raw as usize / size_of::<T>());
            rest = after;
            parts.push((name, section, part));
        }
        parts
            .into_par_iter()
            .try_for_each(|(name, section, part)| section.unpack(name, bytemuck::cast_slice_mut(part)))?;
        Ok(array)
    }
}

impl Section<'_> {
    /// Checks the section and unpacks it, which is to give as many bytes as there is room for.
    pub fn unpack(&self, name: &str, into: &mut [u8]) -> Result<(), FileError> {
        if blake3::hash(self.stored).as_bytes() != self.hash {
            return Err(damaged(name, "its checksum is wrong"));
        }
        let length = zstd::bulk::decompress_to_buffer(self.stored, into).map_err(|e| damaged(name, &e.to_string()))?;
        if length == into.len() && self.raw == length as u64 {
            Ok(())
        } else {
            Err(damaged(name, "its length is wrong"))
        }
    }
}
