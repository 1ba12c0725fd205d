//! `viewfactors`: matrices, their audit, and refusals.

use crate::workshop::Workshop;
use predicates::prelude::*;
use predicates::str::contains;

/// A closed cube that is seen from inside: a floor, a ceiling whose name needs quotes, walls.
const CUBE: &str = "\
v 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nv 0 1 0\nv 1 1 0\nv 1 1 1\nv 0 1 1
g floor\nf 1 4 3 2\ng ceiling, \"white\"\nf 5 6 7 8\ng walls\nf 1 2 6 5\nf 4 8 7 3\nf 1 5 8 4\nf 2 3 7 6\n";

/// F of opposite faces of a cube (Howell's catalogue, C-11).
const OPPOSITE: f64 = 0.199_824_895_698_387_33;

fn workshop() -> Workshop {
    let workshop = Workshop::new();
    workshop.put("cube.obj", CUBE);
    workshop
}

/// Fields of a table whose names have no commas or quotes.
fn table(workshop: &Workshop, name: &str) -> Vec<Vec<String>> {
    let text = String::from_utf8(workshop.bytes(name)).unwrap();
    text.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

fn numbers(row: &[String]) -> Vec<f64> {
    row.iter().map(|field| field.parse().unwrap()).collect()
}

#[test]
fn a_table_has_a_row_for_each_object_and_closed_rows_add_up_to_1() {
    let workshop = workshop();
    workshop.ringlight("viewfactors cube.obj -o F.csv --report F.json").assert().code(0);
    let text = String::from_utf8(workshop.bytes("F.csv")).unwrap();
    let quoted = "\"ceiling, \"\"white\"\"\"";
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines[0], format!("name,area,floor,{quoted},walls"));
    assert!(lines.len() == 4 && lines[2].starts_with(&format!("{quoted},1,")), "{text}");
    let rows: Vec<Vec<f64>> = lines[1..]
        .iter()
        .map(|line| line.rsplitn(5, ',').take(4).map(|field| field.parse().unwrap()).collect())
        .collect();
    for row in &rows {
        let sum: f64 = row[..3].iter().sum();
        assert!((sum - 1.0).abs() < 1e-6, "{row:?}");
    }
    // From last to first: walls, ceiling, floor, area.
    assert!((rows[0][1] - OPPOSITE).abs() < 1e-9 && (rows[2][3] - 4.0).abs() < 1e-12, "{rows:?}");
    assert!((rows[2][0] - (1.0 + OPPOSITE) / 2.0).abs() < 1e-9, "{rows:?}");
    let report = workshop.json("F.json");
    assert_eq!(report["schema"], "ringlight-viewfactors-1");
    assert!(report["row_sums"]["farthest_from_1"].as_f64().unwrap() < 1e-6);
    assert!(report["reciprocity"]["pairs"].as_u64().unwrap() > 0);
    assert!(report["reciprocity"]["relative_largest"].as_f64().unwrap() < 1e-6);
    assert_eq!(report["pairs"]["total"], report["pairs"]["done"]);
    assert_eq!(report["scene"]["triangles"], 12);
    assert_eq!(report["scene"]["polygons"], 6);
    for part in ["settings", "warnings", "seconds", "values", "cpu_seconds", "peak_memory_bytes", "command", "version"]
    {
        assert!(!report[part].is_null(), "{part}");
    }
}

#[test]
fn faces_have_rows_of_their_own_and_objects_are_their_weighted_sums() {
    let workshop = Workshop::new();
    workshop.ringlight("viewfactors box.obj -o objects.csv --sides both").assert().code(0);
    workshop.ringlight("viewfactors box.obj -o faces.csv --sides both --per face").assert().code(0);
    let (objects, faces) = (table(&workshop, "objects.csv"), table(&workshop, "faces.csv"));
    assert_eq!(objects[0], ["name", "area", "room", "table", "lamp"]);
    assert_eq!(faces.len(), 9);
    assert_eq!(faces[0][2..], ["room/1", "room/2", "room/3", "room/4", "room/5", "room/6", "table/7", "lamp/8"]);
    for object in &objects[1..] {
        for (column, to) in objects[0].iter().enumerate().skip(2) {
            let mut sum = 0.0;
            for face in faces[1..].iter().filter(|face| face[0].starts_with(&format!("{}/", object[0]))) {
                let row = numbers(&face[1..]);
                let columns = faces[0].iter().enumerate().skip(2).filter(|(_, n)| n.starts_with(&format!("{to}/")));
                sum += row[0] * columns.map(|(k, _)| row[k - 1]).sum::<f64>();
            }
            let row = numbers(&object[1..]);
            assert!((sum / row[0] - row[column - 1]).abs() < 1e-12, "{} to {to}", object[0]);
        }
    }
}

