//! The ambient term: an estimate of the light still to come, for display only.

use crate::mesh::{Mesh, Patch};
use crate::quantity::{MAX_REFLECTANCE, Rgb};
use crate::shooting::{ElementLight, unshot_radiosity};
use crate::solution::Solution;
use serde::{Deserialize, Serialize};

/// Irradiance to add to what is displayed, W/m² or lux: the unshot radiosity of all patches spread evenly over all
/// surfaces and reflected on and on (Cohen, Chen, Wallace & Greenberg 1988, section 4.3):
///
/// ρ̄ = Σ ρᵢAᵢ / ΣAᵢ, R = 1 + ρ̄ + ρ̄² + … = 1/(1 − ρ̄), ambient = R · Σ ΔBᵢAᵢ / ΣAᵢ.
///
/// It is right for closed scenes only. Never part of exported numbers.
pub fn ambient(solution: &Solution) -> Rgb {
    let mut sums = AmbientSums::default();
    for (id, &emission_waits) in solution.light.emission_waits.iter().enumerate() {
        let patch = solution.mesh.patch(id as u32);
        let elements = patch.elements();
        let light = &solution.light.elements[elements.start as usize..elements.end as usize];
        sums.add(&solution.mesh, &patch, light, emission_waits != 0);
    }
    sums.ambient()
}

/// The sums that the ambient term is made of; they may be joined from parts of the scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AmbientSums {
    /// Σ A, m².
    area: f64,
    /// Σ ρA.
    reflected: [f64; 3],
    /// Σ ΔB·A, W or lm.
    unshot: [f64; 3],
}

impl AmbientSums {
    /// Adds a patch with the light of its elements.
    pub fn add(&mut self, mesh: &Mesh, patch: &Patch, light: &[ElementLight], emission_waits: bool) {
        for (k, (element, light)) in (0..).zip(patch.elements().zip(light)) {
            let share = patch.element_area(k);
            let returned = mesh.colour(patch, element).returned();
            let waiting = unshot_radiosity(mesh, patch, element, light, emission_waits);
            self.area += share;
            for c in 0..3 {
                self.reflected[c] += share * f64::from(returned[c]);
                self.unshot[c] += share * waiting[c];
            }
        }
    }

    /// Of both.
    pub fn join(self, other: AmbientSums) -> AmbientSums {
        AmbientSums {
            area: self.area + other.area,
            reflected: std::array::from_fn(|c| self.reflected[c] + other.reflected[c]),
            unshot: std::array::from_fn(|c| self.unshot[c] + other.unshot[c]),
        }
    }

    /// The ambient term of all that was added.
    pub fn ambient(&self) -> Rgb {
        if self.area <= 0.0 {
            return [0.0; 3];
        }
        [0, 1, 2].map(|c| {
            let mean_reflectance = (self.reflected[c] / self.area).min(f64::from(MAX_REFLECTANCE));
            (self.unshot[c] / self.area / (1.0 - mean_reflectance)) as f32
        })
    }
}

#[cfg(test)]
mod tests {
    use super::ambient;
    use crate::output::fixture::{closed_box, elements, read, solve};
    use std::f32::consts::PI;

    #[test]
    fn in_a_closed_furnace_it_makes_up_for_what_is_missing() {
        // Ke = 1, ρ = 0.5: E = 2π when all light is shot. Inward faces alone, or half of the light would escape.
        for until in [0.9, 0.3] {
            let mut scene = read(&closed_box("glow"));
            scene.materials.iter_mut().for_each(|m| m.double_sided = false);
            let solution = solve(scene, 0.25, until);
            let all = elements(&solution);
            let mean = all.iter().map(|e| solution.light(e.0).mean()[0]).sum::<f32>() / all.len() as f32;
            let sum = mean + ambient(&solution)[0];
            assert!(mean < 0.95 * 2.0 * PI && (sum / (2.0 * PI) - 1.0).abs() < 0.02, "{mean} {sum}");
        }
    }
}
