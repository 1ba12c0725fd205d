//! Solutions as files: sections, ranks, damage.

use super::*;
use crate::column::Store;
use crate::column::tests::HeapScratch;
use crate::mesh::{self, MeshOptions};
use crate::output::fixture;
use crate::ring::owners;
use crate::shooting::{ClusterLight, PatchLight};
use crate::transport::{Communicator, Failure, threads};
use std::io::{self, Write};

/// A floor of squares with `side` elements along its edges, in patches of 4 × 4, and light of which no two elements have the same.
fn floor(side: u32) -> Solution {
    refined_floor(side, |_| 1)
}

/// The same with patches that are refined.
fn refined_floor(side: u32, subdivision: impl Fn(u32) -> u8) -> Solution {
    let obj = "v 0 0 0\nv 0 0 -1\nv -1 0 -1\nv -1 0 0\nv -1 1 0\nusemtl grey\nf 1 2 3 4\nusemtl glow\nf 1 4 5\n";
    let scene = fixture::read(obj);
    let element = 1.0 / f64::from(side);
    let options =
        MeshOptions { patch_size: Some(4.0 * element), element_size: Some(element), ..MeshOptions::default() };
    let mesh = mesh::build(&scene, &options, Store::Heap).unwrap();
    let subdivisions: Vec<u8> = (0..mesh.patch_count() as u32).map(subdivision).collect();
    let mesh = mesh.refined(&scene, &subdivisions, Store::Heap).unwrap();
    let value = |i: usize| (i as f32).sin().abs();
    let elements = (0..mesh.element_count())
        .map(|e| ElementLight { shot: [value(e), 0.0, 1.0], unshot: [value(e + 1); 3], correction: [0.0; 3] })
        .collect::<Vec<_>>()
        .into();
    let emission_waits = (0..mesh.patch_count()).map(|p| u8::from(p % 3 == 0)).collect::<Vec<_>>().into();
    Solution {
        description: Description::new(&scene),
        mesh,
        settings: SolveSettings {
            solver: crate::solve::Solver::Plain,
            cells: 16,
            shoot: crate::shooting::Shoot::Elements,
            sky: None,
            shooters_in_flight: 1,
        },
        ledger: Ledger {
            shots: 12,
            emitters_shot: 0,
            rounds: 1,
            emitted: 0.1 + 0.2,
            escaped: 1e-300,
            absorbed_by_backs: 3.0,
        },
        light: SolvedLight { elements, emission_waits },
        energy: Energy { emitted: 7.0, ..Energy::default() },
        images: Vec::new(),
    }
}

fn bytes(solution: &Solution) -> Vec<u8> {
    let mut bytes = Vec::new();
    write(solution, &mut bytes).unwrap();
    bytes
}

/// The clusters that a rank owns.
fn own(mesh: &Mesh, rank: usize, ranks: usize) -> Vec<u32> {
    let sizes: Vec<u64> = mesh.clusters.iter().map(|c| c.elements.len() as u64).collect();
    let owners = owners(&sizes, &vec![u64::MAX; ranks]);
    (0..owners.len() as u32).filter(|&c| owners[c as usize] as usize == rank).collect()
}

/// The light of some clusters, as a solver holds it.
fn clusters(solution: &Solution, own: &[u32]) -> Vec<ClusterLight> {
    own.iter()
        .map(|&c| {
            let cluster = &solution.mesh.clusters[c as usize];
            let waits = cluster.patches.clone().map(|p| solution.light.emission_waits[p as usize] != 0);
            ClusterLight {
                elements: cluster.elements.clone().map(|e| *solution.light(e)).collect(),
                patches: waits.map(|emission_waits| PatchLight { unshot_power: 0.0, emission_waits }).collect(),
            }
        })
        .collect()
}

/// Does something with the light of `solution` as it is spread over so many ranks; gives the result of each.
fn spread<T: Send>(
    solution: &Solution,
    ranks: usize,
    body: impl Fn(OwnLight<'_>, &mut Communicator<'_>) -> Result<T, Failure> + Sync,
) -> Vec<T> {
    let results = threads::run(ranks, |ranks| {
        let own = own(&solution.mesh, ranks.rank(), ranks.size());
        let clusters = clusters(solution, &own);
        body(OwnLight { own: &own, clusters: &clusters }, ranks)
    });
    results.expect("no rank fails")
}

fn snapshot(solution: &Solution) -> Snapshot<'_> {
    let Solution { description, mesh, settings, ledger, energy, .. } = solution;
    Snapshot { description, mesh, settings, ledger, energy }
}

/// Large enough for two batches of light, and for arrays of several sections.
fn large() -> Solution {
    let solution = floor(400);
    assert!(solution.light.elements.len() * size_of::<ElementLight>() > 5 << 20);
    solution
}

#[test]
fn what_is_read_is_what_was_written() {
    for solution in [floor(5), refined_floor(9, fixture::mixed([1, 2, 3])), large()] {
        let written = bytes(&solution);
        let read = read(&written, Store::Scratch(&HeapScratch)).unwrap();
        assert!(read.light == solution.light && read.ledger == solution.ledger);
        assert!(read.mesh.facets == solution.mesh.facets && read.mesh.clusters == solution.mesh.clusters);
        assert!(read.mesh.first_elements == solution.mesh.first_elements);
        assert!(read.mesh.valid == solution.mesh.valid && read.mesh.patch_facets == solution.mesh.patch_facets);
        assert!(read.description == solution.description && read.energy == solution.energy);
        assert_eq!(digest(&read), digest(&solution));
        assert!(bytes(&read) == written);
    }
}

