//! Solves over rings of ranks, with threads as ranks: bit for bit those of one rank.

mod support;

use ringlight::column::Store;
use ringlight::mesh::{self, Mesh, MeshOptions};
use ringlight::resources::Bytes;
use ringlight::ring::{Moves, Rings, Routing, Shards, Visits};
use ringlight::scene::{self, Light, ReadOptions, Scene};
use ringlight::shooting::{ClusterLight, Shoot};
use ringlight::solve::{self, Progress, Ring, SolveSettings, Solver, Spread, State, StopReason, StopRule, World};
use ringlight::transport::{Communicator, Failure, Traffic, threads};
use ringlight_visibility::OPAQUE;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use support::Folder;

/// A scene to solve.
struct Task {
    mesh: Mesh,
    lights: Vec<Light>,
    settings: SolveSettings,
    shots: u64,
}

impl Task {
    fn new(scene: Scene, sizes: [f64; 2], mixed: bool, settings: SolveSettings, shots: u64) -> Task {
        let [patch_size, element_size] = sizes;
        let options =
            MeshOptions { patch_size: Some(patch_size), element_size: Some(element_size), ..MeshOptions::default() };
        let mut mesh = support::refined(mesh::build(&scene, &options, Store::Heap).unwrap(), &scene, mixed);
        let hierarchy = Arc::new(mesh::hierarchy(&mesh));
        mesh::find_valid_samples(&mut mesh, &hierarchy);
        Task { mesh, lights: scene.lights, settings, shots }
    }

    /// The office at the paper's sizes: 4738 patches, 17251 elements.
    fn office(shooters_in_flight: u32, shots: u64) -> Task {
        Task::own_office([0.475, 0.1945], false, shooters_in_flight, shots)
    }

    fn own_office(sizes: [f64; 2], mixed: bool, shooters_in_flight: u32, shots: u64) -> Task {
        let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
        let bytes = Bytes::new(std::fs::read(folder.join("office.glb")).unwrap());
        let scene = scene::read("office.glb", bytes, &Folder(folder), &ReadOptions::default()).unwrap();
        let settings =
            SolveSettings { solver: Solver::Plain, cells: 16, shoot: Shoot::Elements, sky: None, shooters_in_flight };
        Task::new(scene, sizes, mixed, settings, shots)
    }

    fn solve(&self, mut ring: Ring<'_>, ranks: &mut Communicator<'_>) -> Result<Part, Failure> {
        let world = World::new(&mut ring, &self.lights, self.settings, ranks)?;
        let mut state = State::new(&world, ranks)?;
        let stop = StopRule { until: 1e-3, max_shots: Some(self.shots) };
        let (reason, progress) = solve::plain(&world, &mut ring, &mut state, &stop, ranks, &mut ())?;
        let energy = state.energy(&world, ranks)?;
        let end = format!("{reason:?} {energy:?} {:?}", (state.shots, state.emitters_shot, state.emitted));
        assert_eq!(reason, StopReason::MaxShots);
        let (traffic, held) = (ranks.traffic().clone(), ring.hierarchy().triangles().len());
        let (own, light, visits) = (ring.share().own.clone(), state.clusters, ring.visits());
        Ok(Part { own, light, end, progress, visits, traffic, held })
    }

    fn alone(&self) -> Part {
        let ring = Ring::alone(&self.mesh, Arc::new(mesh::hierarchy(&self.mesh)));
        self.solve(ring, &mut Communicator::alone()).unwrap()
    }

    fn over(&self, spread: Spread) -> Vec<Part> {
        let solve = |ranks: &mut Communicator<'_>| self.solve(Ring::new(&self.mesh, &spread, ranks.rank()), ranks);
        threads::run(spread.rings.ranks(), solve).unwrap()
    }

    /// Compares the light of all ranks with that of one.
    fn check(&self, expected: &Part, spread: Spread) -> Vec<Part> {
        let parts = self.over(spread);
        let mut light = vec![ClusterLight::default(); self.mesh.clusters.len()];
        for part in &parts {
            part.own.iter().zip(&part.light).for_each(|(&cluster, part)| light[cluster as usize] = part.clone());
            assert_eq!(part.end, expected.end, "{spread:?}");
        }
        assert!(light == expected.light, "{spread:?}");
        parts
    }
}

/// What a rank has at the end.
struct Part {
    own: Vec<u32>,
    light: Vec<ClusterLight>,
    /// All that is the same on every rank, in words.
    end: String,
    progress: Progress,
    visits: Visits,
    traffic: BTreeMap<u32, Traffic>,
    /// Triangles held at the end.
    held: usize,
}

fn spread(ranks: usize, rings: usize) -> Spread {
    Spread::new(Rings::new(ranks, rings).expect("so many rings can be"))
}

/// The paper's way: geometry at random, every packet to all.
fn papers(spread: Spread) -> Spread {
    Spread { shards: Shards::Random, routing: Routing::All, ..spread }
}

fn sum(parts: &[Part]) -> Visits {
    parts.iter().fold(Visits::default(), |sum, part| Visits {
        own: sum.own + part.visits.own,
        tested: sum.tested + part.visits.tested,
        sent: sum.sent + part.visits.sent,
    })
}

