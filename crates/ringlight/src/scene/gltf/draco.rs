//! `KHR_draco_mesh_compression`: primitives decoded into memory, once.

use super::accessor::Elements;
use super::json;
use super::views::{Slice, Views, find};
use crate::resources::Bytes;
use crate::scene::SceneError;
use draco_core::{DecodeLimits, DecoderBuffer, Mesh, MeshDecoder};
use std::panic::AssertUnwindSafe;

/// The most memory that so many compressed bytes may ask for. The best real ratios are far below.
fn limits(compressed: usize) -> DecodeLimits {
    const LARGEST_RATIO: u64 = 4096;
    let mut limits = DecodeLimits::default();
    let most = (compressed as u64).saturating_mul(LARGEST_RATIO);
    limits.max_points = limits.max_points.min(most);
    limits.max_faces = limits.max_faces.min(most);
    limits.max_decoded_bytes = limits.max_decoded_bytes.min(most);
    limits
}

/// A decoded primitive.
pub(super) struct DracoPrimitive {
    mesh: Mesh,
    path: String,
}

impl DracoPrimitive {
    /// Decodes the primitive at JSON path `primitive_path`.
    pub fn decode(views: &mut Views, draco: &json::Draco, primitive_path: &str) -> Result<DracoPrimitive, SceneError> {
        let path = format!("{primitive_path}.extensions.KHR_draco_mesh_compression");
        let compressed = views.view(draco.buffer_view, &format!("{path}.bufferView"))?;
        // The decoder is a large crate that meets bytes from anywhere, so a panic in it is an error like any other.
        let decoded = std::panic::catch_unwind(AssertUnwindSafe(|| {
            let mut mesh = Mesh::new();
            let mut buffer = DecoderBuffer::new(compressed.get()).with_limits(limits(compressed.get().len()));
            MeshDecoder::new().decode(&mut buffer, &mut mesh).map(|()| mesh)
        }));
        let expected = "valid Draco data; `gltf-transform copy` writes the scene uncompressed";
        match decoded {
            Ok(Ok(mesh)) => Ok(DracoPrimitive { mesh, path }),
            Ok(Err(cause)) => Err(views.error(&path, format!("data that cannot be decoded: {cause}"), expected)),
            Err(_) => Err(views.error(&path, "data that cannot be decoded", expected)),
        }
    }

    /// Three indices for each triangle.
    pub fn indices(&self) -> Elements {
        let indices = self.mesh.faces().iter().flatten().flat_map(|point| point.0.to_le_bytes());
        Elements::from_indices(Slice::whole(Bytes::new(indices.collect::<Vec<u8>>())))
    }

    /// The attribute that the extension stores under `unique_id` and that stands for accessor `accessor`.
    pub fn attribute(
        &self,
        views: &Views,
        semantic: &str,
        unique_id: u32,
        accessor: u32,
    ) -> Result<Elements, SceneError> {
        let path = format!("{}.attributes.{semantic}", self.path);
        let attribute = self.mesh.attribute_by_unique_id(unique_id).ok_or_else(|| {
            views.error(&path, format!("attribute {unique_id}"), "an attribute that the compressed data has")
        })?;
        let width = usize::from(attribute.num_components());
        let values = attribute.read_f32s(self.mesh.num_points(), width);
        // The accessor says how the decoded numbers are meant (extension, "Conformance").
        let one =
            find(&views.document.accessors, accessor).filter(|accessor| accessor.normalized).map_or(1.0, |accessor| {
                super::accessor::Component::from_code(accessor.component_type).map_or(1.0, |component| component.one())
            });
        let bytes: Vec<u8> = values.iter().flat_map(|value| ((f64::from(*value) / one) as f32).to_le_bytes()).collect();
        Ok(Elements::from_floats(Slice::whole(Bytes::new(bytes)), width))
    }
}
