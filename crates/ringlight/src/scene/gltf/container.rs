//! From bytes to a document: the GLB container (glTF 2.0, section 4.4) and the JSON in it.

use super::json::Document;
use crate::resources::Bytes;
use crate::scene::{Place, SceneError};
use serde_json::error::Category;
use std::ops::Range;

/// The first four bytes of a GLB file.
pub(in crate::scene) const GLB_MAGIC: &[u8] = b"glTF";

const JSON_CHUNK: u32 = u32::from_le_bytes(*b"JSON");
const BINARY_CHUNK: u32 = u32::from_le_bytes(*b"BIN\0");

const EXPECTED: &str = "a glTF document (valid JSON) or a GLB file";

/// Splits a file into its document and, for a GLB, the place of its binary chunk.
pub(super) fn open(name: &str, bytes: &Bytes) -> Result<(Document, Option<Range<usize>>), SceneError> {
    let (json, binary) = if bytes.starts_with(GLB_MAGIC) { chunks(name, bytes)? } else { (0..bytes.len(), None) };
    let text = bytes.get(json).unwrap_or_default();
    let document = parse(name, text.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(text))?;
    check_version(name, &document)?;
    Ok((document, binary))
}

type Chunks = (Range<usize>, Option<Range<usize>>);

fn chunks(name: &str, bytes: &[u8]) -> Result<Chunks, SceneError> {
    let at = |offset: usize| Place::new(name, format!("byte {offset}"));
    let word = |offset: usize| -> Option<u32> {
        let four = bytes.get(offset..offset.checked_add(4)?)?;
        Some(u32::from_le_bytes(four.try_into().ok()?))
    };
    let header = |offset: usize| {
        word(offset).ok_or_else(|| {
            SceneError::new(
                at(offset),
                format!("a file that ends after {} bytes", bytes.len()),
                "a complete GLB header",
            )
        })
    };
    let version = header(4)?;
    if version != 2 {
        return Err(SceneError::new(at(4), format!("GLB version {version}"), "version 2"));
    }
    let length = header(8)? as usize;
    if length > bytes.len() {
        return Err(SceneError::new(
            at(8),
            format!("a length of {length} bytes in a file of {} bytes", bytes.len()),
            "a complete file; it seems to be truncated",
        ));
    }
    let mut json = None;
    let mut binary = None;
    let mut offset = 12;
    // Unknown chunks are skipped, and only the first JSON and BIN chunks count (section 4.4.3).
    while offset < length {
        let size = header(offset)? as usize;
        let kind = header(offset + 4)?;
        let start = offset + 8;
        let end = start.checked_add(size).filter(|end| *end <= length).ok_or_else(|| {
            SceneError::new(
                at(offset),
                format!("a chunk of {size} bytes"),
                format!("at most {} bytes, which the file has left", length.saturating_sub(start)),
            )
        })?;
        match kind {
            JSON_CHUNK if json.is_none() => json = Some(start..end),
            BINARY_CHUNK if json.is_some() && binary.is_none() => binary = Some(start..end),
            _ => {}
        }
        // Chunks are padded to four bytes; the padding is part of their length.
        offset = end;
    }
    let json = json.ok_or_else(|| SceneError::new(at(12), "no JSON chunk", "a JSON chunk first in a GLB file"))?;
    Ok((json, binary))
}

fn parse(name: &str, text: &[u8]) -> Result<Document, SceneError> {
    // Serde would also take the members of an object from a list.
    if text.iter().find(|byte| !byte.is_ascii_whitespace()).is_some_and(|first| *first != b'{') {
        let place = Place::new(name, "line 1 column 1");
        return Err(SceneError::new(place, "no JSON object", EXPECTED));
    }
    let mut deserializer = serde_json::Deserializer::from_slice(text);
    let document = serde_path_to_error::deserialize(&mut deserializer).map_err(|error| {
        let path = error.path().to_string();
        let cause = error.into_inner();
        match cause.classify() {
            Category::Data if path != "." => {
                SceneError::new(Place::new(name, path), cause.to_string(), "a value as glTF 2.0 defines it")
            }
            _ => syntax_error(name, &cause),
        }
    })?;
    // The JSON chunk of a GLB is padded with spaces; some writers pad with zeros.
    let rest = deserializer.end();
    match rest {
        Err(error) if !text.ends_with(b"\0") => Err(syntax_error(name, &error)),
        _ => Ok(document),
    }
}

fn syntax_error(name: &str, cause: &serde_json::Error) -> SceneError {
    let place = Place::new(name, format!("line {} column {}", cause.line(), cause.column()));
    let message = cause.to_string();
    // serde_json repeats the position at the end of its message.
    let found = message.rsplit_once(" at line ").map_or(message.as_str(), |(text, _)| text).to_owned();
    SceneError::new(place, found, EXPECTED)
}

fn check_version(name: &str, document: &Document) -> Result<(), SceneError> {
    let place = |at: &str| Place::new(name, at);
    let expected = "glTF 2.0";
    let version = document
        .asset
        .version
        .as_deref()
        .ok_or_else(|| SceneError::new(place("asset.version"), "nothing", expected))?;
    if version.split('.').next() != Some("2") {
        return Err(SceneError::new(place("asset.version"), format!("version {version:?}"), expected));
    }
    match document.asset.min_version.as_deref() {
        None | Some("2.0") => Ok(()),
        Some(version) => Err(SceneError::new(place("asset.minVersion"), format!("version {version:?}"), expected)),
    }
}
