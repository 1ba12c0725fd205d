//! The same bits, whatever the threads and however often it was stopped.

use crate::workshop::Workshop;

#[test]
fn the_solution_does_not_depend_on_threads() {
    let workshop = Workshop::new();
    workshop.bake("-o one.ringlight --threads 1 --report one.json --until 0.02").assert().code(0);
    workshop.bake("-o two.ringlight --threads 2 --report two.json --until 0.02").assert().code(0);
    assert_eq!(workshop.json("one.json")["solution_digest"], workshop.json("two.json")["solution_digest"]);
    assert!(workshop.bytes("one.ringlight") == workshop.bytes("two.ringlight"));
}

#[test]
fn the_solution_does_not_depend_on_scratch_files() {
    let workshop = Workshop::new();
    std::fs::create_dir(workshop.path("scratch")).unwrap();
    workshop.bake("-o memory.ringlight --max-shots 20").assert().code(0);
    workshop.bake("-o files.ringlight --max-shots 20 --scratch scratch").assert().code(0);
    assert!(workshop.bytes("memory.ringlight") == workshop.bytes("files.ringlight"));
    assert_eq!(std::fs::read_dir(workshop.path("scratch")).unwrap().count(), 0);
    let refused = workshop.bake("-o none.ringlight --scratch nowhere").assert().code(1);
    let message = String::from_utf8_lossy(&refused.get_output().stderr).into_owned();
    assert!(message.contains("no scratch memory: nowhere: "), "{message}");
    assert!(!workshop.path("none.ringlight").exists());
}

#[test]
fn the_solution_does_not_depend_on_where_the_scene_lies() {
    let (here, there) = (Workshop::new(), Workshop::new());
    here.bake("-o a.ringlight --max-shots 20").assert().code(0);
    let scene = here.path("box.obj");
    let mut command = there.ringlight("bake");
    command.arg(scene).args(crate::workshop::COARSE).args(["-o", "a.ringlight", "--max-shots", "20"]).assert().code(0);
    assert!(here.bytes("a.ringlight") == there.bytes("a.ringlight"));
}

#[test]
fn a_run_that_was_stopped_and_resumed_equals_one_that_was_not() {
    let workshop = Workshop::new();
    workshop.bake("-o part.ringlight --max-shots 37 --shoot average --sky 2").assert().code(0);
    workshop.ringlight("resume part.ringlight -o more.ringlight --max-shots 300").assert().code(0);
    workshop.ringlight("resume more.ringlight -o resumed.ringlight --threads 1 --max-shots 350").assert().code(0);
    workshop.bake("-o whole.ringlight --max-shots 350 --shoot average --sky 2").assert().code(0);
    assert!(workshop.bytes("resumed.ringlight") == workshop.bytes("whole.ringlight"));
}

#[test]
fn a_solution_exported_as_a_solution_is_the_same_file() {
    let workshop = Workshop::new();
    workshop.bake("-o a.ringlight --max-shots 20").assert().code(0);
    workshop.ringlight("export a.ringlight -o b.ringlight").assert().code(0);
    assert!(workshop.bytes("a.ringlight") == workshop.bytes("b.ringlight"));
}

#[test]
fn resuming_what_has_converged_changes_nothing() {
    let workshop = Workshop::new();
    workshop.bake("-o a.ringlight --until 0.05").assert().code(0);
    workshop.ringlight("resume a.ringlight -o a.ringlight --until 0.05").assert().code(1);
    workshop.ringlight("resume a.ringlight -o b.ringlight --until 0.05").assert().code(0);
    assert!(workshop.bytes("a.ringlight") == workshop.bytes("b.ringlight"));
}
