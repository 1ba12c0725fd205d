//! Balance over windows on the office's own shots, from good and from bad starts.

use crate::office::{Office, Shots};
use crate::serial::SerialRing;
use anyhow::{Context, Result};
use ringlight::ring::{Balance, Load, Moves, Rings, Routing, Shards, deal};
use ringlight::shooting::Shot;
use serde::Serialize;
use std::path::Path;
use std::sync::Arc;

/// How the geometry lies at first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
enum Start {
    /// Equally many triangles each.
    Even,
    /// In proportion 1 : 2 : 3 : …
    Ramp,
    /// All at one member.
    One,
}

/// A window of a ring.
#[derive(Debug, Serialize)]
struct Row {
    ranks: usize,
    rings: usize,
    ring: usize,
    shards: &'static str,
    routing: &'static str,
    start: Start,
    moves: &'static str,
    window: usize,
    shots: u64,
    /// Busy time of the slowest member, CPU seconds.
    slowest: f64,
    /// Fastest over slowest.
    balance: f64,
    /// Rank correlation with the window before.
    correlation: Option<f64>,
    moved: usize,
}

/// What is tried.
#[derive(Clone, Copy)]
struct Way {
    ranks: usize,
    rings: usize,
    shards: Shards,
    routing: Routing,
    start: Start,
    moves: Moves,
}

/// Runs all of it over so many shots, prints a line for each ring, and writes the windows to `output`.
pub fn run(office: &Office, shots: usize, output: &Path) -> Result<()> {
    let mut source = Shots::new(office);
    let shots: Vec<Shot> = (0..shots).map_while(|_| source.shoot()).collect();
    let mut file = csv::Writer::from_path(output).with_context(|| format!("{} cannot be written", output.display()))?;
    println!(
        "{} shots, {} pieces; fastest/slowest of the windows 0, 1, 2, 3, 5, 10, last",
        shots.len(),
        office.pieces.len()
    );
    let random = (Shards::Random, Routing::All);
    let spatial = (Shards::Spatial, Routing::Boxes);
    for (ranks, rings) in [(8, 1), (16, 4)] {
        for ((shards, routing), starts) in
            [(random, &[Start::Even, Start::Ramp, Start::One][..]), (spatial, &[Start::Even, Start::One])]
        {
            for &start in starts {
                for moves in [Moves::Never, Moves::Balanced] {
                    let way = Way { ranks, rings, shards, routing, start, moves };
                    if (start, moves) == (Start::One, Moves::Never) {
                        continue;
                    }
                    for ring in 0..rings {
                        for row in balance(office, &shots, way, ring) {
                            file.serialize(row)?;
                        }
                    }
                }
            }
        }
    }
    Ok(file.flush()?)
}

/// The windows of one ring.
fn balance(office: &Office, shots: &[Shot], way: Way, ring: usize) -> Vec<Row> {
    let Way { ranks, rings, shards, routing, start, moves } = way;
    let cut = Rings::new(ranks, rings).expect("so many rings can be");
    let members = cut.members(ring).len();
    let holders = start.holders(office, members, shards);
    let mut serial = SerialRing::new(office, cut, ranks, ring, &holders, routing);
    let mut balance = Balance::new(Arc::from(office.pieces.as_slice()), holders, members, shards, moves);
    let mut time = 0.0;
    let mut rest = shots;
    while !rest.is_empty() {
        let (these, others) = rest.split_at(rest.len().min(balance.pause() as usize));
        rest = others;
        let mut loads = vec![Load::default(); members];
        for shot in these {
            for (sum, load) in loads.iter_mut().zip(serial.receive(shot)) {
                *sum = *sum + load;
            }
        }
        time += loads.iter().map(Load::busy).fold(0.0, f64::max);
        if balance.add(these.len() as u64, &loads) {
            time += serial.hold(balance.holders());
        }
    }
    let windows = balance.windows();
    let (shards, routing) =
        (name(shards == Shards::Random, "random", "spatial"), name(routing == Routing::All, "all", "boxes"));
    let moves = name(moves == Moves::Never, "never", "balanced");
    let shown: Vec<String> = [0, 1, 2, 3, 5, 10, windows.len() - 1]
        .iter()
        .filter_map(|&i| windows.get(i))
        .map(|window| format!("{:.3}", window.balance))
        .collect();
    let correlations: Vec<f64> = windows.iter().filter_map(|window| window.correlation).collect();
    let mean = correlations.iter().sum::<f64>() / correlations.len().max(1) as f64;
    println!(
        "N {ranks} R {rings} ring {ring} {shards:7} {routing:5} {start:?} {moves:8}: {} | time {time:.3} s | correlation {mean:.2} | {} windows, {} pieces moved | {:.2} visits",
        shown.join(" "),
        windows.len(),
        windows.iter().map(|window| window.moved).sum::<usize>(),
        serial.visits[0] as f64 / serial.visits[1] as f64,
    );
    let row = |(number, w): (usize, &ringlight::ring::Window)| Row {
        ranks,
        rings,
        ring,
        shards,
        routing,
        start,
        moves,
        window: number,
        shots: w.shots,
        slowest: w.slowest,
        balance: w.balance,
        correlation: w.correlation,
        moved: w.moved,
    };
    windows.iter().enumerate().map(row).collect()
}

fn name(first: bool, one: &'static str, other: &'static str) -> &'static str {
    if first { one } else { other }
}

impl Start {
    fn holders(self, office: &Office, members: usize, shards: Shards) -> Vec<u32> {
        match self {
            Start::Even => deal(&office.pieces, members, shards),
            Start::Ramp => {
                // Member m has m + 1 of the parts.
                let last: Vec<usize> = (1..=members).map(|m| m * (m + 1) / 2).collect();
                let parts = deal(&office.pieces, last[members - 1], shards);
                parts.iter().map(|&part| last.partition_point(|&last| last <= part as usize) as u32).collect()
            }
            Start::One => vec![0; office.pieces.len()],
        }
    }
}
