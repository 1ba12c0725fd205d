//! One scene over many ranks: threads of one process here, MPI processes in the test `mpirun`.

use crate::workshop::Workshop;
use predicates::prelude::*;
use predicates::str::contains;
use std::path::Path;

#[test]
fn ways_to_run_that_make_no_sense_are_usage_errors() {
    let workshop = Workshop::new();
    let before = workshop.files();
    for bad in [
        "--ranks 0",
        "--ranks two",
        "--rings 0",
        "--rings 2",
        "--ranks 3 --rings 4",
        "--ranks 3 --rings all",
        "--packet-size 0",
        "--memory-per-rank 5",
        "--memory-per-rank 0GiB",
        "--ranks 3 --memory-per-rank 1GiB,2GiB",
        "--shards dense",
        "--routing none",
    ] {
        let refused = workshop.bake(&format!("-o a.ringlight {bad}")).assert().code(2);
        let words = String::from_utf8(refused.get_output().stderr.clone()).unwrap();
        assert_eq!(words.matches("error:").count(), 1, "{bad}: {words}");
    }
    workshop.bake("-o a.ringlight --ranks 3 --rings 4").assert().stderr(contains("--rings 4: there are 3 ranks"));
    assert_eq!(workshop.files(), before);
}

#[test]
fn the_solution_does_not_depend_on_ranks_and_rings() {
    let workshop = Workshop::new();
    workshop.bake("-o one.ringlight --until 0.05").assert().code(0);
    let ways = [
        "--ranks 1",
        "--ranks 2 --rings 1",
        "--ranks 3 --rings 2 --threads 2",
        "--ranks 3 --rings 1 --packet-size 7 --shards random --routing all",
        "--ranks 4 --rings 4",
        "--ranks 5",
    ];
    for (number, way) in ways.into_iter().enumerate() {
        workshop.bake(&format!("-o {number}.ringlight --until 0.05 {way}")).assert().code(0);
        assert!(workshop.bytes(&format!("{number}.ringlight")) == workshop.bytes("one.ringlight"), "{way}");
    }
}

/// Ours and, where developers keep them, two shared ones: with a sun, with bulbs, with textures.
#[test]
fn scenes_with_all_kinds_of_light_have_one_solution_however_they_are_spread() {
    let workshop = Workshop::new();
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scenes");
    for (scene, flags) in [
        (scenes.join("office.glb"), "--patch-size 1.4 --element-size 0.7 --max-shots 30"),
        (scenes.join("gallery.glb"), "--patch-size 1.6 --element-size 0.6 --max-shots 90 --shooters-in-flight 3"),
        (shared.join("bakinglab_box/bakinglab_box.gltf"), "--patch-size 3 --element-size 1 --max-shots 40"),
        (
            shared.join("godot_living_room.glb"),
            "--patch-size 4 --element-size 1.5 --max-shots 40 --shooters-in-flight 2",
        ),
    ] {
        if !scene.exists() {
            println!("{} was not found; it is left out", scene.display());
            continue;
        }
        let bake = |way: &str| {
            let mut command =
                workshop.ringlight("bake -o a.ringlight --report a.json --force --solver plain --cells 4 --until 0");
            command.arg(&scene).args(flags.split_whitespace()).args(way.split_whitespace()).assert().code(0);
            (workshop.json("a.json")["solution_digest"].clone(), workshop.bytes("a.ringlight"))
        };
        let expected = bake("--threads 1");
        for way in [
            "--ranks 2 --rings 1 --packet-size 1 --threads 2",
            "--ranks 3 --rings 2 --packet-size 4096 --shards random",
            "--ranks 4 --rings 1 --packet-size 7 --routing all",
            "--ranks 6 --rings 4 --packet-size 200",
            "--ranks 8 --rings 3 --shards random --routing all",
        ] {
            let found = bake(way);
            assert_eq!(found.0, expected.0, "{} {way}", scene.display());
            assert!(found.1 == expected.1, "{} {way}", scene.display());
        }
    }
}

#[test]
fn a_run_goes_on_with_any_other_number_of_ranks() {
    let workshop = Workshop::new();
    workshop.bake("-o whole.ringlight --max-shots 200 --sky 2").assert().code(0);
    workshop.bake("-o a.ringlight --max-shots 60 --sky 2 --ranks 3 --rings 1").assert().code(0);
    workshop.ringlight("resume a.ringlight -o b.ringlight --max-shots 110 --ranks 2").assert().code(0);
    workshop.ringlight("resume b.ringlight -o c.ringlight --max-shots 160").assert().code(0);
    workshop.ringlight("resume c.ringlight -o d.ringlight --max-shots 200 --ranks 4 --rings 3").assert().code(0);
    assert!(workshop.bytes("d.ringlight") == workshop.bytes("whole.ringlight"));
}

