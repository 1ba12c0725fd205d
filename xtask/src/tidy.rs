//! `cargo xtask tidy`: the rules of the source tree that a machine can check.

use anyhow::{Context, Result, ensure};
use std::fs;
use std::path::Path;
use std::process::Command;

/// Modules of the library in the order in which data flows: each may name those before it.
const ORDER: [&str; 18] = [
    "quantity",
    "column",
    "resources",
    "scene",
    "mesh",
    "form_factor",
    "shooting",
    "ring",
    "transport",
    "solve",
    "solution",
    "smooth",
    "adapt",
    "probe",
    "view_factor",
    "plan",
    "output",
    "lib",
];

/// Modules with words that they never name, though the order would allow it. A part of a longer name counts.
const NEVER: [(&str, &[&str]); 2] = [
    ("ring", &["quantity", "scene", "form_factor", "shooting", "radiosity", "irradiance", "exitance", "Rgb"]),
    ("shooting", &["transport", "ring", "Transport", "rank", "ranks"]),
];

/// What the library does not do itself.
const OUTSIDE: [&str; 5] = ["std::fs", "std::env", "std::net", "std::time::Instant", "std::time::SystemTime"];

/// Paths where `unsafe` may be.
const UNSAFE_HOMES: [&str; 3] =
    ["crates/ringlight-visibility/", "crates/ringlight-cli/src/map.rs", "crates/ringlight-mpi/src/sending.rs"];

/// Paths that may name the crate `mpi`.
const MPI_HOMES: [&str; 2] = ["crates/ringlight-mpi/", "crates/ringlight-cli/src/launch.rs"];

/// Most lines of a source file.
const MOST_LINES: usize = 450;

/// Beginnings of paths that exist on one machine only, cut in two so that this file does not hold them.
const MACHINE_PATHS: [[&str; 2]; 5] =
    [["/ho", "me/"], ["/ro", "ot/"], ["/wo", "rk/"], ["/Us", "ers/"], [":\\Us", "ers\\"]];

const LIBRARY: &str = "crates/ringlight/src/";

/// Checks every file that is tracked or could be.
pub fn run(root: &Path) -> Result<()> {
    let output = Command::new("git")
        .args(["ls-files", "--cached", "--others", "--exclude-standard", "-z"])
        .current_dir(root)
        .output()
        .context("cannot run git")?;
    ensure!(output.status.success(), "git ls-files failed: {}", String::from_utf8_lossy(&output.stderr));
    let mut problems = Vec::new();
    let mut count = 0;
    for path in String::from_utf8_lossy(&output.stdout).split_terminator('\0') {
        let Ok(bytes) = fs::read(root.join(path)) else { continue };
        let Ok(text) = String::from_utf8(bytes) else { continue };
        count += 1;
        problems.extend(check(path, &text));
    }
    ensure!(problems.is_empty(), "{}", problems.join("\n"));
    println!("{count} files are tidy");
    Ok(())
}

/// The problems of one file, each with its place.
fn check(path: &str, text: &str) -> Vec<String> {
    let mut problems = Vec::new();
    let mut problem = |line: usize, what: String| problems.push(format!("{path}:{}: {what}", line + 1));
    for (number, line) in text.lines().enumerate() {
        if let Some(start) = MACHINE_PATHS.map(|parts| parts.concat()).iter().find(|start| line.contains(*start)) {
            problem(number, format!("a path of one machine ({start}…)"));
        }
    }
    if !path.ends_with(".rs") {
        return problems;
    }
    let lines = text.lines().count();
    if lines > MOST_LINES {
        problem(lines - 1, format!("{lines} lines; at most {MOST_LINES}"));
    }
    let mut statement = String::new();
    let mut start = 0;
    let mut in_tests = path.ends_with("/tests.rs") || path.contains("/tests/");
    for (number, line) in text.lines().enumerate() {
        let code = code(line);
        for (word, homes) in [("unsafe", &UNSAFE_HOMES[..]), ("mpi", &MPI_HOMES[..])] {
            if !homes.iter().any(|home| path.starts_with(home)) && words(&code).any(|found| found == word) {
                problem(number, format!("`{word}` outside its home"));
            }
        }
        // Test modules stand last in a file and may name anything.
        in_tests |= line == "#[cfg(test)]" && text.lines().nth(number + 1).is_some_and(|next| next.ends_with('{'));
        let Some(module) = path.strip_prefix(LIBRARY).filter(|_| !in_tests) else { continue };
        let module = module.split(['/', '.']).next().unwrap_or_default();
        if let Some((_, never)) = NEVER.iter().find(|(name, _)| *name == module) {
            for word in words(&code).filter(|word| never.contains(word)) {
                problem(number, format!("`{module}` names `{word}`"));
            }
        }
        // A `use` may go over several lines: it is looked at as a whole.
        if statement.is_empty() {
            start = number;
        }
        statement.push_str(code.trim());
        let is_use = statement.starts_with("use ") || statement.starts_with("pub use ");
        if is_use && !statement.ends_with(';') {
            continue;
        }
        for used in paths(&statement) {
            if let Some(outside) = OUTSIDE.iter().find(|outside| is_or_under(&used, outside)) {
                problem(start, format!("the library names `{outside}`"));
            }
            let Some(other) = used.strip_prefix("crate::").and_then(|rest| rest.split("::").next()) else { continue };
            let place = |name: &str| ORDER.iter().position(|known| *known == name);
            match (place(module), place(other)) {
                (None, _) => problem(start, format!("module `{module}` has no place in the order of data flow")),
                (Some(here), Some(there)) if there > here => {
                    problem(start, format!("`{module}` names `{other}`, which comes after it"));
                }
                _ => {}
            }
        }
        statement.clear();
    }
    problems
}

