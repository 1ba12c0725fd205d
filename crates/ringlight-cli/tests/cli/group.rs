//! Group shooting, the default: what chooses it, how it is stopped and goes on, what is foretold of it.

#[cfg(unix)]
use crate::watcher::{self, Watcher};
use crate::workshop::Workshop;
use predicates::prelude::*;
use predicates::str::contains;
use serde_json::json;

/// The box at sizes that are solved in a blink.
const BAKE: &str = "bake box.obj --patch-size 1 --element-size 0.25 --force";

/// The same finely enough to be stopped on its way.
const LONG: &str = "bake box.obj --patch-size 0.5 --element-size 0.1 --error 0.002 --threads 1 --force";

#[test]
fn it_is_the_default_and_what_is_for_plain_refinement_alone_chooses_that() {
    let workshop = Workshop::new();
    for (flags, solver, error, until) in [
        ("", "group", Some(0.01), None),
        ("--error 0.1", "group", Some(0.1), None),
        ("--quality draft --sky 1", "group", Some(0.01), None),
        ("--solver plain", "plain", None, Some(0.01)),
        ("--solver plain --error 0.05", "plain", Some(0.05), Some(0.01)),
        ("--until 0.5", "plain", None, Some(0.5)),
        ("--max-shots 3", "plain", None, Some(0.01)),
        ("--shooters-in-flight 2", "plain", None, Some(0.01)),
        ("--shoot average", "plain", None, Some(0.01)),
        ("--cells 4", "plain", None, Some(0.01)),
    ] {
        workshop.ringlight(&format!("{BAKE} -o a.ringlight --report a.json {flags}")).assert().code(0);
        let report = workshop.json("a.json");
        let settings = &report["settings"];
        assert_eq!(settings["solver"], solver, "{flags}");
        assert_eq!((settings["error"].as_f64(), settings["until"].as_f64()), (error, until), "{flags}");
        if solver == "group" {
            // No lamp but surfaces, which do not shoot one by one; a sky shoots in parts.
            assert_eq!(report["solve"]["shots"].as_u64() > Some(0), flags.contains("--sky"), "{flags}");
            assert_eq!(
                (&report["solve"]["unshot_share"], &report["solve"]["stop_reason"]),
                (&0.0.into(), &"converged".into())
            );
            assert!(report["energy"]["closure_error"].as_f64().unwrap().abs() < 0.05, "{flags}");
        }
    }
}

/// Cutting elements where light changes much gives more of them there, and the same ones wherever it runs, with either solver.
#[test]
fn adaptive_elements_do_not_depend_on_where_they_are_found() {
    let workshop = Workshop::new();
    for solver in ["--error 0.05", "--max-shots 5", "--error 0.05 --lines 1"] {
        let bake = format!("{BAKE} {solver} --adapt 2");
        workshop.ringlight(&format!("{bake} -o one.ringlight --threads 1 --report one.json")).assert().code(0);
        for way in ["--threads 2", "--ranks 3 --rings 2", "--ranks 4 --rings 1 --packet-size 7 --shards random"] {
            workshop.ringlight(&format!("{bake} -o many.ringlight {way}")).assert().code(0);
            assert!(workshop.bytes("many.ringlight") == workshop.bytes("one.ringlight"), "{solver} {way}");
        }
        workshop.ringlight(&format!("{BAKE} {solver} -o even.ringlight --report even.json")).assert().code(0);
        let [adapted, even] = ["one.json", "even.json"].map(|report| workshop.json(report));
        assert_eq!([&adapted["settings"]["adapt"], &even["settings"]["adapt"]], [2, 0]);
        let elements = |report: &serde_json::Value| report["scene"]["elements"].as_u64().unwrap();
        assert!(elements(&adapted) > elements(&even) && elements(&adapted) < 81 * elements(&even));
    }
    workshop.ringlight(&format!("{BAKE} -o a.ringlight --adapt 6")).assert().code(2);
}

/// Faces are cut where blocks stand on them; who does not ask for it gets them whole.
#[test]
fn faces_are_cut_where_light_breaks_if_asked_for() {
    let workshop = Workshop::new();
    let facets = |flags: &str| {
        workshop.ringlight(&format!("{BAKE} -o a.ringlight --report a.json {flags}")).assert().code(0);
        let report = workshop.json("a.json");
        (report["settings"]["lines"].as_u64().unwrap(), report["scene"]["elements"].as_u64().unwrap())
    };
    let [whole, none, cut] = ["", "--lines 0", "--lines 1"].map(facets);
    assert_eq!((whole, cut.0), (none, 1));
    assert!(cut.1 > whole.1 && cut.1 < 3 * whole.1, "{whole:?} {cut:?}");
    workshop.ringlight(&format!("{BAKE} -o a.ringlight --lines some")).assert().code(2);
}

