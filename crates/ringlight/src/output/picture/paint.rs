//! What a ray of sight brings back.

use super::texture::Textures;
use crate::mesh::walk::{Query, Walk};
use crate::mesh::{Facet, Mesh, NONE, OPAQUE_COVERAGE};
use crate::output::seen::{Seen, seen, sight};
use crate::quantity::{MAX_REFLECTANCE, Rgb, photometric};
use crate::scene::{Alpha, Material};
use crate::smooth::Smooth;
use crate::solution::Solution;
use ringlight_visibility::{Hit, Ray};
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

/// Finds samples.
pub struct Painter<'a> {
    solution: &'a Solution,
    mesh: &'a Mesh,
    smooth: Smooth<'a>,
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

/// A ray of sight on its way: L = (ρ·E + Bₑ)/π of the first surface, and of those behind it as far as it lets light through.
pub struct Sight<'p, 'a> {
    painter: &'p Painter<'a>,
    ray: Ray,
    /// Surfaces that it may still meet.
    layers: usize,
    /// Share of what is behind that comes through what it has met.
    passing: f32,
    /// What it has brought back so far.
    pub sample: Sample,
}

impl Walk for Sight<'_, '_> {
    fn query(&self) -> Option<Query> {
        (self.layers > 0).then(|| sight(self.ray))
    }

    fn answer(&mut self, hit: Option<Hit>) {
        let Sight { painter, ray, passing, sample, .. } = self;
        let Some(hit) = hit else {
            let sky = painter.sky(ray);
            sample.radiance = std::array::from_fn(|c| sample.radiance[c] + *passing * sky[c]);
            self.layers = 0;
            return;
        };
        let seen = seen(painter.mesh, ray, hit);
        let finish = painter.finish(&seen);
        let light = painter.smooth.at(seen.element, seen.within);
        let light: Rgb = std::array::from_fn(|c| light[c] + painter.ambient[c]);
        sample.radiance = std::array::from_fn(|c| {
            let reflected = finish.coverage * finish.reflectance[c] * light[c] / PI;
            sample.radiance[c] + *passing * (reflected + finish.emission[c])
        });
        sample.emits |= finish.emission.iter().any(|&x| x > 0.0);
        if finish.coverage > 0.5 && sample.illuminance.is_none() {
            sample.illuminance = Some(photometric(light));
        }
        *passing *= 1.0 - finish.coverage;
        self.layers = if *passing < LEAST_PASSING { 0 } else { self.layers - 1 };
        ray.near = seen.distance.next_up();
    }
}

impl<'a> Painter<'a> {
    /// Decodes the textures. `ambient` is irradiance to add everywhere.
    pub fn new(solution: &'a Solution, smooth: Smooth<'a>, ambient: Rgb) -> Painter<'a> {
        Painter { solution, mesh: &solution.mesh, smooth, textures: Textures::decode(solution), ambient }
    }

    /// A ray that sets off to find a sample.
    pub fn follow(&self, ray: Ray) -> Sight<'_, 'a> {
        Sight { painter: self, ray, layers: MOST_LAYERS, passing: 1.0, sample: Sample::default() }
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
