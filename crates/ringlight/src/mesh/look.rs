//! What a point of a surface sees when it looks about.

use super::plane::RELATIVE_TOLERANCE;
use super::walk::{Query, Rule, Walk};
use super::{Facet, Mesh, NONE, Patch};
use glam::DVec3;
use ringlight_visibility::{Hit, NO_PLANE, Ray};

/// Surfaces nearer than this share of an element's width touch it.
const CONTACT: f64 = 0.02;

/// A sample that sees nothing farther away than this share of an element's width lies in a crack.
const CRACK: f64 = 0.25;

/// Directions (tangent, bitangent, normal) in which a sample looks about: the normal first, then two rings.
pub const DIRECTIONS: [[f64; 3]; 13] = [
    [0.02, 0.01, 0.999_75],
    [0.51, 0.04, 0.859_25],
    [-0.04, 0.51, 0.859_25],
    [-0.51, -0.04, 0.859_25],
    [0.04, -0.51, 0.859_25],
    [0.80, 0.33, 0.501_1],
    [0.33, 0.80, 0.501_1],
    [-0.33, 0.80, 0.501_1],
    [-0.80, 0.33, 0.501_1],
    [-0.80, -0.33, 0.501_1],
    [-0.33, -0.80, 0.501_1],
    [0.33, -0.80, 0.501_1],
    [0.80, -0.33, 0.501_1],
];

/// What a point sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum View {
    /// Backs, and what touches it.
    Covered,
    /// Lit surfaces, all of them near.
    Crack,
    /// More.
    Open,
}

/// The walk that finds what a point of a patch sees besides backs and what touches it. Where a coplanar surface faces it (a
/// box's bottom on the floor), it must see a lit surface; elsewhere it is enough to see nothing. Where surfaces lie in each
/// other, looking the same way, one of them has the light: twice the light would never die out.
#[derive(Clone, Debug)]
pub struct LookAbout<'a> {
    mesh: &'a Mesh,
    patch: u32,
    plane: u32,
    normal: DVec3,
    point: DVec3,
    /// Width of the patch's elements, metres.
    width: f64,
    step: Step,
    /// Whether a ray has met nothing.
    escapes: bool,
    view: View,
}

/// What is asked next.
#[derive(Clone, Copy, Debug)]
enum Step {
    /// Whether a coplanar surface that looks the same way has the light.
    Overlay,
    /// What lies in a direction.
    Direction(usize),
    /// Whether a coplanar surface faces the point, now that the ray in a direction has been the first to meet nothing.
    Facing(usize),
    /// Nothing more.
    Over,
}

impl<'a> LookAbout<'a> {
    /// From a point of a patch.
    pub fn new(mesh: &'a Mesh, patch: &Patch, point: DVec3) -> LookAbout<'a> {
        let width = (patch.area / f64::from(patch.element_count())).sqrt();
        let (step, escapes, view) = (Step::Overlay, false, View::Covered);
        LookAbout { mesh, patch: patch.id, plane: patch.plane, normal: patch.normal, point, width, step, escapes, view }
    }

    /// What has been seen, once the walk is over.
    pub fn view(&self) -> View {
        self.view
    }

    /// A short ray through the surface, from below.
    fn across(&self, rule: Rule) -> Query {
        let step = 10.0 * RELATIVE_TOLERANCE * self.mesh.diagonal;
        let ray = Ray {
            origin: (self.point - step * self.normal).as_vec3().to_array(),
            direction: (2.0 * step * self.normal).as_vec3().to_array(),
            near: 0.0,
            far: 1.0,
            plane: NO_PLANE,
        };
        Query { ray, rule }
    }

    fn towards(&self, [x, y, z]: [f64; 3]) -> Query {
        let (t, b) = self.normal.any_orthonormal_pair();
        let ray = Ray {
            origin: self.point.as_vec3().to_array(),
            direction: (x * t + y * b + z * self.normal).as_vec3().to_array(),
            near: 0.0,
            far: f32::INFINITY,
            plane: self.plane,
        };
        Query { ray, rule: Rule::All }
    }

    /// Takes account of what a ray has hit.
    fn see(&mut self, hit: &Hit) {
        let lit = hit.front || self.mesh.facets[(hit.triangle >> 1) as usize].double_sided();
        let distance = f64::from(hit.distance);
        if lit && distance > CRACK * self.width {
            self.view = View::Open;
        } else if lit && distance > CONTACT * self.width {
            self.view = View::Crack;
        }
    }

    /// The step after a direction.
    fn after(&self, direction: usize) -> Step {
        let last = direction + 1 == DIRECTIONS.len();
        if last || self.view == View::Open { Step::Over } else { Step::Direction(direction + 1) }
    }
}

impl Walk for LookAbout<'_> {
    fn query(&self) -> Option<Query> {
        match self.step {
            Step::Overlay => Some(self.across(Rule::Overlaying(self.patch))),
            Step::Direction(i) => Some(self.towards(DIRECTIONS[i])),
            Step::Facing(_) => Some(self.across(Rule::Facing(self.patch))),
            Step::Over => None,
        }
    }

    fn answer(&mut self, hit: Option<Hit>) {
        self.step = match (self.step, hit) {
            (Step::Overlay, None) => Step::Direction(0),
            (Step::Direction(i), None) if !self.escapes => {
                self.escapes = true;
                Step::Facing(i)
            }
            (Step::Direction(i), hit) => {
                hit.inspect(|hit| self.see(hit));
                self.after(i)
            }
            // To see nothing is enough: the other directions have nothing to add.
            (Step::Facing(_), None) => {
                self.view = View::Open;
                Step::Over
            }
            (Step::Facing(i), Some(_)) => self.after(i),
            (Step::Overlay, Some(_)) | (Step::Over, _) => Step::Over,
        };
    }
}

/// Whether another facet in the plane of a patch looks the same way, and has the light where both lie in each other.
pub(super) fn overlays(mesh: &Mesh, patch: u32, other: u32) -> bool {
    let patch = mesh.patch(patch);
    let (this, facet) = (&mesh.facets[patch.facet as usize], &mesh.facets[other as usize]);
    let same_way = facet.double_sided() || facet.frame().area_vector().dot(patch.normal) > 0.0;
    same_way && precedence(mesh, other, facet) < precedence(mesh, patch.facet, this)
}

/// Whether another facet in the plane of a patch faces it.
pub(super) fn faces(mesh: &Mesh, patch: u32, other: u32) -> bool {
    mesh.facets[other as usize].frame().area_vector().dot(mesh.patch(patch).normal) < 0.0
}

/// Which of two facets that lie in each other has the light: the smaller key. Lamps come before others, small facets before
/// large ones.
fn precedence(mesh: &Mesh, number: u32, facet: &Facet) -> (bool, u64, u32) {
    let colour = match facet.colours[0] {
        NONE => mesh.surface_colours[facet.surface as usize],
        first => mesh.colours[first as usize],
    };
    // Non-negative floats order like their bits.
    (!colour.emits(), facet.frame().area_vector().length().to_bits(), number)
}
