//! Errors and warnings that say where.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::sync::Arc;

/// A place in an input file. Its words are shared: every surface of a scene has a place.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Place {
    /// Name of the file, as the user gave it.
    pub file: Arc<str>,
    /// Where in the file: a JSON path (`nodes[3].mesh`), `line 12`, or `byte 20`.
    pub at: Arc<str>,
}

impl Place {
    /// A place.
    pub fn new(file: impl Into<Arc<str>>, at: impl Into<Arc<str>>) -> Place {
        Place { file: file.into(), at: at.into() }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.at.is_empty() { f.write_str(&self.file) } else { write!(f, "{}: {}", self.file, self.at) }
    }
}

/// A scene that cannot be used, or, if it is no fault of the scene's, cannot be read here.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{place}: {found}; expected {expected}")]
pub struct SceneError {
    /// Where.
    pub place: Place,
    /// What is there.
    pub found: String,
    /// What was expected instead.
    pub expected: String,
    /// Whether it is for want of scratch memory, and no fault of the scene's.
    pub lacks_memory: bool,
}

impl From<std::io::Error> for SceneError {
    /// Of scratch memory: nothing else that may fail is asked for while a scene is read and cut.
    fn from(error: std::io::Error) -> SceneError {
        let found = format!("no scratch memory: {error}");
        SceneError { lacks_memory: true, ..SceneError::new(Place::default(), found, "room for what the scene needs") }
    }
}

impl SceneError {
    /// An error at `place`.
    pub fn new(place: Place, found: impl Into<String>, expected: impl Into<String>) -> SceneError {
        SceneError { place, found: found.into(), expected: expected.into(), lacks_memory: false }
    }
}

/// Something that was ignored or changed, said once with a count.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Warning {
    /// Stable name, e.g. `metal-as-diffuse`.
    pub code: String,
    /// A sentence for people.
    pub message: String,
    /// How often.
    pub count: u64,
    /// Where first.
    pub first_place: Place,
}

/// Warnings by code, in order of first appearance.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Warnings(pub Vec<Warning>);

impl Warnings {
    /// Counts one more of `code`.
    pub fn add(&mut self, code: &str, message: impl Into<String>, place: Place) {
        self.add_many(code, message, place, 1);
    }

    /// Counts `count` more of `code`; nothing if `count` is 0.
    pub fn add_many(&mut self, code: &str, message: impl Into<String>, place: Place, count: u64) {
        if count == 0 {
            return;
        }
        match self.0.iter_mut().find(|w| w.code == code) {
            Some(w) => w.count += count,
            None => self.0.push(Warning { code: code.into(), message: message.into(), count, first_place: place }),
        }
    }
}
