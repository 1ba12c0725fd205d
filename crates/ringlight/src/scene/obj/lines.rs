//! Lines, words and numbers of OBJ and MTL files, with their places.

use crate::scene::{Place, SceneError};
use std::borrow::Cow;

/// A place while reading: a file and a line.
#[derive(Clone, Copy, Debug)]
pub(super) struct At<'a> {
    pub(super) file: &'a str,
    pub(super) line: u64,
}

impl At<'_> {
    pub(super) fn place(&self) -> Place {
        Place::new(self.file, format!("line {}", self.line))
    }

    pub(super) fn error(&self, found: impl Into<String>, expected: impl Into<String>) -> SceneError {
        SceneError::new(self.place(), found, expected)
    }

    /// A finite number.
    pub(super) fn number(&self, word: &[u8]) -> Result<f64, SceneError> {
        std::str::from_utf8(word)
            .ok()
            .and_then(|word| word.parse::<f64>().ok())
            .filter(|number| (*number as f32).is_finite())
            .ok_or_else(|| self.error(quoted(word), "a finite number"))
    }

    /// The first `N` of `numbers`, of which `what` needs that many.
    pub(super) fn first<const N: usize>(&self, numbers: &[f64], what: &str) -> Result<[f64; N], SceneError> {
        match numbers.first_chunk() {
            Some(first) => Ok(*first),
            None => Err(self.error(format!("{what} with {} numbers", numbers.len()), format!("at least {N}"))),
        }
    }
}

/// Logical lines with the number of their first line: ends of any kind, `\` before an end joins two.
pub(super) struct Lines<'a> {
    rest: &'a [u8],
    next_number: u64,
}

impl<'a> Lines<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Lines<'a> {
        Lines { rest: bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes), next_number: 1 }
    }

    fn physical(&mut self) -> Option<&'a [u8]> {
        if self.rest.is_empty() {
            return None;
        }
        let end = self.rest.iter().position(|&b| b == b'\n' || b == b'\r').unwrap_or(self.rest.len());
        let line = &self.rest[..end];
        let ending = if self.rest[end..].starts_with(b"\r\n") { 2 } else { 1 };
        self.rest = self.rest.get(end + ending..).unwrap_or(&[]);
        self.next_number += 1;
        Some(line)
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = (u64, Cow<'a, [u8]>);

    fn next(&mut self) -> Option<Self::Item> {
        let number = self.next_number;
        let mut line = Cow::Borrowed(self.physical()?);
        if !line.trim_ascii_start().starts_with(b"#") {
            while line.last() == Some(&b'\\') {
                let joined = line.to_mut();
                joined.pop();
                joined.push(b' ');
                match self.physical() {
                    Some(next) => joined.extend_from_slice(next),
                    None => break,
                }
            }
        }
        Some((number, line))
    }
}

/// The first word of a line and what follows it; nothing for empty lines and comments.
pub(super) fn statement(line: &[u8]) -> Option<(&[u8], &[u8])> {
    let line = line.trim_ascii();
    if line.is_empty() || line.starts_with(b"#") {
        return None;
    }
    let end = line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len());
    Some((&line[..end], line[end..].trim_ascii()))
}

/// The words of a line up to a comment.
pub(super) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).take_while(|word| !word.starts_with(b"#"))
}

/// Text in UTF-8 or else Latin-1.
pub(super) fn text(bytes: &[u8]) -> String {
    match std::str::from_utf8(bytes) {
        Ok(text) => text.to_owned(),
        Err(_) => bytes.iter().map(|&b| char::from(b)).collect(),
    }
}

/// Text for messages, in quotes and not too long.
pub(super) fn quoted(bytes: &[u8]) -> String {
    let text = text(&bytes[..bytes.len().min(60)]);
    format!("{text:?}{}", if bytes.len() > 60 { "…" } else { "" })
}

/// The path, relative to the scene's folder and with `/` between its parts, of what a file in `folder` calls `name`;
/// nothing if it would leave the scene's folder.
pub(super) fn local_path(folder: &str, name: &str) -> Option<String> {
    let name = name.replace('\\', "/");
    if name.starts_with('/') || name.contains([':', '\0']) {
        return None;
    }
    let mut parts = Vec::new();
    for part in folder.split('/').chain(name.split('/')) {
        match part {
            "" | "." => {}
            ".." => drop(parts.pop()?),
            _ => parts.push(part),
        }
    }
    (!parts.is_empty()).then(|| parts.join("/"))
}
