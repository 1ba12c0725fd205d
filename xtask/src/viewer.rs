//! `cargo xtask viewer`: the page of the live view, from `viewer/` to `viewer/dist`, where `ringlight-view` embeds it.

use crate::test::{command, step};
use anyhow::{Context, Result, ensure};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Builds the page.
pub fn build(root: &Path) -> Result<()> {
    let folder = install(root)?;
    step("page", command(&folder, "npm", "run --silent build -- --logLevel warn"))
}

/// Checks the page's types, and its side of the protocol.
pub fn test(root: &Path) -> Result<()> {
    step("tests of the page", command(&root.join("viewer"), "npm", "run --silent test"))
}

/// Tests the page in a browser, beside bakes by the `ringlight` at `program`.
pub fn test_in_browser(root: &Path, program: &Path, message_passing: bool) -> Result<()> {
    let mut tests = command(&root.join("viewer"), "npm", "run --silent browser");
    tests.env("RINGLIGHT", program).env("RINGLIGHT_MPI", if message_passing { "1" } else { "0" });
    step("tests in the browser", tests)
}

/// Installs what the lock file says, unless that is there.
fn install(root: &Path) -> Result<PathBuf> {
    let folder = root.join("viewer");
    let (lock, mark) = (folder.join("package-lock.json"), folder.join("node_modules/.installed.json"));
    let wanted = fs::read(&lock).context("viewer/package-lock.json cannot be read")?;
    if fs::read(&mark).ok().as_ref() != Some(&wanted) {
        step("what the page needs", command(&folder, "npm", "ci --no-audit --no-fund --silent"))?;
        fs::write(mark, wanted)?;
    }
    Ok(folder)
}

#[derive(Deserialize)]
struct Lock {
    packages: BTreeMap<String, Package>,
}

#[derive(Deserialize)]
struct Package {
    version: Option<String>,
    license: Option<String>,
}

/// Name and version, and licence, of all packages that a lock file of npm names.
pub fn licences(lock: &Path) -> Result<Vec<(String, String)>> {
    let text = fs::read_to_string(lock).with_context(|| format!("{} cannot be read", lock.display()))?;
    let lock: Lock = serde_json::from_str(&text).with_context(|| lock.display().to_string())?;
    ensure!(!lock.packages.is_empty(), "a lock file without packages");
    let package = |(path, package): (String, Package)| {
        let name = path.rsplit_once("node_modules/").map_or("the page", |(_, name)| name).to_owned();
        (format!("{name} {}", package.version.unwrap_or_default()), package.license.unwrap_or_else(|| "none".into()))
    };
    Ok(lock.packages.into_iter().map(package).collect())
}
