//! Error against the size of elements, the number of cells and what is left unshot.

use super::furnace::{deviations, manufactured};
use crate::plot::{Plot, Series};
use crate::scene::{Builder, Meshed, meshed, solve};
use crate::{Bound, Row, Section};
use ringlight::mesh::Frame;
use ringlight::scene::Scene;
use ringlight::solve::State;

/// A closed room of 2 m × 1.6 m × 1.6 m; a lamp, and a board under it that throws a shadow. All lengths are multiples of the
/// largest element, so that elements lie within each other.
fn room() -> Scene {
    let mut builder = Builder::default();
    let mut shades = [0.3, 0.7, 0.5, 0.6, 0.4, 0.8].into_iter().cycle();
    let mut shade = move |b: &mut Builder| {
        let shade = shades.next().unwrap_or_default();
        b.material([shade; 3], [0.0; 3])
    };
    builder.cuboid([0.0; 3], [2.0, 1.6, 1.6], true, &mut shade);
    builder.cuboid([0.4, 0.5, 0.4], [1.2, 0.6, 1.2], false, &mut shade);
    let lamp = builder.material([0.5; 3], [100.0; 3]);
    builder.cuboid([0.8, 1.2, 0.6], [1.2, 1.3, 1.0], false, |_| lamp.clone());
    builder.scene(true)
}

/// Irradiance of every element (first channel; the room is grey), area averages.
struct Light {
    scene: Meshed,
    irradiance: Vec<f64>,
}

fn light(patch: f64, element: f64, cells: u32, until: f64) -> Light {
    let scene = meshed(room(), patch, element);
    let (state, ..) = solve(&scene.world(cells), until);
    Light { irradiance: irradiance(&state), scene }
}

fn irradiance(state: &State) -> Vec<f64> {
    state.clusters.iter().flat_map(|cluster| &cluster.elements).map(|e| f64::from(e.mean()[0])).collect()
}

impl Light {
    /// Root mean square difference from the average of a finer solution over each element, relative to its root mean square.
    fn error(&self, fine: &Light) -> f64 {
        let mesh = &self.scene.mesh;
        let (mut sums, mut areas) = (vec![0.0; mesh.element_count()], vec![0.0; mesh.element_count()]);
        for id in 0..fine.scene.mesh.patch_count() as u32 {
            let patch = fine.scene.mesh.patch(id);
            let corners = fine.scene.mesh.facets[patch.facet as usize].corners;
            let facet = mesh.facets.iter().find(|f| f.corners == corners).expect("both are cut from the same room");
            for (k, e) in patch.elements().enumerate() {
                let at = patch.tile.compose(patch.element_tile(k as u32)).at(Frame::middle(patch.frame.layout));
                let coarse = mesh.find_element(facet, false, at).1 as usize;
                let area = patch.element_area(k as u32);
                sums[coarse] += area * fine.irradiance[e as usize];
                areas[coarse] += area;
            }
        }
        let (mut difference, mut total) = (0.0, 0.0);
        for ((found, sum), area) in self.irradiance.iter().zip(sums).zip(areas) {
            difference += area * (found - sum / area).powi(2);
            total += area * (sum / area).powi(2);
        }
        (difference / total).sqrt()
    }
}

const TEXT: &str = "
A closed room of 2 m × 1.6 m × 1.6 m with a lamp and a board that throws a shadow, against the same room solved with elements of 0.05 m,
patches of 0.2 m, 64 cells (root mean square over all elements, each beside the average of the finer elements in it, relative to
the root mean square irradiance); and the manufactured furnace, whose B is 1 everywhere. The finer solution has errors of its own: what is
below 0.3 % says little. In the furnace, four cells are no better than one. Unshot shares are beside the same elements and cells with nothing left unshot. *Order*: p of error ~ hᵖ.
";

/// Elements, cells and unshot shares.
pub fn measure() -> Section {
    let mut section = Section { title: "Convergence".into(), text: TEXT.trim().into(), ..Section::default() };
    let reference = light(0.2, 0.05, 64, SMALL);
    let sizes = [0.4, 0.2, 0.1];
    let by_size = sizes.map(|size| [size, light(2.0 * size, size, 64, SMALL).error(&reference)]);
    // Halving the elements halves the error at least: order 1 or better.
    add(&mut section, "elements of", "m", &by_size, [0.032, 0.0125, 0.006], [0.5; 3]);
    let cells = [1, 4, 16, 64];
    let by_cells = cells.map(|m| [f64::from(m), light(0.4, 0.1, m, SMALL).error(&reference)]);
    add(&mut section, "elements of 0.1 m,", "cells", &by_cells, [0.042, 0.018, 0.016, 0.006], [1.0; 4]);
    let furnace = manufactured(0.2);
    let furnace_by_cells = cells.map(|m| {
        let (state, ..) = solve(&furnace.world(m), SMALL);
        let deviations = deviations(&furnace, &state);
        let square = deviations.iter().map(|d| d * d).sum::<f64>() / deviations.len() as f64;
        [f64::from(m), square.sqrt()]
    });
    add(
        &mut section,
        "furnace, elements of 0.2 m,",
        "cells",
        &furnace_by_cells,
        [0.0065, 0.008, 0.0012, 0.0006],
        [1.0, 1.3, 1.0, 1.0],
    );
    let shares = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5];
    let all = light(0.4, 0.2, 16, 1e-8);
    let by_share = shares.map(|share| [share, light(0.4, 0.2, 16, share).error(&all)]);
    // A tenth of the unshot light is a tenth of the error, nearly.
    add(&mut section, "unshot", "of the power", &by_share, shares.map(|share| share), [0.11; 5]);
    let series = |name: &str, points: &[[f64; 2]]| Series { name: name.into(), points: points.to_vec() };
    let mut plot = |name: &str, title: &str, axis: &str, series: Vec<Series>| {
        let axes = [axis.into(), "rms error, relative".into()];
        section.plots.push(Plot { name: format!("convergence_{name}"), title: title.into(), axes, series });
    };
    plot("elements", "Error against element size", "element size, m", vec![series("room, 64 cells", &by_size)]);
    let curves =
        vec![series("room, elements of 0.1 m", &by_cells), series("furnace, elements of 0.2 m", &furnace_by_cells)];
    plot("cells", "Error against number of cells", "cells", curves);
    plot("unshot", "Error against unshot share", "unshot power, share of emitted", vec![series("room", &by_share)]);
    section
}

/// Share of the power left unshot where something else is looked at.
const SMALL: f64 = 1e-4;

/// Rows for points (parameter, error): each at most what is allowed, and at most its ratio of the one before.
fn add<const N: usize>(
    section: &mut Section,
    what: &str,
    unit: &str,
    points: &[[f64; 2]; N],
    allowed: [f64; N],
    ratios: [f64; N],
) {
    let mut row = |case: String, expected: f64, found: f64| {
        section.rows.push(Row { case, expected, found, bound: Bound::AtMost });
    };
    for (i, ([parameter, error], allowed)) in points.iter().zip(allowed).enumerate() {
        row(format!("{what} {parameter} {unit}: error"), allowed, *error);
        if i > 0 {
            let [before, larger] = points[i - 1];
            let order = (larger / error).ln() / (before / parameter).ln().abs();
            row(
                format!("{what} {parameter} {unit}: share of the error before (order {order:.2})"),
                ratios[i],
                error / larger,
            );
        }
    }
}
