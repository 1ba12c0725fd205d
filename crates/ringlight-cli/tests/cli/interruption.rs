//! Nothing is lost: time limits, signals, kills, failing writes.

use crate::workshop::Workshop;
use predicates::str::contains;

#[test]
fn a_time_limit_leaves_a_valid_solution_and_says_so() {
    let workshop = Workshop::new();
    workshop.bake_endlessly("--force --time-limit 0.3 -o a.ringlight --report a.json").assert().code(4);
    assert_eq!(workshop.json("a.json")["solve"]["stop_reason"], "time-limit");
    workshop.ringlight("export a.ringlight -o b.ringlight").assert().code(0);
}

#[test]
fn a_time_limit_stops_all_ranks_after_the_same_shot() {
    let workshop = Workshop::new();
    workshop.bake_endlessly("--force --ranks 3 --time-limit 1 -o a.ringlight --report a.json").assert().code(4);
    let shots = workshop.json("a.json")["solve"]["shots"].as_u64().unwrap();
    workshop.bake_endlessly(&format!("--force --max-shots {shots} -o b.ringlight")).assert().code(0);
    assert!(workshop.bytes("a.ringlight") == workshop.bytes("b.ringlight"));
}

/// Resumes `part` for some shots more, and compares with a run that was never stopped.
#[cfg(unix)]
fn assert_goes_on_exactly(workshop: &Workshop, part: &str) {
    let look = format!("resume {part} -o look.ringlight --max-shots 0 --report look.json");
    workshop.ringlight(&look).assert().code(0);
    let shots = workshop.json("look.json")["solve"]["shots"].as_u64().unwrap() + 25;
    let resume = format!("resume {part} -o resumed.ringlight --until 0 --max-shots {shots} --report resumed.json");
    workshop.ringlight(&resume).assert().code(0);
    let whole = format!("-o whole.ringlight --max-shots {shots} --report whole.json");
    workshop.bake_endlessly(&whole).assert().code(0);
    assert_eq!(workshop.json("resumed.json")["solution_digest"], workshop.json("whole.json")["solution_digest"]);
    assert!(workshop.bytes("resumed.ringlight") == workshop.bytes("whole.ringlight"));
}

#[cfg(unix)]
fn wait_for(what: impl Fn() -> bool) {
    for _ in 0..600 {
        if what() {
            return;
        }
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    panic!("waited for half a minute in vain");
}

#[cfg(unix)]
#[test]
fn a_killed_run_goes_on_from_its_checkpoint() {
    let workshop = Workshop::new();
    let mut child = workshop.start_baking_endlessly("--force -o a.ringlight --checkpoint part.ringlight@0");
    wait_for(|| workshop.path("part.ringlight").exists());
    std::thread::sleep(std::time::Duration::from_millis(300));
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(!workshop.path("a.ringlight").exists());
    assert_goes_on_exactly(&workshop, "part.ringlight");
}

#[cfg(unix)]
fn signalled(signal: &str, code: i32, flags: &str) {
    let workshop = Workshop::new();
    let command = format!("--force {flags} -o a.ringlight --report a.json --checkpoint part.ringlight@0");
    let mut child = workshop.start_baking_endlessly(&command);
    wait_for(|| workshop.path("part.ringlight").exists());
    let sent = std::process::Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    assert_eq!(child.wait().unwrap().code(), Some(code));
    assert!(workshop.path("a.json").exists());
    assert!(workshop.bytes("a.ringlight") == workshop.bytes("part.ringlight"));
    assert!(workshop.files().iter().all(|name| !name.starts_with('.')), "{:?}", workshop.files());
    assert_goes_on_exactly(&workshop, "a.ringlight");
}

#[cfg(unix)]
#[test]
fn a_terminated_run_leaves_a_valid_solution() {
    signalled("-TERM", 143, "");
}

#[cfg(unix)]
#[test]
fn ranks_are_terminated_after_the_same_shot() {
    signalled("-TERM", 143, "--ranks 3 --rings 1");
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_leaves_a_valid_solution() {
    signalled("-INT", 130, "");
}

#[test]
fn a_checkpoint_may_be_the_output_and_the_solution_that_is_resumed() {
    let workshop = Workshop::new();
    workshop.bake_endlessly("-o a.ringlight --checkpoint a.ringlight@0 --max-shots 5").assert().code(0);
    workshop.ringlight("resume a.ringlight --checkpoint a.ringlight -o b.ringlight --max-shots 9").assert().code(0);
    assert!(workshop.bytes("a.ringlight") == workshop.bytes("b.ringlight"));
}

#[test]
fn an_output_that_fails_does_not_take_the_others_with_it() {
    let workshop = Workshop::new();
    let gone = workshop.path("gone");
    std::fs::create_dir(&gone).unwrap();
    let remover = {
        let gone = gone.clone();
        std::thread::spawn(move || {
            std::thread::sleep(std::time::Duration::from_millis(500));
            std::fs::remove_dir_all(gone).unwrap();
        })
    };
    let command = "--force --time-limit 2 -o gone/a.ringlight -o b.ringlight";
    workshop.bake_endlessly(command).assert().code(1).stderr(contains("gone/a.ringlight: cannot be written"));
    remover.join().unwrap();
    assert_eq!(workshop.files(), ["b.ringlight", "box.mtl", "box.obj"]);
    workshop.ringlight("export b.ringlight -o c.ringlight").assert().code(0);
}
