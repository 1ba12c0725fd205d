//! Verbs that read solutions or scenes, over many ranks: the same bytes.

use crate::workshop::{READERS, Workshop};
use predicates::prelude::*;
use predicates::str::contains;
use std::path::Path;

#[test]
fn what_is_read_does_not_depend_on_ranks_and_rings() {
    let workshop = Workshop::new();
    workshop.prepare_readers();
    for (verb, outputs) in READERS {
        workshop.ringlight(&format!("{verb} {} --force", Workshop::named(outputs, "one"))).assert().code(0);
        let ways: &[&str] = match verb.starts_with("viewfactors") {
            true => &["--ranks 2", "--ranks 3 --threads 2"],
            false => &[
                "--ranks 2",
                "--ranks 3 --rings 2",
                "--ranks 3 --rings 1 --shards random --routing all --packet-size 7",
            ],
        };
        for way in ways {
            workshop.ringlight(&format!("{verb} {} --force {way}", Workshop::named(outputs, "many"))).assert().code(0);
            for output in outputs {
                let same = workshop.bytes(&format!("one.{output}")) == workshop.bytes(&format!("many.{output}"));
                assert!(same, "{verb} {way}: {output}");
            }
        }
    }
}

#[test]
fn a_bake_over_ranks_draws_the_picture_of_one() {
    let workshop = Workshop::new();
    let bake = "--until 0.05 --size 96x64";
    workshop.bake(&format!("-o one.png -o one.glb {bake}")).assert().code(0);
    workshop.bake(&format!("-o many.png -o many.glb {bake} --ranks 3 --rings 1")).assert().code(0);
    for ending in ["png", "glb"] {
        assert!(workshop.bytes(&format!("one.{ending}")) == workshop.bytes(&format!("many.{ending}")), "{ending}");
    }
}

#[test]
fn pictures_do_not_depend_on_their_split_and_the_report_tells_what_each_rank_did() {
    let workshop = Workshop::new();
    workshop.prepare_readers();
    workshop.ringlight("render part.ringlight --size 64x40 -o one.png -o one.exr").assert().code(0).stderr("");
    for (ranks, rings) in [(1, 1), (2, 1), (2, 2), (3, 2), (8, 3)] {
        for split in ["tiles", "scanlines"] {
            let way = format!("--ranks {ranks} --rings {rings} --split {split}");
            let render = "render part.ringlight --size 64x40 -o a.png -o a.exr --force --report a.json -v";
            let told =
                contains(format!("picture: 64 x 40 pixels on {ranks} ranks by {split}")).and(contains("max/mean"));
            workshop.ringlight(&format!("{render} {way}")).assert().code(0).stderr(told);
            assert!(workshop.bytes("a.png") == workshop.bytes("one.png"), "{way}");
            assert!(workshop.bytes("a.exr") == workshop.bytes("one.exr"), "{way}");
            let report = workshop.json("a.json");
            assert_eq!(report["schema"], "ringlight-render-report-1");
            let picture = &report["picture"];
            assert_eq!(picture["split"], split);
            let loads = picture["ranks"].as_array().unwrap();
            let all = |key: &str| loads.iter().map(|load| load[key].as_u64().unwrap()).collect::<Vec<_>>();
            assert_eq!(all("pixels").len(), ranks);
            assert_eq!(all("pixels").iter().sum::<u64>(), 64 * 40);
            // Sixteen samples a pixel and a rough picture; nothing is see-through, and the room is closed.
            assert_eq!(all("rays").iter().sum::<u64>(), 64 * 40 * 17);
            assert!(all("searched").iter().sum::<u64>() > 0, "{way}");
            assert!(picture["max_over_mean"]["searched"].as_f64().unwrap() >= 1.0);
        }
    }
    workshop.bake("-o b.png --size 16x9 --max-shots 2 --report b.json --split tiles --ranks 2").assert().code(0);
    let report = workshop.json("b.json");
    assert_eq!(report["picture"]["split"], "tiles");
    assert_eq!(report["picture"]["ranks"].as_array().unwrap().len(), 2);
}

/// Costly parts of a picture lie beside each other: every N-th row has its share of them, a tile may be full of them. Each rank
/// is a ring of its own, so that what it looks at is what its own rays cost.
#[test]
fn scanlines_divide_the_office_more_evenly_than_tiles() {
    let workshop = Workshop::new();
    let office = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/office.glb");
    let mut bake = workshop
        .ringlight("bake -o office.ringlight --solver plain --patch-size 1.4 --element-size 0.7 --max-shots 30");
    bake.arg(office).assert().code(0);
    for ranks in [2, 3, 8] {
        let [tiles, scanlines] = ["tiles", "scanlines"].map(|split| {
            let way = format!("--size 160x90 --ranks {ranks} --rings {ranks} --split {split}");
            let render = format!("render office.ringlight -o a.png --force --report a.json {way}");
            workshop.ringlight(&render).assert().code(0);
            workshop.json("a.json")["picture"]["max_over_mean"]["searched"].as_f64().unwrap()
        });
        assert!(scanlines < tiles, "{ranks} ranks: {scanlines} {tiles}");
    }
}

#[test]
fn readers_errors_are_said_once() {
    let workshop = Workshop::new();
    workshop.prepare_readers();
    workshop.put("bad.csv", "x,y\n1,2\n");
    let before = workshop.files();
    for (command, code, words) in [
        ("probe part.ringlight --points bad.csv -o a.csv --ranks 3", 1, "bad.csv"),
        ("probe part.ringlight --grid none@1 -o a.csv --ranks 3", 2, "none"),
        ("probe part.ringlight --points points.csv -o a.csv --ranks 2 --rings 3", 2, "--rings 3"),
        ("probe part.ringlight --points points.csv -o a.csv --ranks 2 --memory-per-rank 1MiB", 1, "each rank needs"),
        ("probe none.ringlight --points points.csv -o a.csv --ranks 3", 1, "none.ringlight"),
        ("render part.ringlight -o a.png --camera none --ranks 3", 2, "no camera"),
        ("export part.ringlight -o nowhere/a.csv --ranks 3", 1, "nowhere"),
        ("render part.ringlight -o a.png --report nowhere/a.json --ranks 2", 1, "nowhere"),
        ("render part.ringlight -o a.png --split rows --ranks 2", 2, "--split"),
        ("viewfactors bad.csv -o F.csv --ranks 3", 3, "bad.csv"),
    ] {
        let failed = workshop.ringlight(command).assert().code(code).stderr(contains(words));
        let said = String::from_utf8(failed.get_output().stderr.clone()).unwrap();
        assert_eq!(said.matches("error:").count(), 1, "{command}: {said}");
    }
    assert_eq!(workshop.files(), before);
}
