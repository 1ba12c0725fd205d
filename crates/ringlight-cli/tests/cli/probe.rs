//! `probe`: points, grids, refusals.

use crate::workshop::Workshop;
use predicates::prelude::*;
use predicates::str::contains;

const POINTS: &str = "name,x,y,z,nx,ny,nz\nfloor,0.3,0,0.3,0,2,0\ntable,1,0.75,1,0,1,0\nwall,-0.2,1,1,1,0,0\n";

fn baked() -> Workshop {
    let workshop = Workshop::new();
    workshop.bake("-o box.ringlight --until 0.05").assert().success();
    workshop.put("points.csv", POINTS);
    workshop
}

fn rows(workshop: &Workshop, name: &str) -> Vec<Vec<String>> {
    let text = String::from_utf8(workshop.bytes(name)).unwrap();
    text.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

#[test]
fn points_come_back_with_their_light_and_status_whatever_the_threads() {
    let workshop = baked();
    for (how, more) in [("gather", ""), ("surface", "--reach 0.1")] {
        let run = |out: &str, threads: &str| {
            let verb =
                format!("probe box.ringlight --points points.csv --how {how} {more} --threads {threads} -o {out}");
            workshop.ringlight(&verb).assert().code(0).stderr(contains("1 of 3 points"));
        };
        run(&format!("{how}1.csv"), "1");
        run(&format!("{how}2.csv"), "2");
        assert_eq!(workshop.bytes(&format!("{how}1.csv")), workshop.bytes(&format!("{how}2.csv")));
        let rows = rows(&workshop, &format!("{how}1.csv"));
        assert_eq!(rows[0].join(","), "x,y,z,nx,ny,nz,e_r,e_g,e_b,e,status");
        assert_eq!(rows.len(), 4);
        assert_eq!(rows[1][..6], ["0.3", "0.0", "0.3", "0.0", "2.0", "0.0"]);
        for row in &rows[1..3] {
            let light: Vec<f64> = row[6..10].iter().map(|e| e.parse().unwrap()).collect();
            assert!(light[0] > light[2] && light[2] > 0.0 && row[10] == "ok", "{row:?}");
            let photometric = 0.2126 * light[0] + 0.7152 * light[1] + 0.0722 * light[2];
            assert!((light[3] / photometric - 1.0).abs() < 1e-6);
        }
        let status = if how == "gather" { "inside" } else { "far" };
        assert_eq!(rows[3][6..], ["", "", "", "", status]);
    }
}

#[test]
fn bad_tables_of_points_are_errors_with_their_line_and_nothing_is_written() {
    let workshop = baked();
    for (text, line, what) in [
        ("x,y,z,nx,ny\n0,0,0,0,1\n", 1, "'nz'"),
        ("x,y,z,nx,ny,nz\n0,0,0,0,1,0\n0,0,NaN,0,1,0\n", 3, "'NaN'"),
        ("x,y,z,nx,ny,nz\n0,0,0,0,0,0\n", 2, "normal"),
        ("x,y,z,nx,ny,nz\n0,0,0,0,1\n", 2, "columns"),
        ("", 1, "header"),
    ] {
        workshop.put("bad.csv", text);
        let before = workshop.files();
        let error = contains("bad.csv").and(contains(format!("line {line}:"))).and(contains(what));
        workshop.ringlight("probe box.ringlight --points bad.csv -o out.csv").assert().code(1).stderr(error);
        assert_eq!(workshop.files(), before);
    }
}

#[test]
fn grids_tell_their_uniformity_and_are_drawn() {
    let workshop = baked();
    let told = contains("4 x 4 of 0.250 m x 0.250 m").and(contains("E mean")).and(contains("U0")).and(contains("W/m²"));
    workshop.ringlight("probe box.ringlight --grid table@0.25 -o grid.png -o grid.csv").assert().code(0).stdout(told);
    assert_eq!(rows(&workshop, "grid.csv").len(), 17);
    assert!(workshop.bytes("grid.png").starts_with(b"\x89PNG"));
    let plane = "probe box.ringlight --grid -0.5,0.8,0;2,0.8,2@0.5 --quiet -o plane.csv";
    workshop.ringlight(plane).assert().code(0).stdout("");
    let rows = rows(&workshop, "plane.csv");
    // The first column lies outside of the room, in the open, where there is no light.
    assert!(rows[1..].iter().all(|r| r[10] == "ok" && (r[0] == "-0.25") == (r[9] == "0.0")), "{rows:?}");
    // Behind the ceiling, looking into it.
    let above = "probe box.ringlight --grid 0,2.1,0;2,2.1,0;0,2.1,2@0.5";
    workshop.ringlight(above).assert().code(0).stdout(contains("0 (16 more have no light: 16 inside)"));
}

#[test]
fn probes_that_make_no_sense_are_usage_errors_and_nothing_is_written() {
    let workshop = baked();
    let before = workshop.files();
    for bad in [
        "",
        "--points points.csv",
        "-o out.csv",
        "--points points.csv --grid floor@1 -o out.csv",
        "--points points.csv -o out.png",
        "--points points.csv -o out.glb",
        "--points points.csv -o points.csv --force",
        "--points points.csv -o out.csv --cells 5",
        "--points points.csv -o out.csv --tolerance 0",
        "--grid floor",
        "--grid chair@0.5",
        "--grid 0,0,0;1,1,1@0.5",
        "--grid table@0.25 --height nan",
    ] {
        let mut command = workshop.ringlight("probe box.ringlight");
        command.args(bad.split_whitespace()).assert().code(2).stderr(contains("error:"));
    }
    workshop.ringlight("probe box.ringlight --grid chair@0.5").assert().stderr(contains("lamp, room, table"));
    workshop
        .ringlight("probe box.ringlight --points none.csv -o out.csv")
        .assert()
        .code(1)
        .stderr(contains("none.csv"));
    workshop.ringlight("probe none.ringlight --grid table@1").assert().code(1).stderr(contains("none.ringlight"));
    workshop.ringlight("probe box.ringlight --points points.csv -o box.obj").assert().code(2);
    assert_eq!(workshop.files(), before);
}

/// A lamp 20 cm above a point is no surface on which the point lies, however large the scene.
#[test]
fn a_lamp_close_above_is_seen_in_large_scenes() {
    let workshop = Workshop::new();
    workshop.put("lamp.mtl", "newmtl lamp\nKd 0 0 0\nKe 1 1 1\nnewmtl black\nKd 0 0 0\n");
    let scene = "mtllib lamp.mtl\nv 0 0 1\nv 0 1 1\nv 1 1 1\nv 1 0 1\nv 10000 0 0\nv 10001 0 0\nv 10000 1 0\n\
        usemtl lamp\nf 1 2 3 4\nusemtl black\nf 5 6 7\n";
    workshop.put("lamp.obj", scene);
    workshop.ringlight("bake lamp.obj -o lamp.ringlight --quality draft").assert().code(0);
    workshop.put("points.csv", "x,y,z,nx,ny,nz\n0.5,0.5,0.8,0,0,1\n");
    workshop.ringlight("probe lamp.ringlight --points points.csv -o out.csv").assert().code(0);
    let row = &rows(&workshop, "out.csv")[1];
    // π·F of the unit square from 0.2 m below its middle: four times Howell's B-3 with a = b = 0.5, c = 0.2.
    let (x, r) = (2.5f64, (1.0 + 2.5f64 * 2.5).sqrt());
    let expected = 4.0 * (x / r * (x / r).atan());
    assert!((row[9].parse::<f64>().unwrap() / expected - 1.0).abs() < 1e-5 && row[10] == "ok", "{row:?} {expected}");
}

#[test]
fn flags_of_the_other_way_are_refused() {
    let workshop = baked();
    for (flags, message) in
        [("--reach 1", "--reach is for --how surface"), ("--how surface --cells 4", "are for --how gather")]
    {
        let verb = format!("probe box.ringlight --points points.csv {flags} -o out.csv");
        workshop.ringlight(&verb).assert().code(2).stderr(contains(message));
    }
}
