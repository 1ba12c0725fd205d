//! What can be written, by the ending of the file. Each kind of output is hooked up at one arm of [`write()`].

use crate::arguments::{DisplayArguments, SplitChoice, Targets, ToneChoice};
use crate::failure::Failure;
use crate::files::{self, NewFile};
use crate::values::{ExposureChoice, PictureSize};
use anyhow::Context;
use ringlight::mesh::Mesh;
use ringlight::output::report::{PictureBalance, PictureReport, Units};
use ringlight::output::{
    Drawn, Exposure, FalseColour, LitOptions, Picture, PictureLoad, PictureOptions, Split, Tone, Unit, View,
};
use ringlight::output::{
    ambient, check_glb, render, write_exr, write_glb, write_gltf, write_png, write_table, write_vtu,
};
use ringlight::resources::Bytes;
use ringlight::scene::{Camera, Place, Warnings};
use ringlight::solution::{self, Description, Solution};
use ringlight::solve::Ring;
use ringlight::transport::{Communicator, Failure as RankFailure};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Kinds of output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Lit model in one file.
    LitBinary,
    /// Lit model as JSON with a file of numbers beside it.
    LitText,
    /// Solution.
    Solution,
    /// Table of elements.
    Table,
    /// Elements for VTK.
    Grid,
    /// Picture for display.
    Png,
    /// Picture in radiance.
    Exr,
}

impl Kind {
    /// The endings that are known.
    pub const ENDINGS: &str = ".glb, .gltf, .ringlight, .csv, .vtu, .png and .exr";

    /// By the ending of a file's name.
    pub fn of(path: &Path) -> Option<Kind> {
        Some(match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "glb" => Kind::LitBinary,
            "gltf" => Kind::LitText,
            "ringlight" => Kind::Solution,
            "csv" => Kind::Table,
            "vtu" => Kind::Grid,
            "png" => Kind::Png,
            "exr" => Kind::Exr,
            _ => return None,
        })
    }

    /// Whether it is a picture, which all ranks draw together.
    pub fn is_picture(self) -> bool {
        matches!(self, Kind::Png | Kind::Exr)
    }
}

/// An output asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Output {
    /// Where.
    pub path: PathBuf,
    /// What.
    pub kind: Kind,
}

impl Output {
    /// All files that it writes.
    fn files(&self) -> Vec<PathBuf> {
        let mut files = vec![self.path.clone()];
        if self.kind == Kind::LitText {
            files.push(self.path.with_extension("bin"));
        }
        files
    }
}

/// What outputs told about themselves.
#[derive(Clone, Copy, Debug, Default)]
pub struct Written {
    /// Share of a lit model's vertices that were clipped to 1.
    pub clipped: f64,
}

/// Files that a command writes and reads, besides its outputs.
#[derive(Clone, Copy, Debug, Default)]
pub struct Others<'a> {
    /// `--report`.
    pub report: Option<&'a Path>,
    /// `--checkpoint`. It may be one of the outputs, or the solution that is resumed: all hold the same light.
    pub checkpoint: Option<&'a Path>,
    /// The scene, which must stay as it is.
    pub scene: Option<&'a Path>,
    /// The solution that is resumed.
    pub resumed: Option<&'a Path>,
}

/// Whether all of it can be written: kinds known to this program, no file twice, not the scene, nothing overwritten without
/// `--force`, folders that take files.
pub fn check(targets: &Targets, others: &Others<'_>) -> Result<(), Failure> {
    let is = |a: Option<&Path>, b: &Path| a.is_some_and(|a| identity(a) == identity(b));
    let saves = |output: &Output| output.kind == Kind::Solution && is(others.checkpoint, &output.path);
    let mut files: Vec<PathBuf> = targets.output.iter().flat_map(Output::files).collect();
    files.extend(others.report.map(Path::to_owned));
    files.extend(others.checkpoint.filter(|_| !targets.output.iter().any(saves)).map(Path::to_owned));
    let mut seen = BTreeSet::new();
    for file in &files {
        if !seen.insert(identity(file)) {
            return Err(Failure::Usage(format!("{} would be written twice", file.display())));
        }
        if is(others.scene, file) {
            return Err(Failure::Usage(format!("{} is the scene; it would be overwritten", file.display())));
        }
    }
    for file in &files {
        let goes_on = is(others.resumed, file) && is(others.checkpoint, file);
        files::check_target(file, targets.force || goes_on)?;
    }
    Ok(())
}

