//! Verbs that read solutions or scenes, over many ranks: the same bytes.

use crate::workshop::{READERS, Workshop};
use predicates::str::contains;

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
        ("viewfactors bad.csv -o F.csv --ranks 3", 3, "bad.csv"),
    ] {
        let failed = workshop.ringlight(command).assert().code(code).stderr(contains(words));
        let said = String::from_utf8(failed.get_output().stderr.clone()).unwrap();
        assert_eq!(said.matches("error:").count(), 1, "{command}: {said}");
    }
    assert_eq!(workshop.files(), before);
}
