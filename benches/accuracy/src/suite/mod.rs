//! The suites, in the order of the page.

mod cie171;
mod cornell;
mod cube;
mod furnace;
mod sphere;

use crate::Section;

/// A suite: its name, and what measures it.
pub type Suite = (&'static str, fn() -> Section);

/// All suites, in the order of the page. Every one has a test of its name in `tests/suites.rs`.
pub const SUITES: &[Suite] = &[
    ("cie171_area_source", cie171::area_source),
    ("cie171_ground", cie171::ground),
    ("cie171_interreflection", cie171::interreflection),
    ("cornell", cornell::measure),
    ("cube", cube::measure),
    ("furnace", furnace::measure),
    ("white_furnace", furnace::white),
    ("integrating_sphere", sphere::measure),
];
