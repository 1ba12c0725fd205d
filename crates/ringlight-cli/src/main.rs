//! The `ringlight` command: flags, files, progress, signals.

mod adapt;
mod arguments;
mod bake;
mod estimate;
mod export;
mod failure;
mod files;
mod finish;
mod host;
mod input;
mod inspect;
mod launch;
mod machine;
mod map;
mod method;
mod outputs;
mod probe;
mod progress;
mod reading;
mod resume;
mod run;
mod scratch;
mod showing;
mod signals;
mod spread;
mod values;
mod view;
mod viewfactors;
mod watch;

use arguments::{Arguments, Verb};
use clap::{CommandFactory, Parser};
use failure::{End, Failure};
use launch::Launch;
use ringlight::transport::Communicator;
use std::io::Write;
use std::process::ExitCode;

fn main() -> ExitCode {
    machine::watch_private_memory();
    let verb = match Arguments::try_parse() {
        Ok(arguments) => view::asked(arguments.verb),
        Err(error) if launch::speaks() => error.exit(),
        Err(_) => return ExitCode::SUCCESS,
    };
    launch::catch_panics();
    match place(&verb) {
        Ok((launch, threads)) => launch.run(threads, &|ranks| act(&verb, ranks)),
        Err(failure) => launch::refuse(&failure),
    }
}

/// Where to run, and with how many threads.
fn place(verb: &Verb) -> Result<(Launch, Option<usize>), Failure> {
    let (name, threads) = match verb {
        Verb::Bake(bake) | Verb::View(bake) => {
            return Ok((Launch::spread(bake.spread.ranks)?, bake.running.threads));
        }
        Verb::Resume(resume) => return Ok((Launch::spread(resume.spread.ranks)?, resume.running.threads)),
        Verb::Export(verb) | Verb::Render(verb) => return Ok((Launch::spread(verb.spread.ranks)?, verb.threads)),
        Verb::Probe(probe) => return Ok((Launch::spread(probe.spread.ranks)?, probe.threads)),
        Verb::ViewFactors(factors) => return Ok((Launch::spread(factors.ranks)?, factors.threads)),
        Verb::Inspect(inspect) => ("inspect", inspect.threads),
        Verb::Completions { .. } => ("completions", Some(1)),
    };
    Ok((Launch::alone(name)?, threads))
}

fn act(verb: &Verb, ranks: &mut Communicator<'_>) -> Result<End, Failure> {
    match verb {
        Verb::Bake(bake) => bake::bake(bake, ranks),
        Verb::View(view) => view::view(view, ranks),
        Verb::Resume(resume) => resume::resume(resume, ranks),
        Verb::Export(export) => export::export(export, ranks),
        Verb::Render(export) => export::render(export, ranks),
        Verb::Probe(probe) => probe::probe(probe, ranks),
        Verb::Inspect(inspect) => inspect::inspect(inspect),
        Verb::ViewFactors(factors) => viewfactors::viewfactors(factors, ranks),
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
