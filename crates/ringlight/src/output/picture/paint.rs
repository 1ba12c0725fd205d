//! What rays of sight meet, and what they show.

use super::texture::Textures;
use crate::mesh::walk::{Query, Walk};
use crate::mesh::{Facet, Mesh, NONE, OPAQUE_COVERAGE};
use crate::output::seen::{Seen, seen, sight};
use crate::quantity::{MAX_REFLECTANCE, Rgb, photometric};
use crate::scene::{Alpha, Material};
use crate::solution::Solution;
use glam::DVec2;
use ringlight_visibility::{Hit, Layout, Ray};
use std::f32::consts::PI;

/// A ray of sight passes at most this many see-through surfaces.
const MOST_LAYERS: usize = 64;

/// Surfaces behind others that let less through than this are not looked for.
const LEAST_PASSING: f32 = 1.0 / 1024.0;

/// One sample of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Radiance, linear RGB, W/(m²·sr) or cd/m².
    pub radiance: Rgb,
    /// Photometric irradiance of the nearest surface that is more than half opaque, W/m² or lux.
    pub illuminance: Option<f32>,
    /// Whether a surface that emits is in it.
    pub emits: bool,
}

impl Sample {
    /// Words of a sample as it travels.
    pub const WORDS: usize = 6;

    pub fn to_words(self) -> [u32; Sample::WORDS] {
        let [r, g, b] = self.radiance.map(f32::to_bits);
        let illuminance = self.illuminance.unwrap_or_default().to_bits();
        [r, g, b, illuminance, self.illuminance.is_some().into(), self.emits.into()]
    }

    pub fn from_words([r, g, b, illuminance, known, emits]: [u32; Sample::WORDS]) -> Sample {
        let radiance = [r, g, b].map(f32::from_bits);
        Sample { radiance, illuminance: (known > 0).then(|| f32::from_bits(illuminance)), emits: emits > 0 }
    }
}

/// Follows rays, and composes samples from what they meet.
pub struct Painter<'a> {
    solution: &'a Solution,
    mesh: &'a Mesh,
    textures: Textures,
    ambient: Rgb,
}

/// What a surface does with light at one place.
struct Finish {
    reflectance: Rgb,
    /// Share of the light from behind that is blocked.
    coverage: f32,
    /// Emitted radiance.
    emission: Rgb,
}

/// What a ray of sight has met: all that is known of a sample but the light that falls there.
#[derive(Clone, Copy, Debug)]
pub struct Fragment {
    /// Number of the facet.
    pub facet: u32,
    /// Number of the element.
    pub element: u32,
    /// Parameters within the element.
    pub within: DVec2,
    /// Share of what it sends that comes through what is before it.
    passing: f32,
    /// Share of the ray that it covers, times its reflectance.
    reflectance: Rgb,
    /// Emitted radiance.
    emission: Rgb,
    /// Whether it is more than half opaque.
    opaque: bool,
}

/// A ray of sight on its way, to the first surface, and to those behind it as far as it lets light through.
pub struct Sight<'p, 'a> {
    painter: &'p Painter<'a>,
    ray: Ray,
    /// Surfaces that it may still meet.
    layers: usize,
    /// Share of what is behind that comes through what it has met.
    passing: f32,
    /// What it has met so far, in the order of depth.
    pub fragments: Vec<Fragment>,
    /// What of the sky comes through all of them.
    pub sky: Rgb,
    /// Rays that were followed for it.
    pub rays: u64,
}

impl Walk for Sight<'_, '_> {
    fn query(&self) -> Option<Query> {
        (self.layers > 0).then(|| sight(self.ray))
    }

    fn answer(&mut self, hit: Option<Hit>) {
        let Sight { painter, ray, passing, .. } = self;
        self.rays += 1;
        let Some(hit) = hit else {
            self.sky = painter.sky(ray).map(|x| *passing * x);
            self.layers = 0;
            return;
        };
        let seen = seen(painter.mesh, ray, hit);
        let finish = painter.finish(&seen);
        self.fragments.push(Fragment {
            facet: seen.facet,
            element: seen.element,
            within: seen.within,
            passing: *passing,
            reflectance: finish.reflectance.map(|x| finish.coverage * x),
            emission: finish.emission,
            opaque: finish.coverage > 0.5,
        });
        *passing *= 1.0 - finish.coverage;
        self.layers = if *passing < LEAST_PASSING { 0 } else { self.layers - 1 };
        ray.near = seen.distance.next_up();
    }
}

