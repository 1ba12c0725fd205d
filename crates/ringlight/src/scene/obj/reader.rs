//! The statements of an OBJ file.

use super::lines::{At, Lines, local_path, quoted, statement, text, words};
use super::material::{self, Definition};
use super::polygon::Triangulator;
use crate::column::{Column, Store};
use crate::resources::Resources;
use crate::scene::{Node, Place, SceneError, Warnings};
use bytemuck::{Pod, Zeroable};
use std::collections::{HashMap, HashSet};
use std::io;

/// Stands for a corner without texture coordinates.
pub(super) const NONE: u32 = u32::MAX;

const IDENTITY: [[f64; 4]; 4] =
    [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];

/// Everything said in an OBJ file, its materials still by name.
pub(super) struct Reader<'a> {
    resources: &'a dyn Resources,
    unit_in_metres: f64,
    pub(super) vertices: Vertices,
    pub(super) triangles: Triangles,
    pub(super) parts: Vec<Part>,
    pub(super) nodes: Vec<Node>,
    /// Names given by `usemtl`, as far as faces use them; the empty one stands for none.
    pub(super) materials: Vec<String>,
    pub(super) definitions: HashMap<String, Definition>,
    pub(super) warnings: Warnings,
    names: Names,
    triangulator: Triangulator,
    /// Number of `f` statements so far.
    faces: u32,
    face: Vec<[u32; 2]>,
    corners: Vec<[f64; 3]>,
}

/// What faces refer to.
#[derive(Debug)]
pub(super) struct Vertices {
    /// Metres.
    pub(super) positions: Column<[f64; 3]>,
    /// Empty, or one for each position.
    pub(super) colours: Column<[f32; 3]>,
    /// As in the file: v runs upwards.
    pub(super) coordinates: Column<[f32; 2]>,
}

/// Triangles in the order of the file.
#[derive(Debug)]
pub(super) struct Triangles {
    /// Indices into the positions.
    pub(super) corners: Column<[u32; 3]>,
    /// For each triangle the number of its `f` statement in the file.
    pub(super) faces: Column<u32>,
    /// For each triangle indices into the texture coordinates, or [`NONE`]; the last triangles may have none.
    pub(super) coordinates: Column<[u32; 3]>,
    /// Triangles of one part that follow each other.
    pub(super) runs: Column<Run>,
}

/// Triangles of one part that follow each other in the file.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Run {
    pub(super) first: u32,
    pub(super) count: u32,
    /// The next run of the same part, or [`NONE`].
    pub(super) next: u32,
}

/// The triangles of one material in one object or group.
#[derive(Debug)]
pub(super) struct Part {
    pub(super) node: u32,
    pub(super) material: u32,
    pub(super) place: Place,
    /// Number of triangles.
    pub(super) triangles: u32,
    /// First and last run of triangles, or [`NONE`].
    pub(super) runs: [u32; 2],
}

impl Triangles {
    fn new(store: Store<'_>) -> io::Result<Triangles> {
        Ok(Triangles {
            corners: store.column()?,
            faces: store.column()?,
            coordinates: store.column()?,
            runs: store.column()?,
        })
    }

    /// Adds a triangle of the face `face` with its positions and coordinates.
    fn push(&mut self, part: &mut Part, face: u32, corners: [[u32; 2]; 3]) -> io::Result<()> {
        let number = self.corners.len() as u32;
        let here = self.runs.len() as u32;
        match self.runs.last_mut() {
            // The file's last run goes on if it is this part's.
            Some(run) if part.runs[1] == here.wrapping_sub(1) => run.count += 1,
            _ => {
                match std::mem::replace(&mut part.runs[1], here) {
                    NONE => part.runs[0] = here,
                    last => self.runs[last as usize].next = here,
                }
                self.runs.push(Run { first: number, count: 1, next: NONE })?;
            }
        }
        part.triangles += 1;
        self.corners.push(corners.map(|corner| corner[0]))?;
        self.faces.push(face)?;
        let coordinates = corners.map(|corner| corner[1]);
        if coordinates != [NONE; 3] {
            self.coordinates.resize(number as usize, [NONE; 3])?;
            self.coordinates.push(coordinates)?;
        }
        Ok(())
    }

    /// The numbers of the triangles of a part, in the order of the file.
    pub(super) fn of(&self, part: &Part) -> impl Iterator<Item = usize> {
        let runs: &[Run] = &self.runs;
        let all = std::iter::successors(runs.get(part.runs[0] as usize), |run| runs.get(run.next as usize));
        all.flat_map(|run| run.first as usize..(run.first + run.count) as usize)
    }
}

/// Names in force, and what has been seen under which name.
#[derive(Default)]
struct Names {
    object: String,
    group: String,
    material: String,
    /// The part that faces go to; found again after each change of names.
    part: Option<usize>,
    nodes: HashMap<(String, String), u32>,
    materials: HashMap<String, u32>,
    parts: HashMap<(u32, u32), usize>,
    libraries: HashSet<String>,
}