/// Two rooms, of which one is lit and has a table: elements become small there alone.
fn half_lit() -> Workshop {
    let workshop = Workshop::new();
    workshop.put("half.mtl", "newmtl grey\nKd 0.5 0.5 0.5\nnewmtl lamp\nKe 20 20 20\n");
    let corners = |[a, b, c]: [f64; 3], [d, e, f]: [f64; 3]| {
        let corners = [[a, b, c], [d, b, c], [d, b, f], [a, b, f], [a, e, c], [d, e, c], [d, e, f], [a, e, f]];
        corners.iter().map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect::<String>()
    };
    let mut obj = String::from("mtllib half.mtl\n");
    for x in [0.0, 4.0] {
        obj += &corners([x, 0.0, 0.0], [x + 4.0, 3.0, 4.0]);
        obj +=
            "usemtl grey\nf -8 -7 -6 -5\nf -4 -3 -2 -1\nf -8 -7 -3 -4\nf -6 -5 -1 -2\nf -7 -6 -2 -3\nf -5 -8 -4 -1\n";
    }
    obj += &(corners([1.0, 1.0, 2.2], [2.5, 2.9, 3.0]) + "f -8 -7 -6 -5\nusemtl lamp\nf -4 -3 -2 -1\n");
    workshop.put("half.obj", obj);
    workshop
}

const HALF_LIT: &str = "half.obj --element-size 0.2 --patch-size 0.4 --error 0.02";

/// Elements of each rank.
fn of_ranks(report: &serde_json::Value) -> Vec<f64> {
    report["ranks"].as_array().unwrap().iter().map(|rank| rank["elements"].as_f64().unwrap()).collect()
}

#[test]
fn adaptive_elements_of_a_half_lit_scene_are_dealt_out_anew_by_load_and_by_memory() {
    let workshop = half_lit();
    let bake = |more: &str| {
        let bake = format!("bake {HALF_LIT} --adapt 2 --ranks 4 -o half.ringlight --force --report half.json {more}");
        workshop.ringlight(&bake).assert().code(0);
        (workshop.json("half.json"), workshop.bytes("half.ringlight"))
    };
    let (report, solution) = bake("");
    let (even, all) = (of_ranks(&report), report["scene"]["elements"].as_f64().unwrap());
    assert_eq!((even.len(), even.iter().sum::<f64>()), (4, all));
    assert!(all > 10_000.0 && even.iter().all(|&most| most <= 1.1 * all / 4.0), "{even:?}");
    // Of what one of four owns, a third is too much for the second.
    let (report, same) = bake("--rings 4 --memory-per-rank 1GiB,14MiB,1GiB,1GiB");
    let uneven = of_ranks(&report);
    println!("{even:?}, {uneven:?}");
    assert!(same == solution && uneven.iter().sum::<f64>() == all);
    assert!(uneven[1] < 0.8 * all / 4.0 && [0, 2, 3].iter().all(|&r| uneven[r] <= 1.1 * (all - uneven[1]) / 3.0));
}

#[test]
fn where_smaller_elements_do_not_fit_they_stay_as_they_are() {
    let workshop = half_lit();
    workshop.ringlight(&format!("bake {HALF_LIT} -o even.ringlight")).assert().code(0);
    let inspection = workshop.ringlight(&format!("inspect {HALF_LIT} --rays-per-second 1e6 --json")).assert().code(0);
    let inspection: serde_json::Value = serde_json::from_slice(&inspection.get_output().stdout).unwrap();
    let memory = inspection["memory_per_rank"].as_array().unwrap();
    let two = memory.iter().find(|memory| memory["ranks"] == 2 && memory["rings"] == 2).unwrap();
    let enough = 1.01 * two["bytes"].as_f64().unwrap();
    let bake = format!("bake {HALF_LIT} --adapt 2 --ranks 2 --rings 2 --memory-per-rank {enough}B -o same.ringlight");
    let told = contains("elements do not become smaller").and(contains("each rank needs about"));
    workshop.ringlight(&format!("{bake} --report same.json")).assert().code(4).stderr(told);
    assert!(workshop.bytes("same.ringlight") == workshop.bytes("even.ringlight"));
    let report = workshop.json("same.json");
    assert_eq!([&report["solve"]["stop_reason"], &report["settings"]["adapt"]], [&json!("memory"), &json!(0)]);
}

