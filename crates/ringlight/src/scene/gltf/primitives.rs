//! Primitives of meshes (glTF 2.0, section 3.7.2) with their accessors checked.

use super::accessor::{self, Elements, Shape};
use super::draco::DracoPrimitive;
use super::geometry::{Coordinates, Mode, Primitive};
use super::json;
use super::materials::{UvSource, UvSources};
use super::views::{Views, find};
use crate::scene::{Place, SceneError, Warnings};
use std::collections::BTreeMap;

/// A primitive on its way from JSON to [`Primitive`].
struct Reading<'a, 'd> {
    views: &'a mut Views<'d>,
    warnings: &'a mut Warnings,
    source: &'a json::Primitive,
    path: String,
    draco: Option<DracoPrimitive>,
}

/// Checks the primitive at JSON path `path`; none, with a warning, if it has no triangles.
pub(super) fn read(
    views: &mut Views,
    warnings: &mut Warnings,
    source: &json::Primitive,
    path: String,
    material: u32,
    uv: UvSources,
) -> Result<Option<Primitive>, SceneError> {
    let mode = match source.mode.unwrap_or(4) {
        4 => Mode::List,
        5 => Mode::Strip,
        6 => Mode::Fan,
        0..=3 => {
            let message = "points and lines neither shine nor reflect and are left out";
            warnings.add("points-and-lines-ignored", message, Place::new(views.name, path));
            return Ok(None);
        }
        mode => return Err(views.error(&format!("{path}.mode"), mode.to_string(), "a mode from 0 to 6")),
    };
    if !source.attributes.contains_key("POSITION") {
        let message = "primitives without positions are left out";
        warnings.add("primitive-without-positions", message, Place::new(views.name, path));
        return Ok(None);
    }
    let draco = match &source.extensions.draco {
        None => None,
        Some(draco) => match DracoPrimitive::decode(views, draco, &path) {
            Ok(decoded) => Some(decoded),
            Err(error) if has_plain_twin(views.document, source) => {
                warnings.add(
                    "compressed-twin-ignored",
                    format!("uncompressed data is read instead: {error}"),
                    error.place.clone(),
                );
                None
            }
            Err(error) => return Err(error),
        },
    };
    // Draco stores a list of triangles whatever the mode says.
    let mode = if draco.is_some() { Mode::List } else { mode };
    Reading { views, warnings, source, path, draco }.finish(mode, material, uv)
}

/// Whether a compressed primitive is also stored plainly, as files do that do not require Draco.
fn has_plain_twin(document: &json::Document, source: &json::Primitive) -> bool {
    let rows = source.attributes.get("POSITION").into_iter().chain(&source.indices);
    rows.copied().all(|index| find(&document.accessors, index).is_some_and(|accessor| accessor.buffer_view.is_some()))
}

impl Reading<'_, '_> {
    fn finish(mut self, mode: Mode, material: u32, uv: UvSources) -> Result<Option<Primitive>, SceneError> {
        let Some(positions) = self.attribute("POSITION", accessor::POSITION)? else { return Ok(None) };
        let vertices = positions.count();
        let indices = self.indices()?;
        let corners = indices.as_ref().map_or(vertices, Elements::count);
        if corners > 0 && (mode.triangles(corners) == 0 || mode == Mode::List && !corners.is_multiple_of(3)) {
            let message = "corners that do not fill a last triangle are left out";
            self.warnings.add("incomplete-triangle", message, Place::new(self.views.name, self.path.as_str()));
        }
        let base = self.coordinates(uv.base, vertices)?;
        let emission = self.coordinates(uv.emission, vertices)?;
        let colours = self.counted("COLOR_0", accessor::COLOUR, vertices)?.map(Elements::normalized);
        let joints = self.joints(vertices)?;
        let targets = self.targets(vertices)?;
        let triangles = mode.triangles(corners);
        let path = self.path.into();
        Ok(Some(Primitive {
            path,
            mode,
            indices,
            positions,
            targets,
            joints,
            base,
            emission,
            colours,
            material,
            triangles,
        }))
    }

