//! Triangles, read from the file's bytes each time they are asked for.

use super::accessor::Elements;
use super::nodes::compose;
use crate::scene::{Geometry, Place, SceneError, SourceTriangle};
use glam::{DMat3, DMat4, DVec3};
use std::sync::Arc;

/// Metres. Farther out, areas and volumes would leave the range of 32-bit floats.
const MOST_DISTANT: f64 = 1e12;

/// How vertices make triangles (glTF 2.0, section 3.7.2.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mode {
    List,
    Strip,
    Fan,
}

impl Mode {
    /// Number of triangles that `corners` indices or vertices make.
    pub fn triangles(self, corners: usize) -> usize {
        match self {
            Mode::List => corners / 3,
            Mode::Strip | Mode::Fan => corners.saturating_sub(2),
        }
    }

    /// Which indices or vertices make triangle `number`.
    fn corners(self, number: usize) -> [usize; 3] {
        match self {
            Mode::List => [3 * number, 3 * number + 1, 3 * number + 2],
            Mode::Strip => [number, number + 1 + number % 2, number + 2 - number % 2],
            Mode::Fan => [number + 1, number + 2, 0],
        }
    }
}

/// Texture coordinates and the transformation that a material applies to them.
#[derive(Clone, Debug)]
pub(super) struct Coordinates {
    pub elements: Elements,
    pub transform: UvTransform,
}

/// `KHR_texture_transform` as the rows of a 2 × 3 matrix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct UvTransform(pub [[f64; 3]; 2]);

impl UvTransform {
    /// Changes nothing.
    pub const IDENTITY: UvTransform = UvTransform([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);

    fn apply(&self, [u, v]: [f64; 2]) -> [f32; 2] {
        let transformed = self.0.map(|[a, b, c]| (a * u + b * v + c) as f32);
        // Undefined coordinates cannot be shown; they are common at vertices of no area and do no harm there.
        transformed.map(|coordinate| if coordinate.is_finite() { coordinate } else { 0.0 })
    }
}

/// A primitive whose accessors have been checked against the file.
#[derive(Debug)]
pub(super) struct Primitive {
    /// JSON path.
    pub path: Arc<str>,
    pub mode: Mode,
    pub indices: Option<Elements>,
    pub positions: Elements,
    /// Displacements of the morph targets.
    pub targets: Vec<Option<Elements>>,
    /// Sets of joint numbers and weights.
    pub joints: Vec<(Elements, Elements)>,
    pub base: Option<Coordinates>,
    pub emission: Option<Coordinates>,
    pub colours: Option<Elements>,
    /// Index into the scene's materials.
    pub material: u32,
    /// Number of triangles.
    pub triangles: usize,
}

/// A mesh under a node.
#[derive(Debug)]
pub(super) struct Placement {
    /// Index of the node in the file.
    pub node: u32,
    /// World transformation of the node.
    pub world: DMat4,
    /// `EXT_mesh_gpu_instancing`.
    pub instances: Option<Box<Instances>>,
    /// Weights of the morph targets.
    pub weights: Vec<f64>,
    /// Joint matrices at rest (section 3.7.3.3); with them the node's own transformation does not count.
    pub joints: Option<Vec<DMat4>>,
}

/// The transformations of a node's instances.
#[derive(Debug)]
pub(super) struct Instances {
    pub translation: Option<Elements>,
    pub rotation: Option<Elements>,
    pub scale: Option<Elements>,
    pub count: usize,
}

impl Instances {
    fn matrix(&self, instance: usize) -> DMat4 {
        compose(
            self.translation.as_ref().map(|rows| rows.floats(instance)),
            self.rotation.as_ref().map(|rows| rows.floats(instance)),
            self.scale.as_ref().map(|rows| rows.floats(instance)),
        )
    }
}

/// Which primitive a surface shows, and where.
#[derive(Clone, Copy, Debug)]
pub(super) struct Source {
    pub primitive: u32,
    pub placement: u32,
    pub instance: u32,
    /// Number of triangles of the surfaces before this one.
    pub first_face: u64,
}

/// All surfaces of a glTF file.
#[derive(Debug)]
pub(super) struct GltfGeometry {
    pub file: String,
    pub primitives: Vec<Primitive>,
    pub placements: Vec<Placement>,
    pub sources: Vec<Source>,
}

impl Geometry for GltfGeometry {
    fn triangles(&self, surface: usize, sink: &mut dyn FnMut(SourceTriangle)) -> Result<(), SceneError> {
        let source = self.sources[surface];
        let primitive = &self.primitives[source.primitive as usize];
        let placement = &self.placements[source.placement as usize];
        let world = match &placement.instances {
            Some(instances) => placement.world * instances.matrix(source.instance as usize),
            None => placement.world,
        };
        let reader = Reader { file: &self.file, primitive, placement, world };
        let is_mirrored = mirrors(&world);
        for number in 0..primitive.triangles {
            let mut triangle = SourceTriangle { colour: [[1.0; 4]; 3], ..SourceTriangle::default() };
            let corners = primitive.mode.corners(number);
            let mut flips = is_mirrored;
            for (place, corner) in corners.into_iter().enumerate() {
                let vertex = reader.vertex_number(corner)?;
                let (position, matrix) = reader.position(vertex)?;
                if placement.joints.is_some() && place == 0 {
                    flips = mirrors(&matrix);
                }
                // A mirroring transformation turns the winding round (section 3.7.4); swapping two corners undoes it.
                let slot = if flips { (3 - place) % 3 } else { place };
                triangle.position[slot] = position;
                if let Some(coordinates) = &primitive.base {
                    triangle.base_uv[slot] = coordinates.transform.apply(coordinates.elements.floats(vertex));
                }
                if let Some(coordinates) = &primitive.emission {
                    triangle.emission_uv[slot] = coordinates.transform.apply(coordinates.elements.floats(vertex));
                }
                if let Some(colours) = &primitive.colours {
                    triangle.colour[slot] = colour(colours, vertex);
                }
            }
            triangle.face = source.first_face.saturating_add(number as u64);
            sink(triangle);
        }
        Ok(())
    }
}

fn mirrors(matrix: &DMat4) -> bool {
    DMat3::from_mat4(*matrix).determinant() < 0.0
}

/// A vertex colour within 0…1; alpha is 1 where the file has none.
fn colour(colours: &Elements, vertex: usize) -> [f32; 4] {
    let mut colour: [f64; 4] = colours.floats(vertex);
    if colours.width() < 4 {
        colour[3] = 1.0;
    }
    colour.map(|channel| if channel.is_nan() { 0.0 } else { channel.clamp(0.0, 1.0) as f32 })
}

/// Reads the vertices of one surface.
struct Reader<'a> {
    file: &'a str,
    primitive: &'a Primitive,
    placement: &'a Placement,
    world: DMat4,
}

