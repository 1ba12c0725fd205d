//! Solves that are watched: nothing that watchers see or do changes the light.

use crate::watcher::{self, Watcher};
use crate::workshop::{COARSE, ENDLESS, Workshop};
use predicates::str::contains;
use std::io::Write;
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Starts a command that is watched.
fn start(workshop: &Workshop, arguments: &str, sizes: &[&str]) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ringlight"));
    command.current_dir(workshop.path("")).args(arguments.split_whitespace()).args(sizes);
    command.stderr(Stdio::piped()).spawn().unwrap()
}

fn digest(workshop: &Workshop, report: &str) -> serde_json::Value {
    workshop.json(report)["solution_digest"].clone()
}

#[test]
fn what_is_shown_changes_no_bit() {
    let workshop = Workshop::new();
    let bake = "bake box.obj --until 0.001 --force";
    for (settings, way) in [
        ("", ""),
        ("", "--view-every 1"),
        ("", "--ranks 3 --rings 1"),
        ("", "--ranks 3 --view-every 2"),
        ("--shooters-in-flight 3", "--ranks 2"),
    ] {
        let plain = format!("{bake} {settings} -o a.ringlight --report a.json");
        workshop.ringlight(&plain).args(COARSE).assert().code(0);
        let watched = format!("{bake} {settings} -o b.ringlight --report b.json --view {way}");
        let mut child = start(&workshop, &watched, &COARSE);
        let (address, said) = watcher::address(&mut child);
        let mut watcher = Watcher::open(&address);
        assert!(watcher.round());
        for word in ["pause", "resume"] {
            watcher.say(word);
        }
        watcher.watch_to_the_end();
        assert_eq!(child.wait().unwrap().code(), Some(0), "{}", said());
        assert_eq!(watcher.status["phase"], "done", "{way}");
        assert!(watcher.light > 0, "{way}");
        assert_eq!(digest(&workshop, "a.json"), digest(&workshop, "b.json"), "{way}");
        assert!(workshop.bytes("a.ringlight") == workshop.bytes("b.ringlight"), "{way}");
    }
}

#[test]
fn attacks_change_no_bit() {
    let workshop = Workshop::new();
    let mut child = start(
        &workshop,
        "bake box.obj --until 0 --max-shots 400 -o b.ringlight --report b.json --view --checkpoint c.ringlight@0",
        &ENDLESS,
    );
    let (address, said) = watcher::address(&mut child);
    let mut watcher = Watcher::open(&address);
    let mut held = Vec::new();
    for k in 0..1000 {
        let Ok(mut stream) = TcpStream::connect(&address) else { continue };
        let words =
            [&b"\xff\xfe\x00garbage\r\n\r\n"[..], b"GET /../../etc/passwd HTTP/1.1\r\n\r\n", b"GET / HT"][k % 3];
        stream.write_all(words).ok();
        held.push(stream);
        held.truncate(300);
    }
    watcher.watch_to_the_end();
    assert_eq!(child.wait().unwrap().code(), Some(0), "{}", said());
    workshop.bake_endlessly("--max-shots 400 -o a.ringlight --report a.json").assert().code(0);
    assert_eq!(digest(&workshop, "a.json"), digest(&workshop, "b.json"));
}

#[test]
fn a_pause_holds_the_solver_and_nothing_else() {
    let workshop = Workshop::new();
    let command = "bake box.obj --until 0 -o a.ringlight --report a.json --view --checkpoint part.ringlight@0.2";
    let mut child = start(&workshop, command, &ENDLESS);
    let (address, said) = watcher::address(&mut child);
    let mut watcher = Watcher::open(&address);
    watcher.wait_for_shots(3);
    watcher.say("pause");
    watcher.wait_for("pause");
    let shots = watcher.status["shots"].as_u64();
    // Checkpoints go on.
    let old = std::fs::metadata(workshop.path("part.ringlight")).unwrap().modified().unwrap();
    let start = Instant::now();
    while std::fs::metadata(workshop.path("part.ringlight")).unwrap().modified().unwrap() == old {
        assert!(start.elapsed() < Duration::from_secs(30), "no checkpoint while it waits");
        assert!(watcher.round());
    }
    assert_eq!(watcher.status["shots"].as_u64(), shots);
    watcher.say("resume");
    watcher.wait_for_shots(shots.unwrap() + 3);
    watcher.say("pause");
    watcher.wait_for("pause");
    // So do signals.
    signal(&child, "-TERM");
    watcher.watch_to_the_end();
    assert_eq!(child.wait().unwrap().code(), Some(143), "{}", said());
    assert_eq!(workshop.json("a.json")["solve"]["stop_reason"], "terminated");
    assert!(workshop.bytes("a.ringlight") == workshop.bytes("part.ringlight"));
}

