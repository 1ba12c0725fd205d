//! Writes `docs/accuracy.md`: `cargo xtask accuracy [SUITE…]`.

use anyhow::{Context, Result, bail};
use ringlight_accuracy::{page, suite::SUITES};
use std::path::Path;

fn main() -> Result<()> {
    let wanted: Vec<String> = std::env::args().skip(1).collect();
    if let Some(unknown) = wanted.iter().find(|name| SUITES.iter().all(|(other, _)| other != name)) {
        let names: Vec<&str> = SUITES.iter().map(|(name, _)| *name).collect();
        bail!("no suite {unknown}; there are {}", names.join(", "));
    }
    let mut sections = Vec::new();
    for (name, measure) in SUITES.iter().filter(|(name, _)| wanted.is_empty() || wanted.iter().any(|w| w == name)) {
        eprintln!("measuring {name}");
        sections.push((*name, measure()));
    }
    if !wanted.is_empty() {
        // A part is for looking at; the page is always whole.
        for (name, section) in &sections {
            print!("{}", page::section(name, section));
        }
        return Ok(());
    }
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs");
    page::write(&docs, &sections).with_context(|| format!("{} cannot be written", docs.display()))
}
