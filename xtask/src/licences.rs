//! `cargo xtask licences`: every dependency, of cargo or npm, must be usable under a licence that `deny.toml` allows. Works
//! offline.

use crate::viewer;
use anyhow::{Context, Result, ensure};
use serde::Deserialize;
use std::fs;
use std::path::Path;
use std::process::Command;

#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
}

#[derive(Deserialize)]
struct Package {
    name: String,
    version: String,
    license: Option<String>,
}

/// Checks all packages of the lock files.
pub fn run(root: &Path) -> Result<()> {
    let rules = fs::read_to_string(root.join("deny.toml")).context("cannot read deny.toml")?;
    let allowed = allowed(&rules);
    ensure!(!allowed.is_empty(), "deny.toml allows no licence");
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--locked"])
        .current_dir(root)
        .output()
        .context("cannot run cargo metadata")?;
    ensure!(output.status.success(), "cargo metadata failed: {}", String::from_utf8_lossy(&output.stderr));
    let metadata: Metadata = serde_json::from_slice(&output.stdout)?;
    let mut refused = Vec::new();
    for package in &metadata.packages {
        let licence = package.license.as_deref().unwrap_or("none");
        if !satisfied(licence, &allowed) {
            refused.push(format!("{} {}: {licence}", package.name, package.version));
        }
    }
    let mut count = metadata.packages.len();
    for lock in ["viewer/package-lock.json", "xtask/tools/package-lock.json"] {
        for (package, licence) in viewer::licences(&root.join(lock))? {
            count += 1;
            if !satisfied(&licence, &allowed) {
                refused.push(format!("{package}: {licence} ({lock})"));
            }
        }
    }
    ensure!(refused.is_empty(), "licences that deny.toml does not allow:\n{}", refused.join("\n"));
    println!("licences of {count} packages are allowed");
    Ok(())
}

/// The quoted words of `allow = [ … ]` in the section `[licenses]`.
fn allowed(rules: &str) -> Vec<&str> {
    let section = rules.split_once("[licenses]").map_or("", |(_, after)| after);
    let list =
        section.split_once("allow = [").and_then(|(_, after)| after.split_once(']')).map_or("", |(list, _)| list);
    list.split('"').skip(1).step_by(2).collect()
}

/// Whether an SPDX expression holds when only `allowed` licences may be chosen. `/` is an old way to write OR.
fn satisfied(expression: &str, allowed: &[&str]) -> bool {
    let spaced = expression.replace('/', " OR ").replace('(', " ( ").replace(')', " ) ").replace(" WITH ", "+WITH+");
    let words: Vec<&str> = spaced.split_whitespace().collect();
    let mut parser = Parser { words: &words, allowed };
    parser.any() && parser.words.is_empty()
}

struct Parser<'a> {
    words: &'a [&'a str],
    allowed: &'a [&'a str],
}

impl Parser<'_> {
    fn take(&mut self, word: &str) -> bool {
        let found = self.words.first() == Some(&word);
        self.words = &self.words[usize::from(found)..];
        found
    }

    fn any(&mut self) -> bool {
        let mut result = self.all();
        while self.take("OR") {
            result |= self.all();
        }
        result
    }

    fn all(&mut self) -> bool {
        let mut result = self.one();
        while self.take("AND") {
            result &= self.one();
        }
        result
    }

    fn one(&mut self) -> bool {
        if self.take("(") {
            let result = self.any();
            return self.take(")") && result;
        }
        let Some((word, rest)) = self.words.split_first() else { return false };
        self.words = rest;
        self.allowed.contains(&word.replace("+WITH+", " WITH ").as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn expressions_are_understood() {
        let allowed = ["MIT", "Zlib", "Apache-2.0 WITH LLVM-exception"];
        for good in ["MIT", "Unlicense/MIT", "GPL-3.0 OR (MIT AND Zlib)", "Apache-2.0 WITH LLVM-exception OR X"] {
            assert!(satisfied(good, &allowed), "{good}");
        }
        for bad in ["", "none", "GPL-3.0", "MIT AND GPL-3.0", "(MIT OR Zlib) AND X", "MIT )", "(MIT", "Apache-2.0"] {
            assert!(!satisfied(bad, &allowed), "{bad}");
        }
    }

    #[test]
    fn the_list_is_found() {
        assert_eq!(allowed("[licenses]\nallow = [\n \"A\",\n \"B\"\n]\n[x]\nallow = [\"C\"]"), ["A", "B"]);
    }
}
