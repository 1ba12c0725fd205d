//! The office's light over rings of ranks, with threads as ranks: bit for bit that of one rank.

use ringlight::column::Store;
use ringlight::mesh::{self, Mesh, MeshOptions};
use ringlight::resources::{Bytes, Resources};
use ringlight::ring::{Bounds, Piece, Rings, Routing, Shards, Visits, deal, outline, owners};
use ringlight::scene::{self, ReadOptions};
use ringlight::shooting::{self, ClusterLight, Shoot, Shot, Work};
use ringlight::solve::{Ring, RingExchange};
use ringlight::transport::{Communicator, Failure, threads};
use ringlight_visibility::{Hierarchy, OPAQUE, Triangle};
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
    mesh::build(&scene, &options, Store::Heap).unwrap()
}

/// Some shots of 16 cells from patches spread over the scene, each of a different grey.
fn shots(mesh: &Mesh) -> Vec<Shot> {
    (0..4u32)
        .map(|i| {
            let patch = mesh.patch(i * 1180 + 13);
            let cluster = mesh.cluster_of(patch.id);
            let light = ClusterLight::new(mesh, cluster);
            let index = (patch.id - mesh.clusters[cluster].patches.start) as usize;
            let mut shot = shooting::patch_shot(mesh, &patch, &light, index, 4, Shoot::Average);
            shot.light = (0..16).map(|k| [10.0 + k as f32, 7.0, 1.0 / (i + 1) as f32]).collect();
            shot
        })
        .collect()
}

fn dark(mesh: &Mesh, clusters: impl Iterator<Item = usize>) -> Vec<ClusterLight> {
    clusters.map(|cluster| ClusterLight::new(mesh, cluster)).collect()
}

/// What one machine makes of the shots.
fn alone(mesh: &Mesh, whole: &Hierarchy, shots: &[Shot]) -> Vec<ClusterLight> {
    let mut light = dark(mesh, 0..mesh.clusters.len());
    let mut work = Work::default();
    for shot in shots {
        for (cluster, light) in light.iter_mut().enumerate() {
            shooting::receive(mesh, cluster, light, shot, whole, &mut work);
        }
    }
    light
}

/// How the work is shared out.
#[derive(Clone, Copy, Debug)]
struct Way {
    ranks: usize,
    rings: usize,
    shards: Shards,
    routing: Routing,
    packet_size: usize,
    window: usize,
}

/// A rank's own clusters and their light.
type Own = (Vec<u32>, Vec<ClusterLight>);

/// One rank's work: its shard, its clusters, all shots.
fn shoot(
    mesh: &Mesh,
    triangles: &[Triangle],
    shots: &[Shot],
    way: Way,
    ranks: &mut Communicator<'_>,
) -> Result<(Own, Visits, u64), Failure> {
    let rings = Rings::new(way.ranks, way.rings).expect("so many rings can be");
    let members = rings.members(rings.ring_of(ranks.rank()));
    let pieces: Vec<Piece> =
        triangles.iter().map(|t| Piece { bounds: Bounds::around(t.corners), triangles: 1 }).collect();
    let mut held = vec![Vec::new(); members.len()];
    deal(&pieces, members.len(), way.shards).iter().enumerate().for_each(|(i, &m)| held[m as usize].push(i));
    let boxes = |held: &Vec<usize>| outline(&held.iter().map(|&i| pieces[i]).collect::<Vec<_>>(), 16);
    let outlines = Arc::new(held.iter().map(boxes).collect::<Vec<_>>());
    let shard = held[ranks.rank() - members.start].iter().map(|&i| triangles[i]).collect();
    let shard = Hierarchy::build(shard, Vec::new());
    let sizes: Vec<u64> = mesh.clusters.iter().map(|c| c.elements.len() as u64).collect();
    let owners = owners(&sizes, way.ranks);
    let own: Vec<u32> = (0..owners.len() as u32).filter(|&c| owners[c as usize] as usize == ranks.rank()).collect();
    let mut light = dark(mesh, own.iter().map(|&c| c as usize));
    let mut exchange = RingExchange::new(rings, ranks.rank(), outlines, way.routing, way.window);
    for (number, shot) in shots.iter().enumerate() {
        let mut ring = Ring { shard: &shard, packet_size: way.packet_size, exchange: &mut exchange, ranks };
        ring.receive(mesh, &own, &mut light, number as u64, shot)?;
        // As the choice of the next shooter will be: something else between shots, which ranks reach at different times.
        ranks.all_reduce(100, [number as u8], |a, b| a.max(b))?;
    }
    let messages: u64 = ranks.traffic().values().map(|traffic| traffic.messages).sum();
    Ok(((own, light), exchange.visits(), messages))
}

#[test]
fn the_offices_light_is_the_same_over_any_rings() {
    let mesh = office();
    let shots = shots(&mesh);
    let whole = mesh::hierarchy(&mesh);
    assert!(whole.triangles().iter().all(|t| t.filter == OPAQUE));
    let expected = alone(&mesh, &whole, &shots);
    let lit = expected.iter().flat_map(|c| &c.elements).filter(|e| e.unshot != [0.0; 3]).count();
    assert!(lit > 5000, "only {lit} elements are lit");
    let ours =
        Way { ranks: 1, rings: 1, shards: Shards::Spatial, routing: Routing::Boxes, packet_size: 200, window: 16 };
    let papers = Way { shards: Shards::Random, routing: Routing::All, ..ours };
    let mut ways = vec![ours, Way { packet_size: 7, ranks: 3, ..ours }, Way { packet_size: 1, ranks: 2, ..ours }];
    for (ranks, rings) in [(2, 2), (4, 1), (4, 2), (6, 4), (8, 1), (8, 3)] {
        ways.extend([ours, papers].map(|way| Way { ranks, rings, ..way }));
    }
    ways.push(Way { packet_size: 4096, ranks: 8, window: 1, ..ours });
    for way in ways {
        let parts =
            threads::run(way.ranks, |ranks| shoot(&mesh, whole.triangles(), &shots, way, ranks)).expect("it runs");
        let mut light = vec![ClusterLight::default(); mesh.clusters.len()];
        let (mut visits, mut messages) = (Visits::default(), 0);
        for ((own, part), counts, sent) in parts {
            messages += sent;
            own.into_iter().zip(part).for_each(|(cluster, part)| light[cluster as usize] = part);
            visits.own += counts.own;
            visits.tested += counts.tested;
        }
        assert!(light == expected, "{way:?}");
        let mean = visits.tested as f64 / visits.own as f64;
        println!("{way:?}: {} packets visit {mean:.2} members each, {messages} messages", visits.own);
        if way.routing == Routing::Boxes {
            assert!(mean <= 0.6 * way.ranks.div_ceil(way.rings) as f64 + 0.5, "{way:?}: {mean} members visited");
        }
    }
}