/// Whether files can be written beside each other: none twice, not the scene, nothing overwritten without `force`, folders
/// that take files.
pub fn check_files(files: &[&Path], scene: &Path, force: bool) -> Result<(), Failure> {
    let mut seen = BTreeSet::new();
    for file in files {
        if !seen.insert(identity(file)) {
            return Err(Failure::Usage(format!("{} would be written twice", file.display())));
        }
        if identity(file) == identity(scene) {
            return Err(Failure::Usage(format!("{} is the scene; it would be overwritten", file.display())));
        }
    }
    files.iter().try_for_each(|file| files::check_target(file, force))?;
    Ok(())
}

/// Whether none of the files is one that the scene was `read` from.
pub fn check_unread(files: &[&Path], read: &[PathBuf]) -> Result<(), Failure> {
    match files.iter().find(|file| read.contains(&identity(file))) {
        Some(file) => Err(Failure::Usage(format!("{} belongs to the scene; it would be overwritten", file.display()))),
        None => Ok(()),
    }
}

/// Whether no output overwrites a file that the scene was `read` from.
pub fn check_inputs(targets: &Targets, others: &Others<'_>, read: &[PathBuf]) -> Result<(), Failure> {
    let outputs = targets.output.iter().flat_map(Output::files);
    let others = others.report.into_iter().chain(others.checkpoint).map(Path::to_owned);
    match outputs.chain(others).find(|file| read.contains(&identity(file))) {
        Some(file) => Err(Failure::Usage(format!("{} belongs to the scene; it would be overwritten", file.display()))),
        None => Ok(()),
    }
}

/// What makes two paths the same file, as far as can be told before it exists.
pub fn identity(path: &Path) -> PathBuf {
    let folder = files::folder_of(path);
    folder.canonicalize().unwrap_or_else(|_| folder.to_owned()).join(path.file_name().unwrap_or_default())
}

/// Whether the lit models can be as large as the mesh makes them, as far as that can be foretold.
pub fn check_sizes(targets: &Targets, mesh: &Mesh) -> Result<(), Failure> {
    match targets.output.iter().find(|output| output.kind == Kind::LitBinary) {
        Some(output) => Ok(check_glb(mesh).with_context(|| output.path.display().to_string())?),
        None => Ok(()),
    }
}

/// Whether the camera that pictures ask for is there. Cameras without a name are called `camera 0`, `camera 1`, …
pub fn check_camera(display: &DisplayArguments, cameras: &[Camera]) -> Result<(), Failure> {
    let name_of = |(number, camera): (usize, &Camera)| match camera.name.as_str() {
        "" => format!("camera {number}"),
        name => name.to_owned(),
    };
    let names: Vec<String> = cameras.iter().enumerate().map(name_of).collect();
    match &display.camera {
        Some(name) if !name.contains(';') && !names.contains(name) => {
            let known = if names.is_empty() { "it has none".into() } else { format!("it has {}", names.join(", ")) };
            Err(Failure::Usage(format!("the scene has no camera '{name}'; {known}")))
        }
        _ => Ok(()),
    }
}

/// A warning if outputs show images that are not at hand.
pub fn missing_images(description: &Description, images: &[Option<Bytes>], targets: &Targets) -> Warnings {
    let mut warnings = Warnings::default();
    let shows = targets.output.iter().any(|o| matches!(o.kind, Kind::LitBinary | Kind::LitText) || o.kind.is_picture());
    let mut missing = description.images.iter().zip(images).filter(|(_, bytes)| bytes.is_none());
    if let Some((image, _)) = missing.next().filter(|_| shows) {
        let message = format!("the image '{}' is not beside the solution; --scene FILE says where it is", image.name);
        warnings.add_many("missing-image", message, Place::default(), 1 + missing.count() as u64);
    }
    warnings
}

/// What outputs show, and how.
pub struct Content<'a> {
    /// The light.
    pub solution: &'a Solution,
    /// How.
    pub display: &'a DisplayArguments,
}

