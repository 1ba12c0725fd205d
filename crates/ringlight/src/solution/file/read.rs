//! Reading: the mesh, and of the light what is asked for.

use super::sections::{Section, Sections};
use super::{FileError, HEADER, Header, LIGHT, SECTION, StoredCluster, damaged};
use crate::column::Store;
use crate::mesh::{Cluster, Colour, Mesh, Occluder};
use crate::shooting::{ClusterLight, PatchLight};
use crate::solution::light::{length, runs, split, within};
use crate::solution::{Description, Solution, SolvedLight};
use crate::solve::{Energy, Ledger, SolveSettings};
use rayon::prelude::*;
use ringlight_visibility::Bitmap;
use std::ops::Range;
use std::sync::Arc;

/// A solution file, from which the parts are read that are needed.
pub struct SolutionFile<'a> {
    sections: Sections<'a>,
    header: Header<'static>,
}

/// The light in a solution file, for who knows the rest: the header grows with the scene's nodes.
pub struct LightFile<'a>(Sections<'a>);

/// Reads a solution; what grows with the scene is kept in `store`. Images are not attached, see [`Description::find_images`].
pub fn read(bytes: &[u8], store: Store<'_>) -> Result<Solution, FileError> {
    let file = SolutionFile::open(bytes)?;
    let mesh = file.mesh(store)?;
    let light = file.light(&mesh, store)?;
    let Header { description, settings, energy, ledger, .. } = file.header;
    let images = vec![None; description.images.len()];
    Ok(Solution { description: description.into_owned(), mesh, settings, ledger, light, energy, images })
}

