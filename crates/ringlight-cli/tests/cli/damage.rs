//! Damaged solutions are errors that say so, never panics.

use crate::workshop::Workshop;
use predicates::prelude::*;
use predicates::str::contains;

#[test]
fn damaged_and_truncated_solutions_are_refused() {
    let workshop = Workshop::new();
    workshop.bake("-o a.ringlight --max-shots 20").assert().code(0);
    let whole = workshop.bytes("a.ringlight");
    let refused = |bytes: &[u8], how: &str| {
        workshop.put("bad.ringlight", bytes);
        let run = workshop.ringlight("resume bad.ringlight -o out.ringlight --max-shots 21").assert();
        let output = run.get_output();
        let text = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{how}: {text}");
        assert!(text.starts_with("error: bad.ringlight: ") && !text.contains("bug"), "{how}: {text}");
        assert!(!workshop.path("out.ringlight").exists(), "{how}");
    };
    for length in [0, 4, 8, 11, 12, 15, 16, 40, 90, whole.len() / 2, whole.len() - 1] {
        refused(&whole[..length], &format!("cut to {length} bytes"));
    }
    // The head byte by byte, the rest in steps.
    for at in (0..100).chain((100..whole.len()).step_by(whole.len() / 40)) {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x55;
        refused(&bytes, &format!("byte {at} changed"));
    }
}

#[test]
fn other_files_are_no_solutions() {
    let workshop = Workshop::new();
    for verb in ["resume box.obj", "export box.obj"] {
        let refused = contains("box.obj").and(contains("not a Ringlight solution"));
        workshop.ringlight(verb).args(["-o", "a.ringlight"]).assert().code(1).stderr(refused);
    }
}
