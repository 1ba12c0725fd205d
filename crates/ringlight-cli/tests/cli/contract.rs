//! Help, exit codes, refusals, progress, report.

use crate::workshop::Workshop;
use predicates::prelude::*;
use predicates::str::contains;

#[test]
fn help_shows_examples_and_exit_codes() {
    let workshop = Workshop::new();
    workshop.ringlight("--help").assert().success().stdout(contains("Exit codes").and(contains("Examples:")));
    for verb in ["bake", "resume", "export", "render", "inspect", "probe", "viewfactors", "completions"] {
        workshop.ringlight(verb).arg("--help").assert().success().stdout(contains("Examples:"));
    }
    workshop.ringlight("--version").assert().success().stdout(contains("ringlight"));
}

#[test]
fn shells_get_completions() {
    let workshop = Workshop::new();
    for shell in ["bash", "zsh", "fish"] {
        workshop.ringlight("completions").arg(shell).assert().success().stdout(contains("element-size"));
    }
}

#[test]
fn values_that_make_no_sense_are_usage_errors_and_nothing_is_written() {
    let workshop = Workshop::new();
    let before = workshop.files();
    for bad in [
        "-o a.ringlight --element-size 0",
        "-o a.ringlight --patch-size nan",
        "-o a.ringlight --until -1",
        "-o a.ringlight --cells 32",
        "-o a.ringlight --time-limit inf",
        "-o a.ringlight --threads 0",
        "-o a.ringlight --sky 1,2",
        "-o a.ringlight --size 10",
        "-o a.ringlight --camera 1,2,3;4",
        "-o a.ringlight --camera desk",
        "-o a.ringlight --solver best",
        "-o a.ringlight --solver plain --error 0.01 --cells 16",
        "-o a.ringlight --error 0",
        "-o a.ringlight --quiet --verbose",
        "-o a.ringlight -o a.ringlight",
        "-o a.ringlight --report a.ringlight",
        "-o a.ringlight --checkpoint box.obj --force",
        "-o a.unknown",
        "",
    ] {
        workshop.ringlight("bake box.obj").args(bad.split_whitespace()).assert().code(2).stderr(contains("error:"));
    }
    workshop.ringlight("bake box.obj -o a.unknown").assert().stderr(contains(".glb").and(contains(".exr")));
    workshop.ringlight("render a.ringlight -o a.csv").assert().code(2).stderr(contains(".png"));
    assert_eq!(workshop.files(), before);
}

/// What scripts may rely on, each in its shortest form; of what is still missing, the refusal names it.
#[test]
fn every_flag_of_bake_works_or_is_refused_by_its_name() {
    let workshop = Workshop::new();
    let bake = |flags: &str| {
        let quick = "bake box.obj -o a.ringlight -o a.png --size 16x9 --patch-size 1 --element-size 0.5 --force";
        workshop.ringlight(quick).args(flags.split_whitespace()).assert()
    };
    for flags in [
        "--solver plain --until 0.5 --max-shots 2 --cells 1 --shoot average --unit cm --sky 2",
        "--quality draft --time-limit 60 --cells 64 --shoot elements --max-shots 2 --unit m --sky 1,2,3 --ambient",
        "--quality draft --threads 2 --ranks 2 --rings auto --memory-per-rank 2GiB --packet-size 9 --shards random",
        "--quality draft --ranks 3 --rings 2 --shooters-in-flight 2 --routing all --shards spatial",
        "--quality draft --checkpoint c.ringlight@5 --report r.json --progress plain --exposure 3 -v",
        "--quality draft --camera 1,1,1.8;1,1,0;80 --exposure auto --tone none --progress none",
        "--quality draft --tone filmic --false-colour lux --progress json --quiet",
        "--quality draft --split tiles --ranks 2",
        "--quality draft --split scanlines --ranks 3",
        "--solver group --sky 1 --cells 16",
        "--error 0.1 --threads 2 --ranks 3 --rings 2",
        "--quality draft --view --view-every 3",
        "--quality draft --view=localhost:0",
        "--quality draft --view=0 --ranks 2",
    ] {
        bake(flags).code(0);
    }
    for (flags, named) in [
        ("--solver best", "--solver"),
        ("--solver plain --error 0.01 --cells 16", "--cells"),
        ("--solver group --until 0.1", "--until"),
        ("--solver group --max-shots 3", "--max-shots"),
        ("--solver group --cells 4", "--cells"),
        ("--solver group --cells 4 --sky 1 --shoot average", "--shoot"),
        ("--error 0.1 --shooters-in-flight 2", "--shooters-in-flight"),
        ("--split rows", "--split"),
        ("--view=:80", "--view"),
        ("--view=a:b", "--view"),
    ] {
        bake(flags).code(2).stderr(contains("error:").and(contains(named)));
    }
}