impl<'a> SolutionFile<'a> {
    /// Reads the directory and what is not light or mesh.
    pub fn open(bytes: &'a [u8]) -> Result<SolutionFile<'a>, FileError> {
        let sections = Sections::find(bytes)?;
        let header: Header<'static> = serde_json::from_slice(&sections.array::<u8>(HEADER, Store::Heap)?)
            .map_err(|e| damaged(HEADER, &e.to_string()))?;
        let Description { nodes, materials, surfaces, .. } = &*header.description;
        if surfaces.iter().any(|s| s.material as usize >= materials.len() || s.node as usize >= nodes.len()) {
            return Err(damaged(HEADER, "a surface refers to what is not there"));
        }
        Ok(SolutionFile { sections, header })
    }

    /// The scene without geometry.
    pub fn description(&self) -> &Description {
        &self.header.description
    }

    /// Settings that decide the result.
    pub fn settings(&self) -> SolveSettings {
        self.header.settings
    }

    /// How far the solver had come.
    pub fn ledger(&self) -> Ledger {
        self.header.ledger
    }

    /// The audit at the time of writing.
    pub fn energy(&self) -> Energy {
        self.header.energy
    }

    /// Reads the mesh; what grows with the scene is kept in `store`.
    pub fn mesh(&self, store: Store<'_>) -> Result<Mesh, FileError> {
        let (sections, header) = (&self.sections, &self.header);
        let surface_colours: Vec<Colour> = sections.array("surface-colours", Store::Heap)?.to_vec();
        let surfaces = header.description.surfaces.len();
        if [surface_colours.len(), header.coverage.len(), header.cutout.len()] != [surfaces; 3] {
            return Err(damaged("surface-colours", "they are not as many as surfaces"));
        }
        let bitmaps = self.bitmaps()?;
        if header.cutout.iter().flatten().any(|&b| b as usize >= bitmaps.len()) {
            return Err(damaged("bitmaps", "one is missing"));
        }
        let occluder = Occluder {
            coverage: header.coverage.to_vec(),
            cutout: header.cutout.to_vec(),
            bitmaps,
            facet_coverage: sections.array("facet-coverage", store)?,
        };
        let mesh = Mesh {
            origin: header.origin,
            diagonal: header.diagonal,
            sizes: header.sizes,
            facets: sections.array("facets", store)?,
            patch_facets: sections.array("patch-facets", store)?,
            first_elements: sections.array("first-elements", store)?,
            clusters: sections.array::<StoredCluster>("clusters", Store::Heap)?.iter().map(Cluster::from).collect(),
            base_uv: sections.array("base-uv", store)?,
            emission_uv: sections.array("emission-uv", store)?,
            vertex_colours: sections.array("vertex-colours", store)?,
            colours: sections.array("colours", store)?,
            surface_colours,
            valid: sections.array("valid", store)?,
            occluder,
            warnings: header.warnings.clone().into_owned(),
            skipped: header.skipped.to_vec(),
        };
        mesh.check().map_err(|what| damaged("facets", &what))?;
        Ok(mesh)
    }

    fn bitmaps(&self) -> Result<Vec<Arc<Bitmap>>, FileError> {
        let bits = self.sections.array::<u64>("bitmaps", Store::Heap)?;
        let mut rest = &bits[..];
        let mut bitmaps = Vec::new();
        for &[width, height] in &self.header.bitmaps {
            let words = (u64::from(width) * u64::from(height)).div_ceil(64) as usize;
            let Some((bits, after)) = rest.split_at_checked(words).filter(|_| words > 0) else {
                return Err(damaged("bitmaps", "it is too short"));
            };
            rest = after;
            bitmaps.push(Arc::new(Bitmap { width, height, bits: bits.to_vec() }));
        }
        Ok(bitmaps)
    }

    /// Reads all the light.
    pub fn light(&self, mesh: &Mesh, store: Store<'_>) -> Result<SolvedLight, FileError> {
        let mut light = SolvedLight::dark(mesh, store)?;
        // A few at a time, so that not all of it is held twice.
        for runs in light_runs(&self.sections, mesh)?.chunks(rayon::current_num_threads()) {
            let unpacked: Vec<Vec<u8>> =
                runs.par_iter().map(|run| run.unpack(mesh)).collect::<Result<_, FileError>>()?;
            for (run, bytes) in runs.iter().zip(unpacked) {
                light.take(&mesh.clusters[run.clusters.clone()], &bytes);
            }
        }
        Ok(light)
    }
}

impl<'a> LightFile<'a> {
    /// Reads the directory.
    pub fn open(bytes: &'a [u8]) -> Result<LightFile<'a>, FileError> {
        Sections::find(bytes).map(LightFile)
    }

    /// Reads the light of some clusters, in ascending order.
    pub fn light_of(&self, mesh: &Mesh, own: &[u32]) -> Result<Vec<ClusterLight>, FileError> {
        let of_run = |run: &Run<'_>| {
            let own = &own[within(own, &run.clusters)];
            let mut lights = Vec::with_capacity(own.len());
            if own.is_empty() {
                return Ok(lights);
            }
            let bytes = run.unpack(mesh)?;
            let mut rest = bytes.as_slice();
            let mut wanted = own.iter().peekable();
            for cluster in run.clusters.clone() {
                let (elements, flags);
                (elements, flags, rest) = split(&mesh.clusters[cluster], rest);
                if wanted.next_if(|&&own| own as usize == cluster).is_some() {
                    let mut light = ClusterLight {
                        elements: bytemuck::pod_collect_to_vec(elements),
                        patches: flags
                            .iter()
                            .map(|&flag| PatchLight { unshot_power: 0.0, emission_waits: flag != 0 })
                            .collect(),
                    };
                    light.renew(mesh, cluster);
                    lights.push(light);
                }
            }
            Ok(lights)
        };
        let parts: Vec<Vec<ClusterLight>> =
            light_runs(&self.0, mesh)?.par_iter().map(of_run).collect::<Result<_, FileError>>()?;
        Ok(parts.into_iter().flatten().collect())
    }
}

fn light_runs<'a>(sections: &Sections<'a>, mesh: &Mesh) -> Result<Vec<Run<'a>>, FileError> {
    let (runs, sections) = (runs(&mesh.clusters, SECTION), sections.of(LIGHT).collect::<Vec<_>>());
    if runs.len() != sections.len() {
        let what = format!("there are {} sections, expected {}", sections.len(), runs.len());
        return Err(damaged(LIGHT, &what));
    }
    let run = |(clusters, (name, section))| Run { clusters, name, section };
    Ok(runs.into_iter().zip(sections).map(run).collect())
}

/// The clusters whose light is in one section.
struct Run<'a> {
    clusters: Range<usize>,
    name: String,
    section: Section<'a>,
}

impl Run<'_> {
    /// The bytes of the clusters.
    fn unpack(&self, mesh: &Mesh) -> Result<Vec<u8>, FileError> {
        let clusters = &mesh.clusters[self.clusters.clone()];
        let expected: usize = clusters.iter().map(length).sum();
        if self.section.raw != expected as u64 {
            return Err(damaged(&self.name, "its length is wrong"));
        }
        let mut bytes = vec![0; expected];
        self.section.unpack(&self.name, &mut bytes)?;
        let mut rest = bytes.as_slice();
        for cluster in clusters {
            let flags;
            (_, flags, rest) = split(cluster, rest);
            if flags.iter().any(|&flag| flag > 1) {
                return Err(damaged(&self.name, "a flag is neither 0 nor 1"));
            }
        }
        Ok(bytes)
    }
}
