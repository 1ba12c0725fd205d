//! What a cluster looks like: its elements as polygons, and their light. The only place of this crate that knows how
//! the elements of a patch lie.
//!
//! Both are *records* of the protocol (README), little-endian, a multiple of four bytes long.

use glam::DVec2;
use half::f16;
use ringlight::mesh::{Frame, Mesh, NONE, Patch};
use ringlight::shooting::ElementLight;
use ringlight_visibility::Layout;
use std::collections::HashMap;

/// Parameters nearer to the border of a patch than this lie on it.
const ON_BORDER: f64 = 1e-9;

/// Corners of an element; a triangle repeats its third.
const CORNERS: usize = 4;

/// Bit of an element's byte of borders: other geometry covers it, and it is not to be drawn. It may be seen through gaps
/// between others otherwise, which are no wider than rounding.
const COVERED: u8 = 1 << 7;

/// The geometry of a cluster.
pub fn geometry(mesh: &Mesh, cluster: u32) -> Vec<u8> {
    let number = cluster;
    let cluster = &mesh.clusters[cluster as usize];
    let count = cluster.elements.len();
    let mut places: HashMap<[u32; 3], u32> = HashMap::with_capacity(2 * count);
    let mut positions: Vec<[f32; 3]> = Vec::with_capacity(2 * count);
    let mut corners: Vec<[u32; CORNERS]> = Vec::with_capacity(count);
    let (mut borders, mut colours, mut emission) = (Vec::new(), Vec::new(), Vec::new());
    let (mut patches, mut texels) = (Vec::new(), Vec::new());
    for id in cluster.patches.clone() {
        let patch = mesh.patch(id);
        let facet = &mesh.facets[patch.facet as usize];
        // Colours of vertices are in the elements' means alone.
        let textured = facet.base_uv != NONE && facet.vertex_colour == NONE;
        patches.push([facet.surface, patch.element_count(), u32::from(textured)]);
        for (k, element) in (0..).zip(patch.elements()) {
            corners.push(outline(&patch, k).map(|position| {
                *places.entry(position.map(f32::to_bits)).or_insert_with(|| {
                    positions.push(position);
                    positions.len() as u32 - 1
                })
            }));
            let covered = if mesh.valid[element as usize] == 0 { COVERED } else { 0 };
            borders.push(border(&patch, k) | covered);
            if textured {
                texels.extend(texture_places(&patch, k, facet.layout(), &mesh.base_uv[facet.base_uv as usize]));
            }
            let colour = mesh.colour(&patch, element);
            let [r, g, b] = colour.reflectance;
            colours.push([r, g, b, colour.coverage].map(|x| (x.clamp(0.0, 1.0) * f32::from(u16::MAX) + 0.5) as u16));
            if colour.emits() {
                emission.push((element - cluster.elements.start, colour.exitance));
            }
        }
    }
    let mut record = Vec::new();
    for word in [
        number,
        cluster.patches.start,
        cluster.elements.start,
        patches.len() as u32,
        positions.len() as u32,
        count as u32,
        emission.len() as u32,
    ] {
        record.extend_from_slice(&word.to_le_bytes());
    }
    positions.iter().flatten().for_each(|x| record.extend_from_slice(&x.to_le_bytes()));
    patches.iter().flatten().for_each(|x| record.extend_from_slice(&x.to_le_bytes()));
    texels.iter().flatten().for_each(|x: &f32| record.extend_from_slice(&x.to_le_bytes()));
    for (element, exitance) in &emission {
        record.extend_from_slice(&element.to_le_bytes());
        exitance.iter().for_each(|x| record.extend_from_slice(&x.to_le_bytes()));
    }
    corners.iter().flatten().for_each(|&k| match u16::try_from(positions.len()) {
        Ok(_) => record.extend_from_slice(&(k as u16).to_le_bytes()),
        Err(_) => record.extend_from_slice(&k.to_le_bytes()),
    });
    colours.iter().flatten().for_each(|x| record.extend_from_slice(&x.to_le_bytes()));
    record.extend_from_slice(&borders);
    record.resize(record.len().next_multiple_of(4), 0);
    record
}