#[test]
fn a_watcher_stops_all_ranks_and_what_is_there_is_saved() {
    let workshop = Workshop::new();
    for ranks in ["", "--ranks 3"] {
        let command = format!("bake box.obj --until 0 --force -o a.ringlight --report a.json --view {ranks}");
        let mut child = start(&workshop, &command, &ENDLESS);
        let (address, said) = watcher::address(&mut child);
        let mut watcher = Watcher::open(&address);
        watcher.wait_for_shots(2);
        watcher.say("pause");
        watcher.wait_for("pause");
        watcher.say("stop");
        watcher.watch_to_the_end();
        let words = said();
        assert_eq!(child.wait().unwrap().code(), Some(4), "{words}");
        assert!(words.contains("stopped from the page"), "{words}");
        let report = workshop.json("a.json");
        assert_eq!(report["solve"]["stop_reason"], "stopped");
        let shots = &report["solve"]["shots"];
        workshop.bake_endlessly(&format!("--force --max-shots {shots} -o b.ringlight")).assert().code(0);
        assert!(workshop.bytes("a.ringlight") == workshop.bytes("b.ringlight"), "{ranks}");
    }
}

#[test]
fn a_scene_or_a_solution_is_shown_until_it_is_interrupted() {
    let workshop = Workshop::new();
    workshop.bake("-o part.ringlight --until 0.05").assert().code(0);
    for (what, sizes) in [
        ("view box.obj --until 0.05 -o a.ringlight", &COARSE[..]),
        ("view part.ringlight", &[]),
        ("view part.ringlight --ranks 2", &[]),
    ] {
        let mut child = start(&workshop, what, sizes);
        let (address, said) = watcher::address(&mut child);
        let mut watcher = Watcher::open(&address);
        watcher.wait_for("done");
        // Who comes later sees it, too.
        let mut late = Watcher::open(&address);
        late.wait_for("done");
        assert!(watcher.light > 0 && late.light > 0);
        let model = model(&address);
        assert!(model.starts_with(b"HTTP/1.1 200"), "{what}: {}", String::from_utf8_lossy(&model));
        assert!(model.windows(4).any(|bytes| bytes == b"glTF"));
        signal(&child, "-INT");
        watcher.watch_to_the_end();
        assert_eq!(child.wait().unwrap().code(), Some(130), "{}", said());
    }
    assert!(workshop.bytes("a.ringlight") == workshop.bytes("part.ringlight"));
}

/// The lit model, with the head of the answer.
fn model(address: &str) -> Vec<u8> {
    let mut stream = TcpStream::connect(address).unwrap();
    write!(stream, "GET /model.glb HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n").unwrap();
    let mut answer = Vec::new();
    std::io::Read::read_to_end(&mut stream, &mut answer).unwrap();
    answer
}

#[test]
fn a_model_is_made_while_the_solver_goes_on() {
    let workshop = Workshop::new();
    let mut child = start(&workshop, "bake box.obj --until 0 -o a.ringlight --view --ranks 2", &ENDLESS);
    let (address, said) = watcher::address(&mut child);
    let mut watcher = Watcher::open(&address);
    watcher.wait_for_shots(2);
    let asked = {
        let address = address.clone();
        std::thread::spawn(move || model(&address))
    };
    while !asked.is_finished() {
        assert!(watcher.round());
    }
    assert!(asked.join().unwrap().windows(4).any(|bytes| bytes == b"glTF"));
    watcher.say("stop");
    watcher.watch_to_the_end();
    assert_eq!(child.wait().unwrap().code(), Some(4), "{}", said());
}

#[test]
fn what_cannot_be_shown_is_refused() {
    let workshop = Workshop::new();
    workshop.bake("-o part.ringlight --until 0.5").assert().code(0);
    let holder = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let taken = format!("view part.ringlight --view={}", holder.local_addr().unwrap());
    workshop.ringlight(&taken).assert().code(1).stderr(contains("cannot be listened to"));
    workshop.ringlight("view part.ringlight --view=nowhere.invalid:1").assert().code(1).stderr(contains("nowhere"));
    workshop.ringlight("view part.ringlight --view=nowhere").assert().code(2).stderr(contains("host:port"));
    workshop.ringlight("view part.ringlight -o a.ringlight").assert().code(2).stderr(contains("export"));
    workshop.ringlight("view part.ringlight --view-every 0").assert().code(2);
    workshop.ringlight("view none.obj").assert().code(1);
}

fn signal(child: &Child, signal: &str) {
    assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
}
