//! How a surface looks unlit: factor, texture, alpha.

use super::texture::Textures;
use crate::mesh::Colour;
use crate::quantity::{MAX_REFLECTANCE, Rgb};
use crate::scene::{Alpha, Texture};
use crate::solution::Solution;
use serde_json::{Value, json};

/// Elements that only reflect and those that emit have different materials.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Shows what it reflects.
    Reflecting,
    /// Shows what it emits and reflects; unlit materials ignore emission, so it goes into the vertex colours.
    Emitting,
}

/// The look of the elements of one kind of a surface.
#[derive(Clone, Debug)]
pub struct Look {
    /// Base colour factor.
    pub factor: [f32; 4],
    /// Base colour texture.
    pub texture: Option<Texture>,
    /// Whether vertex colours are multiplied in.
    pub vertex_colours: bool,
    /// For emitters: none within if the elements' own emission is shown, else the radiance that the texture shows.
    pub emission: Option<Option<Rgb>>,
    /// How alpha is meant.
    pub alpha: Alpha,
}

impl Kind {
    /// Of an element of this colour.
    pub fn of(colour: &Colour) -> Kind {
        if colour.emits() { Kind::Emitting } else { Kind::Reflecting }
    }
}

impl Look {
    /// Of surface number `surface`.
    pub fn new(solution: &Solution, surface: u32, kind: Kind, facets: &[u32], textures: &mut Textures<'_>) -> Look {
        let description = &solution.description;
        let material = &description.materials[description.surfaces[surface as usize].material as usize];
        let [r, g, b, a] = material.base_colour;
        let transparency = material.transmission.clamp(0.0, 1.0);
        let opacity = a.clamp(0.0, 1.0) * (1.0 - transparency);
        let alpha = match material.alpha {
            Alpha::Opaque if transparency > 0.0 => Alpha::Blend,
            other => other,
        };
        match kind {
            Kind::Reflecting => {
                let texture = material.base_texture.filter(|t| textures.usable(t));
                let missing = material.base_texture.is_some() && texture.is_none();
                let limit = if texture.is_some() { 1.0 } else { MAX_REFLECTANCE };
                let rgb = if missing { mean_reflectance(solution, facets) } else { [r, g, b] };
                let [r, g, b] = rgb.map(|x| x.clamp(0.0, limit));
                // A cut-out needs its texture.
                let alpha = if missing && matches!(alpha, Alpha::Mask(_)) { Alpha::Opaque } else { alpha };
                Look { factor: [r, g, b, opacity], texture, vertex_colours: !missing, emission: None, alpha }
            }
            Kind::Emitting => {
                let texture = material.emission_texture.filter(|t| textures.usable(t));
                let emission = texture.map(|_| material.emission);
                let alpha = if alpha == Alpha::Blend { alpha } else { Alpha::Opaque };
                let factor = [1.0, 1.0, 1.0, opacity];
                Look { factor, texture, vertex_colours: false, emission: Some(emission), alpha }
            }
        }
    }

    /// Moves brightness from the vertex colours, whose largest values are `peak`, to the factor, as far as both stay within
    /// 1; gives the divisors of the vertex colours. So a dark surface in bright light is not clipped, and a coloured one in
    /// each channel only where it shows 1.
    pub fn make_room(&mut self, peak: Rgb) -> Rgb {
        std::array::from_fn(|c| {
            let factor = &mut self.factor[c];
            let divisor = if *factor > 0.0 { peak[c].min(1.0 / *factor) } else { 1.0 };
            // Not for the sake of rounding.
            if divisor.is_nan() || divisor <= 1.001 {
                return 1.0;
            }
            *factor = (*factor * divisor).min(1.0);
            divisor
        })
    }

    /// The material of glTF; `divisors` are what [`Look::make_room`] gave.
    pub fn material(&self, solution: &Solution, surface: u32, divisors: Rgb, textures: &mut Textures<'_>) -> Value {
        let description = &solution.description;
        let material = &description.materials[description.surfaces[surface as usize].material as usize];
        let mut surface = json!({
            "baseColorFactor": self.factor.map(f64::from),
            "metallicFactor": 0.0,
            "roughnessFactor": 1.0,
        });
        if let Some(texture) = &self.texture {
            surface["baseColorTexture"] = json!({ "index": textures.number(texture) });
        }
        let mut made = json!({ "pbrMetallicRoughness": surface, "extensions": { "KHR_materials_unlit": {} } });
        if !material.name.is_empty() {
            made["name"] = json!(material.name);
        }
        match self.alpha {
            Alpha::Opaque => {}
            Alpha::Mask(cutoff) => {
                made["alphaMode"] = json!("MASK");
                made["alphaCutoff"] = json!(f64::from(cutoff.max(0.0)));
            }
            Alpha::Blend => made["alphaMode"] = json!("BLEND"),
        }
        if let Some(extras) = &material.extras {
            made["extras"] = extras.clone();
        }
        if divisors != [1.0; 3] {
            let note = json!({ "vertexColourDivisor": divisors.map(f64::from) });
            match &mut made["extras"] {
                Value::Object(extras) => drop(extras.insert("ringlight".into(), note)),
                Value::Null => made["extras"] = json!({ "ringlight": note }),
                _ => {}
            }
        }
        made
    }
}

/// Mean reflectance of facets by area, in place of an image that is not at hand.
fn mean_reflectance(solution: &Solution, facets: &[u32]) -> Rgb {
    let mesh = &solution.mesh;
    let (mut area, mut sum) = (0.0, [0.0; 3]);
    for &f in facets {
        let facet = &mesh.facets[f as usize];
        for id in facet.patch_range(false) {
            let patch = mesh.patch(id);
            for k in 0..patch.element_count() {
                let (share, colour) = (patch.element_area(k), mesh.colour(&patch, patch.first_element + k));
                area += share;
                (0..3).for_each(|c| sum[c] += share * f64::from(colour.reflectance[c]));
            }
        }
    }
    sum.map(|s| if area > 0.0 { (s / area) as f32 } else { 0.5 })
}
