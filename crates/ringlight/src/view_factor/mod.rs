//! Area-averaged form factors (view factors) between polygons, faces and objects. Knows no light.
//!
//! Geometry is held in double precision, straight from the scene: no mesh, no elements.

mod assembly;
mod audit;
mod between;
mod clip;
mod edges;
mod faces;
mod facing;
mod hull;
mod joining;
mod matrix;
mod obstructed;
mod occluders;
mod pair;
mod polygon;
mod quadrature;
mod sampled;
mod screens;
mod shadow;
mod solids;
mod spill;
mod unobstructed;

pub use audit::{Auditor, Reciprocity, RowSums, reciprocity};
pub use faces::{Faces, Group, Per, Sides};
pub use matrix::{Computed, MatrixSettings, Pairs, Row, Watch, compute};
pub use occluders::{Occluder, Occluders};
pub use polygon::Polygon;
pub use spill::{Entry, Storage};

use pair::Pair;
use ringlight_visibility::NO_PLANE;
use sampled::Rays;

/// A factor with the estimate of its error, both as exchange areas A₁F₁₂ = A₂F₂₁, m²: the one number that belongs to the
/// pair. Divide by the area of the side from which it is looked at.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Exchange {
    /// A·F, m².
    pub area: f64,
    /// What it may be off by, m².
    pub error: f64,
}

/// How good a factor is to be: its error is to stay below `relative`·F or `absolute`, whichever is larger.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// Share of F.
    pub relative: f64,
    /// Of F itself, seen from the smaller of the two polygons.
    pub absolute: f64,
}

impl Default for Tolerance {
    fn default() -> Tolerance {
        Tolerance { relative: 1e-3, absolute: 5e-6 }
    }
}

/// Room for intermediate results; one a thread.
#[derive(Debug, Default)]
pub struct Work {
    pair: Pair,
    unobstructed: unobstructed::Scratch,
    between: between::Scratch,
    obstructed: obstructed::Scratch,
}

/// A·F of two polygons: what one sees of the front of the other, averaged over its own front. The same bits for (a, b) and
/// (b, a). With nothing in the way it is exact to about ten digits whatever the tolerance is. With occluders in the way the
/// time it takes is bounded (about a second), and the error may then exceed the tolerance; it always says by how much.
pub fn exchange(
    a: &Polygon,
    b: &Polygon,
    occluders: Option<&Occluders>,
    tolerance: &Tolerance,
    work: &mut Work,
) -> Exchange {
    if (a.plane == b.plane && a.plane != NO_PLANE) || !work.pair.prepare(a, b) {
        return Exchange::default();
    }
    let Work { pair, unobstructed, between, obstructed } = work;
    let metres = pair.unit * pair.unit;
    let occluders = occluders.filter(|occluders| between::find(pair, occluders, between));
    let (area, error) = if let Some(occluders) = occluders {
        let least = tolerance.absolute * a.area.min(b.area) / metres;
        let outer = between::outer(pair, &between.blockers);
        let scene = obstructed::Scene {
            outer: pair.face(outer),
            target: pair.face(1 - outer),
            blockers: &between.blockers,
            rays: Rays {
                hierarchy: &occluders.hierarchy,
                unit: pair.unit,
                shift: pair.origin - occluders.origin,
                planes: [pair.planes[outer], pair.planes[1 - outer]],
            },
            flat: pair.flat,
            least,
        };
        let enough = |area: f64| least.max(tolerance.relative * area);
        obstructed::exchange(&scene, enough, obstructed, unobstructed)
    } else {
        unobstructed::exchange(pair.face(0), pair.face(1), unobstructed)
    };
    Exchange { area: area * metres, error: error * metres }
}

#[cfg(test)]
mod tests;
