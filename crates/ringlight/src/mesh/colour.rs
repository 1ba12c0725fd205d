//! Reflectance, emission and coverage of elements: averages of factors, textures and vertex colours.

use super::{Facet, FacetCoverage, Frame, Mesh, NONE, OPAQUE_COVERAGE, Tile};
use crate::column::Store;
use crate::quantity::{MAX_REFLECTANCE, Rgb};
use crate::scene::texture::TextureImage;
use crate::scene::{Alpha, Material, Scene, Texture};
use bytemuck::{Pod, Zeroable};
use glam::{DVec2, Vec2, Vec4};
use rayon::prelude::*;
use ringlight_visibility::{Bitmap, Layout};
use std::io;
use std::ops::Range;
use std::sync::Arc;

/// Facets whose colours are computed before any is written down.
const FACETS_AT_ONCE: usize = 1 << 10;

/// What an element does with light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Colour {
    /// Diffuse reflectance of the covered part, at most 0.95.
    pub reflectance: Rgb,
    /// Share of the area that is covered (blocks and reflects): 1 for opaque surfaces.
    pub coverage: f32,
    /// Exitance over the whole area, W/m² or lm/m².
    pub exitance: Rgb,
}

impl Colour {
    /// Share of arriving light that leaves again: reflectance × coverage.
    pub fn returned(&self) -> Rgb {
        self.reflectance.map(|r| r * self.coverage)
    }

    /// Whether it emits.
    pub fn emits(&self) -> bool {
        self.exitance.iter().any(|&x| x > 0.0)
    }
}

/// Finds the colours of all surfaces and elements, decoding one image at a time.
pub fn assign(mesh: &mut Mesh, scene: &Scene, store: Store<'_>) -> io::Result<()> {
    let material = |f: &Facet| &scene.materials[scene.surfaces[f.surface as usize].material as usize];
    mesh.surface_colours = scene.surfaces.iter().map(|s| plain(&scene.materials[s.material as usize])).collect();
    mesh.occluder.coverage = mesh.surface_colours.iter().map(|c| c.coverage).collect();
    mesh.occluder.cutout = vec![None; scene.surfaces.len()];
    mesh.occluder.facet_coverage = store.column()?;
    store_varying(mesh, material)?;
    for (number, image) in scene.images.iter().enumerate() {
        let uses = |t: &Option<Texture>| t.is_some_and(|t| t.image as usize == number);
        if !scene.materials.iter().any(|m| uses(&m.base_texture) || uses(&m.emission_texture)) {
            continue;
        }
        match TextureImage::decode(image) {
            Err(error) => mesh.warnings.add(
                "unreadable-texture",
                format!("images that cannot be decoded are left out ({})", error.found),
                error.place,
            ),
            Ok(decoded) => {
                multiply(mesh, scene, &decoded, |m| m.base_texture.filter(|t| t.image as usize == number))?;
                multiply_emission(mesh, scene, &decoded, number);
            }
        }
    }
    limit(mesh, scene);
    Ok(())
}

/// The colour of a material without its textures.
fn plain(material: &Material) -> Colour {
    let [r, g, b, a] = material.base_colour;
    let alpha = match material.alpha {
        Alpha::Opaque => 1.0,
        Alpha::Mask(cutoff) if material.base_texture.is_none() => f32::from(a >= cutoff),
        // The texture's own share is multiplied later.
        Alpha::Mask(_) => 1.0,
        Alpha::Blend => a.clamp(0.0, 1.0),
    };
    Colour {
        reflectance: [r, g, b].map(|x| x.max(0.0)),
        coverage: alpha * (1.0 - material.transmission.clamp(0.0, 1.0)),
        exitance: material.emission.map(|x| x.max(0.0) * std::f32::consts::PI),
    }
}

/// Gives facets with textures or vertex colours a colour for each element. Both sides of a facet share them if they are cut
/// alike.
fn store_varying<'a>(mesh: &mut Mesh, material: impl Fn(&Facet) -> &'a Material) -> io::Result<()> {
    let first_elements: &[u32] = &mesh.first_elements;
    for facet in &mut mesh.facets {
        let plain = mesh.surface_colours[facet.surface as usize];
        let vertex = (facet.vertex_colour != NONE).then(|| mesh.vertex_colours[facet.vertex_colour as usize]);
        let textured = facet.base_uv != NONE || facet.emission_uv != NONE;
        let coloured = vertex.is_some_and(|c| c != [[1.0; 4]; 4]);
        if !textured && !coloured {
            facet.colours = [NONE; 2];
            continue;
        }
        let first = mesh.colours.len() as u32;
        let of_front = elements_of(facet.patch_range(false), first_elements).len() as u32;
        facet.colours = [first, if cut_alike(facet, first_elements) { first } else { first + of_front }];
        let facet: &Facet = facet;
        let blend = material(facet).alpha == Alpha::Blend;
        mesh.colours.extend(coloured_tiles(facet, first_elements).map(|tile| {
            let mut colour = plain;
            if let Some(vertex) = vertex {
                let c = interpolate(facet, vertex.map(Vec4::from), tile.at(Frame::middle(facet.layout())));
                (0..3).for_each(|i| colour.reflectance[i] *= c[i].max(0.0));
                if blend {
                    colour.coverage *= c.w.clamp(0.0, 1.0);
                }
            }
            colour
        }))?;
    }
    Ok(())
}

