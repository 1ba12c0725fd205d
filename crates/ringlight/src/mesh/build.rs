//! From a scene's triangles to the mesh.

use super::cluster;
use super::pairing::{Corner, Polygon, pair};
use super::plane::{Planes, RELATIVE_TOLERANCE};
use super::size::{self, Quality};
use super::{Facet, Mesh, NONE};
use crate::scene::{Place, Scene, SceneError, SourceTriangle};
use glam::{DVec3, Vec3};

/// What the user may fix.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MeshOptions {
    /// Fineness of the defaults.
    pub quality: Quality,
    /// Largest edge of a patch, metres.
    pub patch_size: Option<f64>,
    /// Largest edge of an element, metres.
    pub element_size: Option<f64>,
}

/// Triangles whose height is below this share of their longest edge are slivers: left out, with a count.
const SLIVER: f32 = 1e-5;

/// Cuts the scene's surfaces into patches, elements and clusters. All samples count as valid until
/// [`super::find_valid_samples`] has looked at them.
pub fn build(scene: &Scene, options: &MeshOptions) -> Result<Mesh, SceneError> {
    let mut mesh = Mesh { surface_colours: vec![Default::default(); scene.surfaces.len()], ..Mesh::default() };
    let (low, high) = bounds(scene)?;
    let centre = (low + high) / 2.0;
    mesh.diagonal = (high - low).length();
    // Scenes near the origin keep their coordinates to the bit.
    if centre.length() > 2.0 * mesh.diagonal {
        mesh.origin = centre.round().to_array();
    }
    let mut slivers = 0;
    for surface in 0..scene.surfaces.len() {
        slivers += add_surface(&mut mesh, scene, surface)?;
    }
    if slivers > 0 {
        mesh.skipped.push(("sliver".into(), slivers));
    }
    if mesh.facets.is_empty() {
        let place = Place::new(scene.name.clone(), "");
        return Err(SceneError::new(place, "no triangle with an area", "a surface to light"));
    }
    find_planes(&mut mesh, (high - low).length());
    let double_sided = |f: &Facet| scene.materials[scene.surfaces[f.surface as usize].material as usize].double_sided;
    for facet in &mut mesh.facets {
        // Until the facets are numbered, this marks which have two lit sides.
        facet.first_back_patch = if double_sided(facet) { 0 } else { NONE };
    }
    mesh.sizes = size::choose(&mesh.facets, options.quality, options.patch_size, options.element_size);
    let mut element_counts = Vec::with_capacity(mesh.facets.len());
    let mut total = 0u64;
    for facet in &mut mesh.facets {
        (facet.patches, facet.elements) = size::grids(size::lengths(facet), &mesh.sizes);
        let sides = if double_sided(facet) { 2 } else { 1 };
        let one = facet.patches.iter().chain(&facet.elements).map(|&n| u64::from(n)).product::<u64>();
        total = total.saturating_add(one.saturating_mul(sides));
        element_counts.push(one.min(u64::from(u32::MAX)) as u32);
    }
    if total > u64::from(u32::MAX) / 2 {
        let place = Place::new(scene.name.clone(), "");
        return Err(SceneError::new(
            place,
            format!("{total} elements"),
            "at most 2 billion; choose a larger element size",
        ));
    }
    let turn = 4.0 * mesh.sizes.patch;
    let (order, groups) = cluster::order(&mesh.facets, &element_counts, turn);
    mesh.facets = order.iter().map(|&f| mesh.facets[f as usize]).collect();
    cluster::number(&mut mesh, &groups, double_sided);
    mesh.valid = vec![super::ALL_VALID; total as usize];
    super::colour::assign(&mut mesh, scene);
    Ok(mesh)
}

