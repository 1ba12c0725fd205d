//! A model made of rectangles, which is all that the generated scenes need.

use glam::{DMat3, DQuat, DVec3};

/// Index of a material of a [`Model`].
pub type Paint = usize;

/// What a surface is made of.
#[derive(Clone)]
pub struct Material {
    pub name: String,
    /// Linear reflectance.
    pub colour: [f64; 3],
    /// Emitted colour, at most 1, and the luminance in cd/m² that 1 stands for.
    pub emission: ([f64; 3], f64),
}

/// A rectangle, seen from the side where `along` × `up` points.
#[derive(Clone)]
pub struct Rectangle {
    pub corner: DVec3,
    pub along: DVec3,
    pub up: DVec3,
    pub paint: Paint,
}

/// Rectangles in a common frame.
#[derive(Clone)]
pub struct Mesh {
    pub name: String,
    pub rectangles: Vec<Rectangle>,
}

/// A node of the hierarchy.
#[derive(Clone, Default)]
pub struct Node {
    pub name: String,
    pub translation: DVec3,
    pub rotation: DQuat,
    pub mesh: Option<usize>,
    /// Vertical field of view in degrees, if it is a camera.
    pub camera: Option<f64>,
    pub children: Vec<usize>,
}

/// A scene to be written.
#[derive(Default)]
pub struct Model {
    pub name: String,
    /// Patch size and element size in metres, as recorded in the file.
    pub sizes: (f64, f64),
    pub materials: Vec<Material>,
    pub meshes: Vec<Mesh>,
    pub nodes: Vec<Node>,
    pub roots: Vec<usize>,
}

impl Model {
    /// Adds a matt material.
    pub fn paint(&mut self, name: &str, colour: [f64; 3]) -> Paint {
        self.light(name, colour, [0.0; 3], 0.0)
    }

    /// Adds a material that shines.
    pub fn light(&mut self, name: &str, colour: [f64; 3], emission: [f64; 3], luminance: f64) -> Paint {
        self.materials.push(Material { name: name.to_owned(), colour, emission: (emission, luminance) });
        self.materials.len() - 1
    }

    /// Adds a mesh.
    pub fn mesh(&mut self, name: &str, rectangles: Vec<Rectangle>) -> usize {
        self.meshes.push(Mesh { name: name.to_owned(), rectangles });
        self.meshes.len() - 1
    }

    /// Adds a node, under `parent` or as a root.
    pub fn node(&mut self, name: &str, parent: Option<usize>, mesh: Option<usize>, place: Place) -> usize {
        let node = Node {
            name: name.to_owned(),
            translation: place.0,
            rotation: DQuat::from_rotation_y(place.1.to_radians()),
            mesh,
            camera: None,
            children: Vec::new(),
        };
        self.nodes.push(node);
        let index = self.nodes.len() - 1;
        match parent {
            Some(parent) => self.nodes[parent].children.push(index),
            None => self.roots.push(index),
        }
        index
    }

    /// Adds a camera at `eye` that looks at `target`.
    pub fn camera(&mut self, name: &str, eye: [f64; 3], target: [f64; 3], field_of_view: f64) {
        let back = (DVec3::from(eye) - DVec3::from(target)).normalize();
        let right = DVec3::Y.cross(back).normalize();
        let index = self.node(name, None, None, at(eye[0], eye[1], eye[2]));
        self.nodes[index].rotation = DQuat::from_mat3(&DMat3::from_cols(right, back.cross(right), back));
        self.nodes[index].camera = Some(field_of_view);
    }

    /// Numbers of patches and elements when rectangles are cut to at most these sizes, and how close to a whole number the
    /// nearest ratio of lengths comes: where it is tiny, rounding could change the numbers.
    pub fn count(&self, patch_size: f64, element_size: f64) -> (u64, u64, f64) {
        let mut margin = f64::INFINITY;
        let mut pieces = |length: f64, size: f64| {
            let ratio = length / size;
            margin = margin.min((ratio - ratio.round()).abs());
            (ratio - 1e-6).ceil()
        };
        let (mut patches, mut elements) = (0.0, 0.0);
        for mesh in self.nodes.iter().filter_map(|node| node.mesh) {
            for rectangle in &self.meshes[mesh].rectangles {
                let (mut of_rectangle, mut of_patch) = (1.0, 1.0);
                for length in [rectangle.along.length(), rectangle.up.length()] {
                    let count = pieces(length, patch_size);
                    of_rectangle *= count;
                    of_patch *= pieces(length / count, element_size);
                }
                patches += of_rectangle;
                elements += of_rectangle * of_patch;
            }
        }
        (patches as u64, elements as u64, margin)
    }
}