/// The elements of a run of patches.
fn elements_of(patches: Range<u32>, first_elements: &[u32]) -> Range<usize> {
    first_elements[patches.start as usize] as usize..first_elements[patches.end as usize] as usize
}

/// Whether both sides of a facet have the same elements, if both are lit.
fn cut_alike(facet: &Facet, first_elements: &[u32]) -> bool {
    let count = |id: u32| elements_of(id..id + 1, first_elements).len();
    let pairs = || facet.patch_range(false).zip(facet.patch_range(true));
    // The back of a single-sided facet has no patches, not even a number for the first.
    !facet.double_sided() || pairs().all(|(front, back)| count(front) == count(back))
}

/// The sides of a facet that have colours of their own.
fn coloured_sides(facet: &Facet) -> impl Iterator<Item = bool> + use<> {
    facet.sides().take(if facet.colours[0] == facet.colours[1] { 1 } else { 2 })
}

/// The facet's tiles of the elements that have colours of their own, in the order of the colours.
fn coloured_tiles<'a>(facet: &'a Facet, first_elements: &'a [u32]) -> impl Iterator<Item = Tile> + 'a {
    let layout = facet.layout();
    coloured_sides(facet).flat_map(move |back| (0..).zip(facet.patch_range(back))).flat_map(move |(k, id)| {
        let (tile, count) = (facet.patch_tile(k), elements_of(id..id + 1, first_elements).len() as u32);
        let grid = facet.element_grid(count);
        (0..count).map(move |element| tile.compose(Tile::of(layout, grid, element)))
    })
}

/// A value given at a facet's corners, at parameters `at`.
fn interpolate<T>(facet: &Facet, values: [T; 4], at: DVec2) -> T
where
    T: Copy + std::ops::Add<Output = T> + std::ops::Mul<f32, Output = T>,
{
    let (u, v) = (at.x as f32, at.y as f32);
    let [a, b, c, d] = values;
    match facet.layout() {
        Layout::Triangle => a * (1.0 - u - v) + b * u + c * v,
        Layout::Quad => (a * (1.0 - u) + b * u) * (1.0 - v) + (d * (1.0 - u) + c * u) * v,
    }
}

/// Averages of a texture over the elements of a facet: linear RGB weighted by alpha if `weighted`, and alpha.
fn averages(
    facet: &Facet,
    first_elements: &[u32],
    uv: [[f32; 2]; 4],
    texture: &Texture,
    image: &TextureImage,
    weighted: bool,
) -> Vec<[f32; 4]> {
    let parameters = Frame::corner_parameters(facet.layout());
    let n = parameters.len();
    coloured_tiles(facet, first_elements)
        .map(|tile| {
            let mut corners = [[0.0; 2]; 4];
            for (corner, &p) in corners.iter_mut().zip(parameters) {
                *corner = interpolate(facet, uv.map(Vec2::from), tile.at(p)).to_array();
            }
            if weighted {
                image.average_weighted(&corners[..n], texture.wrap)
            } else {
                image.average(&corners[..n], texture.wrap)
            }
        })
        .collect()
}

/// Multiplies the reflectance (and coverage) of the facets whose base texture shows `image`.
fn multiply(
    mesh: &mut Mesh,
    scene: &Scene,
    image: &TextureImage,
    texture: impl Fn(&Material) -> Option<Texture> + Sync,
) -> io::Result<()> {
    let materials: Vec<&Material> = scene.surfaces.iter().map(|s| &scene.materials[s.material as usize]).collect();
    // Materials in mode MASK see the texture through their cutoff.
    let mut masked: Vec<(u32, TextureImage)> = Vec::new();
    for (surface, material) in materials.iter().enumerate() {
        let (Alpha::Mask(cutoff), Some(_)) = (material.alpha, texture(material)) else { continue };
        let threshold = (cutoff / material.base_colour[3].max(1e-6) * 255.0).clamp(0.0, 256.0);
        if threshold <= 0.0 {
            continue;
        }
        let key = threshold.to_bits();
        let bitmap = match masked.iter().position(|(k, _)| *k == key) {
            Some(i) => mesh.occluder.bitmaps.len() - masked.len() + i,
            None => {
                let Some((bitmap, cut)) = cut_out(image, threshold) else { continue };
                masked.push((key, cut));
                mesh.occluder.bitmaps.push(Arc::new(bitmap));
                mesh.occluder.bitmaps.len() - 1
            }
        };
        mesh.occluder.cutout[surface] = Some(bitmap as u32);
    }
    let (facets, first_elements, base_uv): (&[Facet], &[u32], &[_]) =
        (&mesh.facets, &mesh.first_elements, &mesh.base_uv);
    let average = |facet: &Facet| {
        let material = materials[facet.surface as usize];
        let texture = texture(material)?;
        let cut = match material.alpha {
            Alpha::Mask(cutoff) => {
                let key = (cutoff / material.base_colour[3].max(1e-6) * 255.0).clamp(0.0, 256.0).to_bits();
                masked.iter().find(|(k, _)| *k == key).map(|(_, image)| image)
            }
            _ => None,
        };
        let uv = *base_uv.get(facet.base_uv as usize)?;
        let weighted = material.alpha != Alpha::Opaque;
        Some(averages(facet, first_elements, uv, &texture, cut.unwrap_or(image), weighted))
    };
    for (start, part) in (0u32..).step_by(FACETS_AT_ONCE).zip(facets.chunks(FACETS_AT_ONCE)) {
        let found: Vec<Option<Vec<[f32; 4]>>> = part.par_iter().map(average).collect();
        for ((f, facet), values) in (start..).zip(part).zip(found) {
            let Some(values) = values else { continue };
            let material = materials[facet.surface as usize];
            let first = facet.colours[0] as usize;
            let mut covered = 0.0;
            for (colour, value) in mesh.colours[first..first + values.len()].iter_mut().zip(&values) {
                (0..3).for_each(|c| colour.reflectance[c] *= value[c]);
                if material.alpha != Alpha::Opaque {
                    colour.coverage *= value[3];
                }
                covered += colour.coverage / values.len() as f32;
            }
            if material.alpha == Alpha::Blend {
                mesh.occluder.facet_coverage.push(FacetCoverage { facet: f, share: covered })?;
            }
        }
    }
    mesh.occluder.facet_coverage.sort_unstable_by_key(|c| c.facet);
    Ok(())
}

