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

    fn exact(&self, to: &Receiver) -> Factors {
        let other = |plane: u32| move |(blocker, _): &&(u32, Corners)| *blocker != plane;
        let all: Vec<&(u32, Corners)> = self.blockers.iter().filter(other(to.plane)).collect();
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
            ours.push(shooter.form_factors(to, &self.triangles).iter().sum());
        }
        [ours, discs]
    }

    fn shooters(&self, side: u32) -> Vec<PatchShooter> {
        self.patches.iter().map(|patch| PatchShooter::new(patch, side)).collect()
    }
}

/// Errors of a method over many receivers.
#[derive(Clone, Copy, Default)]
struct Errors {
    /// Σ over patches |f − F|: the share of the hemisphere that goes to the wrong patch.
    misplaced: f64,
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
    fn add(&mut self, exact: &[f64], found: &[f64]) {
        self.receivers += 1.0;
        self.closure += (found.iter().sum::<f64>() - 1.0).abs();
        for (f, e) in found.iter().zip(exact) {
            self.misplaced += (f - e).abs();
            if let Some(class) = CLASSES.iter().rposition(|bound| e >= bound) {
                self.relative[class] += (f - e).abs() / e;
                self.counts[class] += 1.0;
            }
        }
    }

    fn misplaced(&self) -> f64 {
        self.misplaced / self.receivers
    }

    fn cells(&self) -> Vec<String> {
        let percent = |x: f64| format!("{:.3} %", 100.0 * x);
        let mut cells = vec![percent(self.misplaced()), percent(self.closure / self.receivers)];
        cells.extend((0..CLASSES.len()).map(|class| percent(self.relative[class] / self.counts[class])));
        cells
    }
}

/// Points and areas.
pub fn measure() -> Section {
    let room = Room::new();
    let mut section = Section { title: "Rays against the hemicube".into(), text: "TODO".into(), ..Section::default() };
    let headings = ["receivers", "method", "samples", "misplaced", "Σ F − 1", "F > 0.00001", "F > 0.001", "F > 0.01"];
    let mut table = Vec::new();
    points(&room, &mut section, &mut table);
    areas(&room, &mut section, &mut table);
    section.table = Some((headings.map(String::from).to_vec(), table));
    section
}

/// Receiving points all over the room, none of them in a special place.
fn points(room: &Room, section: &mut Section, table: &mut Vec<Vec<String>>) {
    let receivers: Vec<Receiver> = (0..room.patches.len())
        .step_by(7)
        .map(|patch| {
            let golden = |g: f64| (0.5 + g * patch as f64).fract();
            room.receiver(patch, DVec2::new(golden(0.754_877_666), golden(0.569_840_291)))
        })
        .filter(|to| room.exact(to).iter().sum::<f64>() > 0.999)
        .collect();
    let exact: Vec<Factors> = receivers.iter().map(|to| room.exact(to)).collect();
    let mut curves: [Vec<[f64; 2]>; 3] = Default::default();
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
        let cells = side * side;
        let names = [
            format!("contour × visible share, {cells} rays per patch"),
            format!("disc sum, {cells} rays per patch"),
            "hemicube of as many pixels".into(),
        ];
        for ((name, errors), curve) in names.into_iter().zip(errors).zip(&mut curves) {
            curve.push([samples, errors.misplaced()]);
            table.push([vec!["points".into(), name, format!("{samples:.0}")], errors.cells()].concat());
        }
    }
    for resolution in [16, 32, 64, 128, 256, 512] {
        let cube = Hemicube::new(resolution);
        let mut errors = Errors::default();
        for (to, exact) in receivers.iter().zip(&exact).step_by(3) {
            errors.add(exact, &room.hemicube(to, &cube));
        }
        let name = format!("hemicube of {resolution} × {resolution}");
        table.push([vec!["points".into(), name, cube.samples().to_string()], errors.cells()].concat());
    }
    let _ = section;
}

fn areas(_room: &Room, _section: &mut Section, _table: &mut Vec<Vec<String>>) {}
