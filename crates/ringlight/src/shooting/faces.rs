//! Face clusters: small facets that lie together and face alike, lit as one.
//!
//! Models are often made of many more facets than elements are wanted. Each facet is an element of its own then, but light is
//! looked for at one of every face cluster, and found for the others between those.

use crate::mesh::{Cluster, Frame, Mesh, Patch};
use crate::quantity::Rgb;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Largest diagonal of a face cluster's box, as a share of the element size: about as long as that of half an element.
const EXTENT: f32 = 0.7;

/// Least cosine between a face cluster's axis and a normal in it.
const ALIKE: f32 = 0.85;

/// Light of face clusters this many element sizes away still counts.
const REACH: f64 = 1.0;

/// Which elements are lit as one.
#[derive(Debug, Default)]
pub struct Faces {
    /// For each element, the one whose light it shares: its own but for small facets.
    representative: Vec<u32>,
}

/// A surface, and whether it is its back: of a thin shell's four sides, two face alike, and one of those is dark.
type Side = (u32, bool);

/// An element that may belong to a face cluster.
struct Small {
    element: u32,
    side: Side,
    low: Vec3,
    high: Vec3,
    middle: Vec3,
    normal: Vec3,
}

/// Whether surfaces within this box, whose normals lie about one axis within this cosine, make a face cluster.
pub fn is_face_cluster(mesh: &Mesh, low: Vec3, high: Vec3, cosine: f32) -> bool {
    (high - low).length() <= EXTENT * mesh.sizes.element as f32 && cosine >= ALIKE
}

impl Faces {
    /// Of a mesh. A face cluster lies within a cluster, so that who owns one of its elements owns all.
    pub fn new(mesh: &Mesh) -> Faces {
        let of_cluster = |cluster: &Cluster| {
            let mut representative: Vec<u32> = cluster.elements.clone().collect();
            let patches = cluster.patches.clone().map(|id| mesh.patch(id));
            let mut small: Vec<Small> = patches.filter_map(|patch| Small::of(mesh, &patch)).collect();
            small.sort_by_key(|s| s.side);
            for of_side in small.chunk_by_mut(|a, b| a.side == b.side) {
                join(mesh, of_side, &mut |of, element| {
                    representative[(element - cluster.elements.start) as usize] = of;
                });
            }
            representative
        };
        Faces { representative: mesh.clusters.par_iter().flat_map_iter(of_cluster).collect() }
    }

    /// The element whose light `element` shares.
    pub fn representative(&self, element: u32) -> u32 {
        self.representative[element as usize]
    }

    /// Whether light of its own is looked for.
    pub fn is_own(&self, element: u32) -> bool {
        self.representative(element) == element
    }
}

impl Small {
    /// If the patch is a whole small side of a facet, with one element.
    fn of(mesh: &Mesh, patch: &Patch) -> Option<Small> {
        let element = patch.first_element;
        let facet = &mesh.facets[patch.facet as usize];
        // Between the parts of a facet light breaks.
        let alone = patch.element_count() == 1 && facet.patch_count() == 1 && facet.part == 0;
        if !alone || mesh.valid[element as usize] == 0 {
            return None;
        }
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let (corners, count) = patch.frame.corners();
        for corner in &corners[..count] {
            (low, high) = (low.min(corner.as_vec3()), high.max(corner.as_vec3()));
        }
        let normal = patch.normal.as_vec3();
        is_face_cluster(mesh, low, high, 1.0).then(|| {
            let (side, middle) = (side(mesh, patch), middle(patch));
            Small { element, side, low, high, middle, normal }
        })
    }
}

fn side(mesh: &Mesh, patch: &Patch) -> Side {
    (mesh.facets[patch.facet as usize].surface, patch.back)
}

fn middle(patch: &Patch) -> Vec3 {
    patch.frame.at(Frame::middle(patch.frame.layout)).as_vec3()
}

