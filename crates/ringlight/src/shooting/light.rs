//! The light held by clusters: what a rank owns.

use crate::mesh::{Mesh, Patch};
use crate::quantity::Rgb;
use bytemuck::{Pod, Zeroable};
use std::ops::Range;

/// Light of one element. Irradiance in W/m² or lux.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct ElementLight {
    /// Area average of the irradiance received up to the patch's last own shot, and what rounding took since then.
    pub shot: Rgb,
    /// Area average received since then: its reflection is unshot.
    pub unshot: Rgb,
    /// Value at the sample point minus area average; differs from 0 near shooters only.
    pub correction: Rgb,
}

impl ElementLight {
    /// Adds irradiance: its area average, and its value at the sample point. What rounding takes from the sum of many small
    /// amounts is carried over in `shot` (compensated summation, Neumaier 1974): into the next sum while the patch has shot
    /// nothing that counts beside it, so that all of it is reflected; and else to what is displayed.
    pub fn add(&mut self, area: [f64; 3], point: [f64; 3]) {
        for c in 0..3 {
            let carry = if self.shot[c].abs() <= f32::EPSILON * self.unshot[c] { self.shot[c] } else { 0.0 };
            let sum = f64::from(self.unshot[c]) + f64::from(carry) + area[c];
            self.unshot[c] = sum as f32;
            self.shot[c] = (self.shot[c] - carry) + (sum - f64::from(self.unshot[c])) as f32;
            self.correction[c] += (point[c] - area[c]) as f32;
        }
    }

    /// Area average of the irradiance.
    pub fn mean(&self) -> Rgb {
        std::array::from_fn(|c| self.shot[c] + self.unshot[c])
    }

    /// Irradiance at the sample point: what is displayed.
    pub fn at_point(&self) -> Rgb {
        std::array::from_fn(|c| (self.shot[c] + self.unshot[c] + self.correction[c]).max(0.0))
    }
}

/// Light of one patch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PatchLight {
    /// Unshot power, W or lm, summed over channels.
    pub unshot_power: f64,
    /// Whether its own emission has not been shot yet.
    pub emission_waits: bool,
}

/// Light of one cluster.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ClusterLight {
    /// One for each element, in order.
    pub elements: Vec<ElementLight>,
    /// One for each patch, in order.
    pub patches: Vec<PatchLight>,
}

impl ClusterLight {
    /// Dark, with all emission unshot.
    pub fn new(mesh: &Mesh, cluster: usize) -> ClusterLight {
        let cluster = &mesh.clusters[cluster];
        let mut light = ClusterLight {
            elements: vec![ElementLight::default(); cluster.elements.len()],
            patches: Vec::with_capacity(cluster.patches.len()),
        };
        for id in cluster.patches.clone() {
            let patch = mesh.patch(id);
            let emission_waits = patch.elements().any(|e| mesh.colour(&patch, e).emits());
            light.patches.push(PatchLight { unshot_power: 0.0, emission_waits });
            let elements = patch.elements();
            let first = (elements.start - cluster.elements.start) as usize;
            let unshot_power = unshot_power(mesh, &patch, &light.elements[first..][..elements.len()], emission_waits);
            if let Some(last) = light.patches.last_mut() {
                last.unshot_power = unshot_power;
            }
        }
        light
    }

    /// Light of the elements of one of the cluster's patches.
    pub fn patch(&self, mesh: &Mesh, patch: &Patch) -> &[ElementLight] {
        &self.elements[places(mesh, patch)]
    }

    /// The same, to be changed.
    pub fn patch_mut(&mut self, mesh: &Mesh, patch: &Patch) -> &mut [ElementLight] {
        &mut self.elements[places(mesh, patch)]
    }

    /// Renews what is derived from the elements' light, after loading.
    pub fn renew(&mut self, mesh: &Mesh, cluster: usize) {
        let cluster = &mesh.clusters[cluster];
        for (light, id) in self.patches.iter_mut().zip(cluster.patches.clone()) {
            let patch = mesh.patch(id);
            let first = (patch.first_element - cluster.elements.start) as usize;
            let elements = &self.elements[first..][..patch.element_count() as usize];
            light.unshot_power = unshot_power(mesh, &patch, elements, light.emission_waits);
        }
    }
}

/// Where the elements of a patch stand within its cluster's.
fn places(mesh: &Mesh, patch: &Patch) -> Range<usize> {
    let first = (patch.first_element - mesh.clusters[mesh.cluster_of(patch.id)].elements.start) as usize;
    first..first + patch.element_count() as usize
}

/// Unshot radiosity ΔB of element `element`, of the part that is free of other geometry.
pub fn unshot_radiosity(mesh: &Mesh, patch: &Patch, element: u32, light: &ElementLight, emission: bool) -> [f64; 3] {
    let colour = mesh.colour(patch, element);
    let returned = colour.returned();
    std::array::from_fn(|c| {
        let emitted = if emission { f64::from(colour.exitance[c]) } else { 0.0 };
        f64::from(returned[c]) * f64::from(light.unshot[c]) + emitted
    })
}

/// Radiosity B of element `element`, of the part that is free of other geometry: exitance and all that it reflects, shot or
/// not.
pub fn radiosity(mesh: &Mesh, patch: &Patch, element: u32, light: &ElementLight) -> [f64; 3] {
    let colour = mesh.colour(patch, element);
    let (returned, mean) = (colour.returned(), light.mean());
    std::array::from_fn(|c| f64::from(colour.exitance[c]) + f64::from(returned[c]) * f64::from(mean[c]).max(0.0))
}

/// Unshot power of a patch, W or lm, summed over channels in element order.
pub fn unshot_power(mesh: &Mesh, patch: &Patch, elements: &[ElementLight], emission: bool) -> f64 {
    elements
        .iter()
        .enumerate()
        .map(|(k, light)| {
            let element = patch.first_element + k as u32;
            let radiosity = unshot_radiosity(mesh, patch, element, light, emission);
            patch.element_area(k as u32) * mesh.valid_share(element) * (radiosity[0] + radiosity[1] + radiosity[2])
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::ElementLight;

    #[test]
    fn many_small_amounts_add_up() {
        // In plain single precision the first amount would swallow the others.
        let mut light = ElementLight::default();
        light.add([1.0, 3.0, 0.1], [1.0, 3.0, 0.1]);
        for _ in 0..1_000_000 {
            light.add([4e-8, 1e-8, 3e-9], [4e-8, 1e-8, 3e-9]);
        }
        let expected = [1.04, 3.01, 0.103];
        // What is reflected and what is displayed: both.
        for found in [light.unshot, light.mean(), light.at_point()] {
            for c in 0..3 {
                assert!((f64::from(found[c]) / expected[c] - 1.0).abs() < 2e-7, "{found:?}");
            }
        }
    }

    #[test]
    fn light_that_has_been_shot_is_not_shot_again() {
        let mut light = ElementLight { shot: [2.0, 1e-9, 0.0], ..ElementLight::default() };
        light.add([1.0; 3], [1.0; 3]);
        assert_eq!(light.unshot, [1.0; 3]);
        assert_eq!(light.mean()[0], 3.0);
    }
}
