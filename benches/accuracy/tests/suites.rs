//! Every row of every suite holds.

use ringlight_accuracy::suite::SUITES;

/// Measures the suite of this name and asserts its rows.
fn check(name: &str) {
    let (_, measure) = SUITES.iter().find(|(other, _)| *other == name).unwrap_or_else(|| panic!("no suite {name}"));
    measure().assert();
}

macro_rules! suites {
    ($($name:ident)*) => {
        $(#[test] fn $name() { check(stringify!($name)); })*

        #[test]
        fn every_suite_has_its_test() {
            let tested: &[&str] = &[$(stringify!($name)),*];
            assert_eq!(tested, SUITES.iter().map(|(name, _)| *name).collect::<Vec<_>>());
        }
    };
}

suites! {
    view_factors
    obstructed_view_factors
    view_factor_matrices
    hemicube
    disc_sum
    cie171_area_source
    cie171_ground
    cie171_interreflection
    cornell
    cube
    white_furnace
    furnace
    integrating_sphere
    dense
    energy
    convergence
    path_tracing
}
