//! Bytes → checked scene. Reports every problem with its place.
//!
//! A [`Scene`] is a light description (nodes, materials, lights, cameras) plus a [`Geometry`] that hands out triangles
//! surface by surface, in world space and double precision, reading them from the file's bytes each time, so that no
//! second copy of the geometry is held.

pub mod error;
pub mod gltf;
pub mod obj;
mod read;
pub mod texture;

pub use error::{Place, SceneError, Warning, Warnings};
pub use read::{ReadOptions, read};

use crate::resources::Bytes;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A checked scene.
#[derive(Debug)]
pub struct Scene {
    /// Name of the scene, from the file.
    pub name: String,
    /// The node hierarchy as far as output needs it; parents come before their children.
    pub nodes: Vec<Node>,
    /// Triangles of one material under one node; one entry for each instance.
    pub surfaces: Vec<Surface>,
    /// Materials.
    pub materials: Vec<Material>,
    /// Images, encoded; decoded one by one when needed.
    pub images: Vec<Image>,
    /// Punctual lights, in world space.
    pub lights: Vec<Light>,
    /// Cameras, in world space.
    pub cameras: Vec<Camera>,
    /// What was ignored or changed.
    pub warnings: Warnings,
    /// The triangles.
    pub geometry: Box<dyn Geometry>,
}

/// Hands out the triangles of a surface.
pub trait Geometry: Send + Sync + std::fmt::Debug {
    /// Calls `sink` for each triangle of `scene.surfaces[surface]`, in file order. Errors name the place.
    fn triangles(&self, surface: usize, sink: &mut dyn FnMut(SourceTriangle)) -> Result<(), SceneError>;
}

/// A triangle as read: world space, counter-clockwise seen from its front (mirroring by the node is already undone).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SourceTriangle {
    /// Corners, metres.
    pub position: [[f64; 3]; 3],
    /// Coordinates into the material's base texture, texture transform applied.
    pub base_uv: [[f32; 2]; 3],
    /// Coordinates into the material's emission texture, texture transform applied.
    pub emission_uv: [[f32; 2]; 3],
    /// Vertex colours, linear RGBA; ones where the file has none.
    pub colour: [[f32; 4]; 3],
    /// Number of the input face it is a part of, counted over the file from 0: of the `f` statement in an OBJ file, of the
    /// triangle itself in glTF, in the order of the surfaces.
    pub face: u64,
}

/// One node of the hierarchy.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Node {
    /// Name in the file, may be empty.
    pub name: String,
    /// Index of the parent.
    pub parent: Option<u32>,
    /// Local transformation, column-major.
    pub local: [[f64; 4]; 4],
    /// World transformation, column-major.
    pub world: [[f64; 4]; 4],
    /// Index into [`Scene::cameras`].
    pub camera: Option<u32>,
    /// `extras` of the file.
    pub extras: Option<serde_json::Value>,
}

/// The triangles of one material under one node.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Surface {
    /// Name by which people know it: the node's, else the mesh's, else the OBJ group's, else `surface N`. Surfaces of one
    /// node share it.
    pub name: Arc<str>,
    /// Node it hangs under.
    pub node: u32,
    /// Index into [`Scene::materials`].
    pub material: u32,
    /// Number of triangles that [`Geometry::triangles`] gives.
    pub triangles: u64,
    /// Whether vertices have colours.
    pub has_colours: bool,
    /// Where it stands in the file.
    pub place: Place,
}

/// What matters of a material for diffuse light.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Material {
    /// Name in the file, may be empty.
    pub name: String,
    /// Base colour factor: linear RGB reflectance (not yet limited to 0.95) and alpha.
    pub base_colour: [f32; 4],
    /// Base colour texture: sRGB colour, linear alpha; multiplied with the factor.
    pub base_texture: Option<Texture>,
    /// Emitted radiance (luminance), W/(m²·sr) or cd/m²: factor × strength. Exitance is π times this.
    pub emission: [f32; 3],
    /// Emission texture, sRGB; multiplied with `emission`.
    pub emission_texture: Option<Texture>,
    /// How alpha is meant.
    pub alpha: Alpha,
    /// Share of light let through by `KHR_materials_transmission`, 0 to 1.
    pub transmission: f32,
    /// Whether both sides are lit and reflect.
    pub double_sided: bool,
    /// `extras` of the file.
    pub extras: Option<serde_json::Value>,
}

