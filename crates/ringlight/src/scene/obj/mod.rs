//! OBJ + MTL: not read yet.

use super::{Place, Scene, SceneError};
use crate::resources::{Bytes, Resources};

/// Reads an OBJ file whose lengths are given in units of `unit_in_metres`.
pub fn read(
    name: &str,
    _bytes: Bytes,
    _resources: &dyn Resources,
    _unit_in_metres: f64,
) -> Result<Scene, SceneError> {
    Err(SceneError::new(Place::new(name, ""), "an OBJ file", "glTF; OBJ is not read yet"))
}
