//! Scene → faces: named rows of flat convex polygons in double precision, and what blocks their view.

use super::joining::{Part, join};
use super::{Occluder, Polygon};
use crate::column::Store;
use crate::mesh::{CLEAR_COVERAGE, Planes};
use crate::scene::{Alpha, Material, Place, Scene, SceneError, Warnings};
use glam::DVec3;
use std::collections::BTreeMap;
use std::io;
use std::ops::Range;

/// What has a row.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Per {
    /// Every named object: surfaces of one name belong to one.
    #[default]
    Object,
    /// Every face of the file.
    Face,
}

/// Which sides of faces see and are seen. All faces block from both sides.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sides {
    /// The front, from which the corners run counter-clockwise.
    #[default]
    Front,
    /// Both; areas count both.
    Both,
}

/// Polygons with a name: a row and a column of the matrix.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// Name of the object; with [`Per::Face`] followed by `/` and the number of the face in the file, from 1.
    pub name: String,
    /// Sum of the polygons' areas, m².
    pub area: f64,
    /// Its polygons in [`Faces::polygons`].
    pub polygons: Range<usize>,
}

/// The faces of a scene.
#[derive(Clone, Debug, Default)]
pub struct Faces {
    /// Rows, in the order in which their names come up in the file.
    pub groups: Vec<Group>,
    /// Polygons, those of a group together. Coordinates are relative to an origin near the scene.
    pub polygons: Vec<Polygon>,
    /// What blocks.
    pub blockers: Vec<Occluder>,
    /// Triangles in the file.
    pub triangles: u64,
    /// Triangles without an area, which are left out.
    pub degenerate: u64,
    /// What was left out or changed.
    pub warnings: Warnings,
}

/// Faces whose corners lie within this share of the scene's diagonal of a plane lie in it: glTF's coordinates are good to
/// 6e-8 of it.
const PLANE_TOLERANCE: f64 = 2.5e-7;

/// Triangles whose height is below this share of their longest edge have no area that rounding did not make.
const DEGENERATE: f64 = 1e-9;

/// A triangle on its way.
struct Piece {
    object: u32,
    face: u64,
    corners: [DVec3; 3],
}

impl Faces {
    /// Reads all triangles of `scene`, joins those that make convex polygons again, and groups them.
    ///
    /// Emission, colours and textures do not matter. Surfaces that are fully clear (blocking less than 1 % by alpha and
    /// transmission) are left out; all others are opaque.
    pub fn new(scene: &Scene, per: Per, sides: Sides) -> Result<Faces, SceneError> {
        let mut faces = Faces::default();
        let (names, mut pieces) = faces.read(scene)?;
        if pieces.is_empty() {
            let place = Place::new(scene.name.clone(), "");
            return Err(SceneError::new(place, "no triangle with an area", "a face to see or be seen"));
        }
        let planes = move_to_origin_and_find_planes(&mut pieces)?;
        faces.blockers =
            pieces.iter().zip(&planes).map(|(piece, &plane)| Occluder { corners: piece.corners, plane }).collect();
        // The numbers of faces rise within a surface but not over the surfaces of an object.
        let mut order: Vec<usize> = (0..pieces.len()).collect();
        order.sort_by_key(|&i| (pieces[i].object, pieces[i].face));
        for run in order.chunk_by(|&a, &b| pieces[a].object == pieces[b].object) {
            let parts = run.iter().map(|&i| Part {
                corners: pieces[i].corners,
                plane: planes[i],
                unit: if per == Per::Face { pieces[i].face } else { 0 },
            });
            let mut joined = join(&parts.collect::<Vec<_>>());
            joined.sort_by_key(|polygon| polygon.unit);
            let name = &names[pieces[run[0]].object as usize];
            for unit in joined.chunk_by(|a, b| a.unit == b.unit) {
                let name = match per {
                    Per::Object => name.clone(),
                    Per::Face => format!("{name}/{}", unit[0].unit + 1),
                };
                faces.add_group(name, unit.iter().map(|polygon| (polygon.corners.clone(), polygon.plane)), sides);
            }
        }
        Ok(faces)
    }