impl<'a> Painter<'a> {
    /// Decodes the textures. `ambient` is irradiance to add everywhere.
    pub fn new(solution: &'a Solution, ambient: Rgb) -> Painter<'a> {
        Painter { solution, mesh: &solution.mesh, textures: Textures::decode(solution), ambient }
    }

    /// A ray that sets off to find what a sample shows.
    pub fn follow(&self, ray: Ray) -> Sight<'_, 'a> {
        let (fragments, sky) = (Vec::new(), [0.0; 3]);
        Sight { painter: self, ray, layers: MOST_LAYERS, passing: 1.0, fragments, sky, rays: 0 }
    }

    /// The layout of the facet that a fragment lies on.
    pub fn layout(&self, fragment: &Fragment) -> Layout {
        self.mesh.facets[fragment.facet as usize].layout()
    }

    /// The sample that shows these fragments, nearest first, and the sky behind: L = (ρ·E + Bₑ)/π of each, as far as what is
    /// before it lets light through. `light` tells the irradiance E, W/m² or lux.
    pub fn compose(&self, fragments: &[Fragment], sky: Rgb, light: impl Fn(&Fragment) -> Rgb) -> Sample {
        let mut sample = Sample::default();
        for fragment in fragments {
            let light = light(fragment);
            let light: Rgb = std::array::from_fn(|c| light[c] + self.ambient[c]);
            sample.radiance = std::array::from_fn(|c| {
                let reflected = fragment.reflectance[c] * light[c] / PI;
                sample.radiance[c] + fragment.passing * (reflected + fragment.emission[c])
            });
            sample.emits |= fragment.emission.iter().any(|&x| x > 0.0);
            if fragment.opaque && sample.illuminance.is_none() {
                sample.illuminance = Some(photometric(light));
            }
        }
        sample.radiance = std::array::from_fn(|c| sample.radiance[c] + sky[c]);
        sample
    }

    /// Radiance of what is behind everything.
    fn sky(&self, ray: &Ray) -> Rgb {
        self.solution.settings.sky.filter(|_| ray.direction[1] > 0.0).unwrap_or_default()
    }

    fn finish(&self, seen: &Seen) -> Finish {
        let facet = &self.mesh.facets[seen.facet as usize];
        let mean = self.mesh.colour(&self.mesh.patch(seen.patch), seen.element);
        let surfaces = &self.solution.description.surfaces;
        let material = surfaces
            .get(facet.surface as usize)
            .and_then(|s| self.solution.description.materials.get(s.material as usize));
        let Some(material) = material else {
            return Finish { reflectance: mean.reflectance, coverage: 1.0, emission: mean.exitance.map(|x| x / PI) };
        };
        let (reflectance, alpha) = match self.base(seen, facet, material) {
            Some([r, g, b, a]) => ([r, g, b].map(|x| x.clamp(0.0, MAX_REFLECTANCE)), a),
            None => (mean.reflectance, material.base_colour[3]),
        };
        let coverage = if self.mesh.occluder.coverage(seen.facet, facet) >= OPAQUE_COVERAGE {
            1.0
        } else {
            let alpha = if material.alpha == Alpha::Blend { alpha.clamp(0.0, 1.0) } else { 1.0 };
            alpha * (1.0 - material.transmission.clamp(0.0, 1.0))
        };
        let emission = self.emission(seen, facet, material).unwrap_or(mean.exitance.map(|x| x / PI));
        Finish { reflectance, coverage, emission }
    }

    /// Base colour and alpha in full detail; None where only the element's mean is known.
    fn base(&self, seen: &Seen, facet: &Facet, material: &Material) -> Option<[f32; 4]> {
        let vertex = match facet.vertex_colour {
            NONE => [1.0; 4],
            k => seen.between(&self.mesh.vertex_colours[k as usize]),
        };
        let texture = match material.base_texture {
            Some(texture) if facet.base_uv != NONE => {
                self.textures.sample(&texture, seen.between(&self.mesh.base_uv[facet.base_uv as usize]))?
            }
            _ if facet.vertex_colour != NONE => [1.0; 4],
            _ => return None,
        };
        Some(std::array::from_fn(|c| material.base_colour[c] * texture[c] * vertex[c]))
    }

    /// Emitted radiance in full detail; None where only the element's mean is known.
    fn emission(&self, seen: &Seen, facet: &Facet, material: &Material) -> Option<Rgb> {
        let texture = material.emission_texture.filter(|_| facet.emission_uv != NONE)?;
        let uv = seen.between(&self.mesh.emission_uv[facet.emission_uv as usize]);
        let texel = self.textures.sample(&texture, uv)?;
        Some(std::array::from_fn(|c| material.emission[c] * texel[c]))
    }
}
