//! Adaptive elements: smaller ones where light changes in ways that larger ones cannot follow (paper, section 6).
//!
//! The scene is solved roughly first. Where the light at an element's sample point is not what its neighbours let expect, its
//! patch is cut finer, and the scene solved again; what is solved with the accuracy asked for is the last mesh alone. So no light
//! has to be carried over from parents to children, all that decides is the light of whole solutions, which is the same bits on
//! any number of ranks, and who owns what is dealt out anew by the elements that there are.

use crate::mesh::{ALL_VALID, Frame, Inquiry, Patch};
use crate::quantity::Rgb;
use crate::shooting::{Glance, spiral, strength};
use crate::smooth::{Smooth, interpolate};
use crate::solution::Solution;
use crate::solve::Ring;
use crate::transport::{Communicator, Failure};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use ringlight_visibility::Layout;

/// How fine elements become.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fineness {
    /// Elements of the size asked for are cut into three parts along both sides so many times at most.
    pub levels: u32,
    /// Light of an element may differ from what is expected by this share of itself.
    pub tolerance: f64,
}

/// Light less than this share of the usual is not followed more closely than if it were as much.
const USUAL: f32 = 1.5;

/// Parts along a side: three, so that the sample point in the middle of an element stays that of a smaller one, and what was found
/// there stays true.
const PARTS: u32 = 3;

/// The most levels: subdivisions are one byte.
pub const MOST_LEVELS: u32 = 5;

/// Facets are cut into whole numbers of elements, which are narrower than they might be: those up to so many times as large as the finest
/// are not cut.
const SPARE: f64 = 1.2;

/// Rays that tell whether light changes within an element; to do so it has to change by so many times the tolerance, as so few rays tell.
const RAYS: u32 = 64;
const DOUBT: f32 = 2.0;

/// Corners between which light changes by less than this share of itself tell nothing of how it changes: as a rule, there is no neighbour.
const EVEN: f32 = 0.01;

/// What tells where elements are to be smaller.
struct Judge<'a> {
    solution: &'a Solution,
    smooth: Smooth<'a>,
    tolerance: f32,
    /// Light less than this is not followed more closely than if it were as much, W/m² or lux.
    least: f32,
    /// Elements no wider, or longer, than this are not cut, metres.
    finest: f64,
    /// About the z axis.
    directions: Vec<DVec3>,
}

/// How finely the patches of a solved scene are to be cut, for [`crate::mesh::Mesh::refined`]; none finer than
/// `fineness.levels` say, and each at most three times as fine as it was. Every rank calls it; rank 0, which has the light of all,
/// gets them.
pub fn subdivisions<'a>(
    solution: &'a Solution,
    fineness: &Fineness,
    ring: &mut Ring<'a>,
    ranks: &mut Communicator<'_>,
) -> Result<Vec<u8>, Failure> {
    if ranks.rank() > 0 {
        ring.ask(ranks, std::iter::empty::<()>(), |(), _| async {}, |()| ())?;
        return Ok(Vec::new());
    }
    let mesh = &solution.mesh;
    let judge = &Judge::new(solution, fineness);
    let all = (0..mesh.patch_count() as u32).into_par_iter();
    let mut splits: Vec<Option<bool>> = all.map(|id| judge.splits(&mesh.patch(id), mesh.subdivision(id))).collect();
    let unknown: Vec<u32> = (0..).zip(&splits).filter_map(|(id, splits)| splits.is_none().then_some(id)).collect();
    let look =
        |id: u32, inquiry: Inquiry<'a>| async move { (id, judge.changes_within(&mesh.patch(id), &inquiry).await) };
    ring.ask(ranks, unknown.into_iter(), look, |(id, changes)| splits[id as usize] = Some(changes))?;
    let wanted = |(id, splits): (u32, &Option<bool>)| {
        let parts = if *splits == Some(true) { PARTS } else { 1 };
        (parts * mesh.subdivision(id)) as u8
    };
    Ok((0..).zip(&splits).map(wanted).collect())
}

