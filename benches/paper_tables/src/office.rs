//! The office at the paper's sizes, its geometry in pieces, and its shots in their order.

use anyhow::{Context, Result};
use ringlight::column::Store;
use ringlight::mesh::{self, Mesh, MeshOptions};
use ringlight::resources::{Bytes, Resources};
use ringlight::ring::{Bounds, Piece};
use ringlight::scene::{self, ReadOptions};
use ringlight::shooting::{self, ClusterLight, Shoot, Shot, Work};
use ringlight_visibility::{Hierarchy, NO_PLANE, PreparedShooter, Triangle};
use std::path::{Path, PathBuf};

/// A scene that is shot in.
pub struct Office {
    /// Its surfaces: 4738 patches, 17251 elements.
    pub mesh: Mesh,
    /// All that blocks light.
    pub whole: Hierarchy,
    /// Its geometry in pieces.
    pub pieces: Vec<Piece>,
    /// The triangles of each piece.
    pub triangles: Vec<Vec<Triangle>>,
}

struct Folder(PathBuf);

impl Resources for Folder {
    fn read(&self, path: &str) -> std::io::Result<Bytes> {
        std::fs::read(self.0.join(path)).map(Bytes::new)
    }
}

impl Office {
    /// Reads it; a piece is a run of so many facets.
    pub fn read(facets: u32) -> Result<Office> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
        let bytes = std::fs::read(folder.join("office.glb")).context("scenes/office.glb cannot be read")?;
        let scene = scene::read("office.glb", Bytes::new(bytes), &Folder(folder), &ReadOptions::default())?;
        let options = MeshOptions { patch_size: Some(0.475), element_size: Some(0.1945), ..MeshOptions::default() };
        let mesh = mesh::build(&scene, &options, Store::Heap)?;
        let whole = mesh::hierarchy(&mesh);
        // Ids of triangles are twice their facet's number, or one more.
        let mut sorted = whole.triangles().to_vec();
        sorted.sort_unstable_by_key(|t| t.id);
        let run = |t: &Triangle| t.id / (2 * facets);
        let triangles: Vec<Vec<Triangle>> = sorted.chunk_by(|a, b| run(a) == run(b)).map(<[_]>::to_vec).collect();
        let pieces = triangles
            .iter()
            .map(|all| Piece {
                bounds: Bounds::around(all.iter().flat_map(|t| t.corners)),
                triangles: all.len() as u32,
                plane: match all.first() {
                    Some(first) if all.iter().all(|t| t.plane == first.plane) => first.plane,
                    _ => NO_PLANE,
                },
            })
            .collect();
        Ok(Office { mesh, whole, pieces, triangles })
    }

    /// The hierarchy over what a member holds.
    pub fn shard(&self, holders: &[u32], member: u32) -> Hierarchy {
        let held = self.triangles.iter().zip(holders).filter(|(_, holder)| **holder == member);
        Hierarchy::build(held.flat_map(|(triangles, _)| triangles.iter().copied()).collect(), Vec::new())
    }
}

/// Plain progressive refinement on one rank, shot by shot.
pub struct Shots<'a> {
    office: &'a Office,
    light: Vec<ClusterLight>,
    work: Work,
}

impl<'a> Shots<'a> {
    /// From the dark.
    pub fn new(office: &'a Office) -> Shots<'a> {
        let light = (0..office.mesh.clusters.len()).map(|c| ClusterLight::new(&office.mesh, c)).collect();
        Shots { office, light, work: Work::default() }
    }

    /// The patch with the most unshot power shoots through 4 × 4 cells (paper, section 2.2).
    pub fn shoot(&mut self) -> Option<Shot> {
        let mesh = &self.office.mesh;
        let powers =
            self.light.iter().zip(&mesh.clusters).flat_map(|(light, c)| light.patches.iter().zip(c.patches.clone()));
        let (power, id) =
            powers.map(|(p, id)| (p.unshot_power, id)).max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)))?;
        if power <= 0.0 {
            return None;
        }
        let (cluster, patch) = (mesh.cluster_of(id), mesh.patch(id));
        let light = &mut self.light[cluster];
        let index = (id - mesh.clusters[cluster].patches.start) as usize;
        let shot = shooting::patch_shot(mesh, &patch, light, index, 4, Shoot::Average);
        light.patches[index] = Default::default();
        let first = (patch.first_element - mesh.clusters[cluster].elements.start) as usize;
        for element in &mut light.elements[first..first + patch.element_count() as usize] {
            element.shot = element.mean();
            element.unshot = [0.0; 3];
        }
        let shooter = PreparedShooter::new(&shot.shooter);
        for (cluster, light) in self.light.iter_mut().enumerate() {
            shooting::receive(mesh, (cluster, |_| true), light, &shot, &shooter, &self.office.whole, &mut self.work);
        }
        Some(shot)
    }
}