/// Where a node stands and by how many degrees it is turned about the vertical.
#[derive(Clone)]
pub struct Place(DVec3, f64);

/// A place without rotation.
pub fn at(x: f64, y: f64, z: f64) -> Place {
    Place(DVec3::new(x, y, z), 0.0)
}

impl Place {
    /// The same place, turned by this many degrees.
    pub fn turned(self, degrees: f64) -> Place {
        Place(self.0, degrees)
    }
}

/// Closed solids and single rectangles in one frame.
#[derive(Default)]
pub struct Solid(pub Vec<Rectangle>);

impl Solid {
    /// A rectangle seen from the side where `along` × `up` points.
    pub fn rectangle(&mut self, paint: Paint, corner: [f64; 3], along: [f64; 3], up: [f64; 3]) {
        self.0.push(Rectangle { corner: corner.into(), along: along.into(), up: up.into(), paint });
    }

    /// A box between two corners. Returns its six faces: −x, +x, −y, +y, −z, +z.
    pub fn block(&mut self, paint: Paint, low: [f64; 3], high: [f64; 3]) -> &mut [Rectangle] {
        let (low, high) = (DVec3::from(low), DVec3::from(high));
        self.turned_block(paint, (low + high) / 2.0, high - low, DQuat::IDENTITY)
    }

    /// A box of a size, turned about its centre. Returns its faces as [`Solid::block`] does.
    pub fn turned_block(&mut self, paint: Paint, centre: DVec3, size: DVec3, rotation: DQuat) -> &mut [Rectangle] {
        let (x, y, z) = (DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z);
        let faces = [(-x, z, y), (x, -z, y), (-y, x, z), (y, x, -z), (-z, -x, y), (z, x, y)];
        self.0.extend(faces.map(|(outward, along, up)| Rectangle {
            corner: centre + rotation * ((outward - along - up) / 2.0),
            along: rotation * along,
            up: rotation * up,
            paint,
        }));
        let start = self.0.len() - 6;
        &mut self.0[start..]
    }

    /// The inside of a box: six rectangles that face inwards, in the order of [`Solid::block`].
    pub fn room(&mut self, paint: Paint, low: [f64; 3], high: [f64; 3]) -> &mut [Rectangle] {
        let faces = self.block(paint, low, high);
        for face in faces.iter_mut() {
            (face.corner, face.along) = (face.corner + face.along, -face.along);
        }
        faces
    }
}

/// Numbers that look random and are the same everywhere (SplitMix64).
pub struct Dice(pub u64);

impl Dice {
    /// A whole number below `count`.
    pub fn below(&mut self, count: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (bits ^ (bits >> 31)) % count
    }

    /// A length between two others, in whole millimetres.
    pub fn millimetres(&mut self, least: u64, most: u64) -> f64 {
        (least + self.below(most - least + 1)) as f64 / 1000.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_face_outwards_and_rooms_inwards() {
        let mut solid = Solid::default();
        solid.block(0, [1.0; 3], [2.0, 3.0, 4.0]);
        let centre = DVec3::new(1.5, 2.0, 2.5);
        let outward = |r: &Rectangle| r.along.cross(r.up).dot(r.corner + (r.along + r.up) / 2.0 - centre) > 0.0;
        assert!(solid.0.iter().all(outward));
        let mut room = Solid::default();
        room.room(0, [1.0; 3], [2.0, 3.0, 4.0]);
        assert!(!room.0.iter().any(outward));
        let area: f64 = solid.0.iter().map(|r| r.along.cross(r.up).length()).sum();
        assert_eq!((area, solid.0.len()), (2.0 * (2.0 + 3.0 + 6.0), 6));
    }

    #[test]
    fn counting_follows_the_rule() {
        let mut model = Model::default();
        let mut solid = Solid::default();
        solid.rectangle(0, [0.0; 3], [1.0, 0.0, 0.0], [0.0, 0.5, 0.0]);
        let mesh = model.mesh("sheet", solid.0);
        model.node("a", None, Some(mesh), at(0.0, 0.0, 0.0));
        model.node("b", None, Some(mesh), at(5.0, 0.0, 0.0).turned(30.0));
        assert_eq!(model.count(0.5, 0.2).0, 4);
        assert_eq!(model.count(0.5, 0.2).1, 4 * 9);
        assert!(model.count(0.5, 0.2).2 < 1e-9 && model.count(0.3, 0.21).2 > 0.01);
    }
}
