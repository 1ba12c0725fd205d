//! The whole system of equations at once: B = E + ρFB (Stürzlinger & Wild 1994, equation 1) by Gauss–Seidel, in double
//! precision, on the same patches, elements and cells as the progressive solver.

use super::interpolation::parts;
use super::kernel::{PatchShooter, Receiver, triangles};
use glam::DVec3;
use ringlight::mesh::{Mesh, Patch, area_samples};
use ringlight::shooting::{Shot, Source};
use ringlight::solve::World;
use ringlight_visibility::{Cells, Layout, Triangle};

/// Elements nearer to a shooter than this many of their widths average over their samples (the solver's rule, a part of
/// the discretisation).
const NEAR: f64 = 3.0;

/// Irradiance of every element: the area average, and at the sample point.
#[derive(Clone, Debug)]
pub struct Solution {
    /// Area averages, which are reflected.
    pub mean: Vec<[f64; 3]>,
    /// At the sample points, which is displayed.
    pub point: Vec<[f64; 3]>,
}

/// Matrices: rows are elements, columns the cells of all patches.
pub struct Dense<'a> {
    mesh: &'a Mesh,
    patches: Vec<Patch>,
    cells: usize,
    /// Irradiance per radiosity of a cell, area averages and at the points.
    mean: Vec<Vec<f64>>,
    point: Vec<Vec<f64>>,
    /// For each patch, its cells' radiosity per radiosity of its elements.
    parts: Vec<Vec<Vec<f64>>>,
    /// From lamps, sun and sky.
    direct: Solution,
}

/// The points of an element: where it is displayed, and its free samples.
struct Samples {
    display: Receiver,
    free: Vec<Receiver>,
    /// Edges of the element, metres; of a triangle, of the rectangle with the same second moments.
    edges: [DVec3; 2],
}

impl Samples {
    fn new(mesh: &Mesh, patch: &Patch, k: u32) -> Option<Samples> {
        let valid = mesh.valid[(patch.first_element + k) as usize];
        let receiver = |point: DVec3| Receiver { point, normal: patch.normal, plane: patch.plane };
        let tile = patch.element_tile(k);
        // Of a trapezium's elements, those in its middle.
        let frame = &patch.frame;
        let [u, v] = [(frame.edge_u, patch.grid[0]), (frame.edge_v, patch.grid[1])]
            .map(|(edge, count)| (edge + 0.5 * frame.twist) / f64::from(count));
        Some(Samples {
            edges: match frame.layout {
                Layout::Quad => [u, v],
                Layout::Triangle => [(u - v) / 2f64.sqrt(), (u + v) / 6f64.sqrt()],
            },
            display: receiver(patch.sample_point(k, valid)?),
            free: area_samples(valid).map(|s| receiver(patch.area_sample(&tile, s))).collect(),
        })
    }

    /// The average over the free samples.
    fn average<const N: usize>(&self, value: impl Fn(&Receiver) -> [f64; N]) -> [f64; N] {
        let mut sum = [0.0; N];
        for receiver in &self.free {
            let value = value(receiver);
            (0..N).for_each(|i| sum[i] += value[i] / self.free.len() as f64);
        }
        sum
    }
}