#[test]
fn files_that_are_there_are_not_overwritten_without_force() {
    let workshop = Workshop::new();
    workshop.put("a.ringlight", "precious");
    workshop.put("a.json", "precious");
    workshop
        .bake("-o a.ringlight --max-shots 1")
        .assert()
        .code(1)
        .stderr(contains("a.ringlight").and(contains("--force")));
    workshop.bake("-o b.ringlight --report a.json --max-shots 1").assert().code(1).stderr(contains("a.json"));
    workshop.bake("-o b.ringlight --checkpoint a.ringlight --max-shots 1").assert().code(1);
    assert_eq!(workshop.bytes("a.ringlight"), b"precious");
    assert!(!workshop.path("b.ringlight").exists());
    workshop.bake("-o a.ringlight --report a.json --max-shots 1 --force").assert().code(0);
    assert_ne!(workshop.bytes("a.ringlight"), b"precious");
    assert_eq!(workshop.json("a.json")["schema"], "ringlight-report-1");
}

#[test]
fn folders_that_take_no_files_are_refused_before_solving() {
    let workshop = Workshop::new();
    let before = workshop.files();
    workshop.bake("-o nowhere/a.ringlight").assert().code(1).stderr(contains("nowhere"));
    workshop.bake("-o box.mtl/a.ringlight").assert().code(1).stderr(contains("box.mtl"));
    workshop.bake("-o a.ringlight --report nowhere/a.json").assert().code(1).stderr(contains("nowhere"));
    assert_eq!(workshop.files(), before);
}

#[test]
fn a_file_that_cannot_be_read_is_an_error_with_its_name() {
    let workshop = Workshop::new();
    workshop.ringlight("bake none.glb -o a.ringlight").assert().code(1).stderr(contains("none.glb"));
    workshop.ringlight("bake . -o a.ringlight").assert().code(1).stderr(contains("folder"));
    workshop.ringlight("resume none.ringlight -o a.ringlight").assert().code(1).stderr(contains("none.ringlight"));
}

#[test]
fn a_scene_without_light_is_told_how_to_get_one_and_a_sky_is_enough() {
    let workshop = Workshop::new();
    workshop.put("dark.obj", "v 0 0 0\nv 1 0 0\nv 0 0 -1\nf 1 2 3\n");
    let advice =
        contains("emissiveFactor").and(contains("KHR_lights_punctual")).and(contains("Ke")).and(contains("--sky"));
    workshop.ringlight("bake dark.obj -o a.ringlight").assert().code(3).stderr(advice);
    workshop.ringlight("inspect dark.obj").assert().code(0).stdout(contains("--sky"));
    workshop.ringlight("bake dark.obj -o a.ringlight --sky 3 --element-size 0.5").assert().code(0);
}

#[test]
fn broken_scenes_are_refused_with_file_and_line() {
    let workshop = Workshop::new();
    for (content, place) in [
        ("v 0 0\nf 1 1 1\n", "line 1"),
        ("v nan 0 0\n", "line 1"),
        ("v 0 0 0\nv 1 0 0\nf 1 2 7\n", "line 3"),
        ("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 99999999999999999999\n", "line 4"),
        ("# nothing\n", "bad.obj"),
        ("v 0 0 0\nf 1 1 1\n", "bad.obj"),
        ("", "bad.obj"),
    ] {
        workshop.put("bad.obj", content);
        workshop
            .ringlight("bake bad.obj --sky 1 -o a.ringlight")
            .assert()
            .code(3)
            .stderr(contains("error: bad.obj").and(contains(place)));
    }
    workshop.put("bad.txt", "text");
    workshop.ringlight("bake bad.txt -o a.ringlight").assert().code(3).stderr(contains("bad.txt"));
    assert!(!workshop.path("a.ringlight").exists());
}

#[test]
fn warnings_are_said_once_and_reported() {
    let workshop = Workshop::new();
    workshop.put("box.mtl", "newmtl lamp\nKe 1 1 1\nmap_Kd none.png\n");
    let said = workshop.bake("-o a.ringlight --report a.json --max-shots 1").assert().code(0);
    let text = String::from_utf8(said.get_output().stderr.clone()).unwrap();
    assert_eq!(text.matches("none.png").count(), 1, "{text}");
    assert!(text.contains("box.mtl: line 3"), "{text}");
    let report = workshop.json("a.json");
    let codes: Vec<_> = report["warnings"].as_array().unwrap().iter().map(|w| w["code"].as_str().unwrap()).collect();
    assert!(codes.contains(&"missing-texture") && codes.contains(&"missing-material"), "{codes:?}");
    workshop.bake("-o a.ringlight --force --quiet --max-shots 1").assert().code(0).stderr("");
}

#[test]
fn progress_as_json_is_one_object_a_line() {
    let workshop = Workshop::new();
    let run = workshop.bake("-o a.ringlight --progress json --quiet --until 0.05").assert().code(0);
    let text = String::from_utf8(run.get_output().stderr.clone()).unwrap();
    let lines: Vec<serde_json::Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let stages: Vec<_> = lines.iter().map(|line| line["stage"].as_str().unwrap()).collect();
    for stage in ["load", "mesh", "build", "solve", "write"] {
        assert!(stages.contains(&stage), "{stages:?}");
    }
    for key in ["shots", "unshot_share", "rays", "rays_per_second", "seconds"] {
        assert!(lines.iter().all(|line| line[key].is_number()), "{key}");
    }
    assert!(lines.iter().all(|line| line.get("time_left").is_some()));
    assert!(lines.last().unwrap()["unshot_share"].as_f64().unwrap() <= 0.05);
}

