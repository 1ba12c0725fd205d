//! Covered samples, the audit of shots and light from infinity over rings of ranks, with threads as ranks: bit for bit those
//! of one rank.

use ringlight::mesh::{self, Frame, Mesh, MeshOptions};
use ringlight::resources::{Bytes, Resources};
use ringlight::ring::{Bounds, Piece, Rings, Routing, Shards, deal, outline, owners};
use ringlight::scene::{self, Light, LightKind, ReadOptions};
use ringlight::shooting::{self, Audit, ClusterLight, Fate, Shoot, Shot};
use ringlight::solve::{Ring, RingExchange, SolveSettings, World, join};
use ringlight::transport::{Communicator, Failure, threads};
use ringlight_visibility::{Filter, Hierarchy, OPAQUE, Triangle};
use std::path::PathBuf;
use std::sync::Arc;

struct Folder(PathBuf);

impl Resources for Folder {
    fn read(&self, path: &str) -> std::io::Result<Bytes> {
        std::fs::read(self.0.join(path)).map(Bytes::new)
    }
}

fn read(file: &str, patch_size: f64, element_size: f64) -> Mesh {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let bytes = Bytes::new(std::fs::read(folder.join(file)).unwrap());
    let scene = scene::read(file, bytes, &Folder(folder), &ReadOptions::default()).unwrap();
    let options =
        MeshOptions { patch_size: Some(patch_size), element_size: Some(element_size), ..MeshOptions::default() };
    mesh::build(&scene, &options).unwrap()
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

const OURS: Way =
    Way { ranks: 1, rings: 1, shards: Shards::Spatial, routing: Routing::Boxes, packet_size: 200, window: 16 };

/// Our way and the paper's, packets and windows of other sizes.
fn ways() -> Vec<Way> {
    let mut ways =
        vec![OURS, Way { ranks: 3, rings: 3, ..OURS }, Way { ranks: 2, packet_size: 4096, window: 1, ..OURS }];
    for (ranks, rings) in [(2, 1), (3, 2), (4, 1), (8, 3)] {
        ways.push(Way { ranks, rings, ..OURS });
        ways.push(Way { ranks, rings, shards: Shards::Random, routing: Routing::All, packet_size: 7, ..OURS });
    }
    ways
}

/// What a rank is given, besides its way to the others.
struct Held<'a> {
    mesh: &'a Mesh,
    triangles: &'a [Triangle],
    filters: &'a [Filter],
    way: Way,
}

impl Held<'_> {
    /// Makes this rank's shard and lets it `work` with its ring.
    fn with_ring<T>(
        &self,
        ranks: &mut Communicator<'_>,
        work: impl FnOnce(&mut Ring<'_, '_>) -> Result<T, Failure>,
    ) -> Result<T, Failure> {
        let rings = Rings::new(self.way.ranks, self.way.rings).expect("so many rings can be");
        let members = rings.members(rings.ring_of(ranks.rank()));
        let pieces: Vec<Piece> =
            self.triangles.iter().map(|t| Piece { bounds: Bounds::around(t.corners), triangles: 1 }).collect();
        let mut held = vec![Vec::new(); members.len()];
        let holders = deal(&pieces, members.len(), self.way.shards);
        holders.iter().enumerate().for_each(|(i, &m)| held[m as usize].push(i));
        let boxes = |held: &Vec<usize>| outline(&held.iter().map(|&i| pieces[i]).collect::<Vec<_>>(), 16);
        let outlines = Arc::new(held.iter().map(boxes).collect::<Vec<_>>());
        let shard = held[ranks.rank() - members.start].iter().map(|&i| self.triangles[i]).collect();
        let shard = Hierarchy::build(shard, self.filters.to_vec());
        let mut exchange = RingExchange::new(rings, ranks.rank(), outlines, self.way.routing, self.way.window);
        work(&mut Ring { shard: &shard, packet_size: self.way.packet_size, exchange: &mut exchange, ranks })
    }

    /// The clusters of a rank.
    fn own(&self, rank: usize) -> Vec<u32> {
        let sizes: Vec<u64> = self.mesh.clusters.iter().map(|c| c.elements.len() as u64).collect();
        let owners = owners(&sizes, self.way.ranks);
        (0..owners.len() as u32).filter(|&c| owners[c as usize] as usize == rank).collect()
    }
}

