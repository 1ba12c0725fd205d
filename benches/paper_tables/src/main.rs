//! The paper's own experiment (section 4), and dynamic load balancing (section 3.3), on the office over rings of ranks that work
//! one after the other on one thread, so that their CPU times do not disturb each other.

mod balance;
mod clock;
mod office;
mod serial;
mod tables;

use anyhow::Result;
use clap::{Parser, Subcommand};
use office::Office;
use std::path::PathBuf;
use tables::Tables;

/// Runs the paper's own experiment, on the office of 4738 patches and 17251 elements.
#[derive(Parser)]
struct Arguments {
    #[command(subcommand)]
    what: What,
    /// Facets in a piece of geometry, which moves as a whole
    #[arg(long, default_value_t = 2, global = true)]
    facets: u32,
}

#[derive(Subcommand)]
enum What {
    /// Fastest/slowest of the members of rings over windows, with and without balancing
    Balance {
        /// Shots
        #[arg(long, default_value_t = 1000)]
        shots: usize,
        /// Where to write all windows
        #[arg(long, default_value = "benches/results/2026-11-22-balance.csv")]
        output: PathBuf,
    },
    /// The first shot over N ranks and R rings: times and efficiencies
    Tables(Tables),
}

fn main() -> Result<()> {
    let arguments = Arguments::parse();
    let office = Office::read(arguments.facets)?;
    match arguments.what {
        What::Balance { shots, output } => balance::run(&office, shots, &output),
        What::Tables(tables) => tables.run(&office),
    }
}
