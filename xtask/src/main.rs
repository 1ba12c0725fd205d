//! Project tasks: `cargo xtask` lists them.

mod scenes;

use anyhow::{Result, bail};
use std::path::Path;

const HELP: &str = "\
cargo xtask TASK
  scenes     write the generated scenes under scenes/";

fn main() -> Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("xtask lies in the workspace");
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["scenes"] => scenes::run(&root.join("scenes"), false),
        _ => bail!("{HELP}"),
    }
}