    fn indices(&mut self) -> Result<Option<Elements>, SceneError> {
        match (&self.draco, self.source.indices) {
            (Some(draco), _) => Ok(Some(draco.indices())),
            (None, Some(index)) => {
                self.views.elements(index, &format!("{}.indices", self.path), accessor::INDICES).map(Some)
            }
            (None, None) => Ok(None),
        }
    }

    /// The attribute `semantic`, from the compressed data if it is there.
    fn attribute(&mut self, semantic: &str, shape: Shape) -> Result<Option<Elements>, SceneError> {
        let Some(&index) = self.source.attributes.get(semantic) else { return Ok(None) };
        let unique_id = self.source.extensions.draco.as_ref().and_then(|draco| draco.attributes.get(semantic)).copied();
        match (&self.draco, unique_id) {
            (Some(draco), Some(unique_id)) => draco.attribute(self.views, semantic, unique_id, index).map(Some),
            _ => self.views.elements(index, &format!("{}.attributes.{semantic}", self.path), shape).map(Some),
        }
    }

    /// The attribute `semantic`, which has a row for each of `vertices`.
    fn counted(&mut self, semantic: &str, shape: Shape, vertices: usize) -> Result<Option<Elements>, SceneError> {
        let elements = self.attribute(semantic, shape)?;
        if let Some(elements) = &elements {
            self.check_count(elements, vertices, &format!("attributes.{semantic}"))?;
        }
        Ok(elements)
    }

    fn check_count(&self, elements: &Elements, vertices: usize, member: &str) -> Result<(), SceneError> {
        if elements.count() >= vertices {
            return Ok(());
        }
        let at = format!("{}.{member}", self.path);
        Err(self.views.error(&at, format!("{} rows", elements.count()), format!("{vertices}, one for each vertex")))
    }

    fn coordinates(&mut self, source: Option<UvSource>, vertices: usize) -> Result<Option<Coordinates>, SceneError> {
        let Some(UvSource { set, transform }) = source else { return Ok(None) };
        let elements = self.counted(&format!("TEXCOORD_{set}"), accessor::TEXTURE_COORDINATES, vertices)?;
        if elements.is_none() {
            let message = "textures on surfaces without texture coordinates show the colour of one texel";
            let place = Place::new(self.views.name, self.path.as_str());
            self.warnings.add("missing-texture-coordinates", message, place);
        }
        Ok(elements.map(|elements| Coordinates { elements, transform }))
    }

    fn joints(&mut self, vertices: usize) -> Result<Vec<(Elements, Elements)>, SceneError> {
        let mut sets = Vec::new();
        loop {
            let set = sets.len();
            let joints = self.counted(&format!("JOINTS_{set}"), accessor::JOINTS, vertices)?;
            let weights = self.counted(&format!("WEIGHTS_{set}"), accessor::WEIGHTS, vertices)?;
            match (joints, weights) {
                (Some(joints), Some(weights)) => sets.push((joints, weights.normalized())),
                _ => return Ok(sets),
            }
        }
    }

    /// The displacements of the morph targets (section 3.7.2.2); those of colours and coordinates are not read.
    fn targets(&mut self, vertices: usize) -> Result<Vec<Option<Elements>>, SceneError> {
        let source = self.source;
        let read = |(number, target): (usize, &BTreeMap<String, u32>)| {
            let Some(&index) = target.get("POSITION") else { return Ok(None) };
            let member = format!("targets[{number}].POSITION");
            let elements = self.views.elements(index, &format!("{}.{member}", self.path), accessor::POSITION)?;
            self.check_count(&elements, vertices, &member)?;
            Ok(Some(elements))
        };
        source.targets.iter().enumerate().map(read).collect()
    }
}
