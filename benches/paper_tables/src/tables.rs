//! The first shot of the office over rings of ranks (paper, section 4), which work one after the other.

use crate::office::{Office, Shots};
use crate::serial::SerialRing;
use anyhow::{Context, Result};
use clap::Args;
use ringlight::ring::{Balance, Moves, Rings, Routing, Shards, deal};
use ringlight::shooting::Shot;
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;

/// What the paper tells: ranks, rings, efficiency relative to 4 ranks.
const PAPER: [(usize, usize, f64); 4] = [(8, 1, 0.52), (8, 2, 1.01), (256, 1, 0.067), (256, 64, 0.35)];

/// What is run and what a message costs.
#[derive(Args)]
pub struct Tables {
    /// Most ranks: 4, 8, … 256
    #[arg(long, default_value_t = 256)]
    ranks: usize,
    /// Ranks with which all numbers of rings are run, before and after balancing
    #[arg(long, default_value_t = 64)]
    all_rings: usize,
    /// How often the shot is repeated; times are means
    #[arg(long, default_value_t = 5)]
    repeat: u64,
    /// Windows of balancing
    #[arg(long, default_value_t = 5)]
    windows: usize,
    /// Modelled cost of a message, seconds
    #[arg(long, default_value_t = 5e-6)]
    message: f64,
    /// Modelled cost of a byte, seconds
    #[arg(long, default_value_t = 1e-9)]
    byte: f64,
    /// Where to write the table
    #[arg(long, default_value = "benches/results/2026-11-22-paper-tables.csv")]
    output: PathBuf,
}

#[derive(Debug, Serialize)]
struct Row {
    ranks: usize,
    rings: usize,
    shards: &'static str,
    routing: &'static str,
    balanced: bool,
    /// Modelled time of the shot, seconds.
    time: f64,
    /// Largest busy time of a rank, CPU seconds.
    busy: f64,
    /// Sum of all ranks' busy times, CPU seconds.
    total_busy: f64,
    /// Fastest over slowest of the ranks of a ring; the worst ring's.
    balance: f64,
    /// 4 · time of 4 ranks / (ranks · time).
    efficiency: f64,
    /// The paper's.
    paper: Option<f64>,
    /// Members that test a packet, on average.
    visits: f64,
    /// Messages of all ranks.
    messages: u64,
    /// Their bytes.
    bytes: u64,
    message_seconds: f64,
    byte_seconds: f64,
}

/// One rank's part in one shot, on average.
#[derive(Clone, Copy, Debug, Default)]
struct Part {
    busy: f64,
    messages: f64,
    bytes: f64,
}

impl Tables {
    /// Runs it, prints a table, and writes it to the output.
    pub fn run(&self, office: &Office) -> Result<()> {
        let shot = Shots::new(office).shoot().context("the office is dark")?;
        let mut file = csv::Writer::from_path(&self.output)
            .with_context(|| format!("{} cannot be written", self.output.display()))?;
        println!("time = largest (busy + messages · {} s + bytes · {} s) of a rank", self.message, self.byte);
        println!("     + (members of a ring + 1) · {} s, the way of a packet", self.message);
        println!("  N   R shards  routing balanced  time ms  busy ms fastest/slowest efficiency paper visits messages");
        for way in [(Shards::Random, Routing::All), (Shards::Spatial, Routing::Boxes)] {
            let mut base = None;
            for (ranks, rings) in self.worlds() {
                let Some(cut) = Rings::new(ranks, rings) else { continue };
                for balanced in [false, true] {
                    if balanced && (ranks != self.all_rings || rings == ranks) {
                        continue;
                    }
                    let mut row = self.measure(office, &shot, ranks, cut, way, balanced)?;
                    let four = *base.get_or_insert(row.time * ranks as f64);
                    row.efficiency = four / (row.time * ranks as f64);
                    println!("{row}");
                    file.serialize(row)?;
                    file.flush()?;
                }
            }
        }
        Ok(())
    }

