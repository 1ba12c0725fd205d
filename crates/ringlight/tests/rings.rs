//! The office's masks over rings of ranks, with threads as ranks: bit for bit those of one hierarchy.

use ringlight::mesh::{self, Mesh, MeshOptions};
use ringlight::resources::{Bytes, Resources};
use ringlight::ring::{Bounds, Packet, Piece, Rings, Routing, Shards, Visits, deal, outline, owners};
use ringlight::scene::{self, ReadOptions};
use ringlight::shooting::{self, ClusterLight, Shoot};
use ringlight::solve::{Exchange, Work};
use ringlight::transport::{Failure, threads};
use ringlight_visibility::{Hierarchy, OPAQUE, Shooter};
use std::path::PathBuf;
use std::sync::Arc;

struct Folder(PathBuf);

impl Resources for Folder {
    fn read(&self, path: &str) -> std::io::Result<Bytes> {
        std::fs::read(self.0.join(path)).map(Bytes::new)
    }
}

/// The office at the paper's sizes: 4738 patches, 17251 elements.
fn office() -> Mesh {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let bytes = Bytes::new(std::fs::read(folder.join("office.glb")).unwrap());
    let scene = scene::read("office.glb", bytes, &Folder(folder), &ReadOptions::default()).unwrap();
    let options = MeshOptions { patch_size: Some(0.475), element_size: Some(0.1945), ..MeshOptions::default() };
    mesh::build(&scene, &options).unwrap()
}

/// Some patches, spread over the scene, as shooters of 16 cells.
fn shooters(mesh: &Mesh) -> Vec<Shooter> {
    (0..5u32)
        .map(|i| {
            let patch = mesh.patch(i * 947 + 13);
            let cluster = mesh.cluster_of(patch.id);
            let light = ClusterLight::new(mesh, cluster);
            let index = (patch.id - mesh.clusters[cluster].patches.start) as usize;
            shooting::patch_shot(mesh, &patch, &light, index, 4, Shoot::Average).shooter
        })
        .collect()
}

/// The sample points of a cluster, as a packet with its number as ticket.
fn packet(mesh: &Mesh, cluster: usize, shooter: &Shooter) -> Packet {
    let mut packet = Packet { ticket: cluster as u32, ..Packet::default() };
    for id in mesh.clusters[cluster].patches.clone() {
        let patch = mesh.patch(id);
        for k in 0..patch.element_count() {
            let point = patch.sample_point(k, mesh::ALL_VALID).expect("all samples are free").as_vec3();
            packet.x.push(point.x);
            packet.y.push(point.y);
            packet.z.push(point.z);
            packet.plane.push(patch.plane);
            packet.masks.push(shooter.cells.all());
        }
    }
    packet
}

/// What a rank does: its own clusters' packets, and its shard.
struct Rank<'a> {
    mesh: &'a Mesh,
    shooter: &'a Shooter,
    shard: &'a Hierarchy,
    own: std::vec::IntoIter<usize>,
    found: Vec<(u32, Vec<u64>)>,
}

impl Work for Rank<'_> {
    fn next(&mut self) -> Option<Packet> {
        self.own.next().map(|cluster| packet(self.mesh, cluster, self.shooter))
    }

    fn test(&mut self, packet: &mut Packet) {
        let mut masks = std::mem::take(&mut packet.masks);
        self.shard.clear_blocked(self.shooter, packet.points(), &mut masks);
        packet.masks = masks;
    }

    fn finish(&mut self, ticket: u32, masks: Vec<u64>) {
        self.found.push((ticket, masks));
    }
}

