//! Where a picture is taken from.

mod automatic;
#[cfg(test)]
mod tests;

use crate::mesh::Mesh;
use crate::scene::Camera;
use crate::solution::Solution;
use glam::{DVec3, DVec4};
use ringlight_visibility::{NO_PLANE, Ray};

/// An eye and what it takes in; mesh coordinates, metres. The three directions are unit vectors, at right angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Where the eye is.
    pub eye: DVec3,
    /// Direction of the picture's middle.
    pub forward: DVec3,
    /// Direction of the picture's upper edge.
    pub up: DVec3,
    /// Direction of the picture's right edge.
    pub right: DVec3,
    /// How rays leave the eye.
    pub projection: Projection,
}

/// How rays leave the eye.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// All from one point.
    Perspective {
        /// Angle between the upper and the lower edge, radians, below π.
        vertical_field_of_view: f64,
    },
    /// All in one direction.
    Orthographic {
        /// Half the picture's height, metres.
        half_height: f64,
    },
}

/// A camera that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CameraError {
    /// No camera of the scene has this name.
    #[error("no camera is named '{name}'; {known}, or give \"ex,ey,ez;tx,ty,tz;fov\"")]
    Unknown {
        /// Name asked for.
        name: String,
        /// Which names there are.
        known: String,
    },
    /// The text is no camera.
    #[error(
        "camera \"{text}\": {found}; expected \"ex,ey,ez;tx,ty,tz;fov\": eye and target in metres, the vertical field of view in degrees"
    )]
    Malformed {
        /// What was given.
        text: String,
        /// What is wrong with it.
        found: String,
    },
}

impl View {
    /// From `eye` towards `target`, mesh coordinates; the picture's upper edge is up (+y), or, when the view is straight up
    /// or down, away (−z). None if there is no such direction.
    pub fn towards(eye: DVec3, target: DVec3, projection: Projection) -> Option<View> {
        let forward = (target - eye).try_normalize()?;
        let upward = if forward.y.abs() < 0.999_999 { DVec3::Y } else { DVec3::NEG_Z };
        let right = forward.cross(upward).try_normalize()?;
        Some(View { eye, forward, up: right.cross(forward), right, projection })
    }

    /// Of a camera of the scene. None if its transformation is degenerate.
    pub fn of_camera(camera: &Camera, mesh: &Mesh) -> Option<View> {
        let [right, up, back, position] = camera.world.map(|column| DVec4::from(column).truncate());
        let projection = if camera.vertical_field_of_view > 0.0 {
            Projection::Perspective { vertical_field_of_view: camera.vertical_field_of_view.min(3.1) }
        } else {
            Projection::Orthographic { half_height: camera.half_height }
        };
        Some(View {
            eye: position - DVec3::from(mesh.origin),
            forward: -back.try_normalize()?,
            up: up.try_normalize()?,
            right: right.try_normalize()?,
            projection,
        })
    }

    /// From "ex,ey,ez;tx,ty,tz;fov": eye and target in world coordinates, metres, and the vertical field of view, degrees.
    pub fn parse(text: &str, mesh: &Mesh) -> Result<View, CameraError> {
        let error = |found: String| CameraError::Malformed { text: text.into(), found };
        let number = |part: &str| {
            let value = part.trim().parse::<f64>().ok().filter(|v| v.is_finite());
            value.ok_or_else(|| error(format!("'{}' is not a number", part.trim())))
        };
        let point = |part: &str| {
            let values = part.split(',').map(number).collect::<Result<Vec<f64>, _>>()?;
            match values[..] {
                [x, y, z] => Ok(DVec3::new(x, y, z) - DVec3::from(mesh.origin)),
                _ => Err(error(format!("'{part}' has {} numbers", values.len()))),
            }
        };
        let parts: Vec<&str> = text.split(';').collect();
        let [eye, target, angle] = parts[..] else {
            return Err(error(format!("{} parts between semicolons", parts.len())));
        };
        let (eye, target, angle) = (point(eye)?, point(target)?, number(angle)?);
        if !(angle > 0.0 && angle < 180.0) {
            return Err(error(format!("a field of view of {angle}°")));
        }
        let projection = Projection::Perspective { vertical_field_of_view: angle.to_radians() };
        View::towards(eye, target, projection).ok_or_else(|| error("eye and target are the same point".into()))
    }

    /// The camera of that name; those without one are called `camera 0`, `camera 1`, …
    pub fn named(name: &str, solution: &Solution) -> Result<View, CameraError> {
        let cameras = &solution.description.cameras;
        let name_of = |number: usize, camera: &Camera| match camera.name.as_str() {
            "" => format!("camera {number}"),
            name => name.to_string(),
        };
        let found = cameras.iter().enumerate().find(|(number, camera)| name_of(*number, camera) == name);
        found.and_then(|(_, camera)| View::of_camera(camera, &solution.mesh)).ok_or_else(|| {
            let names: Vec<String> = cameras.iter().enumerate().map(|(n, c)| format!("'{}'", name_of(n, c))).collect();
            let known = match &names[..] {
                [] => "the scene has none".into(),
                names => format!("the scene has {}", names.join(", ")),
            };
            CameraError::Unknown { name: name.into(), known }
        })
    }

    /// What `text` asks for: a name, or "ex,ey,ez;tx,ty,tz;fov". Without it the scene's first camera, or none when it has
    /// none: then there is [`View::automatic`].
    pub fn choose(text: Option<&str>, solution: &Solution) -> Result<Option<View>, CameraError> {
        match text {
            Some(text) if text.contains(';') => View::parse(text, &solution.mesh).map(Some),
            Some(name) => View::named(name, solution).map(Some),
            None => Ok(solution.description.cameras.iter().find_map(|c| View::of_camera(c, &solution.mesh))),
        }
    }

    /// The ray through a place of the picture; `x` to the right and `y` upwards from its middle, both in half heights.
    pub fn ray(&self, x: f64, y: f64) -> Ray {
        let (origin, direction) = match self.projection {
            Projection::Perspective { vertical_field_of_view } => {
                let half = libm::tan(vertical_field_of_view / 2.0);
                (self.eye, self.forward + half * (x * self.right + y * self.up))
            }
            Projection::Orthographic { half_height } => {
                (self.eye + half_height * (x * self.right + y * self.up), self.forward)
            }
        };
        sight(origin, direction)
    }
}

/// A ray of sight.
fn sight(origin: DVec3, direction: DVec3) -> Ray {
    Ray {
        origin: origin.as_vec3().to_array(),
        direction: direction.as_vec3().to_array(),
        near: 0.0,
        far: f32::INFINITY,
        plane: NO_PLANE,
    }
}
