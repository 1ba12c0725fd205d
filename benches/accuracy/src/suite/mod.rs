//! The suites, in the order of the page.

mod convergence;
mod dense;
mod disc_sum;
mod energy;
mod furnace;
mod hemicube;

use crate::Section;

/// A suite: its name, and what measures it.
pub type Suite = (&'static str, fn() -> Section);

/// All suites, in the order of the page. Every one has a test of its name in `tests/suites.rs`.
pub const SUITES: &[Suite] = &[
    ("furnace", furnace::measure),
    ("dense", dense::measure),
    ("hemicube", hemicube::measure),
    ("disc_sum", disc_sum::measure),
    ("convergence", convergence::measure),
    ("energy", energy::measure),
];