#[test]
fn the_report_holds_what_scripts_rely_on() {
    let workshop = Workshop::new();
    workshop.bake("-o a.ringlight --report a.json --until 0.02").assert().code(0);
    let report = workshop.json("a.json");
    for key in ["schema", "version", "command", "units", "warnings", "settings", "clipped", "peak_memory_bytes"] {
        assert!(!report[key].is_null(), "{key}");
    }
    for (part, keys) in [
        ("scene", "triangles patches elements objects lights skipped"),
        ("solve", "shots rays masks masks_without_rays rays_saved unshot_share stop_reason"),
        ("seconds", "load mesh build solve write total"),
        ("energy", "emitted absorbed absorbed_by_backs escaped unshot closure_error"),
    ] {
        assert!(keys.split(' ').all(|key| !report[part][key].is_null()), "{part}");
    }
    let keys = "rank ring patches elements shard_triangles busy_seconds wait_seconds bytes_sent packets_visited \
                peak_memory_bytes";
    assert!(keys.split_whitespace().all(|key| report["ranks"][0][key].is_number()));
    assert_eq!(report["scene"]["triangles"], 16);
    assert_eq!(report["scene"]["objects"], 3);
    assert_eq!(report["solve"]["stop_reason"], "converged");
    assert_eq!(report["solution_digest"].as_str().unwrap().len(), 64);
    // A closed room loses no light.
    assert_eq!(report["energy"]["escaped"], 0.0);
}

#[test]
fn inspecting_tells_the_same_counts_as_baking() {
    let workshop = Workshop::new();
    let inspection = workshop.inspect("--solver plain --patch-size 1 --element-size 0.25 --cells 4");
    workshop.bake("-o a.ringlight --report a.json --until 0.01").assert().code(0);
    let report = workshop.json("a.json");
    assert_eq!(inspection["scene"], report["scene"]);
    let (foretold, shots) =
        (inspection["forecast"]["shots"].as_f64().unwrap(), report["solve"]["shots"].as_f64().unwrap());
    assert!(foretold > shots / 4.0 && foretold < shots * 4.0, "foretold {foretold}, shot {shots}");
    workshop
        .ringlight("inspect box.obj --quality draft --solver plain")
        .assert()
        .code(0)
        .stdout(contains("patches").and(contains("shots")).and(contains("measured")));
}

#[test]
fn lit_models_are_written_by_ending() {
    let workshop = Workshop::new();
    workshop.bake("-o a.glb -o b.gltf --report a.json --max-shots 30").assert().code(0);
    assert!(workshop.bytes("a.glb").starts_with(b"glTF"));
    let model = workshop.json("b.gltf");
    assert_eq!(model["buffers"][0]["uri"], "b.bin");
    assert_eq!(model["buffers"][0]["byteLength"], workshop.bytes("b.bin").len());
    assert!(workshop.json("a.json")["clipped"].is_number());
    // The file beside a .gltf is one of ours, too.
    std::fs::remove_file(workshop.path("b.gltf")).unwrap();
    workshop.bake("-o b.gltf --max-shots 30").assert().code(1).stderr(contains("b.bin"));
}

#[test]
fn every_output_is_written_and_written_again_from_the_solution() {
    let workshop = Workshop::new();
    let display = "--size 64x36 --camera 1,1,1.8;1,1,0;80 --exposure 1";
    let outputs = |name: &str| {
        let endings = ["glb", "gltf", "bin", "csv", "vtu", "png", "exr"];
        endings.map(|ending| workshop.bytes(&format!("{name}.{ending}")))
    };
    let all =
        |name: &str| ["glb", "gltf", "csv", "vtu", "png", "exr"].map(|ending| format!("-o {name}.{ending}")).join(" ");
    workshop.bake(&format!("-o a.ringlight {} {display} --max-shots 40", all("a"))).assert().code(0);
    workshop.ringlight(&format!("export a.ringlight {} {display}", all("b"))).assert().code(0);
    for (a, b) in outputs("a").iter().zip(&outputs("b")).filter(|(a, _)| !a.starts_with(b"{")) {
        assert!(!a.is_empty() && a == b);
    }
    workshop.ringlight(&format!("render a.ringlight -o c.png {display}")).assert().code(0);
    assert!(workshop.bytes("a.png") == workshop.bytes("c.png"));
    workshop.ringlight("render a.ringlight -o d.png --size 32x32 --false-colour lux --ambient").assert().code(0);
    workshop.ringlight("render a.ringlight -o e.png --camera desk").assert().code(2).stderr(contains("desk"));
    let table = String::from_utf8(workshop.bytes("a.csv")).unwrap();
    assert!(table.starts_with("element,patch,object,x,y,z,nx,ny,nz,area,e_r,e_g,e_b,b_r,b_g,b_b,e,valid,level"));
}