/// The texels with at least this alpha (0 to 256), as a bitmap and as an image of alpha 0 and 255.
fn cut_out(image: &TextureImage, threshold: f32) -> Option<(Bitmap, TextureImage)> {
    let mut texels = image.texels().to_vec();
    let mut bits = vec![0u64; (texels.len() / 4).div_ceil(64)];
    for (i, texel) in texels.chunks_exact_mut(4).enumerate() {
        let blocks = f32::from(texel[3]) >= threshold;
        bits[i >> 6] |= u64::from(blocks) << (i & 63);
        texel[3] = if blocks { 255 } else { 0 };
    }
    let bitmap = Bitmap { width: image.width(), height: image.height(), bits };
    Some((bitmap, TextureImage::from_texels(image.width(), image.height(), texels)?))
}

/// Multiplies the exitance of the facets whose emission texture is image `number`.
fn multiply_emission(mesh: &mut Mesh, scene: &Scene, image: &TextureImage, number: usize) {
    for facet in &mesh.facets {
        let material = &scene.materials[scene.surfaces[facet.surface as usize].material as usize];
        let Some(texture) = material.emission_texture.filter(|t| t.image as usize == number) else { continue };
        let Some(&uv) = mesh.emission_uv.get(facet.emission_uv as usize) else { continue };
        let first = facet.colours[0] as usize;
        for (k, value) in averages(facet, &mesh.first_elements, uv, &texture, image, false).iter().enumerate() {
            (0..3).for_each(|c| mesh.colours[first + k].exitance[c] *= value[c]);
        }
    }
}

/// Lowers reflectances to [`MAX_REFLECTANCE`], and tells what is see-through.
fn limit(mesh: &mut Mesh, scene: &Scene) {
    let lower = |colour: &mut Colour| {
        let high = colour.reflectance.iter().any(|&r| r > MAX_REFLECTANCE);
        colour.reflectance = colour.reflectance.map(|r| r.min(MAX_REFLECTANCE));
        high
    };
    for (surface, colour) in scene.surfaces.iter().zip(&mut mesh.surface_colours) {
        if lower(colour) {
            mesh.warnings.add("reflectance-lowered", LOWERED, surface.place.clone());
        }
        if colour.coverage < OPAQUE_COVERAGE {
            mesh.warnings.add("see-through", SEE_THROUGH, surface.place.clone());
        }
    }
    for facet in &mesh.facets {
        if facet.colours[0] != NONE {
            let of_side = |back| elements_of(facet.patch_range(back), &mesh.first_elements).len();
            let first = facet.colours[0] as usize;
            let colours = &mut mesh.colours[first..first + coloured_sides(facet).map(of_side).sum::<usize>()];
            let count = colours.iter_mut().filter_map(|c| lower(c).then_some(())).count() as u64;
            let place = scene.surfaces[facet.surface as usize].place.clone();
            mesh.warnings.add_many("texture-reflectance-lowered", LOWERED, place, count);
        }
    }
    let see_through = mesh.occluder.facet_coverage.iter().filter(|c| c.share < OPAQUE_COVERAGE);
    for c in see_through {
        let place = scene.surfaces[mesh.facets[c.facet as usize].surface as usize].place.clone();
        mesh.warnings.add("see-through-texture", SEE_THROUGH, place);
    }
}

const LOWERED: &str = "reflectance above 0.95 is lowered to it, so that light dies out";
const SEE_THROUGH: &str = "see-through surfaces let light pass straight, unrefracted";
