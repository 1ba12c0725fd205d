//! Covered samples, the audit of shots and light from infinity over rings of ranks, with threads as ranks: bit for bit those
//! of one rank.

mod support;

use ringlight::column::Store;
use ringlight::mesh::{self, Frame, Mesh, MeshOptions};
use ringlight::resources::Bytes;
use ringlight::ring::{Rings, Routing, Shards};
use ringlight::scene::{self, Light, LightKind, ReadOptions, Scene};
use ringlight::shooting::{self, Audit, ClusterLight, Fate, Shoot, Shot};
use ringlight::solve::{Ring, SolveSettings, Solver, Spread, World};
use ringlight::transport::{Communicator, Failure, threads};
use ringlight_visibility::OPAQUE;
use std::path::PathBuf;
use std::sync::Arc;
use support::{Folder, pavilion::pavilion};

fn read(file: &str) -> Scene {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let bytes = Bytes::new(std::fs::read(folder.join(file)).unwrap());
    scene::read(file, bytes, &Folder(folder), &ReadOptions::default()).unwrap()
}

fn cut(scene: &Scene, patch_size: f64, element_size: f64) -> Mesh {
    let options =
        MeshOptions { patch_size: Some(patch_size), element_size: Some(element_size), ..MeshOptions::default() };
    mesh::build(scene, &options, Store::Heap).unwrap()
}

/// Our way and the paper's, packets and windows of other sizes.
fn ways() -> Vec<Spread> {
    let over = |ranks, rings| Spread::new(Rings::new(ranks, rings).expect("so many rings can be"));
    let mut ways = vec![over(3, 3), Spread { packet_size: 4096, window: 1, ..over(2, 1) }];
    for (ranks, rings) in [(2, 1), (3, 2), (4, 1), (8, 3)] {
        ways.push(over(ranks, rings));
        ways.push(Spread { shards: Shards::Random, routing: Routing::All, packet_size: 7, ..over(ranks, rings) });
    }
    ways
}

#[test]
fn valid_samples_are_the_same_over_any_rings() {
    for (file, scene, patch_size, element_size) in [
        ("office", read("office.glb"), 0.95, 0.4),
        ("gallery", read("gallery.glb"), 1.2, 0.4),
        ("pavilion", pavilion(), 0.6, 0.2),
    ] {
        let mut mesh = cut(&scene, patch_size, element_size);
        let whole = Arc::new(mesh::hierarchy(&mesh));
        assert_eq!(whole.triangles().iter().any(|t| t.filter != OPAQUE), file == "pavilion");
        let unknown = mesh.clone();
        mesh::find_valid_samples(&mut mesh, &whole);
        let covered = mesh.valid.iter().filter(|&&bits| bits != mesh::ALL_VALID).count();
        println!("{file}: {covered} of {} elements are covered in part", mesh.valid.len());
        assert!(covered > 20, "{file}: only {covered} elements are covered in part");
        for way in ways() {
            let parts = threads::run::<_, Failure>(way.rings.ranks(), |ranks| {
                let mut ring = Ring::new(&unknown, &way, ranks.rank());
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
            assert!(valid == mesh.valid[..], "{file}, {way:?}");
            let mean = tested as f64 / packets.max(1) as f64;
            println!("{file}, {way:?}: {packets} packets visit {mean:.2} members each");
            let members = way.rings.ranks().div_ceil(way.rings.rings()) as f64;
            assert!(way.routing == Routing::All || mean <= f64::max(1.0, 0.9 * members), "{way:?}: {mean}");
        }
    }
}

/// Number of shots that are audited.
const SHOTS: usize = 16;

/// Shots of 16 cells from patches spread over the scene.
fn shots(mesh: &Mesh) -> Vec<Arc<Shot>> {
    let count = mesh.patch_count() as u32;
    let shot = |i: u32| {
        let patch = mesh.patch(i * (count / SHOTS as u32) + 13);
        let cluster = mesh.cluster_of(patch.id);
        let light = ClusterLight::new(mesh, cluster);
        let index = (patch.id - mesh.clusters[cluster].patches.start) as usize;
        let mut shot = shooting::patch_shot(mesh, &patch, &light, index, 4, Shoot::Average);
        shot.light = (0..16).map(|k| [10.0 + k as f32, 7.0, 1.0 / (i + 1) as f32]).collect();
        Arc::new(shot)
    };
    (0..SHOTS as u32).map(shot).collect()
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

/// What the rays of the shots' audits meet, and the powers of the emitters.
fn follow(
    mut ring: Ring<'_>,
    shots: &[Arc<Shot>],
    ranks: &mut Communicator<'_>,
) -> Result<(Vec<Fate>, Vec<u64>), Failure> {
    let mesh = ring.mesh();
    let settings =
        SolveSettings { solver: Solver::Plain, cells: 16, shoot: Shoot::Elements, sky: None, shooters_in_flight: 1 };
    let world = World::new(&mut ring, &lights(mesh), settings, ranks)?;
    let audit = |shot| Audit::new(mesh, shot, 1000, world.centre, world.radius);
    let audits: Vec<Audit<'_>> = shots.iter().chain(&world.emitters).map(|shot| audit(shot)).collect();
    Ok((ring.follow(ranks, &audits)?, world.emitters.iter().map(|e| e.power.to_bits()).collect()))
}

#[test]
fn fates_of_light_are_the_same_over_any_rings() {
    for (scene, patch_size, element_size) in [(read("gallery.glb"), 0.6, 0.19), (pavilion(), 0.6, 0.2)] {
        let mut mesh = cut(&scene, patch_size, element_size);
        let whole = Arc::new(mesh::hierarchy(&mesh));
        mesh::find_valid_samples(&mut mesh, &whole);
        let shots = shots(&mesh);
        let expected = follow(Ring::alone(&mesh, whole), &shots, &mut Communicator::alone()).expect("it runs");
        let fates = &expected.0;
        assert!(fates[..SHOTS].iter().any(|fate| fate.rays < 1000), "no ray starts on a covered place");
        assert!(fates[SHOTS].escaped_at_once > 0 && fates[SHOTS].escaped_at_once < 1000, "{:?}", fates[SHOTS]);
        for lamp in &fates[SHOTS + 1..] {
            assert!(lamp.escaped.value().fract() != 0.0 && lamp.rays > 100, "{lamp:?}");
        }
        for way in ways() {
            let found = threads::run::<_, Failure>(way.rings.ranks(), |ranks| {
                follow(Ring::new(&mesh, &way, ranks.rank()), &shots, ranks)
            });
            assert!(found.expect("it runs").iter().all(|found| *found == expected), "{}, {way:?}", scene.name);
        }
    }
}
