//! The ambient term: an estimate of the light still to come, for display only.

use crate::quantity::Rgb;
use crate::shooting::unshot_radiosity;
use crate::solution::Solution;

/// Irradiance to add to what is displayed, W/m² or lux: the unshot radiosity of all patches spread evenly over all
/// surfaces and reflected on and on (Cohen, Chen, Wallace & Greenberg 1988, section 4.3):
///
/// ρ̄ = Σ ρᵢAᵢ / ΣAᵢ, R = 1 + ρ̄ + ρ̄² + … = 1/(1 − ρ̄), ambient = R · Σ ΔBᵢAᵢ / ΣAᵢ.
///
/// It is right for closed scenes only. Never part of exported numbers.
pub fn ambient(solution: &Solution) -> Rgb {
    let mesh = &solution.mesh;
    let (mut area, mut reflected, mut unshot) = (0.0, [0.0; 3], [0.0; 3]);
    for (id, &emission_waits) in solution.light.emission_waits.iter().enumerate() {
        let patch = mesh.patch(id as u32);
        for k in 0..patch.element_count() {
            let element = patch.first_element + k;
            let share = patch.element_area(k);
            let returned = mesh.colour(&patch, element).returned();
            let waiting = unshot_radiosity(mesh, &patch, element, solution.light(element), emission_waits != 0);
            area += share;
            for c in 0..3 {
                reflected[c] += share * f64::from(returned[c]);
                unshot[c] += share * waiting[c];
            }
        }
    }
    if area <= 0.0 {
        return [0.0; 3];
    }
    [0, 1, 2].map(|c| {
        let mean_reflectance = (reflected[c] / area).min(f64::from(crate::quantity::MAX_REFLECTANCE));
        (unshot[c] / area / (1.0 - mean_reflectance)) as f32
    })
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
