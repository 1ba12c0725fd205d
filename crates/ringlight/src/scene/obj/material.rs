//! MTL files: definitions of materials.

use super::lines::{At, Lines, quoted, statement, text, words};
use crate::scene::{Place, SceneError, Warnings};
use std::collections::HashMap;
use std::collections::hash_map::Entry;

/// A material as its file says it.
#[derive(Clone, Debug, Default)]
pub(super) struct Definition {
    pub(super) place: Place,
    /// `Kd`.
    pub(super) reflectance: Option<[f32; 3]>,
    /// `Ke`.
    pub(super) emission: Option<[f32; 3]>,
    /// `d`, which prevails over `1 − Tr`.
    pub(super) dissolve: Option<f32>,
    /// `Tr`.
    pub(super) transparency: Option<f32>,
    /// `map_Kd`.
    pub(super) reflectance_map: Option<Map>,
    /// `map_Ke`.
    pub(super) emission_map: Option<Map>,
    /// `map_d`.
    pub(super) dissolve_map: Option<Map>,
    /// Whether `illum` asks for glass.
    pub(super) glass: bool,
    /// Whether `Ks` is not black.
    pub(super) specular: bool,
}

/// A texture map with the options that matter.
#[derive(Clone, Debug)]
pub(super) struct Map {
    pub(super) place: Place,
    pub(super) name: String,
    pub(super) clamp: bool,
    pub(super) mapping: Mapping,
}

/// How texture coordinates of the file become those of the texture: scale (`-s`), then offset (`-o`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Mapping {
    scale: [f64; 2],
    offset: [f64; 2],
}

impl Default for Mapping {
    fn default() -> Mapping {
        Mapping { scale: [1.0; 2], offset: [0.0; 2] }
    }
}

impl Mapping {
    /// Coordinates with v downwards from OBJ's, where v runs upwards.
    pub(super) fn apply(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        let u = f64::from(u) * self.scale[0] + self.offset[0];
        let v = f64::from(v) * self.scale[1] + self.offset[1];
        [u as f32, (1.0 - v) as f32]
    }
}

/// Adds the materials defined in an MTL file to `definitions`; those already there stay.
pub(super) fn read(
    file: &str,
    bytes: &[u8],
    definitions: &mut HashMap<String, Definition>,
    warnings: &mut Warnings,
) -> Result<(), SceneError> {
    let mut current: Option<(String, Definition)> = None;
    let mut keep = |material: Option<(String, Definition)>, warnings: &mut Warnings| {
        let Some((name, definition)) = material else { return };
        match definitions.entry(name) {
            Entry::Occupied(entry) => {
                let message = format!("material {:?} is defined more than once; the first counts", entry.key());
                warnings.add("duplicate-material", message, definition.place);
            }
            Entry::Vacant(entry) => drop(entry.insert(definition)),
        }
    };
    for (line, content) in Lines::new(bytes) {
        let Some((keyword, rest)) = statement(&content) else { continue };
        let at = At { file, line };
        if keyword.eq_ignore_ascii_case(b"newmtl") {
            keep(current.take(), warnings);
            current = Some((text(rest), Definition { place: at.place(), ..Definition::default() }));
        } else if let Some((_, definition)) = &mut current {
            property(definition, at, keyword, rest, warnings)?;
        }
    }
    keep(current, warnings);
    Ok(())
}

fn property(
    definition: &mut Definition,
    at: At<'_>,
    keyword: &[u8],
    rest: &[u8],
    warnings: &mut Warnings,
) -> Result<(), SceneError> {
    match keyword.to_ascii_lowercase().as_slice() {
        b"kd" => definition.reflectance = colour(at, rest, warnings)?.or(definition.reflectance),
        b"ke" => definition.emission = colour(at, rest, warnings)?.or(definition.emission),
        b"ks" => definition.specular = words(rest).any(|word| at.number(word).is_ok_and(|number| number > 0.0)),
        b"d" => definition.dissolve = Some(share(at, rest)?),
        b"tr" => definition.transparency = Some(share(at, rest)?),
        b"map_kd" => definition.reflectance_map = map(at, rest, warnings)?,
        b"map_ke" => definition.emission_map = map(at, rest, warnings)?,
        b"map_d" => definition.dissolve_map = map(at, rest, warnings)?,
        b"illum" => definition.glass = matches!(rest, b"4" | b"6" | b"7" | b"9"),
        _ => {}
    }
    Ok(())
}