/// Meaning of a material's alpha.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Alpha {
    /// Ignored.
    Opaque,
    /// Blocks where alpha ≥ the cutoff.
    Mask(f32),
    /// Passes 1 − alpha.
    Blend,
}

/// A texture: an image and how it repeats.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Texture {
    /// Index into [`Scene::images`].
    pub image: u32,
    /// Wrapping along u and v.
    pub wrap: [Wrap; 2],
    /// Whether magnified texels stay sharp.
    pub nearest: bool,
}

/// How texture coordinates beyond 0…1 are meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Wrap {
    /// Repeat.
    Repeat,
    /// Repeat, mirrored in turn.
    Mirror,
    /// The edge goes on.
    Clamp,
}

/// An encoded image (PNG, JPEG or WebP).
#[derive(Clone, Debug)]
pub struct Image {
    /// Name: its path relative to the scene, or `image N` when embedded.
    pub name: String,
    /// Media type, e.g. `image/png`.
    pub media_type: String,
    /// The encoded bytes.
    pub bytes: Bytes,
}

/// A punctual light in world space.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Light {
    /// Name in the file, may be empty.
    pub name: String,
    /// Linear RGB: colour × intensity; candela (W/sr) for point and spot, lux (W/m²) for directional lights.
    pub intensity: [f32; 3],
    /// Kind and place.
    pub kind: LightKind,
    /// Node that carries it.
    pub node: u32,
}

/// Kind of a punctual light; positions in metres, world space.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum LightKind {
    /// Shines alike in all directions.
    Point {
        /// Position.
        position: [f64; 3],
        /// Beyond this distance it is dark (KHR_lights_punctual); infinite if none.
        #[serde(deserialize_with = "infinite_if_null")]
        range: f64,
    },
    /// Shines in a cone.
    Spot {
        /// Position.
        position: [f64; 3],
        /// Unit vector along the axis, away from the lamp.
        direction: [f64; 3],
        /// As for points.
        #[serde(deserialize_with = "infinite_if_null")]
        range: f64,
        /// Cosine of the inner cone's angle.
        inner_cosine: f64,
        /// Cosine of the outer cone's angle.
        outer_cosine: f64,
    },
    /// Shines from infinity.
    Directional {
        /// Unit vector along which the light travels.
        direction: [f64; 3],
    },
}

/// JSON has no infinity: it is written as null.
fn infinite_if_null<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(deserializer)?.unwrap_or(f64::INFINITY))
}

/// A camera in world space; it looks along its −z.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Name in the file (the node's, else the camera's), may be empty.
    pub name: String,
    /// Camera-to-world transformation, column-major, without scale.
    pub world: [[f64; 4]; 4],
    /// Vertical field of view, radians; 0 for an orthographic camera.
    pub vertical_field_of_view: f64,
    /// Half height of an orthographic view, metres.
    pub half_height: f64,
    /// Width over height, if the file says.
    pub aspect: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::LightKind;

    #[test]
    fn a_lamp_without_a_range_is_the_same_after_json() {
        let position = [1.0, 2.0, 3.0];
        let direction = [0.0, -1.0, 0.0];
        for range in [f64::INFINITY, 7.5] {
            let spot = LightKind::Spot { position, direction, range, inner_cosine: 1.0, outer_cosine: 0.5 };
            for kind in [LightKind::Point { position, range }, spot] {
                let text = serde_json::to_string(&kind).unwrap();
                assert_eq!(serde_json::from_str::<LightKind>(&text).unwrap(), kind, "{text}");
            }
        }
        assert!(serde_json::from_str::<LightKind>(r#"{"Point":{"position":[0,0,0]}}"#).is_err());
    }
}
