//! The suites, in the order of the page.

mod cie171;
mod convergence;
mod cornell;
mod cube;
mod dense;
mod disc_sum;
mod energy;
mod furnace;
mod hemicube;
mod obstructed_view_factors;
mod path_tracing;
mod sphere;
mod view_factor_matrices;
mod view_factors;

use crate::Section;

/// A suite: its name, and what measures it.
pub type Suite = (&'static str, fn() -> Section);

/// All suites, in the order of the page. Every one has a test of its name in `tests/suites.rs`.
pub const SUITES: &[Suite] = &[
    ("view_factors", view_factors::measure),
    ("obstructed_view_factors", obstructed_view_factors::measure),
    ("view_factor_matrices", view_factor_matrices::measure),
    ("hemicube", hemicube::measure),
    ("disc_sum", disc_sum::measure),
    ("cie171_area_source", cie171::area_source),
    ("cie171_ground", cie171::ground),
    ("cie171_interreflection", cie171::interreflection),
    ("cornell", cornell::measure),
    ("cube", cube::measure),
    ("white_furnace", furnace::white),
    ("furnace", furnace::measure),
    ("integrating_sphere", sphere::measure),
    ("dense", dense::measure),
    ("energy", energy::measure),
    ("convergence", convergence::measure),
    ("path_tracing", path_tracing::measure),
];
