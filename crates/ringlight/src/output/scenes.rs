//! Small solved scenes for the tests of pictures and tables.

use super::{Picture, PictureOptions, View, fixture, render};
use crate::solution::Solution;

/// A floor of 4.2 m × 4 m, a lamp of 1 m × 1 m two metres above it, and a standing triangle.
pub const LAMP_OVER_FLOOR: &str = "\
    v -2 0 2\nv 2.2 0 2\nv 2.2 0 -2\nv -2 0 -2\nv -.5 2 -.5\nv .5 2 -.5\nv .5 2 .5\nv -.5 2 .5\n\
    v -2 0 -1.5\nv 0 0 -1.5\nv -2 1 -1.5\n\
    o floor\nusemtl grey\nf 1 2 3 4\no lamp\nusemtl lamp\nf 5 6 7 8\no sail\nusemtl white\nf 9 10 11\n";

/// A closed room of 4 m × 3 m × 5 m from (10, 0, 0) with a lamp under its ceiling.
pub const ROOM: &str = "\
    v 10 0 0\nv 14 0 0\nv 14 0 5\nv 10 0 5\nv 10 3 0\nv 14 3 0\nv 14 3 5\nv 10 3 5\n\
    v 11.5 2.9 2\nv 12.5 2.9 2\nv 12.5 2.9 3\nv 11.5 2.9 3\n\
    usemtl grey\no floor\nf 4 3 2 1\no ceiling\nf 5 6 7 8\no north\nf 1 2 6 5\no south\nf 3 4 8 7\n\
    usemtl white\no west\nf 4 1 5 8\nusemtl grey\no east\nf 2 3 7 6\nusemtl lamp\no lamp\nf 9 10 11 12\n";

/// Reads, cuts into elements of `element_size` metres, and solves.
pub fn solved(obj: &str, element_size: f64) -> Solution {
    fixture::solve(fixture::read(obj), element_size, 0.01)
}

/// The picture of a rank that is alone.
pub fn draw(solution: &Solution, options: &PictureOptions) -> Picture {
    let (mut ring, mut ranks) = fixture::alone(solution);
    render(solution, options, &mut ring, &mut ranks).unwrap().unwrap().picture
}

/// The automatic view of a rank that is alone.
pub fn automatic(solution: &Solution, aspect: f64) -> View {
    let (mut ring, mut ranks) = fixture::alone(solution);
    View::automatic(solution, aspect, &mut ring, &mut ranks).unwrap()
}
