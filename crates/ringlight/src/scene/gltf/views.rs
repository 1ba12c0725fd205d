//! Buffers and buffer views: checked windows into the file's own bytes.

use super::json::{Document, Meshopt};
use super::{meshopt, uri};
use crate::resources::{Bytes, Resources};
use crate::scene::{Place, SceneError};
use std::collections::BTreeMap;
use std::ops::Range;

/// A window into shared bytes.
#[derive(Clone, Debug)]
pub(super) struct Slice {
    bytes: Bytes,
    range: Range<usize>,
}

impl Slice {
    /// All of `bytes`.
    pub fn whole(bytes: Bytes) -> Slice {
        let range = 0..bytes.len();
        Slice { bytes, range }
    }

    /// The bytes.
    pub fn get(&self) -> &[u8] {
        self.bytes.get(self.range.clone()).unwrap_or_default()
    }

    /// `length` bytes from `offset` on, if the window has them.
    pub fn part(&self, offset: u64, length: u64) -> Option<Slice> {
        let start = self.range.start.checked_add(usize::try_from(offset).ok()?)?;
        let end = start.checked_add(usize::try_from(length).ok()?)?;
        (end <= self.range.end).then(|| Slice { bytes: self.bytes.clone(), range: start..end })
    }
}

impl AsRef<[u8]> for Slice {
    fn as_ref(&self) -> &[u8] {
        self.get()
    }
}

/// The buffer views of a document. Plain ones stay windows into the file; compressed ones are decoded once.
pub(super) struct Views<'a> {
    /// Name of the file, for places.
    pub name: &'a str,
    /// The document.
    pub document: &'a Document,
    buffers: Vec<Option<Slice>>,
    decoded: BTreeMap<u32, Slice>,
}

impl<'a> Views<'a> {
    /// Opens the buffers of `document`: the GLB's `binary` chunk, embedded data, or what `resources` gives.
    pub fn open(
        name: &'a str,
        document: &'a Document,
        binary: Option<Slice>,
        resources: &dyn Resources,
    ) -> Result<Views<'a>, SceneError> {
        let mut views = Views { name, document, buffers: Vec::new(), decoded: BTreeMap::new() };
        for (index, buffer) in document.buffers.iter().enumerate() {
            let path = format!("buffers[{index}]");
            // A fallback serves only readers that cannot decompress (EXT_meshopt_compression, "Fallback buffers").
            if buffer.extensions.is_fallback() {
                views.buffers.push(None);
                continue;
            }
            let all = match &buffer.uri {
                Some(uri) => views.resource(uri, &format!("{path}.uri"), resources)?,
                // Section 4.4.3.3: the first buffer without a URI is the GLB's binary chunk.
                None => match &binary {
                    Some(slice) if index == 0 => slice.clone(),
                    _ => {
                        let expected = if index == 0 { "a URI or a GLB with a binary chunk" } else { "a URI" };
                        return Err(views.error(&path, "a buffer without data", expected));
                    }
                },
            };
            let slice = all.part(0, buffer.byte_length).ok_or_else(|| {
                views.error(
                    &format!("{path}.byteLength"),
                    format!("a claim of {} bytes where there are {}", buffer.byte_length, all.get().len()),
                    "no more than there are; the file seems to be truncated",
                )
            })?;
            views.buffers.push(Some(slice));
        }
        Ok(views)
    }

    fn resource(&self, text: &str, path: &str, resources: &dyn Resources) -> Result<Slice, SceneError> {
        let target = uri::parse(text).map_err(|(found, expected)| self.error(path, found, expected))?;
        match target {
            uri::Target::Data { bytes, .. } => Ok(Slice::whole(Bytes::new(bytes))),
            uri::Target::Path(file) => resources.read(&file).map(Slice::whole).map_err(|cause| {
                self.error(
                    path,
                    format!("file {file:?}, which cannot be read: {cause}"),
                    "a readable file beside the scene",
                )
            }),
        }
    }

    /// An error at the JSON path `at`.
    pub fn error(&self, at: &str, found: impl Into<String>, expected: impl Into<String>) -> SceneError {
        SceneError::new(Place::new(self.name, at), found, expected)
    }

    /// The bytes of buffer view `index`, which the property at JSON path `referrer` names.
    pub fn view(&mut self, index: u32, referrer: &str) -> Result<Slice, SceneError> {
        if let Some(slice) = self.decoded.get(&index) {
            return Ok(slice.clone());
        }
        let document = self.document;
        let view = find(&document.buffer_views, index)
            .ok_or_else(|| self.index_error(referrer, "buffer view", index, document.buffer_views.len()))?;
        let path = format!("bufferViews[{index}]");
        let Some((extension, compressed)) = view.extensions.meshopt() else {
            return self.window(view.buffer, view.byte_offset, view.byte_length, &path);
        };
        let path = format!("{path}.extensions.{extension}");
        let slice = self.decompress(compressed, &path)?;
        self.decoded.insert(index, slice.clone());
        Ok(slice)
    }

    fn window(&self, buffer: u32, offset: u64, length: u64, path: &str) -> Result<Slice, SceneError> {
        let whole = find(&self.buffers, buffer)
            .ok_or_else(|| self.index_error(&format!("{path}.buffer"), "buffer", buffer, self.buffers.len()))?;
        let Some(whole) = whole else {
            return Err(self.error(
                &format!("{path}.buffer"),
                "a fallback buffer without bytes",
                "a buffer with bytes",
            ));
        };
        whole.part(offset, length).ok_or_else(|| {
            self.error(
                path,
                format!("{length} bytes from byte {offset} on"),
                format!("a range inside the buffer, which has {} bytes", whole.get().len()),
            )
        })
    }

    fn decompress(&self, view: &Meshopt, path: &str) -> Result<Slice, SceneError> {
        let compressed = self.window(view.buffer, view.byte_offset, view.byte_length, path)?;
        let decoded = meshopt::decode(compressed.get(), view).map_err(|found| {
            self.error(path, found, "valid meshopt data; `gltf-transform copy` writes the scene uncompressed")
        })?;
        Ok(Slice::whole(Bytes::new(decoded)))
    }

    /// An index that points past its array.
    pub fn index_error(&self, at: &str, what: &str, index: u32, length: usize) -> SceneError {
        self.error(at, format!("{what} {index}"), format!("an index below {length}"))
    }
}

/// Looks up by a 32-bit index.
pub(super) fn find<T>(items: &[T], index: u32) -> Option<&T> {
    items.get(usize::try_from(index).ok()?)
}
