//! The first shot of the office over rings of ranks (paper, section 4): threads as ranks, busy times by the threads' clocks.

use crate::clock::thread_seconds;
use crate::office::{Office, Shots};
use crate::serial::{PACKET_SIZE, SerialRing, outlines};
use anyhow::{Context, Result};
use clap::Args;
use ringlight::ring::{Balance, Bounds, Moves, Rings, Routing, Shards, deal, owners};
use ringlight::shooting::{ClusterLight, Shot};
use ringlight::solve::{Ring, RingExchange};
use ringlight::transport::{Communicator, Failure, threads};
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;

/// Packets of a rank that are under way at a time.
const UNDER_WAY: usize = 16;

/// What the paper tells: ranks, rings, efficiency relative to 4 ranks.
const PAPER: [(usize, usize, f64); 4] = [(8, 1, 0.52), (8, 2, 1.01), (256, 1, 0.067), (256, 64, 0.35)];

/// Tag of the meeting between repetitions.
const MEETING: u32 = 100;

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
#[derive(Clone, Copy, Debug)]
struct Part {
    busy: f64,
    messages: f64,
    bytes: f64,
    own: u64,
    tested: u64,
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
        let rings = cut.ring_of(ranks - 1) + 1;
        let held = (0..rings)
            .map(|ring| {
                let members = cut.members(ring).len();
                let mut holders = deal(&office.pieces, members, shards);
                if balanced {
                    let mut serial = SerialRing::new(office, cut, ranks, ring, &holders, routing);
                    holders = self.balance(office, shot, &mut serial, holders, shards);
                }
                Held { outlines: outlines(office, &holders, members), holders }
            })
            .collect();
        let sizes: Vec<u64> = office.mesh.clusters.iter().map(|c| c.elements.len() as u64).collect();
        let owners = owners(&sizes, ranks);
        let experiment = Experiment { office, shot, cut, routing, held, owners, repeat: self.repeat };
        let parts = threads::run(ranks, |world| experiment.run(world))?;
        let modelled = |part: &Part| part.busy + part.messages * self.message + part.bytes * self.byte;
        let members = ranks.div_ceil(rings);
        let fastest_over_slowest = |ring: usize| {
            let busy = || parts[cut.members(ring)].iter().map(|part| part.busy);
            busy().fold(f64::INFINITY, f64::min) / busy().fold(0.0, f64::max)
        };
        let (own, tested) = parts.iter().fold((0, 0), |(own, tested), p| (own + p.own, tested + p.tested));
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
            visits: tested as f64 / own as f64,
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

/// The shot over rings of ranks.
struct Experiment<'a> {
    office: &'a Office,
    shot: &'a Shot,
    cut: Rings,
    routing: Routing,
    /// By ring.
    held: Vec<Held>,
    /// The rank of each cluster.
    owners: Vec<u32>,
    repeat: u64,
}

impl Experiment<'_> {
    /// One rank: its shard, its clusters, the shot again and again.
    fn run(&self, world: &mut Communicator<'_>) -> Result<Part, Failure> {
        let Experiment { office, shot, cut, routing, held, owners, repeat } = self;
        let rank = world.rank();
        let ring = cut.ring_of(rank);
        let Held { holders, outlines } = &held[ring];
        let shard = office.shard(holders, (rank - cut.members(ring).start) as u32);
        let own: Vec<u32> = (0..owners.len() as u32).filter(|&c| owners[c as usize] as usize == rank).collect();
        let mut light: Vec<ClusterLight> = own.iter().map(|&c| ClusterLight::new(&office.mesh, c as usize)).collect();
        let mut exchange = RingExchange::new(*cut, rank, outlines.clone(), *routing, UNDER_WAY);
        let mut busy = 0.0;
        for number in 0..*repeat {
            let start = thread_seconds();
            let mut ring = Ring { shard: &shard, packet_size: PACKET_SIZE, exchange: &mut exchange, ranks: world };
            ring.receive(&office.mesh, &own, &mut light, number, shot)?;
            busy += thread_seconds() - start;
            world.all_reduce(MEETING, [0], |a, _| a)?;
        }
        let traffic = world.traffic().iter().filter(|(tag, _)| **tag < MEETING).map(|(_, traffic)| traffic);
        let (messages, bytes) = traffic.fold((0, 0), |(m, b), traffic| (m + traffic.messages, b + traffic.bytes));
        let mean = |x: f64| x / *repeat as f64;
        let visits = exchange.visits();
        Ok(Part {
            busy: mean(busy),
            messages: mean(messages as f64),
            bytes: mean(bytes as f64),
            own: visits.own,
            tested: visits.tested,
        })
    }
}

/// Who of a ring holds what.
struct Held {
    holders: Vec<u32>,
    outlines: Arc<Vec<Vec<Bounds>>>,
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
