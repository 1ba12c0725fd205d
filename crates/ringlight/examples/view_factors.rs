//! Times view factors of pairs of unit squares with nothing between, and one with half a screen; prints CSV.
//!
//! ```text
//! cargo run --release -p ringlight --example view_factors
//! ```
//!
//! `benches/view_factors.py` runs it beside pyviewfactor.

use glam::DVec3;
use ringlight::view_factor::{Occluder, Occluders, Polygon, Tolerance, Work, exchange};
use ringlight_visibility::NO_PLANE;
use std::hint::black_box;
use std::time::Instant;

/// Runs of which the median counts; short ones, so that most of them are not interrupted.
const RUNS: usize = 201;

fn main() {
    let polygon =
        |corners: [[f64; 3]; 4]| Polygon::new(corners.map(DVec3::from).into(), NO_PLANE).expect("a square has an area");
    let square = polygon([[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]]);
    let above = |d: f64| polygon([[0., 0., d], [0., 1., d], [1., 1., d], [1., 0., d]]);
    let wall = |z: f64| polygon([[0., 0., z], [0., 1., z], [0., 1., 1. + z], [0., 0., 1. + z]]);
    let corners = [[0., 0., 0.5], [0.5, 0., 0.5], [0.5, 1., 0.5], [0., 1., 0.5]].map(DVec3::from);
    let screen = [[0, 1, 2], [0, 2, 3]].map(|t| Occluder { corners: t.map(|k: usize| corners[k]), plane: NO_PLANE });
    let screen = Occluders::new(screen.into());
    println!("case,value,error estimate,ms per pair");
    let parallel = [0.1, 0.5, 1.0, 3.0, 10.0].map(|d| (format!("parallel d={d}"), above(d), None));
    let others = [
        ("perpendicular common edge".into(), wall(0.0), None),
        ("perpendicular gap 0.1".into(), wall(0.1), None),
        ("half screen".into(), above(1.0), Some(&screen)),
    ];
    let mut work = Work::default();
    for (name, other, occluders) in parallel.into_iter().chain(others) {
        let mut pair = || exchange(black_box(&square), black_box(&other), occluders, &Tolerance::default(), &mut work);
        let found = pair();
        let mut times: Vec<f64> = (0..RUNS)
            .map(|_| {
                let begin = Instant::now();
                let times = if occluders.is_some() { 1 } else { 100 };
                for _ in 0..times {
                    black_box(pair());
                }
                begin.elapsed().as_secs_f64() * 1e3 / f64::from(times)
            })
            .collect();
        times.sort_by(f64::total_cmp);
        println!("{name},{},{},{}", found.area, found.error, times[RUNS / 2]);
    }
}