impl<'a> Judge<'a> {
    fn new(solution: &'a Solution, fineness: &Fineness) -> Judge<'a> {
        let light = |element: u32| strength(solution.irradiance(element));
        let all = 0..solution.mesh.element_count() as u32;
        let mut lit: Vec<f32> = all.into_par_iter().map(light).filter(|&e| e > 0.0).collect();
        let middle = lit.len() / 2;
        let usual = if lit.is_empty() { 0.0 } else { *lit.select_nth_unstable_by(middle, f32::total_cmp).1 };
        Judge {
            solution,
            smooth: Smooth::without_rays(solution),
            tolerance: fineness.tolerance as f32,
            least: USUAL * usual,
            finest: SPARE * solution.mesh.sizes.element / f64::from(PARTS.pow(fineness.levels.min(MOST_LEVELS))),
            directions: spiral(RAYS),
        }
    }

    /// How much light may differ from what is expected in an element that has so much.
    fn allowed(&self, own: f32) -> f32 {
        self.tolerance * own.max(self.least)
    }

    /// Whether a patch whose elements are cut into `subdivision` parts is to be cut finer; none if its elements and their neighbours do
    /// not tell.
    fn splits(&self, patch: &Patch, subdivision: u32) -> Option<bool> {
        let (mesh, layout) = (&self.solution.mesh, patch.frame.layout);
        let width = (patch.area / f64::from(patch.element_count())).sqrt();
        let [columns, rows] = patch.grid.map(f64::from);
        let length = f64::max(patch.frame.edge_u.length() / columns, patch.frame.edge_v.length() / rows);
        if length <= self.finest || subdivision * PARTS > PARTS.pow(MOST_LEVELS) {
            return Some(false);
        }
        let differs = |element: u32| match mesh.valid[element as usize] {
            0 => false,
            ALL_VALID => {
                let own = strength(self.solution.irradiance(element));
                (expected(&self.smooth.corners(element), layout) - own).abs() > self.allowed(own)
            }
            // What stands on it casts its shadow there.
            _ => true,
        };
        (width > self.finest && patch.elements().any(differs)).then_some(true)
    }

    /// Whether what is seen from elsewhere within an element of a patch reflects more or less light than what its sample point sees,
    /// where its corners do not tell: on a narrow face and in a slot, light changes from one edge to the other.
    async fn changes_within(&self, patch: &Patch, inquiry: &Inquiry<'_>) -> bool {
        let (mesh, layout) = (&self.solution.mesh, patch.frame.layout);
        for (number, element) in (0..).zip(patch.elements()) {
            let own = strength(self.solution.irradiance(element));
            if own == 0.0 || mesh.valid[element as usize] != ALL_VALID {
                continue;
            }
            let corners = self.smooth.corners(element);
            let shown = |at: DVec2| strength(interpolate(&corners, layout, at));
            let middle = Frame::middle(layout);
            let untold = |at: &DVec2| (shown(*at) - shown(middle)).abs() <= EVEN * own;
            let places = std::iter::once(middle).chain(elsewhere(layout).into_iter().filter(untold));
            let tile = patch.element_tile(number);
            let points: Vec<_> = places.map(|at| (patch.frame.at(tile.at(at)), patch.plane)).collect();
            if points.len() == 1 {
                continue;
            }
            let glances: Vec<Glance<'_>> =
                inquiry.follow(Glance::about(mesh, &points, patch.normal, &self.directions)).await;
            let from = |place: usize| {
                let seen = glances[place..].iter().step_by(points.len()).flat_map(|glance| &glance.seen);
                seen.map(|&(e, share)| share * self.reflected(e)).sum::<f32>() / RAYS as f32
            };
            let (found, allowed) = (from(0), DOUBT * self.allowed(own));
            if (1..points.len()).any(|place| (from(place) - found).abs() > allowed) {
                return true;
            }
        }
        false
    }

    /// What an element reflects, W/m² or lm/m².
    fn reflected(&self, element: u32) -> f32 {
        let (mesh, received) = (&self.solution.mesh, self.solution.irradiance(element));
        let returned = mesh.colour(&mesh.patch(mesh.patch_of(element)), element).returned();
        strength([0, 1, 2].map(|c| returned[c] * received[c].max(0.0)))
    }
}

/// What the light at an element's corners lets expect at its middle.
fn expected(corners: &[Rgb; 4], layout: Layout) -> f32 {
    let count = if layout == Layout::Triangle { 3 } else { 4 };
    corners[..count].iter().map(|&light| strength(light)).sum::<f32>() / count as f32
}

/// Middles of parts of an element that lie towards its sides, or its corners.
fn elsewhere(layout: Layout) -> Vec<DVec2> {
    const FIRST: f64 = 0.5 / PARTS as f64;
    const LAST: f64 = 1.0 - FIRST;
    let places = match layout {
        Layout::Quad => vec![[FIRST, 0.5], [LAST, 0.5], [0.5, FIRST], [0.5, LAST]],
        Layout::Triangle => vec![[FIRST, FIRST], [LAST - FIRST, FIRST], [FIRST, LAST - FIRST]],
    };
    places.into_iter().map(DVec2::from).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::form_factor::contour;
    use crate::output::fixture::{
        alone, block, closed_box, paint, read, solve_along_lines, solve_by_groups, solve_refined,
    };
    use crate::solve::Solver;
    use glam::{DVec2, DVec3};

    /// A floor of 4 m × 4 m, a square lamp of 1 m × 1 m that looks down from 3 m, and a square blocker of the same size at 1 m,
    /// a little aside.
    const SCENE: &str = "v -2 0 -2\nv -2 0 2\nv 2 0 2\nv 2 0 -2\nv -0.5 3 -0.5\nv 0.5 3 -0.5\nv 0.5 3 0.5\nv -0.5 3 0.5\n\
        v -0.37 1 -0.43\nv -0.37 1 0.57\nv 0.63 1 0.57\nv 0.63 1 -0.43\n\
        o floor\nusemtl black\nf 1 2 3 4\no lamp\nusemtl lamp\nf 5 6 7 8\no blocker\nusemtl black\nf 9 10 11 12\n";

    fn subdivisions_of(solution: &Solution, fineness: &Fineness) -> Vec<u8> {
        let (mut ring, mut ranks) = alone(solution);
        subdivisions(solution, fineness, &mut ring, &mut ranks).unwrap()
    }

    /// Irradiance of the floor: from the lamp less from what the blocker hides of it, both rectangles along the axes.
    fn exact(x: DVec3) -> f64 {
        let rectangle = |low: DVec2, high: DVec2| {
            let at = |x: f64, z: f64| DVec3::new(x, 3.0, z);
            [at(low.x, low.y), at(high.x, low.y), at(high.x, high.y), at(low.x, high.y)]
        };
        let from = |low: DVec2, high: DVec2| {
            if low.x >= high.x || low.y >= high.y { 0.0 } else { contour(x, DVec3::Y, &rectangle(low, high)) }
        };
        // Seen from the floor, the blocker at 1 m hides three times its size at 3 m.
        let (place, half) = (DVec2::new(x.x, x.z), DVec2::splat(0.5));
        let [low, high] = [DVec2::new(-0.37, -0.43), DVec2::new(0.63, 0.57)].map(|c| place + 3.0 * (c - place));
        10.0 * std::f64::consts::PI * (from(-half, half) - from(low.max(-half), high.min(half)))
    }

    /// Root of the mean square error on the floor about the shadow, relative to the mean there.
    fn error(solution: &Solution) -> f64 {
        let (mesh, smooth) = (&solution.mesh, Smooth::new(solution));
        let floor: Vec<_> = mesh.facets.iter().filter(|facet| facet.surface == 0).collect();
        let (mut squares, mut sum, n) = (0.0, 0.0, 230);
        for k in 0..n * n {
            let [x, z] = [k % n, k / n].map(|i| -1.2 + 2.4 * (f64::from(i) + 0.5) / f64::from(n));
            let place = DVec3::new(x, 0.0, z);
            let inside = |at: DVec2| at.min_element() >= 0.0 && at.max_element() <= 1.0;
            let holding = floor.iter().map(|facet| (facet, facet.frame().parameters(place)));
            let (facet, at) = holding.into_iter().find(|&(_, at)| inside(at)).expect("the floor has no holes");
            let (_, element, within) = mesh.find_element(facet, false, at);
            let found = f64::from(smooth.at(element, within)[1]);
            squares += (found - exact(place)).powi(2);
            sum += exact(place);
        }
        (squares / f64::from(n * n)).sqrt() / (sum / f64::from(n * n))
    }

    /// The scene with exact light at the sample points: what is wrong between them is the elements' fault alone.
    fn lit(size: f64, lines: u32, subdivision: impl Fn(u32) -> u8) -> Solution {
        let mut solution = solve_along_lines(read(SCENE), (Solver::Plain, 1.0), (size, lines), subdivision);
        let floor = |at: DVec3, normal: DVec3| if at.y < 0.5 && normal.y > 0.0 { exact(at) } else { 0.0 };
        paint(&mut solution, floor);
        solution
    }

    /// The scene with the light that group shooting finds.
    fn solved(size: f64, lines: u32, subdivision: impl Fn(u32) -> u8) -> Solution {
        solve_along_lines(read(SCENE), (Solver::Group(0.0005), 0.0), (size, lines), subdivision)
    }

    /// Subdivisions that adaptive elements come to, from elements of `size` metres.
    fn adapted(size: f64, lines: u32, fineness: &Fineness) -> Vec<u8> {
        let mut wanted = vec![1; lit(size, lines, |_| 1).mesh.patch_count()];
        for _ in 0..fineness.levels {
            wanted = subdivisions_of(&lit(size, lines, |patch| wanted[patch as usize]), fineness);
            assert!(wanted.iter().any(|&s| s > 1) && wanted.contains(&1));
        }
        wanted
    }

    /// The size of at least `count` elements that are all alike, metres.
    fn uniform(count: usize) -> f64 {
        let sizes = (1..).map(|k| 0.25 * 0.96f64.powi(k));
        sizes.into_iter().find(|&size| lit(size, 0, |_| 1).mesh.element_count() >= count).unwrap()
    }

    /// The error with adaptive elements, as a share of that with as many uniform ones.
    fn share_of_uniform(size: f64, lines: u32, fineness: &Fineness) -> f64 {
        let wanted = adapted(size, lines, fineness);
        let solution = lit(size, lines, |patch| wanted[patch as usize]);
        let even = lit(uniform(solution.mesh.element_count()), 0, |_| 1);
        let counts = [&solution, &even].map(|solution| solution.mesh.element_count());
        let [adaptive, even] = [&solution, &even].map(error);
        println!("{} elements: {adaptive:.4}; {} uniform ones: {even:.4}", counts[0], counts[1]);
        adaptive / even
    }

    #[test]
    fn the_edge_of_a_shadow_is_followed_with_few_elements() {
        assert!(share_of_uniform(0.125, 0, &Fineness { levels: 1, tolerance: 0.01 }) <= 1.0 / 3.0);
    }

    const ALONG_LINES: Fineness = Fineness { levels: 2, tolerance: 0.003 };

    #[test]
    fn elements_that_end_where_light_breaks_err_least() {
        assert!(share_of_uniform(0.25, 1, &ALONG_LINES) <= 1.0 / 10.0);
    }

    /// The light of the samples is exact enough for that: also where the edges of lamp, blocker and floor are parallel.
    #[test]
    fn what_is_solved_errs_as_little() {
        let wanted = adapted(0.25, 1, &ALONG_LINES);
        let solution = solved(0.25, 1, |patch| wanted[patch as usize]);
        let even = solved(uniform(solution.mesh.element_count()), 0, |_| 1);
        let [adaptive, even] = [&solution, &even].map(error);
        println!("solved: {adaptive:.4}; with as many uniform elements: {even:.4}");
        assert!(adaptive <= even / 10.0);
    }

    /// Black surfaces give no light back: what lies in the penumbra has light of the lamp alone, and next to the umbra little of that.
    #[test]
    fn penumbrae_in_black_rooms_are_found() {
        for (solver, until, most) in [(Solver::Group(0.01), 0.0, [0.013, 0.09]), (Solver::Plain, 1e-6, [0.009, 0.036])]
        {
            let solution = solve_along_lines(read(SCENE), (solver, until), (0.07, 0), |_| 1);
            let mesh = &solution.mesh;
            let floor = (0..mesh.patch_count() as u32).map(|id| mesh.patch(id)).filter(|patch| {
                let at = patch.frame.at(DVec2::splat(0.5));
                at.y < 0.5 && patch.normal.y > 0.0 && at.abs().max_element() < 1.2
            });
            let (mut squares, mut sum, mut count, mut largest) = (0.0, 0.0, 0.0, 0.0f64);
            for patch in floor {
                let exact = exact(patch.sample_point(0, ALL_VALID).unwrap());
                let difference = f64::from(solution.irradiance(patch.first_element)[1]) - exact;
                (squares, sum, count) = (squares + difference * difference, sum + exact, count + 1.0);
                largest = largest.max(difference.abs());
            }
            let found = [(squares / count).sqrt(), largest].map(|x| x / (sum / count));
            println!("{solver:?}: off by {found:?}");
            assert!(count > 1000.0 && found[0] < most[0] && found[1] < most[1], "{solver:?} {found:?}");
        }
    }

    #[test]
    fn light_that_falls_off_in_a_slot_is_followed_where_no_neighbour_tells() {
        // Two books 4 cm apart, of which each side is one element.
        let books = block([0.40, 0.3, 0.40], [0.45, 0.5, 0.60]) + &block([0.49, 0.3, 0.40], [0.54, 0.5, 0.60]);
        let lamp =
            "v 0.05 0.02 0.05\nv 0.05 0.02 0.15\nv 0.15 0.02 0.15\nv 0.15 0.02 0.05\nusemtl lamp\nf -4 -3 -2 -1\n";
        let solution = solve_by_groups(read(&(closed_box("white") + &books + lamp)), 0.2);
        let mesh = &solution.mesh;
        let wanted = subdivisions_of(&solution, &Fineness { levels: 1, tolerance: 0.04 });
        let of_side = |x: f64, normal: DVec3| {
            let is = |id: &u32| {
                let patch = mesh.patch(*id);
                patch.normal.dot(normal) > 0.99 && (mesh.to_world(patch.frame.origin).x - x).abs() < 1e-6
            };
            let id = (0..mesh.patch_count() as u32).find(is).unwrap();
            assert_eq!(mesh.patch(id).element_count(), 1);
            wanted[id as usize]
        };
        // The lamp's light comes from the bright walls behind the first book, through the slot's ends.
        let (in_slot, open) = (of_side(0.49, -DVec3::X), of_side(0.54, DVec3::X));
        assert_eq!([in_slot, open], [3, 1]);
    }

    #[test]
    fn even_light_and_darkness_need_no_small_elements() {
        let mut solution = solve_refined(read(SCENE), [0.5; 2], 1.0, |_| 1);
        let fineness = Fineness { levels: 3, tolerance: 0.01 };
        for light in [0.0, 5.0] {
            paint(&mut solution, |_, _| light);
            assert!(subdivisions_of(&solution, &fineness).iter().all(|&s| s == 1));
        }
    }
}
