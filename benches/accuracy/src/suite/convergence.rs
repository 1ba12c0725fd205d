//! Error against the size of elements, the number of cells and what is left unshot.

use crate::plot::{Plot, Series};
use crate::scene::{Builder, Meshed, meshed, solve};
use crate::{Bound, Row, Section};
use glam::DVec3;
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
                let coarse = (facet.first_element + facet.find_element(at).0) as usize;
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

/// All three, for the room.
pub fn measure() -> Section {
    let mut section = Section { title: "Convergence".into(), text: TEXT.trim().into(), ..Section::default() };
    let t = std::time::Instant::now();
    let reference = light(0.2, 0.05, 64, 1e-5);
    eprintln!("{:?} {}", t.elapsed(), reference.irradiance.len());
    for (patch, element, cells) in [
        (0.8, 0.4, 64),
        (0.4, 0.2, 64),
        (0.2, 0.1, 64),
        (0.4, 0.1, 1),
        (0.4, 0.1, 4),
        (0.4, 0.1, 16),
        (0.4, 0.1, 64),
        (0.2, 0.05, 16),
    ] {
        let found = light(patch, element, cells, 1e-5);
        eprintln!("{patch} {element} {cells}: {:.5} {:?}", found.error(&reference), t.elapsed());
    }
    let _ = (Bound::AtMost, DVec3::ZERO);
    let _: Option<(Row, Plot, Series)> = None;
    section.rows.clear();
    section
}

const TEXT: &str = "x";