fn is_or_under(path: &str, parent: &str) -> bool {
    path.strip_prefix(parent).is_some_and(|rest| rest.is_empty() || rest.starts_with("::"))
}

/// A line without its comment and without what its strings say.
fn code(line: &str) -> String {
    let line = line.replace("'\"'", "' '");
    let (mut code, mut in_string, mut escaped) = (String::with_capacity(line.len()), false, false);
    for (place, c) in line.char_indices() {
        if !in_string && line[place..].starts_with("//") {
            break;
        }
        if c == '"' && !escaped {
            in_string = !in_string;
        }
        if !in_string {
            code.push(c);
        }
        escaped = in_string && c == '\\' && !escaped;
    }
    code
}

/// The identifiers of a line.
fn words(code: &str) -> impl Iterator<Item = &str> {
    code.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|word| !word.is_empty())
}

/// The paths in a statement that start with `crate` or `std`, those in braces written out.
fn paths(statement: &str) -> Vec<String> {
    let mut found = Vec::new();
    for root in ["crate::", "std::"] {
        for (start, _) in statement.match_indices(root) {
            let free = !statement[..start].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ':');
            if free {
                expand("", &statement[start..], &mut found);
            }
        }
    }
    found
}

/// Reads one path, or a group of them in braces, and returns what follows.
fn expand<'a>(prefix: &str, text: &'a str, found: &mut Vec<String>) -> &'a str {
    let end = text.find(|c: char| !c.is_alphanumeric() && c != '_' && c != ':').unwrap_or(text.len());
    let path = format!("{prefix}{}", &text[..end]);
    let Some(mut rest) = text[end..].strip_prefix('{').filter(|_| path.ends_with("::")) else {
        found.push(path.trim_end_matches(':').to_owned());
        return &text[end..];
    };
    loop {
        rest = expand(&path, rest.trim_start(), found);
        // What follows a name up to the next one: ` as other`, `*`.
        rest = rest.trim_start_matches(|c| c != ',' && c != '}');
        match rest.strip_prefix(',') {
            Some(after) => rest = after,
            None => return rest.strip_prefix('}').unwrap_or(rest),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_written_out() {
        let written = paths("use std::{fs, io::{self, Read}, time as t,};");
        assert_eq!(written, ["std::fs", "std::io::self", "std::io::Read", "std::time", "std"]);
        assert_eq!(paths("let x = my_crate::y(crate::mesh::Z);"), ["crate::mesh::Z"]);
    }

    #[test]
    fn rules_are_kept() {
        let scene = "crates/ringlight/src/scene/mod.rs";
        assert_eq!(check(scene, "use crate::resources::Bytes;\nuse super::error;\n"), [""; 0]);
        let found =
            check(scene, "\nuse crate::{\n    mesh::Mesh,\n    quantity,\n};\nlet now = std::time::Instant::now();");
        let name = "the library names `std::time::Instant`";
        assert_eq!(
            found,
            [format!("{scene}:2: `scene` names `mesh`, which comes after it"), format!("{scene}:6: {name}")]
        );
        let tested = "fn f() {}\n#[cfg(test)]\nmod tests {\n    use std::fs;\n}\n";
        assert_eq!(check(scene, tested), [""; 0]);
        assert_eq!(check("crates/ringlight/src/ring/a.rs", "use crate::quantity::Rgb;").len(), 2);
        assert_eq!(check("crates/ringlight/src/shooting/mod.rs", "fn f(rank: u32) {} // rank").len(), 1);
        assert_eq!(check("crates/ringlight/src/stray.rs", "use crate::mesh;").len(), 1);
    }

    #[test]
    fn unsafe_long_files_and_machine_paths_are_found() {
        assert_eq!(check("xtask/src/a.rs", "unsafe {} // unsafe").len(), 1);
        assert_eq!(check("xtask/src/a.rs", r#"let text = ("\\\"// unsafe", '"', "unsafe");"#).len(), 0);
        assert_eq!(check("crates/ringlight-visibility/src/a.rs", "unsafe {}").len(), 0);
        assert_eq!(check("a.rs", &"\n".repeat(451)).len(), 1);
        let start = MACHINE_PATHS[0].concat();
        assert_eq!(check("a.md", &format!("see {start}me")), [format!("a.md:1: a path of one machine ({start}…)")]);
    }
}
