//! Reader for glTF 2.0, as `.gltf` and as `.glb`.
//!
//! The way of the data: the container gives a typed `json` document; `nodes` resolves the hierarchy; `views` and
//! `accessor` turn buffer views and accessors into checked windows on the file's own bytes; `materials` and `primitives`
//! check what surfaces need; `geometry` reads triangles from those windows whenever they are asked for. Only compressed
//! (`meshopt`, `draco`) and base64 data are copied.

mod accessor;
mod container;
mod draco;
mod extensions;
mod geometry;
mod json;
mod lights;
mod materials;
mod meshopt;
mod nodes;
mod primitives;
mod uri;
mod views;

use super::{Node, Place, Scene, SceneError, Surface, Warnings};
use crate::resources::{Bytes, Resources};
pub(super) use container::GLB_MAGIC;
use geometry::{GltfGeometry, Instances, Placement, Source};
use glam::DMat4;
use json::Document;
use materials::{Materials, UvSources};
use nodes::Hierarchy;
use std::sync::Arc;
use views::{Slice, Views, find};

/// More surfaces than this are refused: meshes times instances can ask for more than any memory holds.
const MOST_SURFACES: usize = 1 << 22;

/// Names are repeated for every surface, so that a long one, instanced, could ask for more than any memory holds.
const LONGEST_NAME: usize = 256;

/// Reads the glTF file `name`; what it refers to comes from `resources`.
pub fn read(name: &str, bytes: Bytes, resources: &dyn Resources) -> Result<Scene, SceneError> {
    let (document, binary) = container::open(name, &bytes)?;
    let mut warnings = Warnings::default();
    extensions::check(name, &document, &mut warnings)?;
    let hierarchy = nodes::resolve(name, &document)?;
    let whole = Slice::whole(bytes);
    let binary = binary.and_then(|range| whole.part(range.start as u64, range.len() as u64));
    let mut views = Views::open(name, &document, binary, resources)?;

    let used = used_materials(&document, &hierarchy);
    let mut materials = Vec::new();
    let mut uv_sources = Vec::new();
    let mut reader = Materials::new(&mut views, resources, &mut warnings);
    // One past the last is the default material, kept only if a primitive needs it.
    let needs_default = used.last().copied().unwrap_or(false);
    for index in 0..document.materials.len() + usize::from(needs_default) {
        let (material, uv) = reader.read(index, used.get(index).copied().unwrap_or(false))?;
        materials.push(material);
        uv_sources.push(uv);
    }
    let images = std::mem::take(&mut reader.images);

    let mut builder = Builder {
        name,
        file: name.into(),
        document: &document,
        views: &mut views,
        warnings: &mut warnings,
        world: &hierarchy.world,
        uv_sources,
        meshes: vec![None; document.meshes.len()],
        surfaces: Vec::new(),
        geometry: GltfGeometry {
            file: name.to_owned(),
            primitives: Vec::new(),
            placements: Vec::new(),
            sources: Vec::new(),
        },
    };
    let mut nodes = hierarchy.nodes;
    let mut lights = Vec::new();
    let mut cameras = Vec::new();
    for (slot, (&index, node)) in (0_u32..).zip(hierarchy.shown.iter().zip(&mut nodes)) {
        let Some(source) = find(&document.nodes, index) else { continue };
        let world = DMat4::from_cols_array_2d(&node.world);
        builder.place_mesh(index, source, slot, node)?;
        if let Some(camera) = source.camera {
            node.camera = builder.camera(camera, index, &node.name, &world)?.map(|camera| {
                cameras.push(camera);
                cameras.len() as u32 - 1
            });
        }
        if let Some(light) = source.extensions.as_ref().and_then(|extensions| extensions.light.as_ref()) {
            lights.extend(builder.light(light.light, index, slot, &world)?);
        }
    }
    let Builder { surfaces, geometry, .. } = builder;
    if surfaces.is_empty() {
        return Err(SceneError::new(
            Place::new(name, "scenes"),
            "the scene has no triangles",
            "at least one triangle in the default scene",
        ));
    }
    if !document.animations.is_empty() {
        let message = "animations are ignored: the scene is lit as it stands at rest";
        let count = document.animations.len() as u64;
        warnings.add_many("animation-ignored", message, Place::new(name, "animations[0]"), count);
    }
    Ok(Scene {
        name: hierarchy.scene_name,
        nodes,
        surfaces,
        materials,
        images,
        lights,
        cameras,
        warnings,
        geometry: Box::new(geometry),
    })
}

/// Which materials the scene's primitives use; the last entry stands for the default material.
fn used_materials(document: &Document, hierarchy: &Hierarchy) -> Vec<bool> {
    let mut used = vec![false; document.materials.len() + 1];
    let mut is_seen = vec![false; document.meshes.len()];
    for &index in &hierarchy.shown {
        let Some(mesh) = find(&document.nodes, index).and_then(|node| node.mesh) else { continue };
        if is_seen.get_mut(mesh as usize).is_none_or(|seen| std::mem::replace(seen, true)) {
            continue;
        }
        for primitive in find(&document.meshes, mesh).iter().flat_map(|mesh| &mesh.primitives) {
            let material = primitive.material.map_or(document.materials.len(), |material| material as usize);
            if let Some(flag) = used.get_mut(material) {
                *flag = true;
            }
        }
    }
    used
}