/// A colour: `r [g b]` or `xyz x [y z]`; nothing, with a warning, if it is a spectral curve.
fn colour(at: At<'_>, rest: &[u8], warnings: &mut Warnings) -> Result<Option<[f32; 3]>, SceneError> {
    let mut words = words(rest).peekable();
    let kind = words.next_if(|word| word.eq_ignore_ascii_case(b"xyz") || word.eq_ignore_ascii_case(b"spectral"));
    if kind.is_some_and(|word| word.eq_ignore_ascii_case(b"spectral")) {
        warnings.add("spectral-colour", "spectral curves are not read; the colour keeps its default", at.place());
        return Ok(None);
    }
    let numbers: Vec<f64> = words.take(3).map(|word| at.number(word)).collect::<Result<_, _>>()?;
    let [x, y, z] = match *numbers {
        [grey] => [grey; 3],
        _ => at.first(&numbers, "a colour")?,
    };
    let rgb = if kind.is_some() {
        let channel = |a: [f64; 3]| (a[0] * x + a[1] * y + a[2] * z).max(0.0);
        [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]].map(channel)
    } else {
        [x, y, z]
    };
    if rgb.iter().any(|channel| *channel < 0.0) {
        return Err(at.error(quoted(rest), "a colour without negative channels"));
    }
    Ok(Some(rgb.map(|channel| channel as f32)))
}

/// A number from 0 to 1, after an optional `-halo`.
fn share(at: At<'_>, rest: &[u8]) -> Result<f32, SceneError> {
    let word = words(rest).find(|word| *word != b"-halo").unwrap_or(b"");
    Ok(at.number(word)?.clamp(0.0, 1.0) as f32)
}

/// A texture map: options, then a file name, which may have spaces in it. Nothing, with a warning, if the name is missing.
fn map(at: At<'_>, rest: &[u8], warnings: &mut Warnings) -> Result<Option<Map>, SceneError> {
    let mut rest = rest;
    let mut map = Map { place: at.place(), name: String::new(), clamp: false, mapping: Mapping::default() };
    while rest.starts_with(b"-") {
        let Some((option, after)) = statement(rest) else { break };
        rest = after;
        match option {
            b"-o" => map.mapping.offset = pair(at, &mut rest, map.mapping.offset)?,
            b"-s" => map.mapping.scale = pair(at, &mut rest, map.mapping.scale)?,
            b"-t" => drop(pair(at, &mut rest, [0.0; 2])?),
            b"-clamp" => map.clamp = take(&mut rest) == b"on",
            b"-mm" => {
                let (base, gain) = (at.number(take(&mut rest))?, at.number(take(&mut rest))?);
                if (base, gain) != (0.0, 1.0) {
                    warnings.add("texture-option", "the texture option -mm is ignored", at.place());
                }
            }
            b"-blendu" | b"-blendv" | b"-bm" | b"-boost" | b"-cc" | b"-imfchan" | b"-texres" | b"-type" => {
                take(&mut rest);
            }
            _ => {
                let message = format!("the texture option {} is not known", quoted(option));
                warnings.add("texture-option", message, at.place());
            }
        }
    }
    map.name = text(rest).trim_matches('"').to_owned();
    if map.name.is_empty() {
        warnings.add("missing-texture", "a texture map without a file name is ignored", at.place());
        return Ok(None);
    }
    Ok(Some(map))
}

/// Takes the next word.
fn take<'a>(rest: &mut &'a [u8]) -> &'a [u8] {
    let (word, after) = statement(rest).unwrap_or_default();
    *rest = after;
    word
}

/// Takes one to three numbers, of which the first two count; those that are missing stay as they are.
fn pair(at: At<'_>, rest: &mut &[u8], mut value: [f64; 2]) -> Result<[f64; 2], SceneError> {
    value[0] = at.number(take(rest))?;
    for i in 1..3 {
        let Some((word, after)) = statement(rest) else { break };
        let Ok(number) = at.number(word) else { break };
        if after.is_empty() {
            break;
        }
        *rest = after;
        if let Some(slot) = value.get_mut(i) {
            *slot = number;
        }
    }
    Ok(value)
}