#[test]
fn valid_samples_are_the_same_over_any_rings() {
    for (file, patch_size, element_size) in [("office.glb", 0.95, 0.4), ("gallery.glb", 1.2, 0.4)] {
        let mut mesh = read(file, patch_size, element_size);
        let whole = mesh::hierarchy(&mesh);
        assert!(whole.triangles().iter().all(|t| t.filter == OPAQUE));
        let unknown = mesh.clone();
        mesh::find_valid_samples(&mut mesh, &whole);
        let covered = mesh.valid.iter().filter(|&&bits| bits != mesh::ALL_VALID).count();
        println!("{file}: {covered} of {} elements are covered in part", mesh.valid.len());
        assert!(covered > 20, "{file}: only {covered} elements are covered in part");
        for way in ways() {
            let held = Held { mesh: &unknown, triangles: whole.triangles(), filters: &[], way };
            let parts = threads::run::<_, Failure>(way.ranks, |ranks| {
                let own = held.own(ranks.rank());
                let (valid, visits) = held.with_ring(ranks, |ring| {
                    Ok((ring.find_valid_samples(0, &unknown, &own)?, ring.exchange.visits()))
                })?;
                Ok((own, valid, visits))
            });
            let mut valid = vec![0; mesh.valid.len()];
            let (mut packets, mut tested) = (0, 0);
            for (own, part, visits) in parts.expect("it runs") {
                packets += visits.own;
                tested += visits.tested;
                let mut part = part.as_slice();
                for cluster in own {
                    let elements = &mesh.clusters[cluster as usize].elements;
                    let (these, others) = part.split_at(elements.len());
                    valid[elements.start as usize..elements.end as usize].copy_from_slice(these);
                    part = others;
                }
            }
            assert!(valid == mesh.valid, "{file}, {way:?}");
            let mean = tested as f64 / packets as f64;
            println!("{file}, {way:?}: {packets} packets visit {mean:.2} members each");
            let members = way.ranks.div_ceil(way.rings) as f64;
            assert!(way.routing == Routing::All || mean <= f64::max(1.0, 0.9 * members), "{way:?}: {mean}");
        }
    }
}

/// Some shots of 16 cells from patches spread over the scene.
fn shots(mesh: &Mesh) -> Vec<Shot> {
    let count = mesh.patch_count() as u32;
    (0..6)
        .map(|i| {
            let patch = mesh.patch(i * (count / 6) + 13);
            let cluster = mesh.cluster_of(patch.id);
            let light = ClusterLight::new(mesh, cluster);
            let index = (patch.id - mesh.clusters[cluster].patches.start) as usize;
            let mut shot = shooting::patch_shot(mesh, &patch, &light, index, 4, Shoot::Average);
            shot.light = (0..16).map(|k| [10.0 + k as f32, 7.0, 1.0 / (i + 1) as f32]).collect();
            shot
        })
        .collect()
}

/// A low sun, and lamps a metre from a surface whose light ends behind it.
fn lights(mesh: &Mesh) -> Vec<Light> {
    let patch = mesh.patch(13);
    let position = mesh.to_world(patch.frame.at(Frame::middle(patch.frame.layout)) + patch.normal).to_array();
    let direction = (-patch.normal).to_array();
    [
        LightKind::Directional { direction: [0.6, -0.64, 0.48] },
        LightKind::Point { position, range: 3.0 },
        LightKind::Spot { position, direction, range: 2.0, inner_cosine: 0.9, outer_cosine: 0.5 },
    ]
    .into_iter()
    .map(|kind| Light { name: String::new(), intensity: [1.0, 2.0, 3.0], kind, node: 0 })
    .collect()
}

/// Follows the rays of some audits over a ring.
fn follow(ring: &mut Ring<'_, '_>, first: u64, mesh: &Mesh, audits: &[Audit<'_>]) -> Result<Vec<Fate>, Failure> {
    let fates = ring.follow(first, mesh, audits)?;
    fates.into_iter().map(|fate| join(ring.ranks, fate)).collect()
}

#[test]
fn fates_of_light_are_the_same_over_any_rings() {
    let mut mesh = read("gallery.glb", 0.6, 0.19);
    let whole = mesh::hierarchy(&mesh);
    mesh::find_valid_samples(&mut mesh, &whole);
    let settings = SolveSettings { cells: 16, shoot: Shoot::Elements, sky: None };
    let lights = lights(&mesh);
    let world = World::new(&mesh, &whole, &lights, settings);
    let mut shots = shots(&mesh);
    shots.extend(world.emitters.iter().cloned());
    let audit = |shot| Audit::new(&mesh, shot, 1000, world.centre, world.radius);
    let expected: Vec<Fate> = shots.iter().map(|shot| audit(shot).follow(&whole)).collect();
    assert!(expected[..6].iter().any(|fate| fate.rays < 1000), "no ray starts on a covered place");
    assert!(expected[6].escaped_at_once > 0 && expected[6].escaped_at_once < 1000, "{:?}", expected[6]);
    for lamp in &expected[7..] {
        assert!(lamp.escaped.value().fract() != 0.0 && lamp.rays > 100, "{lamp:?}");
    }
    for way in ways() {
        let held = Held { mesh: &mesh, triangles: whole.triangles(), filters: &[], way };
        let found = threads::run::<_, Failure>(way.ranks, |ranks| {
            held.with_ring(ranks, |ring| {
                let mut number = 0;
                let world = World::with_entry(&mesh, ring.shard, &lights, settings, |audits| {
                    follow(ring, number, &mesh, audits)
                })?;
                let mut fates = Vec::new();
                for shot in &shots {
                    number += 1;
                    fates.extend(follow(ring, number, &mesh, &[audit(shot)])?);
                }
                Ok((fates, world.emitters.iter().map(|e| e.power.to_bits()).collect::<Vec<_>>()))
            })
        });
        let powers: Vec<u64> = world.emitters.iter().map(|e| e.power.to_bits()).collect();
        for (fates, entered) in found.expect("it runs") {
            assert!(fates == expected && entered == powers, "{way:?}");
        }
    }
}
