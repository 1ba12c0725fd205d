//! The reader for each kind of file.

use super::{Place, Scene, SceneError};
use crate::resources::{Bytes, Resources};

/// How to read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadOptions {
    /// Length of the file's unit, metres; OBJ only.
    pub unit_in_metres: f64,
}

impl Default for ReadOptions {
    fn default() -> Self {
        ReadOptions { unit_in_metres: 1.0 }
    }
}

/// Reads a scene; `name` is the file's name as people know it.
pub fn read(name: &str, bytes: Bytes, resources: &dyn Resources, options: &ReadOptions) -> Result<Scene, SceneError> {
    if name.to_ascii_lowercase().ends_with(".obj") {
        return super::obj::read(name, bytes, resources, options.unit_in_metres);
    }
    Err(SceneError::new(Place::new(name, ""), "an unknown kind of file", "glTF (.gltf, .glb) or OBJ (.obj)"))
}
