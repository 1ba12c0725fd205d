//! Rays against the hemicube: form factors over the same configurations at equal numbers of samples, beside exact ones.

use crate::method::clip::Corners;
use crate::method::disc_sum::{self, Cell};
use crate::method::exact;
use crate::method::hemicube::Hemicube;
use crate::oracle::kernel::{PatchShooter, Receiver, triangles};
use crate::plot::{Plot, Series};
use crate::scene::{Builder, Meshed, meshed};
use crate::{Bound, Row, Section};
use glam::DVec2;
use ringlight::mesh::Patch;
use ringlight_visibility::{Layout, Triangle};

/// Cells along a shooter's side.
const SIDES: [u32; 4] = [1, 2, 4, 8];

/// A closed room of patches with two boxes in it, and what the methods need of them.
struct Room {
    patches: Vec<Patch>,
    polygons: Vec<Corners>,
    triangles: Vec<Triangle>,
    /// The boxes' faces with their planes: all that hides anything.
    blockers: Vec<(u32, Corners)>,
}

/// A method's form factors from a receiver to all patches.
type Factors = Vec<f64>;

impl Room {
    fn new() -> Room {
        let mut builder = Builder::default();
        let grey = builder.material([0.5; 3], [0.0; 3]);
        builder.cuboid([0.0; 3], [4.0, 3.0, 3.0], true, |_| grey.clone());
        builder.cuboid([0.7, 0.0, 0.8], [1.4, 1.1, 1.5], false, |_| grey.clone());
        builder.cuboid([2.1, 0.9, 1.2], [3.0, 1.3, 2.4], false, |_| grey.clone());
        let Meshed { mesh, .. } = meshed(builder.scene(true), 0.5, 0.5);
        let patches: Vec<Patch> = (0..mesh.patch_count() as u32).map(|id| mesh.patch(id)).collect();
        assert!(patches.iter().all(|patch| patch.frame.layout == Layout::Quad));
        let in_room = |p: f64, size: f64| p > 1e-6 && p < size - 1e-6;
        let faces = mesh.facets.iter().map(|facet| (facet.plane, facet.frame().corners().0.to_vec()));
        // The room's own walls stand behind everything.
        let inner = |corners: &Corners| {
            let middle = corners.iter().sum::<glam::DVec3>() / corners.len() as f64;
            in_room(middle.x, 4.0) && in_room(middle.y, 3.0) && in_room(middle.z, 3.0)
        };
        Room {
            polygons: patches.iter().map(|patch| patch.frame.corners().0.to_vec()).collect(),
            triangles: triangles(&mesh),
            blockers: faces.filter(|(_, corners)| inner(corners)).collect(),
            patches,
        }
    }

    /// A receiver at parameters `at` of patch `patch`.
    fn receiver(&self, patch: usize, at: DVec2) -> Receiver {
        let patch = &self.patches[patch];
        Receiver { point: patch.frame.at(at), normal: patch.normal, plane: patch.plane }
    }

    /// Whether any of the patch can be seen.
    fn faces(&self, to: &Receiver, patch: &Patch) -> bool {
        let above = |corner: &glam::DVec3| to.normal.dot(*corner - to.point) > 1e-9;
        patch.plane != to.plane
            && patch.normal.dot(to.point - patch.frame.origin) > 0.0
            && patch.frame.corners().0.iter().any(above)
    }

    /// How many patches rays have to be sent to.
    fn facing(&self, to: &Receiver) -> usize {
        self.patches.iter().filter(|patch| self.faces(to, patch)).count()
    }

    /// As if nothing hid anything.
    fn unobstructed(&self, to: &Receiver) -> Factors {
        self.behind(to, &[])
    }

    fn exact(&self, to: &Receiver) -> Factors {
        self.behind(to, &self.blockers)
    }

    /// Exact form factors behind blockers.
    fn behind(&self, to: &Receiver, blockers: &[(u32, Corners)]) -> Factors {
        let other = |plane: u32| move |(blocker, _): &&(u32, Corners)| *blocker != plane;
        let all: Vec<&(u32, Corners)> = blockers.iter().filter(other(to.plane)).collect();
        self.patches
            .iter()
            .zip(&self.polygons)
            .map(|(patch, polygon)| {
                if !self.faces(to, patch) {
                    return 0.0;
                }
                let blockers: Vec<Corners> =
                    all.iter().copied().filter(other(patch.plane)).map(|(_, corners)| corners.clone()).collect();
                exact::form_factor(to.point, to.normal, polygon, &blockers)
            })
            .collect()
    }