#[test]
fn the_solution_does_not_depend_on_where_it_runs_or_who_watches() {
    let workshop = Workshop::new();
    workshop.ringlight(&format!("{BAKE} -o one.ringlight --threads 1")).assert().code(0);
    for way in [
        "--threads 2",
        "--ranks 3 --rings 2",
        "--ranks 3 --rings 1 --packet-size 7 --shards random --routing all",
        "--view --view-every 1",
    ] {
        workshop.ringlight(&format!("{BAKE} -o many.ringlight {way}")).assert().code(0);
        assert!(workshop.bytes("many.ringlight") == workshop.bytes("one.ringlight"), "{way}");
    }
}

#[test]
fn what_a_time_limit_stopped_goes_on_to_the_same_light() {
    let workshop = Workshop::new();
    workshop.ringlight(&format!("{LONG} -o whole.ringlight --report whole.json")).assert().code(0);
    let stopped = workshop.ringlight(&format!("{LONG} -o a.ringlight --report a.json --time-limit 0.3")).assert();
    stopped.code(4).stderr(contains("stopped by --time-limit").and(contains("% done")));
    assert_eq!(workshop.json("a.json")["solve"]["stop_reason"], "time-limit");
    workshop.ringlight("export a.ringlight -o a.csv").assert().code(0);
    workshop.ringlight("resume a.ringlight -o b.ringlight --time-limit 0.3").assert().code(4);
    workshop.ringlight("resume b.ringlight -o c.ringlight --ranks 2 --report c.json").assert().code(0);
    let [whole, resumed] = ["whole.json", "c.json"].map(|name| workshop.json(name));
    assert_eq!(resumed["settings"]["solver"], "group");
    assert_eq!(resumed["settings"]["error"], 0.002);
    assert_eq!(resumed["solution_digest"], whole["solution_digest"]);
    assert!(workshop.bytes("c.ringlight") == workshop.bytes("whole.ringlight"));
}