#[test]
fn the_matrix_does_not_depend_on_threads() {
    let workshop = Workshop::new();
    let run = |threads: u32| {
        let outputs = format!("-o {threads}.csv -o {threads}.npy --errors {threads}e.csv --threads {threads}");
        workshop.ringlight(&format!("viewfactors box.obj --per face --sides both {outputs}")).assert().code(0);
        [format!("{threads}.csv"), format!("{threads}.npy"), format!("{threads}e.csv")]
            .map(|name| workshop.bytes(&name))
    };
    assert!(run(1) == run(2));
}

#[test]
fn sparse_tables_have_a_line_for_each_factor_that_is_large_enough() {
    let workshop = workshop();
    workshop.ringlight("viewfactors cube.obj -o F.csv --per face --min 0.1999").assert().code(0);
    let text = String::from_utf8(workshop.bytes("F.csv")).unwrap();
    assert!(text.starts_with("from,to,area,factor,error\n"));
    // Opposite faces are below, neighbours (0.200044) above: 4 lines for each face.
    assert_eq!(text.lines().count(), 1 + 24);
    for line in text.lines().skip(1) {
        let fields: Vec<f64> = line.rsplitn(4, ',').take(3).map(|field| field.parse().unwrap()).collect();
        assert!((fields[1] - (1.0 - OPPOSITE) / 4.0).abs() < 1e-9 && fields[2] == 1.0 && fields[0] < 1e-6, "{line}");
    }
}

#[test]
fn arrays_hold_the_same_numbers_as_tables() {
    let workshop = Workshop::new();
    workshop.ringlight("viewfactors box.obj -o F.csv -o F.npy --errors E.npy --sides both").assert().code(0);
    let rows = table(&workshop, "F.csv");
    for name in ["F.npy", "E.npy"] {
        let bytes = workshop.bytes(name);
        assert!(bytes.starts_with(b"\x93NUMPY\x01\x00"));
        let start = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        let header = std::str::from_utf8(&bytes[10..start]).unwrap();
        assert!(header.contains("'descr': '<f8'") && header.contains("'shape': (3, 3)"), "{header}");
        let numbers_in_array: Vec<f64> =
            bytes[start..].chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect();
        assert_eq!((start % 64, numbers_in_array.len()), (0, 9));
        if name == "F.npy" {
            let in_table: Vec<f64> = rows[1..].iter().flat_map(|row| numbers(&row[2..])).collect();
            assert_eq!(numbers_in_array, in_table);
        }
    }
}

