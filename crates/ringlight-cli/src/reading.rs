//! What verbs that read a solution do first: the first rank of each machine unpacks it, and the others map it.

use crate::arguments::SpreadArguments;
use crate::failure::Failure;
use crate::host::Host;
use crate::launch::COMMAND;
use crate::{input, spread};
use anyhow::Context;
use ringlight::column::Bytes;
use ringlight::mesh::Mesh;
use ringlight::plan::{Counts, MeshPlace};
use ringlight::ring::Rings;
use ringlight::solution::{FileError, Solution, SolutionFile, SolvedLight};
use ringlight::solve::Ring;
use ringlight::transport::Communicator;
use std::io::{self, Write};
use std::ops::Range;
use std::path::Path;

/// Reads a solution and attaches the images that it shows. Every rank calls it.
pub fn solution(
    ranks: &mut Communicator<'_>,
    host: &Host,
    path: &Path,
    scene: Option<&Path>,
) -> Result<Solution, Failure> {
    let located = || path.display().to_string();
    let bytes = input::bytes(path)?;
    let file = SolutionFile::open(&bytes).with_context(located)?;
    let unpack = || {
        let mesh = file.mesh(host.store())?;
        let light = file.light(&mesh, host.store())?;
        Ok::<_, FileError>((mesh, light))
    };
    let unpacked = host.leads().then(unpack).transpose().with_context(located)?;
    let (mesh, light) = match unpacked {
        Some(unpacked) if ranks.size() == 1 => unpacked,
        unpacked => {
            let write = unpacked.as_ref().map(|(mesh, _)| |out: &mut dyn Write| mesh.share(out));
            let mesh = Mesh::shared(&host.share(ranks, write)?).context("what ranks share")?;
            let write = unpacked.as_ref().map(|(_, light)| |out: &mut dyn Write| light.share(out));
            let light = SolvedLight::shared(&mesh, &host.share(ranks, write)?).context("what ranks share")?;
            (mesh, light)
        }
    };
    let (description, settings) = (file.description().clone(), file.settings());
    let images = input::images(path, scene, &description, host.store())?;
    Ok(Solution { description, mesh, settings, ledger: file.ledger(), light, energy: file.energy(), images })
}

/// Gives all ranks what the first one has of a solution, and the images that the first of each machine has; all have the
/// mesh and the rest. Every rank calls it.
pub fn everywhere(ranks: &mut Communicator<'_>, host: &Host, solution: Solution) -> Result<Solution, Failure> {
    if ranks.size() == 1 {
        return Ok(solution);
    }
    let Solution { description, mesh, mut light, images, .. } = solution;
    let description = if ranks.rank() == 0 { serde_json::to_vec(&description) } else { Ok(Vec::new()) };
    let description = ranks.broadcast(0, COMMAND, description.context("description")?)?;
    let description = serde_json::from_slice(&description).context("description")?;
    host.hand_on(ranks, &mut light.elements)?;
    host.hand_on(ranks, &mut light.emission_waits)?;
    let write = host.leads().then_some(|out: &mut dyn Write| light.share(out));
    let light = SolvedLight::shared(&mesh, &host.share(ranks, write)?).context("what ranks share")?;
    let write = host.leads().then_some(|out: &mut dyn Write| write_images(&images, out));
    let images = read_images(&host.share(ranks, write)?).context("what ranks share")?;
    Ok(Solution { description, mesh, light, images, ..solution })
}

/// Before the bytes of an image comes their number; this where there are none.
const NO_IMAGE: u64 = u64::MAX;

fn write_images(images: &[Option<Bytes>], out: &mut dyn Write) -> io::Result<()> {
    for image in images {
        out.write_all(&image.as_ref().map_or(NO_IMAGE, |bytes| bytes.len() as u64).to_ne_bytes())?;
        out.write_all(image.as_deref().unwrap_or_default())?;
    }
    Ok(())
}

fn read_images(bytes: &Bytes) -> Option<Vec<Option<Bytes>>> {
    let (mut images, mut start) = (Vec::new(), 0);
    while start < bytes.len() {
        let length = u64::from_ne_bytes(*bytes.get(start..)?.first_chunk()?);
        start += size_of::<u64>();
        images.push(if length == NO_IMAGE {
            None
        } else {
            let range = start..start.checked_add(length as usize)?;
            start = range.end;
            bytes.get(range.clone())?;
            Some(Bytes::new(Part(bytes.clone(), range)))
        });
    }
    Some(images)
}

/// Some of the bytes of a file.
struct Part(Bytes, Range<usize>);

impl AsRef<[u8]> for Part {
    fn as_ref(&self) -> &[u8] {
        &self.0[self.1.clone()]
    }
}

/// This rank's place among those that hold the geometry together. Every rank calls it.
pub fn ring<'m>(
    ranks: &mut Communicator<'_>,
    arguments: &SpreadArguments,
    mesh: &'m Mesh,
) -> Result<Ring<'m>, Failure> {
    let bounded = ranks.size() > 1 || arguments.is_bounded();
    let rings = match bounded {
        true => {
            let available = spread::available(arguments, ranks)?;
            let demand = Counts::of(mesh).demand(MeshPlace::Files, 1);
            spread::choose(arguments, demand, &available).map_err(anyhow::Error::msg)?.rings
        }
        false => Rings::one(1),
    };
    Ok(Ring::new(mesh, &spread::spread(arguments, rings), ranks.rank()))
}