#[test]
fn every_rank_reports() {
    let workshop = Workshop::new();
    workshop.bake("-o a.ringlight --report a.json --ranks 3 --rings 2 --until 0.05").assert().code(0);
    let report = workshop.json("a.json");
    let ranks = report["ranks"].as_array().unwrap();
    let all = |key: &str| -> Vec<f64> { ranks.iter().map(|rank| rank[key].as_f64().unwrap()).collect() };
    assert_eq!(all("rank"), [0.0, 1.0, 2.0]);
    assert_eq!(all("ring"), [0.0, 1.0, 1.0]);
    for (key, total) in [("patches", "patches"), ("elements", "elements")] {
        assert_eq!(all(key).iter().sum::<f64>(), report["scene"][total].as_f64().unwrap(), "{key}");
    }
    // The first ring is one rank with all of the geometry; the second two, who share it as their load by the clock lets it move: on a
    // busy machine one may end with all of so little.
    let [whole, a, b] = *all("shard_triangles") else { panic!("there are three ranks") };
    assert_eq!((whole, a + b), (16.0, 16.0));
    assert!(all("busy_seconds").iter().all(|&seconds| seconds > 0.0));
    assert!(all("wait_seconds").iter().all(|&seconds| seconds >= 0.0));
    assert!(all("wait_seconds").iter().any(|&seconds| seconds > 0.0));
    assert!(all("bytes_sent").iter().all(|&bytes| bytes > 0.0));
    assert!(all("packets_visited").iter().sum::<f64>() > 0.0);
    assert_eq!(report["settings"]["ranks"], 3);
    assert_eq!(report["settings"]["rings"], 2);
}

#[test]
fn errors_are_said_once_however_many_ranks_meet_them() {
    let workshop = Workshop::new();
    workshop.put("bad.obj", "v 0 0\n");
    let bad = "bake bad.obj -o a.ringlight --ranks 3";
    for (command, code) in [
        (bad, 3),
        ("bake none.obj -o a.ringlight --ranks 3", 1),
        ("bake box.obj -o nowhere/a.ringlight --ranks 3", 1),
        ("bake box.obj -o a.ringlight --ranks 3 --memory-per-rank 1MiB", 1),
        ("bake box.obj -o a.png --camera none --ranks 3", 2),
    ] {
        let failed = workshop.ringlight(command).assert().code(code);
        let words = String::from_utf8(failed.get_output().stderr.clone()).unwrap();
        assert_eq!(words.matches("error:").count(), 1, "{command}: {words}");
    }
    workshop.ringlight(bad).assert().stderr(contains("bad.obj: line 1"));
    assert_eq!(workshop.files(), ["bad.obj", "box.mtl", "box.obj"]);
}

#[test]
fn a_solve_that_does_not_fit_is_refused_with_what_it_needs() {
    let workshop = Workshop::new();
    for ranks in ["", "--ranks 2 --rings 2"] {
        let refusal =
            contains("each rank needs about").and(contains("may use 2.0 MiB")).and(contains("ranks would do"));
        workshop.bake(&format!("-o a.ringlight --memory-per-rank 2MiB {ranks}")).assert().code(1).stderr(refusal);
    }
    assert!(!workshop.path("a.ringlight").exists());
    let inspection = workshop.inspect("--solver plain");
    let of = |ranks: u64, rings: u64| {
        let all = inspection["memory_per_rank"].as_array().unwrap();
        let it = all.iter().find(|memory| memory["ranks"] == ranks && memory["rings"] == rings).unwrap();
        it["bytes"].as_u64().unwrap()
    };
    // Of so small a scene, packets under way in a wide ring take more than it saves.
    assert!(of(8, 8) < of(8, 1) && of(8, 8) <= inspection["memory_bytes"].as_u64().unwrap());
    workshop.ringlight("inspect box.obj").assert().code(0).stdout(contains("in a ring").and(contains("on each of 16")));
}

/// The command as an MPI launcher starts it, which never speaks to the others.
#[test]
#[cfg_attr(feature = "mpi", ignore = "a command built with MPI would wait for the launcher")]
fn a_command_without_mpi_does_not_run_as_often_as_a_launcher_starts_it() {
    let workshop = Workshop::new();
    let started = |arguments: &str, rank: &str, size: &str| {
        let mut command = workshop.bake(arguments);
        command.env("PMI_RANK", rank).env("PMI_SIZE", size);
        command.assert()
    };
    let advice = contains("--features mpi").and(contains("--ranks N"));
    started("-o a.ringlight --max-shots 1", "0", "3").code(1).stderr(advice);
    started("-o a.ringlight --max-shots 1", "2", "3").code(0).stderr("");
    started("-o a.ringlight --max-shots 1 --ranks 2", "0", "3").code(2).stderr(contains("--ranks"));
    started("-o a.unknown", "1", "3").code(0).stderr("");
    assert!(!workshop.path("a.ringlight").exists());
    started("-o a.ringlight --max-shots 1", "0", "1").code(0);
    workshop.ringlight("inspect box.obj").env("PMIX_RANK", "0").assert().code(2).stderr(contains("one rank"));
}
