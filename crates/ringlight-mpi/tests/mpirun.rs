//! Real MPI: `mpirun`, or the launcher that `MPIRUN` names, starts the check on several numbers of ranks, more than there are cores.

use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Longest run of the check, with room for slow machines.
const LIMIT: Duration = Duration::from_secs(120);

/// Runs the check on so many ranks; how it ended, what it printed, and how long it took.
fn check(ranks: usize, case: &[&str]) -> (Output, Duration) {
    let start = Instant::now();
    let mut command = Command::new(std::env::var_os("MPIRUN").unwrap_or_else(|| "mpirun".into()));
    // Open MPI refuses root and more ranks than cores unless it is told otherwise; other implementations ignore this.
    command
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
        .env("OMPI_MCA_rmaps_base_oversubscribe", "1")
        .env("OMPI_MCA_mpi_yield_when_idle", "1");
    let mut child = command
        .args(["-n", &ranks.to_string(), env!("CARGO_BIN_EXE_ringlight-mpi-check")])
        .args(case)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the launcher can be started");
    // The output is short enough for the pipes to hold it.
    while child.try_wait().expect("the check can be waited for").is_none() {
        if start.elapsed() > LIMIT {
            child.kill().ok();
            panic!("{ranks} ranks ({case:?}) did not end within {LIMIT:?}");
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    (child.wait_with_output().expect("the output can be read"), start.elapsed())
}

fn text(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

#[test]
fn mpi_conforms() {
    for ranks in [1, 2, 3, 4, 6] {
        let (output, _) = check(ranks, &[]);
        assert!(output.status.success(), "{ranks} ranks: {}", text(&output));
        assert!(text(&output).contains(&format!("{ranks} ranks conform")), "{}", text(&output));
    }
}

#[test]
fn the_message_of_a_failing_rank_reaches_the_user_and_all_ranks_end() {
    let (output, _) = check(3, &["fail"]);
    assert_eq!(output.status.code(), Some(1), "{}", text(&output));
    assert!(text(&output).contains("rank 2: cannot go on"), "{}", text(&output));
}

#[test]
fn ranks_that_do_not_answer_after_a_failure_are_ended() {
    let (output, took) = check(3, &["hang"]);
    assert!(!output.status.success(), "{}", text(&output));
    assert!(text(&output).contains("rank 0: cannot go on"), "{}", text(&output));
    assert!(text(&output).contains("do not end; aborting"), "{}", text(&output));
    // Eight seconds of patience, and the launcher's own.
    assert!(took < Duration::from_secs(20), "{took:?}");
}

#[test]
fn a_rank_that_dies_ends_the_others() {
    let (output, took) = check(3, &["die"]);
    assert!(!output.status.success(), "{}", text(&output));
    assert!(took < Duration::from_secs(10), "{took:?}");
}