impl<'a> Reader<'a> {
    /// Reads a whole file.
    pub(super) fn read(
        file: &str,
        bytes: &[u8],
        resources: &'a dyn Resources,
        unit_in_metres: f64,
    ) -> Result<Reader<'a>, SceneError> {
        let store = resources.store();
        let mut reader = Reader {
            resources,
            unit_in_metres,
            vertices: Vertices { positions: store.column()?, colours: store.column()?, coordinates: store.column()? },
            triangles: Triangles::new(store)?,
            parts: Vec::new(),
            nodes: Vec::new(),
            materials: Vec::new(),
            definitions: HashMap::new(),
            warnings: Warnings::default(),
            names: Names::default(),
            triangulator: Triangulator::default(),
            faces: 0,
            face: Vec::new(),
            corners: Vec::new(),
        };
        for (line, content) in Lines::new(bytes) {
            if let Some((keyword, rest)) = statement(&content) {
                reader.statement(At { file, line }, keyword, rest)?;
            }
        }
        Ok(reader)
    }

    fn statement(&mut self, at: At<'_>, keyword: &[u8], rest: &[u8]) -> Result<(), SceneError> {
        match keyword {
            b"v" => self.vertex(at, rest)?,
            b"vt" => self.coordinates(at, rest)?,
            b"f" | b"fo" => self.face(at, rest)?,
            b"o" => {
                self.names.object = text(rest);
                self.names.group.clear();
                self.names.part = None;
            }
            b"g" => {
                self.names.group = if rest == b"default" { String::new() } else { text(rest) };
                self.names.part = None;
            }
            b"usemtl" => {
                self.names.material = text(rest);
                self.names.part = None;
            }
            b"mtllib" => self.libraries(at, rest)?,
            b"vn" | b"s" | b"t" | b"l" | b"p" | b"mg" | b"lod" | b"bevel" | b"c_interp" | b"d_interp" => {}
            b"shadow_obj" | b"trace_obj" | b"usemap" | b"maplib" => {}
            b"curv" | b"curv2" | b"surf" => {
                let message = "free-form curves and surfaces are not read; only faces are";
                self.warnings.add("free-form-geometry", message, at.place());
            }
            b"vp" | b"cstype" | b"deg" | b"bmat" | b"step" | b"parm" | b"trim" | b"hole" | b"scrv" | b"sp" | b"end"
            | b"con" | b"ctech" | b"stech" => {}
            _ => {
                let message = format!("the statement {} is not known and was skipped", quoted(keyword));
                self.warnings.add("unknown-statement", message, at.place());
            }
        }
        Ok(())
    }

    /// `v x y z`, then nothing, a weight, a colour, or a colour with alpha.
    fn vertex(&mut self, at: At<'_>, rest: &[u8]) -> Result<(), SceneError> {
        let numbers: [Option<f64>; 6] = numbers(at, rest)?;
        let [Some(x), Some(y), Some(z), colour @ ..] = numbers else {
            return Err(at.error(quoted(rest), "three coordinates"));
        };
        let vertices = &mut self.vertices;
        if vertices.positions.len() >= NONE as usize {
            return Err(at.error("one vertex too many", "fewer than 2^32"));
        }
        let position = [x, y, z].map(|coordinate| coordinate * self.unit_in_metres);
        if position.iter().any(|coordinate| !(*coordinate as f32).is_finite()) {
            return Err(at.error(quoted(rest), "coordinates of moderate size"));
        }
        if let [Some(red), Some(green), Some(blue)] = colour {
            let colour = [red, green, blue].map(|channel| channel as f32);
            if colour.iter().any(|channel| !(0.0..=1.0).contains(channel)) {
                let message = "vertex colours are limited to the range from 0 to 1";
                self.warnings.add("vertex-colour-range", message, at.place());
            }
            vertices.colours.resize(vertices.positions.len(), [1.0; 3])?;
            vertices.colours.push(colour.map(|channel| channel.clamp(0.0, 1.0)))?;
        } else if !vertices.colours.is_empty() {
            vertices.colours.push([1.0; 3])?;
        }
        vertices.positions.push(position)?;
        Ok(())
    }

    /// `vt u [v [w]]`.
    fn coordinates(&mut self, at: At<'_>, rest: &[u8]) -> Result<(), SceneError> {
        let [u, v] = numbers(at, rest)?;
        let u = u.ok_or_else(|| at.error("vt without numbers", "one to three"))?;
        if self.vertices.coordinates.len() >= NONE as usize {
            return Err(at.error("one texture coordinate too many", "fewer than 2^32"));
        }
        self.vertices.coordinates.push([u as f32, v.unwrap_or(0.0) as f32])?;
        Ok(())
    }

    /// `f v[/[vt][/vn]] …`.
    fn face(&mut self, at: At<'_>, rest: &[u8]) -> Result<(), SceneError> {
        let number = self.faces;
        self.faces = number.checked_add(1).ok_or_else(|| at.error("one face too many", "fewer than 2^32"))?;
        self.face.clear();
        self.corners.clear();
        for word in words(rest) {
            let mut parts = word.split(|&b| b == b'/');
            let vertex = index(at, parts.next().unwrap_or(b""), self.vertices.positions.len(), "vertices")?;
            let coordinates = match parts.next() {
                None | Some(b"") => NONE,
                Some(part) => index(at, part, self.vertices.coordinates.len(), "texture coordinates")?,
            };
            self.face.push([vertex, coordinates]);
            self.corners.push(self.vertices.positions[vertex as usize]);
        }
        if self.face.len() < 3 {
            self.warnings.add("short-face", "faces with fewer than three corners were skipped", at.place());
            return Ok(());
        }
        let part = match self.names.part {
            Some(part) => part,
            None => self.find_part(at),
        };
        self.names.part = Some(part);
        if self.triangles.corners.len() + self.face.len() >= NONE as usize {
            return Err(at.error("one triangle too many", "fewer than 2^32"));
        }
        let part = &mut self.parts[part];
        let mut kept = Ok(());
        self.triangulator.triangulate(&self.corners, |triangle| {
            if kept.is_ok() {
                kept = self.triangles.push(part, number, triangle.map(|corner| self.face[corner as usize]));
            }
        });
        Ok(kept?)
    }

    /// The part of the names in force; makes it, its material and its nodes if they are new.
    fn find_part(&mut self, at: At<'_>) -> usize {
        let node = self.find_node();
        let material = match self.names.materials.get(&self.names.material) {
            Some(&material) => material,
            None => {
                self.materials.push(self.names.material.clone());
                let material = (self.materials.len() - 1) as u32;
                self.names.materials.insert(self.names.material.clone(), material);
                material
            }
        };
        *self.names.parts.entry((node, material)).or_insert_with(|| {
            self.parts.push(Part { node, material, place: at.place(), triangles: 0, runs: [NONE; 2] });
            self.parts.len() - 1
        })
    }

    /// The node of the object and group in force: groups of an object hang under it.
    fn find_node(&mut self) -> u32 {
        let Names { object, group, nodes, .. } = &mut self.names;
        let mut find = |object: &str, group: &str, parent| {
            *nodes.entry((object.to_owned(), group.to_owned())).or_insert_with(|| {
                let name = if group.is_empty() { object } else { group };
                self.nodes.push(Node {
                    name: name.to_owned(),
                    parent,
                    local: IDENTITY,
                    world: IDENTITY,
                    ..Node::default()
                });
                (self.nodes.len() - 1) as u32
            })
        };
        match (object.as_str(), group.as_str()) {
            (object, "") => find(object, "", None),
            ("", group) => find("", group, None),
            (object, group) => {
                let parent = find(object, "", None);
                find(object, group, Some(parent))
            }
        }
    }

    /// `mtllib` with one or more file names. Names may have spaces in them: one ends with the word that ends with `.mtl`.
    fn libraries(&mut self, at: At<'_>, rest: &[u8]) -> Result<(), SceneError> {
        let line = text(rest);
        let mut start = 0;
        for (end, _) in line.match_indices(char::is_whitespace).chain([(line.len(), "")]) {
            let name = line[start..end].trim();
            let ending = name.trim_end_matches('"').as_bytes().last_chunk();
            if ending.is_some_and(|ending: &[u8; 4]| ending.eq_ignore_ascii_case(b".mtl")) || end == line.len() {
                start = end;
                if !name.is_empty() {
                    self.library(at, name.trim_matches('"'))?;
                }
            }
        }
        Ok(())
    }

    fn library(&mut self, at: At<'_>, name: &str) -> Result<(), SceneError> {
        if !self.names.libraries.insert(name.to_owned()) {
            return Ok(());
        }
        let Some(path) = local_path("", name) else {
            let message = format!("the material file {name:?} lies outside the scene's folder and was not read");
            self.warnings.add("path-outside", message, at.place());
            return Ok(());
        };
        match self.resources.read(&path) {
            Ok(bytes) => material::read(&path, &bytes, &mut self.definitions, &mut self.warnings),
            Err(error) => {
                let message = format!("the material file {path:?} cannot be read: {error}");
                self.warnings.add("missing-material-file", message, at.place());
                Ok(())
            }
        }
    }
}

/// Up to `N` numbers of a line.
fn numbers<const N: usize>(at: At<'_>, rest: &[u8]) -> Result<[Option<f64>; N], SceneError> {
    let mut numbers = [None; N];
    for (slot, word) in numbers.iter_mut().zip(words(rest)) {
        *slot = Some(at.number(word)?);
    }
    Ok(numbers)
}

/// An index counted from 0: in the file they count from 1, or from −1 backwards.
fn index(at: At<'_>, word: &[u8], count: usize, what: &str) -> Result<u32, SceneError> {
    let number = std::str::from_utf8(word).ok().and_then(|word| word.parse::<i64>().ok());
    let index = number.filter(|&number| number != 0).and_then(|number| match number {
        1.. => number.checked_sub(1),
        _ => number.checked_add(count as i64),
    });
    match index {
        Some(index) if (0..count as i64).contains(&index) => Ok(index as u32),
        _ => Err(at.error(format!("index {}", quoted(word)), format!("one of the {count} {what} so far"))),
    }
}