    /// Numbers of ranks and rings; the first is what efficiencies are relative to.
    fn worlds(&self) -> Vec<(usize, usize)> {
        let mut worlds = Vec::new();
        for ranks in (2..=8).map(|k| 1 << k).filter(|&ranks| ranks <= self.ranks) {
            let wanted = |&rings: &usize| match ranks == self.all_rings {
                true => ranks.is_multiple_of(rings),
                false => rings == 1 || rings == ranks / 4,
            };
            worlds.extend((1..=ranks).filter(wanted).map(|rings| (ranks, rings)));
        }
        worlds
    }

    fn measure(
        &self,
        office: &Office,
        shot: &Shot,
        ranks: usize,
        cut: Rings,
        (shards, routing): (Shards, Routing),
        balanced: bool,
    ) -> Result<Row> {
        let rings = cut.rings();
        let mut parts = vec![Part::default(); ranks];
        let mut visits = [0; 2];
        for ring in 0..rings {
            let members = cut.members(ring);
            let mut holders = deal(&office.pieces, members.len(), shards);
            let mut serial = SerialRing::new(office, cut, ranks, ring, &holders, routing);
            if balanced {
                holders = self.balance(office, shot, &mut serial, holders, shards);
                serial.hold(&holders);
            }
            serial.visits = [0; 2];
            for _ in 0..self.repeat {
                let loads = serial.receive(shot);
                for (member, load) in loads.iter().enumerate() {
                    let [messages, bytes] = serial.traffic(member).map(|n| n as f64);
                    let part = &mut parts[members.start + member];
                    part.busy += load.busy() / self.repeat as f64;
                    (part.messages, part.bytes) = (messages, bytes);
                }
            }
            (0..2).for_each(|i| visits[i] += serial.visits[i]);
        }
        let modelled = |part: &Part| part.busy + part.messages * self.message + part.bytes * self.byte;
        let members = ranks.div_ceil(rings);
        let fastest_over_slowest = |ring: usize| {
            let busy = || parts[cut.members(ring)].iter().map(|part| part.busy);
            busy().fold(f64::INFINITY, f64::min) / busy().fold(0.0, f64::max)
        };
        Ok(Row {
            ranks,
            rings,
            shards: if shards == Shards::Random { "random" } else { "spatial" },
            routing: if routing == Routing::All { "all" } else { "boxes" },
            balanced,
            time: parts.iter().map(modelled).fold(0.0, f64::max) + (members + 1) as f64 * self.message,
            busy: parts.iter().map(|part| part.busy).fold(0.0, f64::max),
            total_busy: parts.iter().map(|part| part.busy).sum(),
            balance: (0..rings).map(fastest_over_slowest).fold(f64::INFINITY, f64::min),
            efficiency: 0.0,
            paper: PAPER.iter().find(|(n, r, _)| (*n, *r) == (ranks, rings)).map(|&(_, _, efficiency)| efficiency),
            visits: visits[0] as f64 / visits[1] as f64,
            messages: parts.iter().map(|part| part.messages).sum::<f64>().round() as u64,
            bytes: parts.iter().map(|part| part.bytes).sum::<f64>().round() as u64,
            message_seconds: self.message,
            byte_seconds: self.byte,
        })
    }

    /// Balances a ring over windows of this shot; gives who holds what then.
    fn balance(
        &self,
        office: &Office,
        shot: &Shot,
        ring: &mut SerialRing<'_>,
        holders: Vec<u32>,
        shards: Shards,
    ) -> Vec<u32> {
        let pieces = Arc::from(office.pieces.as_slice());
        let mut balance = Balance::new(pieces, holders, ring.members(), shards, Moves::Balanced);
        while balance.windows().len() < self.windows {
            if balance.add(1, &ring.receive(shot)) {
                ring.hold(balance.holders());
            }
        }
        balance.holders().to_vec()
    }
}

impl std::fmt::Display for Row {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Row { ranks, rings, shards, routing, balance, efficiency, visits, messages, .. } = self;
        let balanced = if self.balanced { "yes" } else { "no" };
        let (time, busy) = (1e3 * self.time, 1e3 * self.busy);
        let paper = self.paper.map_or(String::new(), |paper| format!("{paper:.3}"));
        write!(f, "{ranks:3} {rings:3} {shards:7} {routing:7} {balanced:8} {time:8.3} {busy:8.3} {balance:15.3} ")?;
        write!(f, "{efficiency:10.3} {paper:>5} {visits:6.2} {messages:8}")
    }
}
