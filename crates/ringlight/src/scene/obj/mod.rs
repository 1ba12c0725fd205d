//! Wavefront OBJ with MTL.
//!
//! OBJ says nothing about sides, and files wind their faces either way, so every material is double-sided: it costs
//! patches that stay dark inside solids, and never makes a visible face black. Lengths are multiplied by the unit that the
//! caller gives. `Kd` is linear reflectance, `Ke` radiance, vertex colours are taken as linear. Objects (`o`) and groups
//! (`g`) become nodes, groups under their object; the faces of one material in a node become a surface. Normals, smoothing
//! groups, lines, points and free-form surfaces are not read.

mod lines;
mod material;
mod polygon;
mod reader;
mod resolve;
#[cfg(test)]
mod tests;

use crate::resources::{Bytes, Resources};
use crate::scene::{Geometry, Place, Scene, SceneError, SourceTriangle, Surface};
use material::Mapping;
use reader::{NONE, Part, Reader, Triangles, Vertices};

/// Reads an OBJ file called `name`; its material files and textures come from `resources`.
pub fn read(name: &str, bytes: Bytes, resources: &dyn Resources, unit_in_metres: f64) -> Result<Scene, SceneError> {
    let mut reader = Reader::read(name, &bytes, resources, unit_in_metres)?;
    if reader.parts.is_empty() {
        return Err(SceneError::new(Place::new(name, ""), "no faces", "at least one statement f with three corners"));
    }
    let used = std::mem::take(&mut reader.materials);
    let first_places = first_places(&reader.parts, used.len());
    let resolved = resolve::resolve(&used, &first_places, &reader.definitions, resources, &mut reader.warnings);
    let Reader { mut vertices, mut triangles, parts, nodes, mut warnings, .. } = reader;

    let mut surfaces = Vec::with_capacity(parts.len());
    let mut any_textured = false;
    for (number, part) in parts.iter().enumerate() {
        let material = &resolved.materials[part.material as usize];
        let has_texture = material.base_texture.is_some() || material.emission_texture.is_some();
        if has_texture {
            any_textured = true;
            let is_bare = |&t: &usize| triangles.coordinates.get(t).is_none_or(|corners| corners.contains(&NONE));
            let bare = triangles.of(part).filter(is_bare).count();
            let message =
                format!("triangles with the textured material {:?} have no texture coordinates", material.name);
            warnings.add_many("missing-texture-coordinates", message, part.place.clone(), bare as u64);
        }
        let node = &nodes[part.node as usize].name;
        surfaces.push(Surface {
            name: if node.is_empty() { format!("surface {number}").into() } else { node.as_str().into() },
            node: part.node,
            material: part.material,
            triangles: part.triangles.into(),
            has_colours: !vertices.colours.is_empty(),
            place: part.place.clone(),
        });
    }
    vertices.positions.shrink_to_fit();
    vertices.colours.shrink_to_fit();
    if !any_textured {
        (vertices.coordinates, triangles.coordinates) = Default::default();
    }
    vertices.coordinates.shrink_to_fit();
    triangles.corners.shrink_to_fit();
    triangles.faces.shrink_to_fit();
    triangles.coordinates.shrink_to_fit();
    triangles.runs.shrink_to_fit();
    let file_name = name.rsplit(['/', '\\']).next().unwrap_or(name);
    Ok(Scene {
        name: file_name.rsplit_once('.').map_or(file_name, |(stem, _)| stem).to_owned(),
        nodes,
        surfaces,
        materials: resolved.materials,
        images: resolved.images,
        lights: Vec::new(),
        cameras: Vec::new(),
        warnings,
        geometry: Box::new(ObjGeometry { vertices, triangles, parts, mappings: resolved.mappings }),
    })
}

/// Where each material is used first.
fn first_places(parts: &[Part], materials: usize) -> Vec<Place> {
    let mut places = vec![Place::default(); materials];
    for part in parts.iter().rev() {
        places[part.material as usize] = part.place.clone();
    }
    places
}

/// The triangles of an OBJ file, about 44 bytes each.
#[derive(Debug)]
struct ObjGeometry {
    vertices: Vertices,
    triangles: Triangles,
    parts: Vec<Part>,
    /// For each material: of the base texture and of the emission texture.
    mappings: Vec<[Mapping; 2]>,
}

impl Geometry for ObjGeometry {
    fn triangles(&self, surface: usize, sink: &mut dyn FnMut(SourceTriangle)) -> Result<(), SceneError> {
        let part = &self.parts[surface];
        let [base, emission] = self.mappings[part.material as usize];
        let (positions, colours): (&[[f64; 3]], &[[f32; 3]]) = (&self.vertices.positions, &self.vertices.colours);
        let (corners, all_coordinates): (&[[u32; 3]], &[[f32; 2]]) =
            (&self.triangles.corners, &self.vertices.coordinates);
        let (faces, corner_coordinates): (&[u32], &[[u32; 3]]) = (&self.triangles.faces, &self.triangles.coordinates);
        for number in self.triangles.of(part) {
            let triangle = corners[number];
            let coordinates = corner_coordinates.get(number).map_or([[0.0; 2]; 3], |corners| {
                corners.map(|corner| all_coordinates.get(corner as usize).copied().unwrap_or_default())
            });
            sink(SourceTriangle {
                position: triangle.map(|corner| positions[corner as usize]),
                base_uv: coordinates.map(|uv| base.apply(uv)),
                emission_uv: coordinates.map(|uv| emission.apply(uv)),
                colour: triangle.map(|corner| match colours.get(corner as usize) {
                    Some(&[red, green, blue]) => [red, green, blue, 1.0],
                    None => [1.0; 4],
                }),
                face: faces[number].into(),
            });
        }
        Ok(())
    }
}