impl<'a> Dense<'a> {
    /// All form factors of a world, every one with every triangle tested.
    pub fn new(world: &World<'a>) -> Dense<'a> {
        let (mesh, side) = (world.mesh, f64::from(world.settings.cells).sqrt() as u32);
        let cells = (side * side) as usize;
        let triangles = triangles(mesh);
        let patches: Vec<Patch> = (0..mesh.patch_count() as u32).map(|id| mesh.patch(id)).collect();
        let shooters: Vec<PatchShooter> = patches.iter().map(|patch| PatchShooter::new(patch, side)).collect();
        let dark = vec![[0.0; 3]; mesh.element_count()];
        let mut dense = Dense {
            mesh,
            cells,
            mean: vec![vec![0.0; patches.len() * cells]; mesh.element_count()],
            point: vec![vec![0.0; patches.len() * cells]; mesh.element_count()],
            parts: (patches.iter().zip(&shooters))
                .map(|(patch, shooter)| parts(mesh, patch, side, shooter.areas(), world.settings.shoot))
                .collect(),
            direct: Solution { mean: dark.clone(), point: dark },
            patches,
        };
        for patch in dense.patches.clone() {
            let width = (patch.area / f64::from(patch.element_count())).sqrt();
            for k in 0..patch.element_count() {
                let Some(samples) = Samples::new(mesh, &patch, k) else { continue };
                let element = (patch.first_element + k) as usize;
                for (j, shooter) in shooters.iter().enumerate() {
                    dense.fill(element, j * cells, shooter, &samples, NEAR * width, &triangles);
                }
                for emitter in &world.emitters {
                    dense.add_direct(element, emitter, &samples, &triangles);
                }
            }
        }
        dense
    }

    fn fill(
        &mut self,
        element: usize,
        column: usize,
        shooter: &PatchShooter,
        samples: &Samples,
        reach: f64,
        triangles: &[Triangle],
    ) {
        let near = shooter.distance(samples.display.point) < reach;
        let point = shooter.form_factors(&samples.display, near, triangles);
        let mean = &mut self.mean[element][column..][..self.cells];
        if near {
            for receiver in &samples.free {
                let factors = shooter.form_factors(receiver, true, triangles);
                mean.iter_mut().zip(factors).for_each(|(m, f)| *m += f / samples.free.len() as f64);
            }
        } else {
            // Alone for the whole element, unless a part of that is covered.
            let whole = samples.free.len() == 16;
            let more = if whole { shooter.second_order(&samples.display, samples.edges, &point) } else { 0.0 };
            mean.iter_mut().zip(&point).for_each(|(m, f)| *m = f * (1.0 + more).clamp(0.0, 2.0));
        }
        self.point[element][column..][..self.cells].copy_from_slice(&point);
    }

    /// Lamps and the sun cast hard shadows: elements show the average over their samples. The sky is soft.
    fn add_direct(&mut self, element: usize, emitter: &Shot, samples: &Samples, triangles: &[Triangle]) {
        let at = |receiver: &Receiver| direct(receiver, emitter, triangles);
        let mean = if emitter.light.len() == 1 { samples.average(at) } else { at(&samples.display) };
        for light in [&mut self.direct.mean[element], &mut self.direct.point[element]] {
            *light = std::array::from_fn(|c| light[c] + mean[c]);
        }
    }

    /// Solves by Gauss–Seidel, a patch at a time, until nothing changes in double precision.
    pub fn solve(&self) -> Solution {
        let mut radiosity = vec![[0.0; 3]; self.patches.len() * self.cells];
        let mut solution = self.direct.clone();
        for sweep in 0.. {
            let mut change = 0.0f64;
            for (j, patch) in self.patches.iter().enumerate() {
                for e in patch.elements().map(|e| e as usize) {
                    let new = gather(&self.mean[e], &radiosity, self.direct.mean[e]);
                    let old = std::mem::replace(&mut solution.mean[e], new);
                    let changes = old.iter().zip(new).map(|(old, new)| (new - old).abs() / new.max(f64::MIN_POSITIVE));
                    change = changes.fold(change, f64::max);
                }
                self.shine(j, &solution.mean, &mut radiosity[j * self.cells..][..self.cells]);
            }
            if change < 1e-13 && sweep > 0 {
                break;
            }
            assert!(sweep < 10_000, "Gauss–Seidel does not converge: {change}");
        }
        for (e, point) in solution.point.iter_mut().enumerate() {
            *point = gather(&self.point[e], &radiosity, self.direct.point[e]);
        }
        solution
    }

    /// Radiosity of patch `j`'s cells under this irradiance.
    fn shine(&self, j: usize, irradiance: &[[f64; 3]], cells: &mut [[f64; 3]]) {
        let patch = &self.patches[j];
        let elements: Vec<[f64; 3]> = patch
            .elements()
            .map(|e| {
                let colour = self.mesh.colour(patch, e);
                std::array::from_fn(|c| {
                    f64::from(colour.exitance[c]) + f64::from(colour.reflectance[c]) * irradiance[e as usize][c]
                })
            })
            .collect();
        for (cell, parts) in cells.iter_mut().zip(&self.parts[j]) {
            *cell = std::array::from_fn(|c| parts.iter().zip(&elements).map(|(part, b)| part * b[c]).sum());
        }
    }
}

/// Irradiance: direct, and from all cells.
fn gather(row: &[f64], radiosity: &[[f64; 3]], direct: [f64; 3]) -> [f64; 3] {
    row.iter().zip(radiosity).fold(direct, |sum, (f, b)| std::array::from_fn(|c| sum[c] + f * b[c]))
}

/// Irradiance from a lamp (intensity · cosθ/r²), the sun or a part of the sky (their irradiance · cosθ).
fn direct(to: &Receiver, emitter: &Shot, triangles: &[Triangle]) -> [f64; 3] {
    let seen = to.sees(triangles, &emitter.shooter);
    let mut sum = [0.0; 3];
    for (k, light) in emitter.light.iter().enumerate().filter(|(k, _)| seen[*k]) {
        let factor = match (&emitter.source, &emitter.shooter.cells) {
            (Source::Point { position, cone: None, range }, _) if range.is_infinite() => {
                let way = *position - to.point;
                to.normal.dot(way.normalize()) / way.length_squared()
            }
            (Source::Directions, Cells::Directions(towards)) => to.normal.dot(DVec3::from(towards[k].map(f64::from))),
            _ => panic!("the oracle knows bare lamps, suns and skies"),
        };
        (0..3).for_each(|c| sum[c] += factor * f64::from(light[c]));
    }
    sum
}
