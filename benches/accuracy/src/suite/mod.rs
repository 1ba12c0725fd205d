//! The suites, in the order of the page.

mod furnace;
mod path_tracing;

use crate::Section;

/// A suite: its name, and what measures it.
pub type Suite = (&'static str, fn() -> Section);

/// All suites, in the order of the page. Every one has a test of its name in `tests/suites.rs`.
pub const SUITES: &[Suite] = &[("furnace", furnace::measure), ("path_tracing", path_tracing::measure)];