#[cfg(unix)]
#[test]
fn a_killed_run_goes_on_from_its_checkpoint() {
    let workshop = Workshop::new();
    workshop.ringlight(&format!("{LONG} -o whole.ringlight")).assert().code(0);
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_ringlight"));
    let bake = format!("{LONG} -o a.ringlight --checkpoint part.ringlight@0 --progress none");
    let mut child = command.current_dir(workshop.path("")).args(bake.split_whitespace()).spawn().unwrap();
    let start = std::time::Instant::now();
    while !workshop.path("part.ringlight").exists() {
        assert!(start.elapsed().as_secs() < 30, "no checkpoint within half a minute");
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(!workshop.path("a.ringlight").exists());
    workshop.ringlight("resume part.ringlight -o b.ringlight").assert().code(0);
    assert!(workshop.bytes("b.ringlight") == workshop.bytes("whole.ringlight"));
}

#[cfg(unix)]
#[test]
fn watchers_see_the_light_of_the_first_round_and_may_stop_the_second() {
    let workshop = Workshop::new();
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_ringlight"));
    let bake = format!("{LONG} -o a.ringlight --view --ranks 2");
    command.current_dir(workshop.path("")).args(bake.split_whitespace()).stderr(std::process::Stdio::piped());
    let mut child = command.spawn().unwrap();
    let (address, said) = watcher::address(&mut child);
    let mut watcher = Watcher::open(&address);
    while watcher.status["unshot_share"] != 0.0 || watcher.light == 0 {
        assert!(watcher.round(), "the server has ended before the first round: {}", watcher.status);
    }
    assert_eq!(watcher.status["phase"], "solve");
    watcher.say("stop");
    watcher.watch_to_the_end();
    assert_eq!(child.wait().unwrap().code(), Some(4), "{}", said());
    workshop.ringlight("resume a.ringlight -o b.ringlight").assert().code(0);
    workshop.ringlight(&format!("{LONG} -o whole.ringlight")).assert().code(0);
    assert!(workshop.bytes("b.ringlight") == workshop.bytes("whole.ringlight"));
}

#[test]
fn a_solution_goes_on_by_the_method_that_began_it() {
    let workshop = Workshop::new();
    workshop.ringlight(&format!("{BAKE} -o group.ringlight")).assert().code(0);
    workshop.ringlight("resume group.ringlight -o again.ringlight").assert().code(0);
    assert!(workshop.bytes("again.ringlight") == workshop.bytes("group.ringlight"));
    for flags in ["--until 0.001", "--max-shots 9"] {
        let refusal = contains("group.ringlight").and(contains("--solver plain")).and(contains(&flags[..6]));
        workshop.ringlight(&format!("resume group.ringlight -o b.ringlight {flags}")).assert().code(2).stderr(refusal);
    }
    assert!(!workshop.path("b.ringlight").exists());
    workshop.bake("-o plain.ringlight --max-shots 5").assert().code(0);
    workshop.ringlight("resume plain.ringlight -o c.ringlight --report c.json").assert().code(0);
    let settings = &workshop.json("c.json")["settings"];
    assert_eq!((&settings["solver"], &settings["until"]), (&"plain".into(), &0.01.into()));
    workshop.bake("-o d.ringlight").assert().code(0);
    assert!(workshop.bytes("c.ringlight") == workshop.bytes("d.ringlight"));
}

#[test]
fn inspecting_foretells_rays_and_memory() {
    let workshop = Workshop::new();
    let sizes = "--patch-size 1 --element-size 0.25";
    let [group, fine, plain] =
        ["", "--error 0.001", "--solver plain"].map(|flags| workshop.inspect(&format!("{sizes} {flags}")));
    workshop.ringlight(&format!("{BAKE} -o a.ringlight --report a.json")).assert().code(0);
    let report = workshop.json("a.json");
    assert_eq!(group["scene"], report["scene"]);
    let forecast = &group["forecast"];
    assert_eq!(
        (&forecast["solver"], &forecast["error"], &forecast["until"]),
        (&"group".into(), &0.01.into(), &().into())
    );
    assert_eq!(forecast["own_elements"], report["scene"]["elements"]);
    // Masks of the lamp come on top.
    let (foretold, cast) = (forecast["rays"].as_f64().unwrap(), report["solve"]["rays"].as_f64().unwrap());
    assert!(foretold > cast / 3.0 && foretold < 2.0 * cast, "foretold {foretold}, cast {cast}");
    assert_eq!(forecast["seconds"].as_f64().unwrap(), foretold / 1e6);
    assert_eq!((&plain["forecast"]["solver"], &plain["forecast"]["until"]), (&"plain".into(), &0.01.into()));
    let memory = |of: &serde_json::Value| of["memory_bytes"].as_u64().unwrap();
    let rows = memory(&fine) - memory(&group);
    // Seventeen times as many rays make so many more entries of 8 bytes.
    let elements = report["scene"]["elements"].as_u64().unwrap();
    assert!(rows > elements * 8 * 1000 && memory(&group) > memory(&plain), "{rows}");
    let words = contains("by groups to an error of 1 %").and(contains("look about")).and(contains("measured"));
    workshop.ringlight("inspect box.obj --quality draft").assert().code(0).stdout(words);
    workshop.ringlight("inspect box.obj --error 0.1 --until 0.1").assert().code(2).stderr(contains("--until"));
}

/// Where contrast asks for more rays than usual.
#[cfg(target_os = "linux")]
#[test]
fn no_more_memory_is_taken_than_was_foretold() {
    let workshop = Workshop::new();
    let gallery = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/gallery.glb");
    let sizes = "--patch-size 0.8 --element-size 0.25";
    let mut bake = workshop.ringlight(&format!("bake -o a.ringlight --report a.json {sizes}"));
    bake.arg(&gallery).assert().code(0);
    let mut inspect = workshop.ringlight(&format!("inspect --json --rays-per-second 1e6 {sizes}"));
    let run = inspect.arg(&gallery).assert().code(0);
    let inspection: serde_json::Value = serde_json::from_slice(&run.get_output().stdout).unwrap();
    let foretold = inspection["memory_bytes"].as_f64().unwrap();
    let taken = workshop.json("a.json")["peak_memory_bytes"].as_f64().unwrap();
    println!("{taken} bytes of the {foretold} foretold");
    assert!(taken < foretold && taken > 0.5 * foretold, "{taken} bytes of the {foretold} foretold");
}