    fn hemicube(&self, to: &Receiver, cube: &Hemicube) -> Factors {
        cube.form_factors(to.point, to.normal, &self.polygons)
    }

    /// Ours (the contour times the visible share), and the disc sum, with rays to `side`² cells of every patch.
    fn rays(&self, to: &Receiver, shooters: &[PatchShooter]) -> [Factors; 2] {
        let (mut ours, mut discs) = (Vec::new(), Vec::new());
        for (patch, shooter) in self.patches.iter().zip(shooters) {
            if !self.faces(to, patch) {
                ours.push(0.0);
                discs.push(0.0);
                continue;
            }
            let seen = to.sees(&self.triangles, &shooter.shooter);
            let cells = shooter.cells().iter().zip(shooter.areas()).zip(seen);
            let cells = cells.map(|((&position, &area), seen)| Cell { position, area, seen });
            discs.push(disc_sum::form_factor(to.point, to.normal, shooter.normal(), cells));
            ours.push(shooter.form_factors(to, false, &self.triangles).iter().sum());
        }
        [ours, discs]
    }

    fn shooters(&self, side: u32) -> Vec<PatchShooter> {
        self.patches.iter().map(|patch| PatchShooter::new(patch, side)).collect()
    }
}

/// What a receiver sees of every patch, and what it would see if nothing hid anything.
struct Truth {
    exact: Factors,
    unobstructed: Factors,
}

/// Errors of a method over many receivers.
#[derive(Clone, Copy, Default)]
struct Errors {
    /// Σ over patches |f − F|, the share of the hemisphere that goes to the wrong patch: patches that are seen whole, and
    /// others.
    misplaced: [f64; 2],
    /// |Σ f − 1|.
    closure: f64,
    /// Mean of |f − F|/F over the patches with more than a hundred-thousandth of the hemisphere, in classes.
    relative: [f64; CLASSES.len()],
    receivers: f64,
    counts: [f64; CLASSES.len()],
}

/// Form factors from tiny to large: lower bounds.
const CLASSES: [f64; 3] = [1e-5, 1e-3, 1e-2];

impl Errors {
    fn add(&mut self, truth: &Truth, found: &[f64]) {
        self.receivers += 1.0;
        self.closure += (found.iter().sum::<f64>() - 1.0).abs();
        for ((f, e), unobstructed) in found.iter().zip(&truth.exact).zip(&truth.unobstructed) {
            self.misplaced[usize::from(*e < unobstructed * (1.0 - 1e-9))] += (f - e).abs();
            if let Some(class) = CLASSES.iter().rposition(|bound| e >= bound) {
                self.relative[class] += (f - e).abs() / e;
                self.counts[class] += 1.0;
            }
        }
    }

    fn misplaced(&self) -> f64 {
        (self.misplaced[0] + self.misplaced[1]) / self.receivers
    }

    fn cells(&self) -> Vec<String> {
        let percent = |x: f64| format!("{:.3} %", 100.0 * x);
        let mut cells: Vec<String> = self.misplaced.iter().map(|m| percent(m / self.receivers)).collect();
        cells.push(percent(self.closure / self.receivers));
        cells.extend((0..CLASSES.len()).map(|class| percent(self.relative[class] / self.counts[class])));
        cells
    }
}

const TEXT: &str = "
The claim of Stürzlinger & Wild (1994), that form factors by rays are more accurate than by the hemicube (Cohen & Greenberg 1985),
over the same configurations: from receivers all over a room of 4 m × 3 m × 3 m with two boxes in it to each of its 0.5 m patches,
seen whole, in part or not at all. Exact values: what the boxes hide is cut away from each patch, and the rest integrated along
its contour. Rays go to 1, 4, 16 and 64 cells of every patch that faces the receiver; the hemicube has as many pixels as all
these rays together. *Misplaced*: Σ |f − F| over the patches, of a hemisphere of 1, over patches that are seen whole and over others. Other columns: mean of |f − F|/F over
the patches above a size, up to the next.

