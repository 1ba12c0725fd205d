//! The page: `docs/accuracy.md` and its diagrams.

use crate::{Bound, Row, Section};
use anyhow::Result;
use std::fmt::Write;
use std::fs;
use std::path::Path;

const INTRODUCTION: &str = "\
# Accuracy

Ringlight beside exact values, published tables and other methods. Written by `cargo xtask accuracy`, nothing is edited
by hand. Every row with a bound is held to it by a test. *Expected* is exact or published where the section names a source; where the bound
says *at most* it is the bound itself.
";

/// Writes the page and its diagrams into `docs`.
pub fn write(docs: &Path, sections: &[(&str, Section)]) -> Result<()> {
    let diagrams = docs.join("accuracy");
    fs::create_dir_all(&diagrams)?;
    let mut text = INTRODUCTION.to_string();
    for (name, part) in sections {
        text.push_str(&section(name, part));
        for plot in &part.plots {
            fs::write(diagrams.join(format!("{}.svg", plot.name)), plot.svg()?)?;
        }
    }
    fs::write(docs.join("accuracy.md"), text)?;
    Ok(())
}

/// One section as Markdown.
pub fn section(name: &str, section: &Section) -> String {
    let mut text = String::new();
    writeln!(text, "\n## {}\n\n{}\n\nTest: `{name}`.", section.title, section.text.trim()).ok();
    if !section.rows.is_empty() {
        writeln!(text, "\n| case | expected | found | deviation | bound |\n|---|---:|---:|---:|---:|").ok();
    }
    for row in &section.rows {
        let (expected, found) = (number(row.expected), number(row.found));
        writeln!(text, "| {} | {expected} | {found} | {} | {} |", row.case, deviation(row), bound(row)).ok();
    }
    if let Some((headings, rows)) = &section.table {
        writeln!(text, "\n| {} |\n|{}", headings.join(" | "), "---|".repeat(headings.len())).ok();
        rows.iter().for_each(|cells| writeln!(text, "| {} |", cells.join(" | ")).unwrap_or_default());
    }
    for plot in &section.plots {
        writeln!(text, "\n![{}](accuracy/{}.svg)", plot.title, plot.name).ok();
    }
    text
}

/// A number with as many digits as say something.
pub fn number(value: f64) -> String {
    match value.abs() {
        0.0 => "0".into(),
        a if !(1e-3..1e6).contains(&a) => format!("{value:.4e}"),
        a => format!("{value:.*}", (7 - a.log10().floor() as i32).clamp(0, 9) as usize),
    }
}

/// A share as people read it.
fn share(value: f64) -> String {
    if value.abs() < 1e-4 { format!("{value:.1e}") } else { format!("{:.3} %", 100.0 * value) }
}

fn deviation(row: &Row) -> String {
    match row.bound {
        Bound::AtMost => String::new(),
        _ if row.expected == 0.0 => format!("{:+.1e}", row.deviation()),
        _ => share(row.deviation()),
    }
}

fn bound(row: &Row) -> String {
    match row.bound {
        Bound::Relative(r) => share(r),
        Bound::Absolute(a) => format!("±{}", number(a)),
        Bound::Larger { relative, absolute } => format!("{} or ±{}", share(relative), number(absolute)),
        Bound::AtMost => "at most".into(),
    }
}