impl<'a> Content<'a> {
    fn lit_options(&self) -> LitOptions {
        let exposure = match self.display.exposure {
            ExposureChoice::Auto => Exposure::automatic(self.solution),
            ExposureChoice::Value(value) => Exposure::from_ev(value),
        };
        LitOptions { exposure, ambient: self.display.ambient }
    }

    /// The picture, on the first rank. Every rank calls it; either all or none of them find that there is no such camera.
    pub fn picture(
        &self,
        ring: &mut Ring<'a>,
        ranks: &mut Communicator<'_>,
    ) -> Result<anyhow::Result<Option<Drawn>>, RankFailure> {
        let (solution, display) = (self.solution, self.display);
        let PictureSize { width, height } = display.size;
        let view = match View::choose(display.camera.as_deref(), solution) {
            Ok(Some(view)) => view,
            Ok(None) => View::automatic(solution, f64::from(width) / f64::from(height), ring, ranks)?,
            Err(error) => return Ok(Err(error.into())),
        };
        let radiometric = Units::of(&solution.description) == Units::RADIOMETRIC;
        let unit = if radiometric { Unit::WattsPerSquareMetre } else { Unit::Lux };
        let options = PictureOptions {
            exposure: match display.exposure {
                ExposureChoice::Auto => None,
                ExposureChoice::Value(value) => Some(Exposure::from_ev(value)),
            },
            tone: match display.tone {
                ToneChoice::Filmic => Tone::Filmic,
                ToneChoice::None => Tone::None,
            },
            false_colour: display.false_colour.map(|_| FalseColour { unit, ..FalseColour::default() }),
            ambient: if display.ambient { ambient(solution) } else { [0.0; 3] },
            split: match display.split {
                SplitChoice::Tiles => Split::Tiles,
                SplitChoice::Scanlines => Split::Scanlines,
            },
            ..PictureOptions::new(view, width, height)
        };
        Ok(Ok(render(solution, &options, ring, ranks)?))
    }
}

/// Writes one output; `picture` is there if it is one.
pub fn write(output: &Output, content: &Content<'_>, picture: Option<&Picture>) -> anyhow::Result<Written> {
    let (path, solution) = (output.path.as_path(), content.solution);
    let mut written = Written::default();
    match output.kind {
        Kind::Solution => files::write(path, |out| solution::write(solution, out))?,
        Kind::LitBinary => {
            let options = content.lit_options();
            written.clipped = files::write(path, |out| write_glb(solution, &options, out))?.clipped;
        }
        Kind::LitText => {
            let (options, data) = (content.lit_options(), path.with_extension("bin"));
            let name = data.file_name().unwrap_or_default().to_string_lossy();
            let model = |json: &mut NewFile, bin: &mut NewFile| write_gltf(solution, &options, &name, json, bin);
            written.clipped = files::write_pair([path, &data], model)?.clipped;
        }
        Kind::Table => files::write(path, |out| write_table(solution, out))?,
        Kind::Grid => files::write(path, |out| write_vtu(solution, out))?,
        Kind::Png => files::write(path, |out| picture.map_or(Ok(()), |picture| write_png(picture, out)))?,
        Kind::Exr => files::write(path, |out| picture.map_or(Ok(()), |picture| write_exr(picture, out)))?,
    }
    Ok(written)
}

/// What ranks did for a picture, in words, a line each.
pub fn loads(report: &PictureReport) -> Vec<String> {
    let PictureReport { width, height, split, max_over_mean, ranks } = report;
    let PictureBalance { pixels, rays, searched, light_bytes } = max_over_mean;
    let line = |(rank, load): (usize, &PictureLoad)| {
        let PictureLoad { pixels, rays, searched, elements_asked, light_bytes, .. } = load;
        format!(
            "  rank {rank}: {pixels} pixels, {rays} rays, {searched} nodes and triangles looked at, light of \
             {elements_asked} elements asked for, {light_bytes} bytes of light kept"
        )
    };
    let all = format!(
        "picture: {width} x {height} pixels on {} ranks by {split}; max/mean: pixels {pixels:.3}, rays {rays:.3}, \
         looked at {searched:.3}, light {light_bytes:.3}",
        ranks.len()
    );
    std::iter::once(all).chain(ranks.iter().enumerate().map(line)).collect()
}