/// Gathers surfaces node by node.
struct Builder<'a, 'd> {
    name: &'a str,
    /// The same name, shared by the surfaces' places.
    file: Arc<str>,
    document: &'d Document,
    views: &'a mut Views<'d>,
    warnings: &'a mut Warnings,
    world: &'a [DMat4],
    uv_sources: Vec<UvSources>,
    /// The primitives of each mesh that has been met.
    meshes: Vec<Option<Vec<u32>>>,
    surfaces: Vec<Surface>,
    geometry: GltfGeometry,
}

impl Builder<'_, '_> {
    /// Adds the surfaces of the mesh that node `index` of the file carries; `slot` is its place in the scene.
    fn place_mesh(&mut self, index: u32, source: &json::Node, slot: u32, node: &Node) -> Result<(), SceneError> {
        let Some(mesh_index) = source.mesh else { return Ok(()) };
        let path = format!("nodes[{index}]");
        let document = self.document;
        let mesh = find(&document.meshes, mesh_index).ok_or_else(|| {
            self.views.index_error(&format!("{path}.mesh"), "mesh", mesh_index, document.meshes.len())
        })?;
        let primitives = self.primitives(mesh_index, mesh)?;
        let instances = self.instances(source, &path)?;
        let joints = self.joints(source, &path)?;
        let weights = self.weights(source, mesh, &path);
        let instance_count = instances.as_ref().map_or(1, |instances| instances.count);
        let placement = self.geometry.placements.len() as u32;
        let world = DMat4::from_cols_array_2d(&node.world);
        let instances = instances.map(Box::new);
        self.geometry.placements.push(Placement { node: index, world, instances, weights, joints });
        let wanted = primitives.len().saturating_mul(instance_count).saturating_add(self.surfaces.len());
        if wanted > MOST_SURFACES {
            let found = format!("{wanted} surfaces, counting every instance");
            return Err(self.views.error(&path, found, format!("at most {MOST_SURFACES}")));
        }
        let known_name = Some(node.name.as_str()).filter(|name| !name.is_empty()).or(mesh.name.as_deref());
        let known_name = known_name.filter(|name| !name.is_empty()).map(|name| Arc::from(shorten(name)));
        for instance in 0..instance_count as u32 {
            for &primitive in &primitives {
                let Some(shown) = find(&self.geometry.primitives, primitive) else { continue };
                let first_face = match (self.geometry.sources.last(), self.surfaces.last()) {
                    (Some(last), Some(surface)) => last.first_face.saturating_add(surface.triangles),
                    _ => 0,
                };
                let name = known_name.clone().unwrap_or_else(|| format!("surface {}", self.surfaces.len()).into());
                self.surfaces.push(Surface {
                    name,
                    node: slot,
                    material: shown.material,
                    triangles: shown.triangles as u64,
                    has_colours: shown.colours.is_some(),
                    place: Place::new(self.file.clone(), shown.path.clone()),
                });
                self.geometry.sources.push(Source { primitive, placement, instance, first_face });
            }
        }
        Ok(())
    }

    /// The primitives of a mesh that have triangles, checked when it is met first.
    fn primitives(&mut self, index: u32, mesh: &json::Mesh) -> Result<Vec<u32>, SceneError> {
        if let Some(known) = find(&self.meshes, index).cloned().flatten() {
            return Ok(known);
        }
        let mut primitives = Vec::new();
        for (number, source) in mesh.primitives.iter().enumerate() {
            let path = format!("meshes[{index}].primitives[{number}]");
            let materials = self.document.materials.len();
            let material = match source.material {
                None => materials,
                Some(material) if (material as usize) < materials => material as usize,
                Some(material) => {
                    return Err(self.views.index_error(&format!("{path}.material"), "material", material, materials));
                }
            };
            let uv = self.uv_sources.get(material).copied().unwrap_or_default();
            let primitive = primitives::read(self.views, self.warnings, source, path, material as u32, uv)?;
            if let Some(primitive) = primitive.filter(|primitive| primitive.triangles > 0) {
                primitives.push(self.geometry.primitives.len() as u32);
                self.geometry.primitives.push(primitive);
            }
        }
        if let Some(slot) = self.meshes.get_mut(index as usize) {
            *slot = Some(primitives.clone());
        }
        Ok(primitives)
    }

