//! The lit model: glTF 2.0 with the light in its vertex colours.
//!
//! Each node keeps its name, place, camera and extras and gets a mesh of its own, cut into elements. Materials are unlit
//! and keep factor and texture, so that a viewer shows texture × factor × light × exposure / π, which is what
//! `render --tone none` shows. Vertex colours end at 1, which the report counts.

mod look;
mod model;
mod nodes;
mod piece;
#[cfg(test)]
mod tests;
mod texture;

use super::{Exposure, ambient};
use crate::mesh::Mesh;
use crate::smooth::Smooth;
use crate::solution::{self, Solution};
use model::{Model, pad};
use piece::Lit;
use serde_json::{Value, json};
use std::io::{self, Write};

/// How a lit model is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LitOptions {
    /// Display value of radiance.
    pub exposure: Exposure,
    /// Whether light still unshot is shown as an even ambient term.
    pub ambient: bool,
}

/// What was written.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LitReport {
    /// Share of the lit area of surfaces that do not emit whose light was clipped to display value 1.
    pub clipped: f64,
    /// Images that are not at hand; their surfaces have their mean colour.
    pub missing_images: u64,
    /// Vertices written.
    pub vertices: u64,
    /// Triangles written.
    pub triangles: u64,
}

/// Bytes of the headers of a binary glTF: of the file, and of two chunks.
const HEADERS: u64 = 12 + 2 * 8;

/// Whether the lit model of a mesh can be a binary glTF, as far as that can be foretold: some need more than this finds.
pub fn check_glb(mesh: &Mesh) -> io::Result<()> {
    let least = HEADERS + model::least_length(mesh);
    if least > u64::from(u32::MAX) { Err(too_large(&format!("at least {least}"))) } else { Ok(()) }
}

fn too_large(bytes: &str) -> io::Error {
    let message = format!("the lit model takes {bytes} bytes and a .glb ends at 4 GiB: write a .gltf instead");
    io::Error::new(io::ErrorKind::FileTooLarge, message)
}

/// Writes a binary glTF. It ends at 4 GiB; an error says so.
pub fn write_glb(solution: &Solution, options: &LitOptions, out: &mut dyn Write) -> io::Result<LitReport> {
    let lit = light(solution, options);
    let model = Model::new(&lit)?;
    let document = serde_json::to_vec(&model.document(None, extras(solution, options)))?;
    let (text, data) = ((document.len() as u64).next_multiple_of(4), model.length());
    let total = HEADERS + text + data;
    let total = u32::try_from(total).map_err(|_| too_large(&total.to_string()))?;
    out.write_all(b"glTF")?;
    for word in [2, total, text as u32] {
        out.write_all(&word.to_le_bytes())?;
    }
    out.write_all(b"JSON")?;
    out.write_all(&document)?;
    pad(out, document.len() as u64, b' ')?;
    out.write_all(&(data as u32).to_le_bytes())?;
    out.write_all(b"BIN\0")?;
    finish(&model, out)
}

/// Writes a glTF document to `json` and its data to `bin`, whose file is called `bin_name` and lies beside it.
pub fn write_gltf(
    solution: &Solution,
    options: &LitOptions,
    bin_name: &str,
    json: &mut dyn Write,
    bin: &mut dyn Write,
) -> io::Result<LitReport> {
    let lit = light(solution, options);
    let model = Model::new(&lit)?;
    serde_json::to_writer(&mut *json, &model.document(Some(&escape(bin_name)), extras(solution, options)))?;
    json.write_all(b"\n")?;
    finish(&model, bin)
}

fn light<'a>(solution: &'a Solution, options: &LitOptions) -> Lit<'a> {
    Lit {
        solution,
        smooth: Smooth::new(solution),
        scale: options.exposure.scale / std::f32::consts::PI,
        ambient: if options.ambient { ambient(solution) } else { [0.0; 3] },
    }
}

fn finish(model: &Model<'_>, out: &mut dyn Write) -> io::Result<LitReport> {
    let clipping = model.write(out)?;
    let (vertices, triangles) = model.size();
    Ok(LitReport { clipped: clipping.share(), missing_images: model.missing_images(), vertices, triangles })
}

fn extras(solution: &Solution, options: &LitOptions) -> Value {
    // OBJ has no photometric units.
    let obj = |file: &str| file.to_ascii_lowercase().ends_with(".obj");
    let radiometric = solution.description.surfaces.iter().any(|s| obj(&s.place.file));
    json!({
        "exposure": f64::from(options.exposure.scale),
        "ambient": options.ambient,
        "units": if radiometric { "W/m²" } else { "lux" },
        "solutionDigest": solution::digest(solution),
        "meaning": "displayed = texture × factor × COLOR_0; where an element reflects, factor × COLOR_0 is \
                    reflectance × irradiance / π × exposure, clipped to 1",
    })
}

/// A file's name as a URI reference.
fn escape(name: &str) -> String {
    name.bytes()
        .map(|b| match b {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' => char::from(b).to_string(),
            _ => format!("%{b:02X}"),
        })
        .collect()
}