#[test]
fn the_offices_light_is_the_same_over_any_rings() {
    let office = Task::office(1, 12);
    let expected = office.alone();
    let lit = expected.light.iter().flat_map(|c| &c.elements).filter(|e| e.mean() != [0.0; 3]).count();
    assert!(lit > 5000, "only {lit} elements are lit");
    let mut ways = vec![
        Spread { packet_size: 7, ..spread(3, 1) },
        Spread { packet_size: 1, ..spread(2, 1) },
        Spread { packet_size: 4096, window: 1, ..spread(8, 1) },
    ];
    for (ranks, rings) in [(2, 2), (4, 1), (4, 2), (6, 4), (8, 1), (8, 3), (16, 2)] {
        ways.extend([spread(ranks, rings), papers(spread(ranks, rings))]);
    }
    for way in ways {
        let parts = office.check(&expected, way);
        let visits = sum(&parts);
        let mean = visits.tested as f64 / visits.own.max(1) as f64;
        println!("{way:?}: {} packets visit {mean:.2} members each", visits.own);
        let members = way.rings.ranks().div_ceil(way.rings.rings());
        if way.routing == Routing::Boxes && members > 1 {
            assert!(mean <= 0.9 * members as f64, "{way:?}: {mean} members visited");
        }
    }
}

#[test]
fn light_through_panes_and_lattices_is_the_same_over_any_rings() {
    // Under the sun and the lamp alone the panes' light is passed on; a sky is 256 shooters more.
    for (sky, shooters_in_flight, shots) in [(None, 1, 40), (Some([0.3, 0.4, 0.6]), 3, 260)] {
        let settings =
            SolveSettings { solver: Solver::Plain, cells: 16, shoot: Shoot::Elements, sky, shooters_in_flight };
        let pavilion = Task::new(support::pavilion::pavilion(), [1.0, 0.25], false, settings, shots);
        let hierarchy = mesh::hierarchy(&pavilion.mesh);
        let opaque = hierarchy.triangles().iter().filter(|triangle| triangle.filter == OPAQUE).count();
        assert!(opaque > 10 && hierarchy.triangles().len() > opaque + 30, "{opaque} of the triangles are opaque");
        assert_eq!((pavilion.mesh.occluder.bitmaps.len(), pavilion.lights.len()), (1, 1));
        let expected = pavilion.alone();
        let lit = expected.light.iter().flat_map(|c| &c.elements).filter(|e| e.mean() != [0.0; 3]).count();
        assert!(lit > 500, "only {lit} of {} elements are lit", pavilion.mesh.valid.len());
        pavilion.check(&expected, spread(3, 2));
        pavilion.check(&expected, papers(spread(4, 1)));
        if sky.is_none() {
            for (ranks, rings) in [(2, 1), (4, 1), (8, 3)] {
                pavilion.check(&expected, Spread { packet_size: 7, ..spread(ranks, rings) });
                pavilion.check(&expected, papers(spread(ranks, rings)));
            }
            // Some members hold nothing.
            pavilion.check(&expected, spread(32, 1));
        }
    }
}

#[test]
fn the_light_of_elements_of_all_sizes_is_the_same_over_any_rings() {
    let office = Task::own_office([0.95, 0.4], true, 2, 12);
    let expected = office.alone();
    for (ranks, rings) in [(2, 2), (4, 1), (6, 4)] {
        office.check(&expected, Spread { packet_size: 7, ..spread(ranks, rings) });
        office.check(&expected, papers(spread(ranks, rings)));
    }
}

#[test]
fn several_shooters_in_flight_give_the_same_light_over_any_rings() {
    for (shooters_in_flight, solver) in [(2, Solver::Plain), (5, Solver::Plain), (2, Solver::PlainTo(0.02))] {
        let mut office = Task::office(shooters_in_flight, 23);
        office.settings.solver = solver;
        let expected = office.alone();
        for (ranks, rings) in [(2, 1), (3, 2), (5, 1), (6, 6)] {
            office.check(&expected, spread(ranks, rings));
            office.check(&expected, papers(spread(ranks, rings)));
        }
    }
}

/// Geometry that moves to random members after every shot changes nothing.
#[test]
fn geometry_may_move_between_all_shots() {
    for shooters_in_flight in [1, 3] {
        let office = Task::office(shooters_in_flight, 16);
        let expected = office.alone();
        for (ranks, rings) in [(2, 1), (5, 2), (4, 1)] {
            for way in [spread(ranks, rings), papers(spread(ranks, rings))] {
                let held = |moves| -> Vec<usize> {
                    office.check(&expected, Spread { moves, ..way }).iter().map(|part| part.held).collect()
                };
                assert_ne!(held(Moves::Random), held(Moves::Never), "nothing has moved");
            }
        }
    }
}

#[test]
fn no_light_travels_but_that_of_the_shooter() {
    let office = Task::office(1, 10);
    let expected = office.alone();
    let parts = office.check(&expected, spread(4, 2));
    let mut total: BTreeMap<u32, Traffic> = BTreeMap::new();
    for (&tag, traffic) in parts.iter().flat_map(|part| &part.traffic) {
        let entry = total.entry(tag).or_default();
        entry.messages += traffic.messages;
        entry.bytes += traffic.bytes;
    }
    println!("{total:?}");
    // Per shot: one reduction (two steps among four ranks) before it and one before the end, and the shot to three ranks:
    // its number, its power, sixteen colours.
    let (choices, shots) = (total[&1], total[&5]);
    assert_eq!(choices.messages, 11 * 4 * 2);
    assert_eq!((shots.messages, shots.bytes), (10 * 3, 10 * 3 * (4 + 8 + 16 * 12)));
    // Each member of a ring says that its own packets are home, and is told that all are.
    // The audit of all shots together is one more question.
    assert_eq!((total[&3].messages, total[&4].messages), (11 * 2, 11 * 2));
    // All else are points and masks, rays and hits, the sums of the audit, and how busy everyone was.
    assert_eq!(total.keys().copied().collect::<Vec<_>>(), [1, 2, 3, 4, 5, 6, 7, 8]);
    assert!(expected.progress.rays <= parts[0].progress.rays);
}
