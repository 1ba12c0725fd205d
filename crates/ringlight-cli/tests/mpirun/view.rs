//! Solves over MPI that are watched: the first rank serves, and nothing that watchers do changes the light.

use super::watcher::{self, Watcher};
use super::{LIMIT, Workshop, bake, bake_endlessly, end, process_of, send, start};

#[test]
fn what_is_shown_changes_no_bit() {
    let workshop = Workshop::new();
    workshop.bake("-o one.ringlight --until 0.001").assert().code(0);
    for way in ["--rings 1", "--rings 3 --view-every 1"] {
        let arguments = bake(&format!("-o many.ringlight --until 0.001 --force --view {way}"));
        let mut child = start(&workshop, 3, &arguments);
        let (address, said) = watcher::address(&mut child);
        let mut watcher = Watcher::open(&address);
        assert!(watcher.round());
        watcher.say("pause");
        watcher.say("resume");
        watcher.watch_to_the_end();
        assert_eq!(end(child, LIMIT).status.code(), Some(0), "{}", said());
        assert!(watcher.light > 0 && watcher.status["ranks"].as_array().is_some_and(|ranks| ranks.len() == 3), "{way}");
        assert!(workshop.bytes("one.ringlight") == workshop.bytes("many.ringlight"), "{way}");
    }
}

#[test]
fn a_signal_to_any_rank_ends_a_pause() {
    let workshop = Workshop::new();
    let mut child = start(&workshop, 3, &bake_endlessly("-o a.ringlight --report a.json --view"));
    let (address, said) = watcher::address(&mut child);
    let mut watcher = Watcher::open(&address);
    watcher.wait_for_shots(2);
    watcher.say("pause");
    watcher.wait_for("pause");
    send("-TERM", process_of(&child, 2));
    watcher.watch_to_the_end();
    assert_eq!(end(child, LIMIT).status.code(), Some(143), "{}", said());
    let shots = workshop.json("a.json")["solve"]["shots"].as_u64().unwrap();
    workshop.bake_endlessly(&format!("-o b.ringlight --max-shots {shots}")).assert().code(0);
    assert!(workshop.bytes("a.ringlight") == workshop.bytes("b.ringlight"));
}
