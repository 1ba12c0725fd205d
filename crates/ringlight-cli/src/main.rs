//! The `ringlight` command: flags, files, progress, signals.

mod arguments;
mod bake;
mod estimate;
mod export;
mod failure;
mod files;
mod input;
mod inspect;
mod machine;
mod map;
mod outputs;
mod probe;
mod progress;
mod resume;
mod run;
mod scratch;
mod signals;
mod values;
mod viewfactors;

use arguments::{Arguments, Verb};
use clap::{CommandFactory, Parser};
use failure::{End, Failure};
use std::io::Write;
use std::panic::{self, AssertUnwindSafe};
use std::process::ExitCode;

fn main() -> ExitCode {
    machine::watch_private_memory();
    let arguments = Arguments::parse();
    panic::set_hook(Box::new(|panic| {
        complain(&format!("this is a bug in ringlight: {panic}; please report it with the command line"));
    }));
    // Unwinding removes files that are half-written.
    match panic::catch_unwind(AssertUnwindSafe(|| act(&arguments.verb))) {
        Ok(Ok(end)) => end.into(),
        Ok(Err(failure)) => {
            complain(&failure.to_string());
            failure.code()
        }
        Err(_) => ExitCode::FAILURE,
    }
}

/// Prints an error; a closed standard error is no reason to fail differently.
fn complain(message: &str) {
    writeln!(std::io::stderr(), "error: {message}").ok();
}

fn act(verb: &Verb) -> Result<End, Failure> {
    let threads = match verb {
        Verb::Bake(bake) => bake.running.threads,
        Verb::Resume(resume) => resume.running.threads,
        Verb::Export(export) | Verb::Render(export) => export.threads,
        Verb::Probe(probe) => probe.threads,
        Verb::Inspect(inspect) => inspect.threads,
        Verb::ViewFactors(factors) => factors.threads,
        Verb::Completions { .. } => None,
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build_global();
    pool.map_err(|error| anyhow::Error::new(error).context("threads cannot be started"))?;
    match verb {
        Verb::Bake(bake) => bake::bake(bake),
        Verb::Resume(resume) => resume::resume(resume),
        Verb::Export(export) => export::export(export),
        Verb::Render(export) => export::render(export),
        Verb::Probe(probe) => probe::probe(probe),
        Verb::Inspect(inspect) => inspect::inspect(inspect),
        Verb::ViewFactors(factors) => viewfactors::viewfactors(factors),
        Verb::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(*shell, &mut Arguments::command(), "ringlight", &mut script);
            print(&script)
        }
    }
}

/// Writes to standard output; a reader that has seen enough (`| head`) is no error.
fn print(bytes: &[u8]) -> Result<End, Failure> {
    let mut out = std::io::stdout();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(anyhow::Error::new(error).context("standard output cannot be written").into())
        }
        _ => Ok(End::Done),
    }
}