/// The box around all triangles, metres.
fn bounds(scene: &Scene) -> Result<(DVec3, DVec3), SceneError> {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for surface in 0..scene.surfaces.len() {
        scene.geometry.triangles(surface, &mut |t: SourceTriangle| {
            for p in t.position {
                (low, high) = (low.min(p.into()), high.max(p.into()));
            }
        })?;
    }
    if low.x > high.x {
        return Err(SceneError::new(Place::new(scene.name.clone(), ""), "no triangles", "a surface to light"));
    }
    Ok((low, high))
}

/// Adds a surface's facets; gives the number of slivers left out.
fn add_surface(mesh: &mut Mesh, scene: &Scene, number: usize) -> Result<u64, SceneError> {
    let surface = &scene.surfaces[number];
    let material = &scene.materials[surface.material as usize];
    let origin = DVec3::from(mesh.origin);
    let mut triangles: Vec<[Corner; 3]> = Vec::with_capacity(surface.triangles.min(1 << 24) as usize);
    let mut slivers = 0;
    let (base, emission) = (material.base_texture.is_some(), material.emission_texture.is_some());
    scene.geometry.triangles(number, &mut |t| {
        let corners: [Corner; 3] = std::array::from_fn(|i| Corner {
            position: (DVec3::from(t.position[i]) - origin).as_vec3(),
            base_uv: if base { t.base_uv[i] } else { [0.0; 2] },
            emission_uv: if emission { t.emission_uv[i] } else { [0.0; 2] },
            colour: if surface.has_colours { t.colour[i] } else { [1.0; 4] },
        });
        if is_sliver(corners.map(|c| c.position)) { slivers += 1 } else { triangles.push(corners) }
    })?;
    for polygon in pair(&triangles) {
        add_facet(mesh, number as u32, &polygon, [base, emission, surface.has_colours]);
    }
    Ok(slivers)
}

fn is_sliver([a, b, c]: [Vec3; 3]) -> bool {
    let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    let twice_area = (b - a).cross(c - a).length();
    !(twice_area > SLIVER * longest && twice_area > f32::MIN_POSITIVE)
}

fn add_facet(mesh: &mut Mesh, surface: u32, polygon: &Polygon, [base, emission, colours]: [bool; 3]) {
    fn store<T>(values: &mut Vec<T>, wanted: bool, value: T) -> u32 {
        if wanted {
            values.push(value);
            values.len() as u32 - 1
        } else {
            NONE
        }
    }
    let c = &polygon.corners;
    let facet = Facet {
        corners: c.map(|c| c.position),
        surface,
        plane: NONE,
        first_patch: NONE,
        first_back_patch: NONE,
        first_element: NONE,
        first_back_element: NONE,
        base_uv: store(&mut mesh.base_uv, base, c.map(|c| c.base_uv)),
        emission_uv: store(&mut mesh.emission_uv, emission, c.map(|c| c.emission_uv)),
        vertex_colour: store(&mut mesh.vertex_colours, colours, c.map(|c| c.colour)),
        colour: NONE,
        patches: [1; 2],
        elements: [1; 2],
    };
    debug_assert_eq!(facet.layout() == ringlight_visibility::Layout::Triangle, polygon.triangle);
    mesh.facets.push(facet);
}

/// Gives plane ids, large facets first.
fn find_planes(mesh: &mut Mesh, diagonal: f64) {
    let areas: Vec<DVec3> = mesh.facets.iter().map(|f| f.frame().area_vector()).collect();
    let mut order: Vec<u32> = (0..mesh.facets.len() as u32).collect();
    order.sort_by(|&a, &b| {
        areas[b as usize].length_squared().total_cmp(&areas[a as usize].length_squared()).then(a.cmp(&b))
    });
    let reach = mesh.facets.iter().flat_map(|f| f.corners).map(|c| f64::from(c.length())).fold(0.0, f64::max);
    let mut planes = Planes::new(RELATIVE_TOLERANCE * diagonal, reach);
    for f in order {
        let facet = &mut mesh.facets[f as usize];
        facet.plane = planes.id(&facet.corners.map(|c| c.as_dvec3()), areas[f as usize]);
    }
}