impl Reader<'_> {
    fn vertex_number(&self, corner: usize) -> Result<usize, SceneError> {
        let Some(indices) = &self.primitive.indices else { return Ok(corner) };
        let vertex = indices.unsigned(corner) as usize;
        let count = self.primitive.positions.count();
        if vertex < count {
            return Ok(vertex);
        }
        let place = Place::new(self.file, format!("{}.indices[{corner}]", self.primitive.path));
        Err(SceneError::new(place, format!("vertex {vertex}"), format!("a vertex below {count}")))
    }

    /// World position of a vertex and the matrix that led to it.
    fn position(&self, vertex: usize) -> Result<([f64; 3], DMat4), SceneError> {
        let mut local: DVec3 = self.primitive.positions.floats(vertex).into();
        for (target, weight) in self.primitive.targets.iter().zip(&self.placement.weights) {
            if let Some(displacements) = target
                && *weight != 0.0
            {
                local += *weight * DVec3::from(displacements.floats(vertex));
            }
        }
        if !local.is_finite() {
            return Err(self.undefined(&self.primitive.path, vertex, local));
        }
        let matrix = match &self.placement.joints {
            Some(joints) => self.skin(joints, vertex)?,
            None => self.world,
        };
        let world = matrix.transform_point3(local);
        if !world.is_finite() || world.abs().max_element() > MOST_DISTANT {
            return Err(self.undefined(
                &format!("nodes[{}].mesh: {}", self.placement.node, self.primitive.path),
                vertex,
                world,
            ));
        }
        Ok((world.to_array(), matrix))
    }

    #[cold]
    fn undefined(&self, path: &str, vertex: usize, position: DVec3) -> SceneError {
        let place = Place::new(self.file, format!("{path}.attributes.POSITION[{vertex}]"));
        let expected = format!("finite coordinates of at most {MOST_DISTANT:e} metres");
        SceneError::new(place, format!("position {:?}", position.to_array()), expected)
    }

    /// The weighted sum of joint matrices. Weights should add up to 1 and are scaled to do so; a vertex without weights
    /// follows its first joint.
    fn skin(&self, joints: &[DMat4], vertex: usize) -> Result<DMat4, SceneError> {
        let mut sum = DMat4::ZERO;
        let mut total = 0.0;
        let mut first = None;
        for (set, (numbers, weights)) in self.primitive.joints.iter().enumerate() {
            let numbers: [f64; 4] = numbers.floats(vertex);
            let weights: [f64; 4] = weights.floats(vertex);
            for (number, weight) in numbers.into_iter().zip(weights) {
                let joint = joints.get(number as usize);
                if weight != 0.0 || first.is_none() {
                    let joint = joint.ok_or_else(|| {
                        let at = format!("{}.attributes.JOINTS_{set}[{vertex}]", self.primitive.path);
                        let expected = format!("a joint below {}", joints.len());
                        SceneError::new(Place::new(self.file, at), format!("joint {number}"), expected)
                    })?;
                    first.get_or_insert(*joint);
                    sum += *joint * weight;
                    total += weight;
                }
            }
        }
        let scaled = sum * (1.0 / total);
        Ok(if scaled.is_finite() { scaled } else { first.unwrap_or(self.world) })
    }
}
