//! Shooters that are not patches: punctual lights and the sky.

use super::shot::{FAR, Shot, Source};
use crate::scene::{Light, LightKind};
use glam::DVec3;
use ringlight_visibility::{Cells, NO_PLANE, Shooter};
use std::f64::consts::{PI, TAU};

/// A light that is not a surface.
pub type Emitter = Shot;

/// The scene's punctual lights as shooters of one cell, in mesh coordinates (`origin` is subtracted). A directional
/// light's power is what passes through the disc of `radius` metres that holds the scene.
pub fn emitters(lights: &[Light], origin: [f64; 3], radius: f64) -> Vec<Emitter> {
    let local = |p: [f64; 3]| DVec3::from(p) - DVec3::from(origin);
    let single = |p: DVec3| p.as_vec3().to_array();
    lights
        .iter()
        .map(|light| {
            let sum: f64 = light.intensity.iter().map(|&x| f64::from(x)).sum();
            let (cells, source, power) = match light.kind {
                LightKind::Point { position, range } => {
                    let position = local(position);
                    let source = Source::Point { position, cone: None, range };
                    (Cells::Points(vec![single(position)]), source, 2.0 * TAU * sum)
                }
                LightKind::Spot { position, direction, range, inner_cosine, outer_cosine } => {
                    let position = local(position);
                    let cone = Some((direction.into(), inner_cosine, outer_cosine));
                    // ∫ over the cone of the squared linear ramp of KHR_lights_punctual.
                    let solid_angle = TAU * ((1.0 - inner_cosine) + (inner_cosine - outer_cosine) / 3.0);
                    (Cells::Points(vec![single(position)]), Source::Point { position, cone, range }, solid_angle * sum)
                }
                LightKind::Directional { direction } => {
                    let towards = single(-DVec3::from(direction));
                    (Cells::Directions(vec![towards]), Source::Directions, PI * radius * radius * sum)
                }
            };
            Shot { shooter: Shooter { cells, plane: NO_PLANE, far: FAR }, light: vec![light.intensity], source, power }
        })
        .collect()
}

/// Rings of sky patches between horizon and zenith.
const SKY_RINGS: u32 = 8;

/// Sky patches along the horizon.
const SKY_SECTORS: u32 = 32;

/// A uniform sky of `radiance` (W/(m²·sr) or cd/m²) over the half of directions above the horizon (+y), as 256 patches of
/// equal solid angle with `side`² directions each.
pub fn skies(radiance: [f32; 3], side: u32, radius: f64) -> Vec<Emitter> {
    let sum: f64 = radiance.iter().map(|&x| f64::from(x)).sum();
    let cells = side * side;
    let solid_angle = TAU / f64::from(SKY_RINGS * SKY_SECTORS * cells);
    let light = radiance.map(|l| (f64::from(l) * solid_angle) as f32);
    (0..SKY_RINGS * SKY_SECTORS)
        .map(|k| {
            let directions = (0..cells).map(|cell| {
                // Equal areas on the sphere: uniform in height and azimuth (Archimedes).
                let height = f64::from(k / SKY_SECTORS * side + cell / side) + 0.5;
                let turn = f64::from(k % SKY_SECTORS * side + cell % side) + 0.5;
                let y = height / f64::from(SKY_RINGS * side);
                let (s, c) = sine_cosine(turn / f64::from(SKY_SECTORS * side));
                let r = (1.0 - y * y).sqrt();
                DVec3::new(r * c, y, r * s).as_vec3().to_array()
            });
            Shot {
                shooter: Shooter { cells: Cells::Directions(directions.collect()), plane: NO_PLANE, far: FAR },
                light: vec![light; cells as usize],
                source: Source::Directions,
                power: PI * radius * radius * sum * solid_angle * f64::from(cells),
            }
        })
        .collect()
}

/// Share of a lamp's light that its `range` leaves at `distance`, both in metres (KHR_lights_punctual).
pub fn range_window(distance: f64, range: f64) -> f64 {
    let x = (distance / range) * (distance / range);
    (1.0 - x * x).clamp(0.0, 1.0)
}

/// Sine and cosine of `turns` whole turns in plain arithmetic: the same bits on every machine.
pub fn sine_cosine(turns: f64) -> (f64, f64) {
    let quarter = (turns * 4.0).round();
    let x = (turns - quarter / 4.0) * TAU;
    let z = x * x;
    // Taylor series; |x| ≤ π/4.
    let (mut s, mut c) = (0.0, 0.0);
    for k in (0..10).rev() {
        let k = f64::from(k);
        s = 1.0 - z / ((2.0 * k + 2.0) * (2.0 * k + 3.0)) * s;
        c = 1.0 - z / ((2.0 * k + 1.0) * (2.0 * k + 2.0)) * c;
    }
    let s = x * s;
    match quarter.rem_euclid(4.0) as u8 {
        0 => (s, c),
        1 => (c, -s),
        2 => (-s, -c),
        _ => (-c, s),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sine_and_cosine_equal_the_standard_library() {
        for i in -400..400 {
            let turns = f64::from(i) / 173.0;
            let (s, c) = sine_cosine(turns);
            let (es, ec) = (turns * TAU).sin_cos();
            assert!((s - es).abs() < 2e-14 && (c - ec).abs() < 2e-14, "{turns}");
        }
    }

    #[test]
    fn an_open_horizontal_surface_gets_pi_times_the_sky_radiance() {
        let sum: f64 = skies([1.0; 3], 8, 1.0)
            .iter()
            .flat_map(|s| match &s.shooter.cells {
                Cells::Directions(d) => d.iter().zip(&s.light).map(|(d, l)| f64::from(d[1] * l[0])).collect::<Vec<_>>(),
                _ => vec![],
            })
            .sum();
        // Uniform in height: the midpoint rule is exact up to the rounding of f32.
        assert!((sum / PI - 1.0).abs() < 1e-5, "{sum}");
    }
}
