//! Punctual lights (`KHR_lights_punctual`) and cameras (glTF 2.0, section 3.10), in world space.

use super::json;
use crate::scene::{Camera, Light, LightKind, Place, SceneError, Warnings};
use glam::{DMat3, DMat4, DVec3};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

/// Light `index` of the file as node `node` of the scene carries it; none where its direction cannot be told.
pub(super) fn light(
    name: &str,
    index: u32,
    light: &json::Light,
    node: u32,
    world: &DMat4,
    warnings: &mut Warnings,
) -> Result<Option<Light>, SceneError> {
    let path = format!("extensions.KHR_lights_punctual.lights[{index}]");
    let error = |member: &str, found: String, expected: &str| {
        SceneError::new(Place::new(name, format!("{path}.{member}")), found, expected)
    };
    let strength = light.intensity.unwrap_or(1.0);
    let intensity = light.color.unwrap_or([1.0; 3]).map(|channel| (channel * strength) as f32);
    if intensity.iter().any(|channel| !channel.is_finite() || *channel < 0.0) {
        return Err(error("intensity", format!("intensity {intensity:?}"), "finite numbers that are not negative"));
    }
    let range = light.range.unwrap_or(f64::INFINITY);
    if range <= 0.0 {
        return Err(error("range", range.to_string(), "a positive range"));
    }
    let position = world.w_axis.truncate().to_array();
    // Lights shine along the node's −z. A scale changes neither their strength nor their range.
    let direction = world.transform_vector3(DVec3::NEG_Z).try_normalize().map(|direction| direction.to_array());
    let kind = match (light.kind.as_str(), direction) {
        ("point", _) => LightKind::Point { position, range },
        ("directional", Some(direction)) => LightKind::Directional { direction },
        ("spot", Some(direction)) => {
            let spot = light.spot.as_ref();
            let inner = spot.and_then(|spot| spot.inner_cone_angle).unwrap_or(0.0);
            let outer = spot.and_then(|spot| spot.outer_cone_angle).unwrap_or(FRAC_PI_4);
            // Exporters write π/2 as a float, which is a little more than π/2.
            if !(inner >= 0.0 && inner <= outer && outer > 0.0 && outer <= FRAC_PI_2 + 1e-6) {
                let found = format!("cone angles {inner} and {outer}");
                return Err(error("spot", found, "0 ≤ innerConeAngle ≤ outerConeAngle ≤ π/2"));
            }
            let (inner_cosine, outer_cosine) = (libm::cos(inner), libm::cos(outer).max(0.0));
            LightKind::Spot { position, direction, range, inner_cosine, outer_cosine }
        }
        ("directional" | "spot", None) => {
            let message = "a light under a node without extent shines nowhere and is left out";
            warnings.add("light-without-direction", message, Place::new(name, path));
            return Ok(None);
        }
        (kind, _) => return Err(error("type", format!("{kind:?}"), "point, spot or directional")),
    };
    Ok(Some(Light { name: light.name.clone().unwrap_or_default(), intensity, kind, node }))
}

/// A camera as a node carries it; none, with the reason, where its numbers make no sense.
pub(super) fn camera(camera: &json::Camera, node_name: &str, world: &DMat4) -> Result<Camera, String> {
    let name = if node_name.is_empty() { camera.name.clone().unwrap_or_default() } else { node_name.to_owned() };
    let world = without_scale(world).ok_or("a camera under a node without extent")?.to_cols_array_2d();
    let positive = |number: f64| number > 0.0 && number.is_finite();
    match (&camera.perspective, &camera.orthographic) {
        (Some(lens), _) => {
            if !(positive(lens.yfov) && lens.yfov < PI) {
                return Err(format!("a field of view of {} radians", lens.yfov));
            }
            let aspect = lens.aspect_ratio.filter(|aspect| positive(*aspect));
            Ok(Camera { name, world, vertical_field_of_view: lens.yfov, half_height: 0.0, aspect })
        }
        (None, Some(lens)) => {
            // The magnifications may be negative, which mirrors the picture; that is of no use here.
            let (width, height) = (lens.xmag.abs(), lens.ymag.abs());
            if !positive(height) {
                return Err(format!("ymag {}", lens.ymag));
            }
            let aspect = Some(width / height).filter(|aspect| positive(*aspect));
            Ok(Camera { name, world, vertical_field_of_view: 0.0, half_height: height, aspect })
        }
        (None, None) => Err("neither perspective nor orthographic".to_owned()),
    }
}

/// A right-handed frame that keeps the view direction (z) and as much of "up" (y) as fits. Section 3.10.2: a camera's
/// node must not be scaled, but files do it.
fn without_scale(world: &DMat4) -> Option<DMat4> {
    let axes = DMat3::from_mat4(*world);
    let back = axes.z_axis.try_normalize()?;
    let right = axes.y_axis.cross(back).try_normalize()?;
    let up = back.cross(right);
    let position = world.w_axis.truncate();
    Some(DMat4::from_cols(right.extend(0.0), up.extend(0.0), back.extend(0.0), position.extend(1.0)))
}