The hemicube wins in one column: whatever its resolution, its pixels add up to nearly 1 (Σ f − 1), because each goes to some patch;
rays to one patch know nothing of the others. It also has a fixed cost however many patches there are. What it misplaces is
more than rays do at equal samples (rows below). The disc sum shows how much of that is owed to the rays,
and how much to the contour. Over areas, the hemicube stands in the middle of the receiving patch, as in 1985, with all its pixels, or
at each of the 16 points that ours takes, with a sixteenth of them.
";

/// Points and areas.
pub fn measure() -> Section {
    let room = Room::new();
    let mut section =
        Section { title: "Rays against the hemicube".into(), text: TEXT.trim().into(), ..Section::default() };
    let headings = [
        "receivers",
        "method",
        "samples",
        "misplaced, seen whole",
        "in part",
        "Σ f − 1",
        "F > 0.00001",
        "F > 0.001",
        "F > 0.01",
    ];
    let mut table = Vec::new();
    points(&room, &mut section, &mut table);
    areas(&room, &mut section, &mut table);
    section.table = Some((headings.map(String::from).to_vec(), table));
    section
}

/// Receiving points all over the room, none of them in a special place.
fn points(room: &Room, section: &mut Section, table: &mut Vec<Vec<String>>) {
    let at = |patch: usize| {
        let golden = |g: f64| (0.5 + g * patch as f64).fract();
        room.receiver(patch, DVec2::new(golden(0.754_877_666), golden(0.569_840_291)))
    };
    let receivers: Vec<Receiver> = (0..room.patches.len()).step_by(7).map(at).collect();
    let truth = receivers.iter().map(|to| Truth { exact: room.exact(to), unobstructed: room.unobstructed(to) });
    // Under a box it is dark.
    let (receivers, exact): (Vec<Receiver>, Vec<Truth>) =
        receivers.iter().zip(truth).filter(|(_, truth)| truth.exact.iter().sum::<f64>() > 0.5).unzip();
    let closure = exact.iter().map(|truth| (truth.exact.iter().sum::<f64>() - 1.0).abs()).fold(0.0, f64::max);
    let case = "exact form factors from a point add up to 1, worst".to_string();
    section.rows.push(Row { case, expected: 0.0, found: closure, bound: Bound::Absolute(1e-9) });
    let mut curves = ["contour × visible share", "disc sum", "hemicube"]
        .map(|name| Series { name: name.into(), points: Vec::new() });
    for side in SIDES {
        let shooters = room.shooters(side);
        let mut errors = [Errors::default(); 3];
        let mut samples = 0.0;
        for (to, exact) in receivers.iter().zip(&exact) {
            let count = room.facing(to) * (side * side) as usize;
            samples += count as f64 / receivers.len() as f64;
            let [ours, discs] = room.rays(to, &shooters);
            let cube = room.hemicube(to, &Hemicube::of_samples(count as f64));
            errors.iter_mut().zip([ours, discs, cube]).for_each(|(errors, found)| errors.add(exact, &found));
        }
        for (errors, curve) in errors.iter().zip(&mut curves) {
            curve.points.push([samples, errors.misplaced()]);
            let name = format!("{}, {} per patch", curve.name, side * side);
            table.push([vec!["points".into(), name, format!("{samples:.0}")], errors.cells()].concat());
        }
        let [ours, _, cube] = errors.map(|errors| errors.misplaced());
        let cells = side * side;
        compare(
            section,
            format!("points, {cells} samples per patch: ours misplaces"),
            ours,
            OURS_AT_POINTS[side.ilog2() as usize],
        );
        compare(section, format!("points, {cells} samples per patch: ours of the hemicube's"), ours / cube, 0.06);
    }
    // How fine a hemicube has to be to come near.
    for resolution in [16, 32, 64, 128, 256, 512] {
        let cube = Hemicube::new(resolution);
        let mut errors = Errors::default();
        for (to, exact) in receivers.iter().zip(&exact).step_by(3) {
            errors.add(exact, &room.hemicube(to, &cube));
        }
        let name = format!("hemicube of {resolution} × {resolution}");
        table.push([vec!["points".into(), name, cube.samples().to_string()], errors.cells()].concat());
    }
    section.plots.push(plot("hemicube_points", "Form factors from points", curves));
}

