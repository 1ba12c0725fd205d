//! The command over real MPI processes: `mpirun`, or the launcher that `MPIRUN` names, starts more ranks than there are cores.

#[path = "../cli/workshop.rs"]
#[allow(dead_code, reason = "the command's other tests use the rest")]
mod workshop;

#[cfg(unix)]
#[path = "../cli/watcher.rs"]
#[allow(dead_code, reason = "the command's other tests use the rest")]
mod watcher;

#[cfg(target_os = "linux")]
mod memory;
#[cfg(target_os = "linux")]
mod view;

use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};
use workshop::{COARSE, ENDLESS, READERS, Workshop};

/// Longest run of the command, with room for slow machines.
const LIMIT: Duration = Duration::from_secs(120);

/// Starts `ringlight` on so many ranks in the workshop's folder.
fn start(workshop: &Workshop, ranks: usize, arguments: &str) -> Child {
    let mut command = Command::new(std::env::var_os("MPIRUN").unwrap_or_else(|| "mpirun".into()));
    // Open MPI refuses root and more ranks than cores unless it is told otherwise; other implementations ignore this.
    command
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
        .env("OMPI_MCA_rmaps_base_oversubscribe", "1")
        .env("OMPI_MCA_mpi_yield_when_idle", "1");
    command
        .args(["-n", &ranks.to_string(), env!("CARGO_BIN_EXE_ringlight")])
        .args(arguments.split_whitespace())
        .current_dir(workshop.path(""))
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command.spawn().expect("the launcher can be started")
}

