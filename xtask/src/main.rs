//! Project tasks: `cargo xtask` lists them.

mod licences;
mod scenes;
mod test;
mod tidy;

use anyhow::{Result, bail};
use std::path::Path;
use std::process::ExitCode;

const HELP: &str = "\
cargo xtask TASK
  test       everything that has to pass, the tests last
  tidy       the rules of the source tree (CONTRIBUTING.md)
  licences   the licences of all dependencies against deny.toml
  scenes     write the generated files in scenes/";

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
        ["scenes"] => scenes::run(&root.join("scenes")),
        [] => {
            println!("{HELP}");
            Ok(())
        }
        _ => bail!("{HELP}"),
    }
}
