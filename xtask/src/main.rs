//! Project tasks: `cargo xtask` lists them.

mod licences;
mod scenes;
mod test;
mod tidy;
mod viewer;

use anyhow::{Context, Result, bail, ensure};
use std::path::Path;
use std::process::{Command, ExitCode};

const HELP: &str = "\
cargo xtask TASK
  test       everything that has to pass, the tests last
  tidy       the rules of the source tree (CONTRIBUTING.md)
  licences   the licences of all dependencies against deny.toml
  viewer     build the page of the live view (needs Node.js and npm)
  scenes     write the generated files in scenes/
  large-scene N glb|nodes|obj FILE
             write a scene of N triangles or a few more, for measuring memory
  accuracy   measure the accuracy and write docs/accuracy.md; with names of suites: print those";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match run(&arguments.iter().map(String::as_str).collect::<Vec<_>>()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &[&str]) -> Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("xtask lies in the workspace");
    match arguments {
        ["test"] => test::run(root),
        ["tidy"] => tidy::run(root),
        ["licences"] => licences::run(root),
        ["viewer"] => viewer::build(root),
        ["scenes"] => scenes::run(&root.join("scenes")),
        ["large-scene", triangles, form, file] => scenes::large::run(triangles, form, Path::new(file)),
        ["accuracy", suites @ ..] => accuracy(root, suites),
        [] => {
            println!("{HELP}");
            Ok(())
        }
        _ => bail!("{HELP}"),
    }
}

/// Runs the measurements of `benches/accuracy`.
fn accuracy(root: &Path, suites: &[&str]) -> Result<()> {
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["run", "--release", "--quiet", "--package", "ringlight-accuracy", "--"]).args(suites);
    let status = cargo.current_dir(root).status().context("cargo cannot be run")?;
    ensure!(status.success(), "the accuracy was not measured ({status})");
    Ok(())
}