#[test]
fn elements_that_are_no_grids_are_refused() {
    let mut solution = refined_floor(9, fixture::mixed([1, 2, 3]));
    solution.mesh.first_elements[2] += 1;
    let error = read(&bytes(&solution), Store::Heap).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("the elements of patch 1 are not a grid"), "{error}");
}

#[test]
fn ranks_write_the_bytes_of_one() {
    let solution = large();
    let (expected, digest) = (bytes(&solution), digest(&solution));
    for ranks in [1, 2, 3, 5] {
        let written = spread(&solution, ranks, |light, ranks| {
            let mut out = Vec::new();
            let result = write_over_ranks(&snapshot(&solution), light, ranks, &mut out)?;
            result.expect("memory takes all");
            let whole = light.gather(&solution.mesh, Store::Scratch(&HeapScratch), ranks)?;
            assert_eq!(whole.is_some(), ranks.rank() == 0);
            assert!(whole.is_none_or(|whole| whole == solution.light));
            let found = light.digest(&solution.mesh, solution.ledger.shots, ranks)?;
            assert_eq!(found, (ranks.rank() == 0).then(|| digest.clone()));
            Ok(out)
        });
        assert!(written[0] == expected, "{ranks} ranks");
        assert!(written[1..].iter().all(Vec::is_empty));
    }
}

#[test]
fn ranks_read_their_own_light() {
    let solution = large();
    let written = bytes(&solution);
    let file = SolutionFile::open(&written).unwrap();
    let mesh = file.mesh(Store::Heap).unwrap();
    assert_eq!((file.ledger(), file.settings()), (solution.ledger, solution.settings));
    let light = LightFile::open(&written).unwrap();
    for ranks in [1, 3] {
        for rank in 0..ranks {
            let own = own(&mesh, rank, ranks);
            let mut expected = clusters(&solution, &own);
            expected.iter_mut().zip(&own).for_each(|(light, &c)| light.renew(&mesh, c as usize));
            assert!(expected.iter().any(|light| light.patches.iter().any(|patch| patch.unshot_power > 0.0)));
            assert!(light.light_of(&mesh, &own).unwrap() == expected);
        }
    }
}

/// Takes some bytes and then no more.
struct Full(usize);

impl Write for Full {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0 = self.0.checked_sub(bytes.len()).ok_or_else(|| io::Error::other("the disk is full"))?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_full_disk_is_rank_0s_error_and_the_next_write_succeeds() {
    let solution = large();
    let expected = bytes(&solution);
    for room in [0, 100, expected.len() / 4, expected.len() / 2, expected.len() - 1] {
        let written = spread(&solution, 3, |light, ranks| {
            let failed = write_over_ranks(&snapshot(&solution), light, ranks, &mut Full(room))?;
            assert_eq!(
                failed.map_err(|e| e.to_string()).err().as_deref(),
                match ranks.rank() {
                    0 => Some("the disk is full"),
                    _ => None,
                }
            );
            let mut out = Vec::new();
            write_over_ranks(&snapshot(&solution), light, ranks, &mut out)?.expect("memory takes all");
            Ok(out)
        });
        assert!(written[0] == expected, "room for {room} bytes");
    }
}

/// Where the sections of a file stand: name, start, end.
fn directory(file: &[u8]) -> Vec<(String, usize, usize)> {
    let (mut at, mut sections) = (16, Vec::new());
    while at < file.len() {
        let name = String::from_utf8(file[at..at + 24].to_vec()).unwrap();
        let stored = u64::from_le_bytes(file[at + 32..at + 40].try_into().unwrap()) as usize;
        sections.push((name.trim_end_matches('\0').into(), at, at + 72 + stored));
        at += 72 + stored;
    }
    sections
}

#[test]
fn sections_are_small_and_there_as_often_as_said() {
    let written = bytes(&large());
    let directory = directory(&written);
    assert_eq!(u32::from_le_bytes(written[12..16].try_into().unwrap()) as usize, directory.len());
    for (name, start, _) in &directory {
        let raw = u64::from_le_bytes(written[start + 24..start + 32].try_into().unwrap());
        assert!(raw > 0 && raw <= 1 << 20, "{name}: {raw}");
    }
    let count = |array: &str| directory.iter().filter(|(name, ..)| name.starts_with(array)).count();
    assert!(count("light-") > 5 && count("header-") == 1 && count("base-uv-") == 0);
}

#[test]
fn a_file_that_lacks_a_section_or_has_another_is_refused() {
    let written = bytes(&large());
    let refused = |mut file: Vec<u8>, count: u32, how: &str| {
        file[12..16].copy_from_slice(&count.to_le_bytes());
        let error = read(&file, Store::Heap).map(|_| ()).unwrap_err();
        assert!(matches!(error, FileError::Damaged { .. }), "{how}: {error}");
    };
    let directory = directory(&written);
    let (count, whole) = (directory.len() as u32, &written);
    for (name, start, end) in directory {
        let mut less = whole.clone();
        less.drain(start..end);
        refused(less, count - 1, &format!("without {name}"));
        let twice = [&whole[..], &whole[start..end]].concat();
        refused(twice, count + 1, &format!("{name} twice"));
        let mut renamed = whole.clone();
        renamed[start..start + 12].copy_from_slice(b"stranger-0\0\0");
        refused(renamed, count, &format!("{name} renamed"));
    }
    refused([&whole[..], b"more"].concat(), count, "bytes at the end");
    assert!(matches!(read(&[b"RINGLIGH", &[1, 0, 0, 0][..]].concat(), Store::Heap), Err(FileError::Version(1))));
}
