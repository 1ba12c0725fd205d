//! Covered samples, the audit of shots and light from infinity over rings of ranks, with threads as ranks: bit for bit those
//! of one rank.

use ringlight::mesh::{self, Frame, Mesh, MeshOptions};
use ringlight::resources::{Bytes, Resources};
use ringlight::ring::{Rings, Routing, Shards};
use ringlight::scene::{self, Light, LightKind, ReadOptions};
use ringlight::shooting::{self, Audit, ClusterLight, Fate, Shoot, Shot};
use ringlight::solve::{Ring, SolveSettings, Spread, World};
use ringlight::transport::{Communicator, Failure, threads};
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

/// Our way and the paper's, packets and windows of other sizes.
fn spreads() -> Vec<Spread> {
    let ours = |ranks, rings| Spread::new(Rings::new(ranks, rings).expect("so many rings can be"));
    let mut spreads = vec![ours(1, 1), ours(3, 3), Spread { packet_size: 4096, window: 1, ..ours(2, 1) }];
    for (ranks, rings) in [(2, 1), (3, 2), (4, 1), (8, 3)] {
        let ours = ours(ranks, rings);
        spreads.push(ours);
        spreads.push(Spread { shards: Shards::Random, routing: Routing::All, packet_size: 7, ..ours });
    }
    spreads
}

#[test]
fn valid_samples_are_the_same_over_any_rings() {
    for (file, patch_size, element_size) in [("office.glb", 0.95, 0.4), ("gallery.glb", 1.2, 0.4)] {
        let mut mesh = read(file, patch_size, element_size);
        let whole = mesh::hierarchy(&mesh);
        let unknown = mesh.clone();
        mesh::find_valid_samples(&mut mesh, &whole);
        let covered = mesh.valid.iter().filter(|&&bits| bits != mesh::ALL_VALID).count();
        println!("{file}: {covered} of {} elements are covered in part", mesh.valid.len());
        assert!(covered > 20, "{file}: only {covered} elements are covered in part");
        for spread in spreads() {
            let parts = threads::run::<_, Failure>(spread.rings.ranks(), |ranks| {
                let mut ring = Ring::new(&unknown, &spread, ranks.rank());
                let valid = ring.find_valid_samples(ranks)?;
                Ok((ring.share().own.clone(), valid, ring.visits()))
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
            assert!(valid == mesh.valid, "{file}, {spread:?}");
            let mean = tested as f64 / packets as f64;
            println!("{file}, {spread:?}: {packets} packets visit {mean:.2} members each");
            if spread.routing == Routing::Boxes && packets > 0 {
                let members = spread.rings.members(0).len().max(2) as f64;
                assert!(mean <= 0.9 * members, "{spread:?}: {mean} members visited");
            }
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

#[test]
fn fates_of_light_are_the_same_over_any_rings() {
    let mut mesh = read("gallery.glb", 0.6, 0.19);
    let whole = Arc::new(mesh::hierarchy(&mesh));
    mesh::find_valid_samples(&mut mesh, &whole);
    let settings = SolveSettings { cells: 16, shoot: Shoot::Elements, sky: None, shooters_in_flight: 1 };
    let lights = lights(&mesh);
    let mut alone = Ring::alone(&mesh, whole.clone());
    let world = World::new(&mut alone, &mut Communicator::alone(), &lights, settings).unwrap();
    let mut shots: Vec<Arc<Shot>> = shots(&mesh).into_iter().map(Arc::new).collect();
    shots.extend(world.emitters.iter().cloned());
    let audit = |shot| Audit::new(&mesh, shot, 1000, world.centre, world.radius);
    let expected: Vec<Fate> = shots.iter().map(|shot| audit(shot).follow(&whole)).collect();
    assert!(expected[..6].iter().any(|fate| fate.rays < 1000), "no ray starts on a covered place");
    assert!(expected[6].escaped_at_once > 0 && expected[6].escaped_at_once < 1000, "{:?}", expected[6]);
    for lamp in &expected[7..] {
        assert!(lamp.escaped.value().fract() != 0.0 && lamp.rays > 100, "{lamp:?}");
    }
    let powers: Vec<u64> = world.emitters.iter().map(|e| e.power.to_bits()).collect();
    for spread in spreads() {
        let found = threads::run::<_, Failure>(spread.rings.ranks(), |ranks| {
            let mut ring = Ring::new(&mesh, &spread, ranks.rank());
            let world = World::new(&mut ring, ranks, &lights, settings)?;
            let own = ring.share().own.iter();
            let mut light: Vec<ClusterLight> = own.map(|&c| ClusterLight::new(&mesh, c as usize)).collect();
            let mut fates = Vec::new();
            for (shot, number) in shots.iter().zip(0..) {
                ring.begin(number, shot);
                fates.push(ring.commit(ranks, number, shot, &audit(shot), &mut light)?);
            }
            Ok((fates, world.emitters.iter().map(|e| e.power.to_bits()).collect::<Vec<_>>()))
        });
        let mut fates = vec![Fate::default(); shots.len()];
        for (part, entered) in found.expect("it runs") {
            assert!(entered == powers, "{spread:?}");
            fates.iter_mut().zip(part).for_each(|(fate, part)| *fate = fate.join(part));
        }
        assert!(fates == expected, "{spread:?}");
    }
}