/// Waits for the end, which comes within `limit`. The output is short enough for the pipes to hold it.
fn end(mut child: Child, limit: Duration) -> Output {
    let start = Instant::now();
    while child.try_wait().expect("it can be waited for").is_none() {
        if start.elapsed() > limit {
            child.kill().ok();
            panic!("it did not end within {limit:?}");
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    child.wait_with_output().expect("the output can be read")
}

fn run(workshop: &Workshop, ranks: usize, arguments: &str) -> (Option<i32>, String) {
    let output = end(start(workshop, ranks, arguments), LIMIT);
    (output.status.code(), words(&output))
}

fn words(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

fn bake(arguments: &str) -> String {
    format!("bake box.obj {} {arguments}", COARSE.join(" "))
}

/// The same with sizes at which it goes on for long.
fn bake_endlessly(arguments: &str) -> String {
    format!("bake box.obj --until 0 {} {arguments}", ENDLESS.join(" "))
}

#[test]
fn the_solution_does_not_depend_on_ranks_and_rings() {
    let workshop = Workshop::new();
    workshop.bake("-o one.ringlight --until 0.05 --report one.json").assert().code(0);
    for (ranks, way) in [
        (1, ""),
        (2, ""),
        (2, "--rings 1 --packet-size 1 --routing all --threads 1"),
        (3, "--rings 2"),
        (3, "--rings 1 --packet-size 4096 --shards random --threads 2"),
        (4, "--rings 1 --shards random --routing all"),
        (4, "--rings 2 --packet-size 7"),
        (4, "--rings 3"),
        (6, "--rings 1 --threads 1"),
        (6, "--rings 4 --packet-size 200 --routing all"),
    ] {
        let (code, words) =
            run(&workshop, ranks, &bake(&format!("-o many.ringlight --until 0.05 --report many.json --force {way}")));
        assert_eq!(code, Some(0), "{ranks} ranks {way}: {words}");
        assert_eq!(
            workshop.json("many.json")["solution_digest"],
            workshop.json("one.json")["solution_digest"],
            "{way}"
        );
        assert_eq!(workshop.json("many.json")["ranks"].as_array().unwrap().len(), ranks);
        assert!(workshop.bytes("many.ringlight") == workshop.bytes("one.ringlight"), "{ranks} ranks {way}");
        assert_eq!(words.matches("converged").count(), 1, "{words}");
    }
}

#[test]
fn what_is_read_does_not_depend_on_ranks() {
    let workshop = Workshop::new();
    workshop.prepare_readers();
    for (verb, outputs) in READERS {
        workshop.ringlight(&format!("{verb} {} --force", Workshop::named(outputs, "one"))).assert().code(0);
        for ranks in [2, 3] {
            let (code, words) = run(&workshop, ranks, &format!("{verb} {} --force", Workshop::named(outputs, "many")));
            assert_eq!(code, Some(0), "{verb} on {ranks} ranks: {words}");
            for output in outputs {
                let same = workshop.bytes(&format!("one.{output}")) == workshop.bytes(&format!("many.{output}"));
                assert!(same, "{verb} on {ranks} ranks: {output}");
            }
        }
    }
}

#[test]
fn pictures_are_the_same_however_they_are_divided() {
    let workshop = Workshop::new();
    workshop.prepare_readers();
    workshop.ringlight("render part.ringlight --size 64x40 -o one.png -o one.exr").assert().code(0);
    for way in ["--split tiles --rings 1", "--split tiles --rings 3", "--split scanlines --rings 2"] {
        let render = "render part.ringlight --size 64x40 -o many.png -o many.exr --report many.json --force";
        let (code, words) = run(&workshop, 3, &format!("{render} {way}"));
        assert_eq!(code, Some(0), "{way}: {words}");
        for ending in ["png", "exr"] {
            let same = workshop.bytes(&format!("one.{ending}")) == workshop.bytes(&format!("many.{ending}"));
            assert!(same, "{way}: {ending}");
        }
        let report = workshop.json("many.json");
        let loads = report["picture"]["ranks"].as_array().unwrap();
        let pixels: Vec<u64> = loads.iter().map(|load| load["pixels"].as_u64().unwrap()).collect();
        assert_eq!((pixels.len(), pixels.iter().sum::<u64>()), (3, 64 * 40), "{way}");
    }
}

#[test]
fn errors_are_said_once_and_decide_the_exit_code() {
    let workshop = Workshop::new();
    workshop.put("bad.obj", "v 0 0\n");
    for (arguments, code) in [
        (bake("-o a.unknown"), 2),
        (bake("-o a.ringlight --rings 4"), 2),
        (bake("-o a.ringlight --ranks 2"), 2),
        ("inspect box.obj".into(), 2),
        ("bake bad.obj -o a.ringlight".into(), 3),
        ("bake none.obj -o a.ringlight".into(), 1),
        (bake("-o nowhere/a.ringlight"), 1),
        (bake("-o a.ringlight --memory-per-rank 1MiB"), 1),
    ] {
        let (found, words) = run(&workshop, 3, &arguments);
        assert_eq!(found, Some(code), "{arguments}: {words}");
        assert_eq!(words.matches("error:").count(), 1, "{arguments}: {words}");
    }
    assert_eq!(workshop.files(), ["bad.obj", "box.mtl", "box.obj"]);
}

#[test]
fn a_time_limit_stops_all_ranks_after_the_same_shot() {
    let workshop = Workshop::new();
    let (code, words) = run(&workshop, 3, &bake_endlessly("-o a.ringlight --time-limit 1 --report a.json"));
    assert_eq!(code, Some(4), "{words}");
    let shots = workshop.json("a.json")["solve"]["shots"].as_u64().unwrap();
    workshop.bake_endlessly(&format!("-o b.ringlight --max-shots {shots}")).assert().code(0);
    assert!(workshop.bytes("a.ringlight") == workshop.bytes("b.ringlight"));
}

/// The process of a rank that `mpirun` has started.
#[cfg(target_os = "linux")]
fn process_of(launcher: &Child, rank: usize) -> u32 {
    let entries = std::fs::read_dir("/proc").unwrap().flatten();
    let processes = entries.filter_map(|entry| entry.file_name().into_string().ok()?.parse::<u32>().ok());
    let read = |process: u32, file: &str| {
        let bytes = std::fs::read(format!("/proc/{process}/{file}")).unwrap_or_default();
        String::from_utf8_lossy(&bytes).into_owned()
    };
    let parent = |process: u32| -> Option<u32> {
        read(process, "status").lines().find_map(|line| line.strip_prefix("PPid:\t"))?.parse().ok()
    };
    let is_rank = |&process: &u32| {
        // Some launchers have a helper between themselves and the ranks.
        let parents = [parent(process), parent(process).and_then(parent)];
        let told = ["PMIX_RANK", "PMI_RANK"].map(|name| format!("{name}={rank}"));
        parents.contains(&Some(launcher.id()))
            && read(process, "environ").split('\0').any(|variable| told.iter().any(|told| told == variable))
    };
    processes.into_iter().find(is_rank).expect("the launcher has started the rank")
}

#[cfg(target_os = "linux")]
fn send(signal: &str, process: u32) {
    assert!(Command::new("kill").args([signal, &process.to_string()]).status().unwrap().success());
}

/// Starts an endless run on three ranks, and waits until it has left a checkpoint.
#[cfg(target_os = "linux")]
fn start_endless(workshop: &Workshop) -> Child {
    let child = start(workshop, 3, &bake_endlessly("-o a.ringlight --rings 1 --checkpoint part.ringlight@0"));
    let start = Instant::now();
    while !workshop.path("part.ringlight").exists() {
        assert!(start.elapsed() < LIMIT, "no checkpoint within {LIMIT:?}");
        std::thread::sleep(Duration::from_millis(20));
    }
    std::thread::sleep(Duration::from_millis(500));
    child
}

/// Resumes on another number of ranks, and compares with a run that was never stopped.
#[cfg(target_os = "linux")]
fn assert_goes_on_exactly(workshop: &Workshop, part: &str) {
    workshop.ringlight(&format!("resume {part} -o look.ringlight --max-shots 0 --report look.json")).assert().code(0);
    let shots = workshop.json("look.json")["solve"]["shots"].as_u64().unwrap() + 25;
    let resume = format!("resume {part} -o resumed.ringlight --until 0 --max-shots {shots}");
    let (code, words) = run(workshop, 2, &resume);
    assert_eq!(code, Some(0), "{words}");
    workshop.bake_endlessly(&format!("-o whole.ringlight --max-shots {shots}")).assert().code(0);
    assert!(workshop.bytes("resumed.ringlight") == workshop.bytes("whole.ringlight"));
}

#[cfg(target_os = "linux")]
#[test]
fn when_one_rank_is_killed_all_end_and_the_checkpoint_goes_on_with_another_number() {
    for rank in [1, 0] {
        let workshop = Workshop::new();
        let child = start_endless(&workshop);
        send("-KILL", process_of(&child, rank));
        let output = end(child, Duration::from_secs(10));
        assert!(!output.status.success());
        // MPICH's launcher ends the others at once, before any of them can say a word, and may then name any of them.
        let words = words(&output).to_lowercase();
        let by_mpich = words.contains("bad termination of one of your application processes");
        assert!(by_mpich || words.contains(&format!("rank {rank}")), "{words}");
        assert!(!workshop.path("a.ringlight").exists());
        assert_goes_on_exactly(&workshop, "part.ringlight");
    }
}

/// As batch systems do when the time is over: a signal to any rank stops all of them after the same shot.
#[cfg(target_os = "linux")]
#[test]
fn a_signal_to_one_rank_stops_all_with_valid_output() {
    for (rank, signal, code) in [(2, "-TERM", 143), (0, "-INT", 130)] {
        let workshop = Workshop::new();
        let child = start_endless(&workshop);
        send(signal, process_of(&child, rank));
        let output = end(child, LIMIT);
        assert_eq!(output.status.code(), Some(code), "{}", words(&output));
        assert!(workshop.bytes("a.ringlight") == workshop.bytes("part.ringlight"));
        assert_goes_on_exactly(&workshop, "a.ringlight");
    }
}
