//! The suites, in the order of the page.

mod furnace;
mod obstructed_view_factors;
mod view_factor_matrices;
mod view_factors;

use crate::Section;

/// A suite: its name, and what measures it.
pub type Suite = (&'static str, fn() -> Section);

/// All suites, in the order of the page. Every one has a test of its name in `tests/suites.rs`.
pub const SUITES: &[Suite] = &[
    ("furnace", furnace::measure),
    ("view_factors", view_factors::measure),
    ("obstructed_view_factors", obstructed_view_factors::measure),
    ("view_factor_matrices", view_factor_matrices::measure),
];