    /// `EXT_mesh_gpu_instancing`.
    fn instances(&mut self, source: &json::Node, path: &str) -> Result<Option<Instances>, SceneError> {
        let extension = source.extensions.as_ref().and_then(|extensions| extensions.instancing.as_ref());
        let Some(extension) = extension else { return Ok(None) };
        let path = format!("{path}.extensions.EXT_mesh_gpu_instancing.attributes");
        let mut read = |semantic: &str, shape| {
            let index = extension.attributes.get(semantic).copied();
            index.map(|index| self.views.elements(index, &format!("{path}.{semantic}"), shape)).transpose()
        };
        let translation = read("TRANSLATION", accessor::VECTOR)?;
        let rotation = read("ROTATION", accessor::ROTATION)?.map(accessor::Elements::normalized);
        let scale = read("SCALE", accessor::VECTOR)?;
        let given = [&translation, &rotation, &scale];
        let mut counts = given.iter().filter_map(|rows| rows.as_ref().map(accessor::Elements::count));
        let Some(count) = counts.next() else {
            // Only custom attributes: they do not tell where the instances are.
            return Ok(None);
        };
        if counts.any(|other| other != count) {
            return Err(self.views.error(&path, "attributes of different counts", "one row for each instance"));
        }
        if given.iter().all(|rows| rows.as_ref().is_none_or(accessor::Elements::is_unbacked)) {
            return Err(self.views.error(&path, format!("{count} instances without a buffer view"), "a buffer view"));
        }
        Ok(Some(Instances { translation, rotation, scale, count }))
    }

    /// Joint matrices at rest (section 3.7.3): where each joint stands, times the inverse of where it stood when bound.
    fn joints(&mut self, source: &json::Node, path: &str) -> Result<Option<Vec<DMat4>>, SceneError> {
        let Some(index) = source.skin else { return Ok(None) };
        let document = self.document;
        let at = format!("{path}.skin");
        let skin = find(&document.skins, index)
            .ok_or_else(|| self.views.index_error(&at, "skin", index, document.skins.len()))?;
        self.warnings.add("skin-at-rest", "skinned meshes are lit in their rest pose", Place::new(self.name, at));
        let path = format!("skins[{index}]");
        let inverse_at = format!("{path}.inverseBindMatrices");
        let inverse = skin.inverse_bind_matrices;
        let inverse = inverse.map(|index| self.views.elements(index, &inverse_at, accessor::MATRIX)).transpose()?;
        if let Some(rows) = inverse.as_ref().filter(|rows| rows.count() < skin.joints.len()) {
            let expected = format!("{}, one for each joint", skin.joints.len());
            return Err(self.views.error(&inverse_at, format!("{} matrices", rows.count()), expected));
        }
        let mut joints = Vec::with_capacity(skin.joints.len());
        for (number, &joint) in skin.joints.iter().enumerate() {
            let world = *find(self.world, joint).ok_or_else(|| {
                self.views.index_error(&format!("{path}.joints[{number}]"), "node", joint, self.world.len())
            })?;
            let bind = inverse.as_ref().map(|rows| DMat4::from_cols_array(&rows.floats(number)));
            joints.push(bind.map_or(world, |bind| world * bind));
        }
        Ok(Some(joints))
    }

    /// Weights of the morph targets: the node's, else the mesh's (section 3.7.2.2).
    fn weights(&mut self, source: &json::Node, mesh: &json::Mesh, path: &str) -> Vec<f64> {
        if mesh.primitives.iter().any(|primitive| !primitive.targets.is_empty()) {
            let message = "morph targets are lit at their default weights";
            self.warnings.add("morph-targets-at-default", message, Place::new(self.name, format!("{path}.mesh")));
        }
        source.weights.as_ref().unwrap_or(&mesh.weights).clone()
    }

    fn camera(
        &mut self,
        index: u32,
        node: u32,
        node_name: &str,
        world: &DMat4,
    ) -> Result<Option<super::Camera>, SceneError> {
        let cameras = &self.document.cameras;
        let source = find(cameras, index)
            .ok_or_else(|| self.views.index_error(&format!("nodes[{node}].camera"), "camera", index, cameras.len()))?;
        match lights::camera(source, node_name, world) {
            Ok(camera) => Ok(Some(camera)),
            Err(reason) => {
                let place = Place::new(self.name, format!("cameras[{index}]"));
                self.warnings.add("camera-ignored", format!("cameras that show nothing are left out: {reason}"), place);
                Ok(None)
            }
        }
    }

    fn light(&mut self, index: u32, node: u32, slot: u32, world: &DMat4) -> Result<Option<super::Light>, SceneError> {
        let lights = self.document.extensions.lights.as_ref().map_or(&[][..], |extension| &extension.lights);
        let source = find(lights, index).ok_or_else(|| {
            let at = format!("nodes[{node}].extensions.KHR_lights_punctual.light");
            self.views.index_error(&at, "light", index, lights.len())
        })?;
        lights::light(self.name, index, source, slot, world, self.warnings)
    }
}

/// The start of a name, at most [`LONGEST_NAME`] bytes.
fn shorten(name: &str) -> &str {
    let end = (0..=LONGEST_NAME.min(name.len())).rev().find(|end| name.is_char_boundary(*end));
    name.get(..end.unwrap_or(0)).unwrap_or_default()
}
