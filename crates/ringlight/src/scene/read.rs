//! Chooses the reader of a scene file.

use super::{Place, Scene, SceneError, gltf, obj};
use crate::resources::{Bytes, Resources};

/// What the user may say about a scene file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadOptions {
    /// Length of the file's unit in metres. Only for OBJ: glTF is always in metres.
    pub unit_in_metres: f64,
}

impl Default for ReadOptions {
    fn default() -> Self {
        ReadOptions { unit_in_metres: 1.0 }
    }
}

/// Reads the scene file `name`, whose content is `bytes`; what it refers to comes from `resources`.
///
/// The content decides where it can: a GLB by its first bytes, glTF by its opening brace; then the ending of the name.
pub fn read(name: &str, bytes: Bytes, resources: &dyn Resources, options: &ReadOptions) -> Result<Scene, SceneError> {
    let text = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&bytes);
    let first = text.iter().find(|byte| !byte.is_ascii_whitespace());
    let ending = name.rsplit_once('.').map(|(_, ending)| ending.to_ascii_lowercase());
    let is_gltf = bytes.starts_with(gltf::GLB_MAGIC) || first == Some(&b'{');
    match ending.as_deref() {
        _ if is_gltf => gltf::read(name, bytes, resources),
        Some("gltf" | "glb") => gltf::read(name, bytes, resources),
        Some("obj") => obj::read(name, bytes, resources, options.unit_in_metres),
        _ => Err(SceneError::new(Place::new(name, ""), "a file of unknown kind", "glTF (.gltf, .glb) or OBJ (.obj)")),
    }
}