/// The corners of a patch's `k`-th element, counter-clockwise seen from its lit side.
fn outline(patch: &Patch, k: u32) -> [[f32; 3]; CORNERS] {
    let (mut corners, count) = patch.frame.tile(patch.element_tile(k)).corners();
    finish(&mut corners, count, patch.back);
    corners.map(|corner| corner.as_vec3().to_array())
}

/// The coordinates in its texture of the corners of [`outline`]; `corners` are those of the facet.
fn texture_places(patch: &Patch, k: u32, layout: Layout, corners: &[[f32; 2]; 4]) -> [[f32; 2]; CORNERS] {
    let tile = patch.tile.compose(patch.element_tile(k));
    let mut places = [[0.0; 2]; CORNERS];
    let parameters = Frame::corner_parameters(layout);
    for (place, &p) in places.iter_mut().zip(parameters) {
        let weights = Frame::corner_weights(layout, tile.at(p));
        *place = [0, 1].map(|axis| weights.iter().zip(corners).map(|(w, corner)| *w as f32 * corner[axis]).sum());
    }
    finish(&mut places, parameters.len(), patch.back);
    places
}

/// Puts what belongs to the first `count` corners in the order of [`outline`].
fn finish<T: Copy>(corners: &mut [T; CORNERS], count: usize, back: bool) {
    if back {
        corners[..count].reverse();
    }
    let last = corners[count - 1];
    corners[count..].fill(last);
}

/// Which edges of a patch's `k`-th element are edges of the patch: bit i for the edge from corner i of [`outline`] to the next.
fn border(patch: &Patch, k: u32) -> u8 {
    let tile = patch.element_tile(k);
    let mut at: Vec<_> = Frame::corner_parameters(patch.frame.layout).iter().map(|&p| tile.at(p)).collect();
    if patch.back {
        at.reverse();
    }
    let triangle = at.len() < CORNERS;
    let sides = |p: DVec2| {
        let far = if triangle { [p.x + p.y - 1.0, 1.0] } else { [p.x - 1.0, p.y - 1.0] };
        [p.x, p.y, far[0], far[1]].map(|distance| distance.abs() < ON_BORDER)
    };
    let mut bits = 0;
    for edge in 0..at.len() {
        let (from, to) = (sides(at[edge]), sides(at[(edge + 1) % at.len()]));
        bits |= u8::from((0..4).any(|side| from[side] && to[side])) << edge;
    }
    bits
}

/// The irradiance at the sample points of a cluster's elements; of elements that other geometry covers, no number.
pub fn light(mesh: &Mesh, cluster: u32, elements: &[ElementLight]) -> Vec<u8> {
    let valid = &mesh.valid[mesh.clusters[cluster as usize].elements.start as usize..];
    let brightest = elements.iter().flat_map(ElementLight::at_point).fold(0.0, f32::max);
    let unit = unit(brightest);
    let mut record = Vec::with_capacity(8 + 6 * elements.len() + 2);
    record.extend_from_slice(&cluster.to_le_bytes());
    record.extend_from_slice(&unit.to_le_bytes());
    for (element, &valid) in elements.iter().zip(valid) {
        for x in element.at_point() {
            let number = if valid == 0 { f16::NAN } else { f16::from_f32(x / unit) };
            record.extend_from_slice(&number.to_le_bytes());
        }
    }
    record.resize(record.len().next_multiple_of(4), 0);
    record
}

/// The power of two by which half floats are to be multiplied so that they reach up to `brightest` and as far down as they can.
fn unit(brightest: f32) -> f32 {
    if brightest > 0.0 && brightest.is_finite() {
        // The exponent alone; half floats end a little below 2¹⁶.
        const REACH: f32 = 16384.0;
        f32::from_bits(brightest.to_bits() & f32::INFINITY.to_bits()).max(f32::MIN_POSITIVE * REACH) / REACH
    } else {
        1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_floats_reach_the_brightest_light() {
        for brightest in [1e-30, 1e-6, 0.3, 1.0, 65504.0, 1e5, 1e30] {
            let unit = unit(brightest);
            assert!(f16::from_f32(brightest / unit).is_finite(), "{brightest}");
            for share in [1.0, 0.1, 1e-4, 1e-8] {
                let back = f16::from_f32(share * brightest / unit).to_f32() * unit;
                assert!((back / (share * brightest) - 1.0).abs() < 2e-3, "{brightest} {share}");
            }
        }
        assert_eq!(unit(0.0), 1.0);
    }
}
