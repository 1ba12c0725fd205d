//! From a scene's triangles to the mesh.

use super::cluster;
use super::discontinuity;
use super::pairing::{Corner, Pairing, Polygon};
use super::plane::{Planes, RELATIVE_TOLERANCE};
use super::size::{self, Quality};
use super::{Facet, Mesh, NONE};
use crate::column::{Column, Store};
use crate::scene::{Place, Scene, SceneError, SourceTriangle};
use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::io;

/// What the user may fix.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MeshOptions {
    /// Fineness of the defaults.
    pub quality: Quality,
    /// Largest edge of a patch, metres.
    pub patch_size: Option<f64>,
    /// Largest edge of an element, metres.
    pub element_size: Option<f64>,
    /// Of so many area lights, the strongest, the lines along which they let light break on large facets are edges of elements; and,
    /// unless it is 0, those along which something stands on the facets or passes through. What shines of one surface in one plane is one light.
    pub lines: u32,
}

/// Triangles whose height is below this share of their longest edge are slivers: left out, with a count.
const SLIVER: f32 = 1e-5;

/// Cuts the scene's surfaces into patches, elements and clusters. All samples count as valid until
/// [`super::find_valid_samples`] has looked at them. All that grows with the number of triangles or elements is in `store`, but
/// for the clusters.
pub fn build(scene: &Scene, options: &MeshOptions, store: Store<'_>) -> Result<Mesh, SceneError> {
    let mut mesh = Mesh {
        facets: store.column()?,
        patch_facets: store.column()?,
        first_elements: store.column()?,
        base_uv: store.column()?,
        emission_uv: store.column()?,
        vertex_colours: store.column()?,
        colours: store.column()?,
        valid: store.column()?,
        ..Mesh::default()
    };
    let (low, high) = bounds(scene)?;
    let centre = (low + high) / 2.0;
    mesh.diagonal = (high - low).length();
    // Scenes near the origin keep their coordinates to the bit.
    if centre.length() > 2.0 * mesh.diagonal {
        mesh.origin = centre.round().to_array();
    }
    add_surfaces(&mut mesh, scene, store)?;
    if mesh.facets.is_empty() {
        let place = Place::new(scene.name.clone(), "");
        return Err(SceneError::new(place, "no triangle with an area", "a surface to light"));
    }
    find_planes(&mut mesh, store)?;
    let double_sided = |f: &Facet| scene.materials[scene.surfaces[f.surface as usize].material as usize].double_sided;
    for facet in &mut mesh.facets {
        // Until the facets are numbered, this marks which have two lit sides.
        facet.first_back_patch = if double_sided(facet) { 0 } else { NONE };
    }
    mesh.sizes = size::choose(&mesh.facets, options.quality, [options.patch_size, options.element_size], store)?;
    let lines = if options.lines > 0 { discontinuity::lines(&mesh, scene, options.lines) } else { Vec::new() };
    discontinuity::cut(&mut mesh, &lines, store)?;
    let mut total = 0u64;
    for facet in &mesh.facets {
        let sides = if double_sided(facet) { 2 } else { 1 };
        let one = facet.patches.iter().chain(&facet.elements).map(|&n| u64::from(n)).product::<u64>();
        total = total.saturating_add(one.saturating_mul(sides));
    }
    limit(total, scene)?;
    let turn = 4.0 * mesh.sizes.patch;
    let (order, groups) = cluster::order(&mesh.facets, turn, store)?;
    let unordered = std::mem::replace(&mut mesh.facets, store.column()?);
    let by_number: &[Facet] = &unordered;
    mesh.facets.reserve(by_number.len())?;
    mesh.facets.extend(order.iter().map(|&f| by_number[f as usize]))?;
    drop((order, unordered));
    cluster::number(&mut mesh, &groups, double_sided)?;
    mesh.valid.resize(total as usize, super::ALL_VALID)?;
    super::colour::assign(&mut mesh, scene, store)?;
    Ok(mesh)
}