    /// All triangles of the scene that have an area, with the names of its objects.
    fn read(&mut self, scene: &Scene) -> Result<(Vec<String>, Vec<Piece>), SceneError> {
        let (mut names, mut pieces) = (Vec::new(), Vec::new());
        let mut numbers = BTreeMap::new();
        for (number, surface) in scene.surfaces.iter().enumerate() {
            self.triangles += surface.triangles;
            if is_clear(&scene.materials[surface.material as usize]) {
                let message = "surfaces that are fully clear are left out: they neither see nor block";
                self.warnings.add("clear-surface", message, surface.place.clone());
                continue;
            }
            let object = *numbers.entry(&surface.name).or_insert_with(|| {
                names.push(surface.name.to_string());
                names.len() as u32 - 1
            });
            let mut degenerate = 0;
            scene.geometry.triangles(number, &mut |triangle| {
                let corners = triangle.position.map(DVec3::from);
                if is_degenerate(corners) {
                    degenerate += 1;
                } else {
                    pieces.push(Piece { object, face: triangle.face, corners });
                }
            })?;
            self.degenerate += degenerate;
            let message = "triangles without an area are left out";
            self.warnings.add_many("degenerate-triangle", message, surface.place.clone(), degenerate);
        }
        Ok((names, pieces))
    }

    fn add_group(&mut self, name: String, outlines: impl Iterator<Item = (Vec<DVec3>, u32)>, sides: Sides) {
        let first = self.polygons.len();
        for (corners, plane) in outlines {
            let reversed = (sides == Sides::Both).then(|| corners.iter().rev().copied().collect());
            self.polygons.extend(Polygon::new(corners, plane));
            self.polygons.extend(reversed.and_then(|corners| Polygon::new(corners, plane)));
        }
        let polygons = first..self.polygons.len();
        let area = self.polygons[polygons.clone()].iter().map(|polygon| polygon.area).sum();
        self.groups.push(Group { name, area, polygons });
    }
}

/// Whether nothing of what falls on the material's surfaces stays there. Textures are not asked.
fn is_clear(material: &Material) -> bool {
    let alpha = match material.alpha {
        Alpha::Opaque => 1.0,
        Alpha::Mask(cutoff) => f32::from(material.base_colour[3] >= cutoff),
        Alpha::Blend => material.base_colour[3].clamp(0.0, 1.0),
    };
    alpha * (1.0 - material.transmission.clamp(0.0, 1.0)) < CLEAR_COVERAGE
}

fn is_degenerate([a, b, c]: [DVec3; 3]) -> bool {
    let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
    let twice_area = (b - a).cross(c - a).length();
    !(twice_area > DEGENERATE * longest && twice_area.is_normal())
}

/// Takes the scene near the origin where it lies far from it, and gives the plane ids of the pieces.
fn move_to_origin_and_find_planes(pieces: &mut [Piece]) -> io::Result<Vec<u32>> {
    let corners = || pieces.iter().flat_map(|piece| piece.corners);
    let low = corners().fold(DVec3::INFINITY, DVec3::min);
    let high = corners().fold(DVec3::NEG_INFINITY, DVec3::max);
    let (centre, diagonal) = ((low + high) / 2.0, (high - low).length());
    if centre.length() > 2.0 * diagonal {
        let origin = centre.round();
        pieces.iter_mut().for_each(|piece| piece.corners.iter_mut().for_each(|corner| *corner -= origin));
    }
    let area_vector = |i: usize| {
        let [a, b, c] = pieces[i].corners;
        (b - a).cross(c - a)
    };
    // Large ones first: they define planes best.
    let mut order: Vec<usize> = (0..pieces.len()).collect();
    let areas: Vec<f64> = (0..pieces.len()).map(|i| area_vector(i).length_squared()).collect();
    order.sort_by(|&a, &b| areas[b].total_cmp(&areas[a]).then(a.cmp(&b)));
    let reach = pieces.iter().flat_map(|piece| piece.corners).map(DVec3::length).fold(0.0, f64::max);
    let mut planes = Planes::new(PLANE_TOLERANCE * diagonal, reach, Store::Heap)?;
    let mut ids = vec![0; pieces.len()];
    for i in order {
        ids[i] = planes.id(&pieces[i].corners, area_vector(i))?;
    }
    Ok(ids)
}
