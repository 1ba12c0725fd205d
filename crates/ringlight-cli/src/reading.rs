//! What verbs that read a solution do first: the first rank of each machine unpacks it, and the others map it.

use crate::arguments::SpreadArguments;
use crate::failure::Failure;
use crate::host::Host;
use crate::{input, spread};
use anyhow::Context;
use ringlight::mesh::Mesh;
use ringlight::plan::Counts;
use ringlight::ring::Rings;
use ringlight::solution::{FileError, Solution, SolutionFile, SolvedLight};
use ringlight::solve::Ring;
use ringlight::transport::Communicator;
use std::io::Write;
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
    let images = input::images(path, scene, &description)?;
    Ok(Solution { description, mesh, settings, ledger: file.ledger(), light, energy: file.energy(), images })
}

/// This rank's place among those that hold the geometry together. Every rank calls it.
pub fn ring<'m>(
    ranks: &mut Communicator<'_>,
    arguments: &SpreadArguments,
    mesh: &'m Mesh,
) -> Result<Ring<'m>, Failure> {
    let bounded = ranks.size() > 1 || arguments.memory_per_rank.is_some();
    let rings = match bounded {
        true => spread::choose(arguments, Counts::of(mesh).demand(), ranks)?.0,
        false => Rings::one(1),
    };
    Ok(Ring::new(mesh, &spread::spread(arguments, rings), ranks.rank()))
}