/// Refuses meshes of too many elements.
pub(super) fn limit(elements: u64, scene: &Scene) -> Result<(), SceneError> {
    if elements <= u64::from(u32::MAX) / 2 {
        return Ok(());
    }
    let place = Place::new(scene.name.clone(), "");
    Err(SceneError::new(place, format!("{elements} elements"), "at most 2 billion; choose a larger element size"))
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

/// Adds the facets of all surfaces.
fn add_surfaces(mesh: &mut Mesh, scene: &Scene, store: Store<'_>) -> Result<(), SceneError> {
    let origin = DVec3::from(mesh.origin);
    let mut triangles: Column<[Corner; 3]> = store.column()?;
    let mut pairing = Pairing::new(store)?;
    let mut slivers = 0;
    for (number, surface) in scene.surfaces.iter().enumerate() {
        let material = &scene.materials[surface.material as usize];
        let (base, emission) = (material.base_texture.is_some(), material.emission_texture.is_some());
        triangles.clear();
        let mut kept = Ok(());
        scene.geometry.triangles(number, &mut |t| {
            let corners: [Corner; 3] = std::array::from_fn(|i| Corner {
                position: (DVec3::from(t.position[i]) - origin).as_vec3(),
                base_uv: if base { t.base_uv[i] } else { [0.0; 2] },
                emission_uv: if emission { t.emission_uv[i] } else { [0.0; 2] },
                colour: if surface.has_colours { t.colour[i] } else { [1.0; 4] },
            });
            if is_sliver(corners.map(|c| c.position)) {
                slivers += 1;
            } else if kept.is_ok() {
                kept = triangles.push(corners);
            }
        })?;
        kept?;
        pairing.pair(&triangles, |polygon| {
            add_facet(mesh, number as u32, polygon, [base, emission, surface.has_colours])
        })?;
    }
    if slivers > 0 {
        mesh.skipped.push(("sliver".into(), slivers));
    }
    Ok(())
}

fn is_sliver([a, b, c]: [Vec3; 3]) -> bool {
    let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    let twice_area = (b - a).cross(c - a).length();
    !(twice_area > SLIVER * longest && twice_area > f32::MIN_POSITIVE)
}

fn add_facet(mesh: &mut Mesh, surface: u32, polygon: &Polygon, [base, emission, colours]: [bool; 3]) -> io::Result<()> {
    fn keep<T: Pod>(values: &mut Column<T>, wanted: bool, value: T) -> io::Result<u32> {
        if !wanted {
            return Ok(NONE);
        }
        values.push(value)?;
        Ok(values.len() as u32 - 1)
    }
    let c = &polygon.corners;
    let facet = Facet {
        corners: c.map(|c| c.position),
        surface,
        plane: NONE,
        first_patch: NONE,
        first_back_patch: NONE,
        base_uv: keep(&mut mesh.base_uv, base, c.map(|c| c.base_uv))?,
        emission_uv: keep(&mut mesh.emission_uv, emission, c.map(|c| c.emission_uv))?,
        vertex_colour: keep(&mut mesh.vertex_colours, colours, c.map(|c| c.colour))?,
        colours: [NONE; 2],
        patches: [1; 2],
        elements: [1; 2],
        part: 0,
    };
    debug_assert_eq!(facet.layout() == ringlight_visibility::Layout::Triangle, polygon.triangle);
    mesh.facets.push(facet)
}

/// A facet by its size.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Sized {
    area_squared: f64,
    facet: u64,
}

/// Gives plane ids, large facets first.
fn find_planes(mesh: &mut Mesh, store: Store<'_>) -> io::Result<()> {
    let facets: &mut [Facet] = &mut mesh.facets;
    let mut order: Column<Sized> = store.column()?;
    order.reserve(facets.len())?;
    let size = |f: &Facet| f.frame().area_vector().length_squared();
    order.extend((0..).zip(&*facets).map(|(facet, f)| Sized { area_squared: size(f), facet }))?;
    order.par_sort_unstable_by(|a, b| b.area_squared.total_cmp(&a.area_squared).then(a.facet.cmp(&b.facet)));
    let reach = facets.iter().flat_map(|f| f.corners).map(|c| f64::from(c.length())).fold(0.0, f64::max);
    let mut planes = Planes::new(RELATIVE_TOLERANCE * mesh.diagonal, reach, store)?;
    for sized in &order {
        let facet = &mut facets[sized.facet as usize];
        facet.plane = planes.id(&facet.corners.map(|c| c.as_dvec3()), facet.frame().area_vector())?;
    }
    Ok(())
}