/// The masks of every shooter and cluster over `rings`, and what it took.
fn over(
    rings: (usize, usize),
    mesh: &Mesh,
    shooters: &[Shooter],
    how: (Shards, Routing),
) -> (Vec<Vec<Vec<u64>>>, Visits) {
    let (ranks, rings) = (rings.0, Rings::new(rings.0, rings.1).unwrap());
    let whole = mesh::hierarchy(mesh);
    assert!(whole.triangles().iter().all(|t| t.filter == OPAQUE));
    let pieces: Vec<Piece> =
        whole.triangles().iter().map(|t| Piece { bounds: Bounds::around(t.corners), triangles: 1 }).collect();
    let sizes: Vec<u64> = mesh.clusters.iter().map(|c| c.elements.len() as u64).collect();
    let owners = owners(&sizes, ranks);
    let results = threads::run(ranks, |communicator| {
        let rank = communicator.rank();
        let members = rings.members(rings.ring_of(rank));
        let holders = deal(&pieces, members.len(), how.0);
        let mut held = vec![Vec::new(); members.len()];
        holders.iter().enumerate().for_each(|(i, &member)| held[member as usize].push(i));
        let boxes = |held: &Vec<usize>| outline(&held.iter().map(|&i| pieces[i]).collect::<Vec<_>>(), 16);
        let outlines = Arc::new(held.iter().map(boxes).collect::<Vec<_>>());
        let triangles = held[rank - members.start].iter().map(|&i| whole.triangles()[i]).collect();
        let shard = Hierarchy::build(triangles, Vec::new());
        let mut exchange = Exchange::new(rings, rank, outlines, how.1, 4);
        let own: Vec<usize> = (0..owners.len()).filter(|&c| owners[c] as usize == rank).collect();
        let mut found = Vec::new();
        for (shot, shooter) in shooters.iter().enumerate() {
            let mut work = Rank { mesh, shooter, shard: &shard, own: own.clone().into_iter(), found: Vec::new() };
            exchange.see(communicator, shot as u64, shooter, &mut work)?;
            found.push(work.found);
            // What the master's job will be: something else between shots, at which ranks may arrive early.
            communicator.all_reduce(100, [shot as u8], |a, b| a.max(b))?;
        }
        Ok::<_, Failure>((found, exchange.visits()))
    })
    .unwrap();
    let mut masks = vec![vec![Vec::new(); mesh.clusters.len()]; shooters.len()];
    let mut visits = Visits::default();
    for (found, counts) in results {
        for (shot, found) in found.into_iter().enumerate() {
            found.into_iter().for_each(|(cluster, found)| masks[shot][cluster as usize] = found);
        }
        visits.own += counts.own;
        visits.tested += counts.tested;
        visits.sent += counts.sent;
    }
    (masks, visits)
}

#[test]
fn the_offices_masks_are_the_same_over_any_rings() {
    let mesh = office();
    let shooters = shooters(&mesh);
    let (expected, alone) = over((1, 1), &mesh, &shooters, (Shards::Spatial, Routing::Boxes));
    assert_eq!(alone.sent, 0);
    let whole = mesh::hierarchy(&mesh);
    for (shooter, masks) in shooters.iter().zip(&expected) {
        for (cluster, masks) in masks.iter().enumerate() {
            let mut packet = packet(&mesh, cluster, shooter);
            let mut direct = std::mem::take(&mut packet.masks);
            whole.clear_blocked(shooter, packet.points(), &mut direct);
            assert_eq!(*masks, direct);
        }
    }
    for rings in [(2, 2), (3, 1), (4, 1), (4, 2), (6, 4), (8, 1)] {
        for how in [(Shards::Spatial, Routing::Boxes), (Shards::Random, Routing::All)] {
            let (masks, visits) = over(rings, &mesh, &shooters, how);
            assert!(masks == expected, "{rings:?}, {how:?}");
            let mean = visits.tested as f64 / visits.own as f64;
            println!("{rings:?}, {how:?}: {mean:.2} members visited by each of {} packets", visits.own);
            assert_eq!(visits.own, alone.own);
            if how.1 == Routing::Boxes && rings.1 == 1 {
                assert!(mean < 0.75 * rings.0 as f64, "{mean} of {} members", rings.0);
            }
        }
    }
}