/// Averages over receiving patches; many of them touch the patches that they see.
fn areas(room: &Room, section: &mut Section, table: &mut Vec<Vec<String>>) {
    let average = |patch: usize, side: u32, factors: &dyn Fn(&Receiver) -> Factors| {
        let mut sum = vec![0.0; room.patches.len()];
        let share = f64::from(side * side).recip();
        for k in 0..side * side {
            let at = (DVec2::new((k % side).into(), (k / side).into()) + 0.5) / f64::from(side);
            sum.iter_mut().zip(factors(&room.receiver(patch, at))).for_each(|(sum, f)| *sum += f * share);
        }
        sum
    };
    // The midpoint rule on 20 × 20 points: a twenty-fifth of the error of 4 × 4.
    let truth = |patch: usize| Truth {
        exact: average(patch, 20, &|to| room.exact(to)),
        unobstructed: average(patch, 20, &|to| room.unobstructed(to)),
    };
    let receivers: Vec<(usize, Truth)> = (0..room.patches.len())
        .step_by(23)
        .map(|patch| (patch, truth(patch)))
        .filter(|(_, truth)| truth.exact.iter().sum::<f64>() > 0.999)
        .collect();
    let mut curves = ["contour × visible share at 16 points", "hemicube in the middle", "hemicubes at 16 points"]
        .map(|name| Series { name: name.into(), points: Vec::new() });
    for side in &SIDES[..3] {
        let shooters = room.shooters(*side);
        let mut errors = [Errors::default(); 3];
        let mut samples = 0.0;
        for (patch, exact) in &receivers {
            let middle = room.receiver(*patch, DVec2::splat(0.5));
            let count = (room.facing(&middle) * (side * side) as usize) as f64;
            samples += 16.0 * count / receivers.len() as f64;
            let (one, each) = (Hemicube::of_samples(16.0 * count), Hemicube::of_samples(count));
            let ours = average(*patch, 4, &|to| {
                let [ours, _] = room.rays(to, &shooters);
                ours
            });
            let cubes = average(*patch, 4, &|to| room.hemicube(to, &each));
            errors
                .iter_mut()
                .zip([ours, room.hemicube(&middle, &one), cubes])
                .for_each(|(e, found)| e.add(exact, &found));
        }
        for (errors, curve) in errors.iter().zip(&mut curves) {
            curve.points.push([samples, errors.misplaced()]);
            let name = format!("{}, {} per patch", curve.name, 16 * side * side);
            table.push([vec!["areas".into(), name, format!("{samples:.0}")], errors.cells()].concat());
        }
        let [ours, middle, cubes] = errors.map(|errors| errors.misplaced());
        let case = |what: &str| format!("areas, {} samples per patch: {what}", 16 * side * side);
        compare(section, case("ours misplaces"), ours, OURS_OVER_AREAS[side.ilog2() as usize]);
        compare(section, case("ours of the hemicube's in the middle"), ours / middle, 0.3);
        compare(section, case("ours of 16 hemicubes'"), ours / cubes, 0.3);
    }
    section.plots.push(plot("hemicube_areas", "Form factors over areas", curves));
}

/// What our way misplaces at points with 1, 4, 16 and 64 cells, at most.
const OURS_AT_POINTS: [f64; 4] = [0.03, 0.012, 0.0055, 0.0026];

/// What our way misplaces over areas with 16 points and 1, 4 and 16 cells, at most.
const OURS_OVER_AREAS: [f64; 3] = [0.033, 0.02, 0.006];

fn compare(section: &mut Section, case: String, found: f64, expected: f64) {
    section.rows.push(Row { case, expected, found, bound: Bound::AtMost });
}

fn plot(name: &str, title: &str, series: [Series; 3]) -> Plot {
    let axes = ["rays or pixels".into(), "misplaced share of the hemisphere".into()];
    Plot { name: name.into(), title: format!("{title}: error at equal samples"), axes, series: series.to_vec() }
}