#[test]
fn one_face_sees_nothing_and_no_face_is_refused() {
    let workshop = Workshop::new();
    workshop.put("one.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\ng only\nf 1 2 3\n");
    workshop.ringlight("viewfactors one.obj -o one.csv").assert().code(0);
    assert_eq!(workshop.bytes("one.csv"), b"name,area,only\nonly,0.5,0\n");
    workshop.put("none.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
    workshop
        .ringlight("viewfactors none.obj -o none.csv")
        .assert()
        .code(3)
        .stderr(contains("none.obj").and(contains("area")));
    workshop.put("none.gltf", "{\"asset\":{\"version\":\"2.0\"}}");
    workshop.ringlight("viewfactors none.gltf -o none.csv").assert().code(3).stderr(contains("none.gltf"));
    workshop.put("bad.obj", "v 0 0 0\nv 1 0 0\nf 1 2 7\n");
    workshop.ringlight("viewfactors bad.obj -o none.csv").assert().code(3).stderr(contains("line 3"));
    assert!(!workshop.path("none.csv").exists());
}

#[test]
fn gltf_nodes_are_objects_and_its_triangles_faces() {
    let workshop = Workshop::new();
    let furnace = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/furnace.glb");
    let mut objects = workshop.ringlight("viewfactors -o F.csv --report F.json");
    objects.arg(furnace).assert().code(0);
    let mut faces = workshop.ringlight("viewfactors -o G.csv --per face --report G.json");
    faces.arg(furnace).assert().code(0);
    let (by_object, by_face) = (workshop.json("F.json"), workshop.json("G.json"));
    assert_eq!(by_face["scene"]["rows"], by_face["scene"]["triangles"]);
    // Objects are pieced together again from their triangles, so this compares two ways of cutting.
    let mean = |report: &serde_json::Value| report["row_sums"]["area_weighted_mean"].as_f64().unwrap();
    assert!((mean(&by_object) - mean(&by_face)).abs() < 1e-3);
    assert!(by_object["scene"]["polygons"].as_u64().unwrap() < by_face["scene"]["polygons"].as_u64().unwrap());
}

#[test]
fn scenes_turned_inside_out_are_noticed() {
    let workshop = workshop();
    let turned = CUBE.replace("f 1 4 3 2", "f 1 2 3 4").replace("f 5 6 7 8", "f 8 7 6 5");
    workshop.put("turned.obj", turned);
    workshop
        .ringlight("viewfactors turned.obj -o F.csv")
        .assert()
        .code(0)
        .stderr(contains("--sides both").and(contains("2 times")));
    workshop.ringlight("viewfactors cube.obj -o G.csv").assert().code(0).stderr(contains("warning").not());
}

#[test]
fn what_makes_no_sense_is_refused_and_nothing_is_written() {
    let workshop = workshop();
    workshop.put("old.csv", "precious");
    let before = workshop.files();
    for bad in [
        "",
        "-o F.glb",
        "-o F.csv --min 0",
        "-o F.csv --min 2",
        "-o F.csv --tolerance 0",
        "-o F.csv --tolerance nan",
        "-o F.csv --per edge",
        "-o F.csv -o F.csv",
        "-o F.csv --errors F.csv",
        "-o F.npy --min 0.1",
        "-o F.csv --min 0.1 --errors E.csv",
        "-o F.csv --report F.csv",
    ] {
        workshop
            .ringlight("viewfactors cube.obj")
            .args(bad.split_whitespace())
            .assert()
            .code(2)
            .stderr(contains("error:"));
    }
    workshop.ringlight("viewfactors box.glb -o F.csv --unit mm").assert().code(2).stderr(contains("--unit"));
    workshop.ringlight("viewfactors cube.obj -o old.csv").assert().code(1).stderr(contains("--force"));
    workshop.ringlight("viewfactors cube.obj -o nowhere/F.csv").assert().code(1).stderr(contains("nowhere"));
    workshop.ringlight("viewfactors none.obj -o F.csv").assert().code(1).stderr(contains("none.obj"));
    workshop.ringlight("viewfactors cube.obj --report cube.obj --force -o F.csv").assert().code(2);
    workshop
        .ringlight("viewfactors box.obj --report box.mtl --force -o F.csv")
        .assert()
        .code(2)
        .stderr(contains("box.mtl"));
    assert_eq!(workshop.files(), before);
    assert_eq!(workshop.bytes("old.csv"), b"precious");
    workshop.ringlight("viewfactors cube.obj -o old.csv --force").assert().code(0);
    assert_ne!(workshop.bytes("old.csv"), b"precious");
}

#[test]
fn progress_as_json_counts_pairs() {
    let workshop = workshop();
    let run = workshop.ringlight("viewfactors cube.obj -o F.csv --progress json --quiet").assert().code(0);
    let text = String::from_utf8(run.get_output().stderr.clone()).unwrap();
    let lines: Vec<serde_json::Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let last = lines.iter().rev().find(|line| line["stage"] == "solve").unwrap();
    assert_eq!((&last["pairs"], &last["pairs_total"]), (&15.into(), &15.into()));
    assert!(lines.iter().all(|line| line["seconds"].is_number() && line.get("shots").is_none()));
}

/// Unit squares that face each other 0.5 m apart, a screen 2 cm above half of the lower, and something 10 km away: what is
/// near each other is judged by itself, not by the size of the scene.
#[test]
fn small_gaps_count_in_large_scenes() {
    let workshop = Workshop::new();
    let squares = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 0.5\nv 0 1 0.5\nv 1 1 0.5\nv 1 0 0.5\n\
        v 0 0 0.02\nv 0.5 0 0.02\nv 0.5 1 0.02\nv 0 1 0.02\nv 10000 0 0\nv 10001 0 0\nv 10000 1 0\n\
        o a\nf 1 2 3 4\no b\nf 5 6 7 8\no screen\nf 9 10 11 12\n";
    workshop.put("near.obj", squares);
    workshop.put("far.obj", format!("{squares}o far\nf 13 14 15\n"));
    for name in ["near", "far"] {
        workshop.ringlight(&format!("viewfactors {name}.obj -o {name}.csv")).assert().code(0);
    }
    let factor = |name: &str| numbers(&table(&workshop, name)[1][1..])[2];
    // Half of 0.415 is hidden, and little more.
    assert!((0.19..0.215).contains(&factor("near.csv")));
    assert!((factor("far.csv") / factor("near.csv") - 1.0).abs() < 2e-3);
}