/// Halves what is too large for one face cluster along its longest extent of (position, normal); tells of each element by
/// which it is represented: the one in the middle.
fn join(mesh: &Mesh, small: &mut [Small], tell: &mut impl FnMut(u32, u32)) {
    if small.len() < 2 {
        return;
    }
    let none = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (low, high) = small.iter().fold(none, |(low, high), s| (low.min(s.low), high.max(s.high)));
    let axis = small.iter().map(|s| s.normal).sum::<Vec3>().normalize_or_zero();
    let cosine = small.iter().map(|s| s.normal.dot(axis)).fold(1.0, f32::min);
    if is_face_cluster(mesh, low, high, cosine) {
        let centre = small.iter().map(|s| s.middle).sum::<Vec3>() / small.len() as f32;
        let away = |s: &Small| (s.middle - centre).length_squared();
        if let Some(of) = small.iter().min_by(|a, b| away(a).total_cmp(&away(b)).then(a.element.cmp(&b.element))) {
            small.iter().for_each(|s| tell(of.element, s.element));
        }
        return;
    }
    let turn = EXTENT * mesh.sizes.element as f32;
    let key = |s: &Small| [s.middle.to_array(), (s.normal * turn).to_array()].concat();
    let mut extent = [(f32::INFINITY, f32::NEG_INFINITY); 6];
    for s in small.iter() {
        for (e, x) in extent.iter_mut().zip(key(s)) {
            *e = (e.0.min(x), e.1.max(x));
        }
    }
    let longest = (0..6).max_by(|&a, &b| (extent[a].1 - extent[a].0).total_cmp(&(extent[b].1 - extent[b].0)));
    let longest = longest.unwrap_or(0);
    let place = |s: &Small| if longest < 3 { s.middle[longest] } else { s.normal[longest - 3] };
    let half = small.len() / 2;
    small.select_nth_unstable_by(half, |a, b| place(a).total_cmp(&place(b)).then(a.element.cmp(&b.element)));
    let (left, right) = small.split_at_mut(half);
    join(mesh, left, tell);
    join(mesh, right, tell);
}

/// Light between the face clusters' representatives: each counts the more the nearer it is and the more alike it faces
/// (Shepard 1968; Franke & Nielson 1980 for weights of bounded reach).
pub struct Between<'a> {
    mesh: &'a Mesh,
    /// Representatives by their side and the cube of [`REACH`] that they lie in.
    places: Vec<((Side, [i32; 3]), Place)>,
    reach: f64,
}

#[derive(Clone, Copy)]
struct Place {
    element: u32,
    side: Side,
    point: Vec3,
    normal: Vec3,
}

impl<'a> Between<'a> {
    /// None if every element has light of its own.
    pub fn new(mesh: &'a Mesh, faces: &Faces) -> Option<Between<'a>> {
        let mut shared = vec![false; faces.representative.len()];
        for (element, &of) in (0..).zip(&faces.representative) {
            shared[of as usize] |= of != element;
        }
        let reach = REACH * mesh.sizes.element;
        let place = |id: u32| {
            let patch = mesh.patch(id);
            shared[patch.first_element as usize].then(|| {
                let place = Place::of(mesh, &patch);
                ((place.side, cube(place.point, reach)), place)
            })
        };
        let mut places: Vec<_> = (0..mesh.patch_count() as u32).into_par_iter().filter_map(place).collect();
        places.par_sort_unstable_by_key(|(key, place)| (*key, place.element));
        (!places.is_empty()).then_some(Between { mesh, places, reach })
    }

    /// Light on the middle of a patch that is one element, given that of all representatives.
    pub fn light(&self, patch: &Patch, light: &[Rgb]) -> Rgb {
        let at = Place::of(self.mesh, patch);
        let [x, y, z] = cube(at.point, self.reach);
        let (mut sum, mut total) = ([0.0f64; 3], 0.0);
        for (i, j) in (-1..=1).flat_map(|i| (-1..=1).map(move |j| (i, j))) {
            let cube = |k: i32| (at.side, [x + i, y + j, z + k]);
            let start = self.places.partition_point(|(key, _)| *key < cube(-1));
            let row = self.places[start..].iter().take_while(|(key, _)| *key <= cube(1));
            for (_, place) in row {
                let weight = self.weight(&at, place);
                total += weight;
                (0..3).for_each(|c| sum[c] += weight * f64::from(light[place.element as usize][c]));
            }
        }
        if total > 0.0 { sum.map(|s| (s / total) as f32) } else { light[at.element as usize] }
    }

    fn weight(&self, at: &Place, place: &Place) -> f64 {
        let squared = f64::from((place.point - at.point).length_squared());
        let alike = f64::from(place.normal.dot(at.normal));
        if squared >= self.reach * self.reach || alike <= 0.0 {
            return 0.0;
        }
        let away = squared.sqrt();
        let near = (self.reach - away) / away.max(1e-4 * self.reach);
        (near * alike * alike).powi(2)
    }
}

impl Place {
    fn of(mesh: &Mesh, patch: &Patch) -> Place {
        let (side, point, normal) = (side(mesh, patch), middle(patch), patch.normal.as_vec3());
        Place { element: patch.first_element, side, point, normal }
    }
}

fn cube(point: Vec3, size: f64) -> [i32; 3] {
    (DVec3::from(point) / size).floor().as_ivec3().to_array()
}
