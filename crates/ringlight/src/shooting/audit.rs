//! Where a shooter's light goes, by rays of its own: the audit is measured, never taken from the remainder.

use super::emitter::{range_window, sine_cosine};
use super::shot::{Shot, Source};
use crate::mesh::{Mesh, RELATIVE_TOLERANCE, is_covered};
use glam::{DVec2, DVec3};
use ringlight_visibility::{Cells, Hierarchy, NO_PLANE, Ray};

/// Shares of a shot's power.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Fate {
    /// Hits nothing, also behind see-through surfaces; or is what a lamp's range cuts off.
    pub escaped: f64,
    /// Meets no surface at all.
    pub escaped_at_once: f64,
    /// Hits the unlit back of a surface.
    pub backs: f64,
}

/// Follows `rays` rays of `shot`, spread evenly by the R2 sequence (Roberts 2018). For light from infinity the rays start on
/// the disc of `radius` metres about `centre` that holds the scene.
pub fn audit(mesh: &Mesh, hierarchy: &Hierarchy, shot: &Shot, rays: u32, centre: DVec3, radius: f64) -> Fate {
    let mut fate = Fate::default();
    let weights: Vec<f64> = shot.light.iter().map(|l| l.iter().map(|&x| f64::from(x)).sum()).collect();
    let total: f64 = weights.iter().sum();
    let mut lost = 0.0;
    let range = match shot.source {
        Source::Point { range, .. } => range,
        _ => f64::INFINITY,
    };
    for i in 0..rays {
        let fraction = |g: f64| (0.5 + g * f64::from(i + 1)).fract();
        // Generators of the R4 sequence.
        let [a, b, c, d] =
            [0.856_674_883_854_502_9, 0.733_891_856_627_126, 0.628_706_721_037_809_5, 0.538_597_257_223_655_8]
                .map(fraction);
        let Some((origin, direction)) = start(mesh, shot, &weights, total, [a, b, c, d], centre, radius) else {
            lost += 1.0;
            continue;
        };
        let ray = follow(mesh, hierarchy, shot.shooter.plane, origin, direction, range);
        // A patch's free samples are known to a sixteenth of an element: where it matters, look again.
        if let (Source::Patch(source), true) = (&shot.source, ray != Fate::default())
            && is_covered(mesh, hierarchy, &mesh.patch(source.patch), origin)
        {
            lost += 1.0;
            continue;
        }
        fate.escaped += ray.escaped;
        fate.escaped_at_once += ray.escaped_at_once;
        fate.backs += ray.backs;
    }
    let sent = f64::from(rays) - lost;
    if sent > 0.0 {
        fate.escaped /= sent;
        fate.escaped_at_once /= sent;
        fate.backs /= sent;
    }
    fate
}

/// A ray of the shot for four numbers in 0…1; none where no light leaves.
fn start(
    mesh: &Mesh,
    shot: &Shot,
    weights: &[f64],
    total: f64,
    [a, b, c, d]: [f64; 4],
    centre: DVec3,
    radius: f64,
) -> Option<(DVec3, DVec3)> {
    // The cell by its share of the light.
    let mut left = c * total;
    let mut cell = weights.len() - 1;
    for (k, &w) in weights.iter().enumerate() {
        if left < w {
            cell = k;
            break;
        }
        left -= w;
    }
    let disc = |normal: DVec3, r: f64| {
        let (t, u) = normal.any_orthonormal_pair();
        let (s, c) = sine_cosine(b);
        r * (c * t + s * u)
    };
    match (&shot.source, &shot.shooter.cells) {
        (Source::Patch(source), Cells::Grid(grid)) => {
            // Within the cell along one diagonal is enough to leave the grid's symmetry.
            let inner = DVec2::new(d, (d * 7.0).fract()) - 0.5;
            let step = 1.0 / f64::from(grid.side) / if source.count == 3 { 3.0 } else { 1.0 };
            let [u, v] = grid.layout.centre(grid.side, cell).map(f64::from);
            let (u, v) = (u + inner.x * step, v + inner.y * step);
            if mesh.patch(source.patch).is_covered(mesh, DVec2::new(u, v)) {
                return None;
            }
            let edge = |e: [f32; 3]| DVec3::from(e.map(f64::from));
            let origin = edge(grid.origin) + u * edge(grid.edge_u) + v * edge(grid.edge_v) + u * v * edge(grid.twist);
            // Just above the surface, lest rounding lets a flat ray pass under a neighbour's edge.
            let n = source.normal;
            let origin = origin + RELATIVE_TOLERANCE * mesh.diagonal * n;
            // Cosine distribution (Malley's method).
            Some((origin, disc(n, a.sqrt()) + (1.0 - a).sqrt() * n))
        }
        (Source::Point { position, cone: None, .. }, _) => {
            let z = 2.0 * a - 1.0;
            Some((*position, disc(DVec3::Y, (1.0 - z * z).sqrt()) + z * DVec3::Y))
        }
        (Source::Point { position, cone: Some((axis, inner, outer)), .. }, _) => {
            let z = 1.0 - a * (1.0 - outer);
            let ramp = ((z - outer) / (inner - outer).max(1e-4)).clamp(0.0, 1.0);
            // By rejection against the cone's squared ramp.
            (d < ramp * ramp).then(|| (*position, disc(*axis, (1.0 - z * z).max(0.0).sqrt()) + z * *axis))
        }
        (Source::Directions, Cells::Directions(directions)) => {
            let towards = DVec3::from(directions[cell].map(f64::from));
            Some((centre + 2.0 * radius * towards + disc(towards, radius * a.sqrt()), -towards))
        }
        _ => None,
    }
}

/// Follows one ray through see-through surfaces to where its light ends.
fn follow(mesh: &Mesh, hierarchy: &Hierarchy, plane: u32, origin: DVec3, direction: DVec3, range: f64) -> Fate {
    let mut fate = Fate::default();
    let mut ray = Ray {
        origin: origin.as_vec3().to_array(),
        direction: direction.as_vec3().to_array(),
        near: 0.0,
        far: f32::INFINITY,
        plane,
    };
    let mut weight = 1.0;
    for surface in 0..64 {
        let Some(hit) = hierarchy.nearest_hit(&ray) else {
            fate.escaped += weight;
            if weight == 1.0 {
                fate.escaped_at_once += 1.0;
            }
            return fate;
        };
        if surface == 0 {
            let reaching = range_window(f64::from(hit.distance), range);
            fate.escaped += 1.0 - reaching;
            weight = reaching;
        }
        let number = hit.triangle >> 1;
        let facet = &mesh.facets[number as usize];
        // A cut-out blocks wholly where it is hit.
        let cutout = mesh.occluder.cutout[facet.surface as usize].is_some();
        let coverage = if cutout { 1.0 } else { f64::from(mesh.occluder.coverage(number, facet)) };
        let blocked = if coverage >= f64::from(crate::mesh::OPAQUE_COVERAGE) { 1.0 } else { coverage };
        if !hit.front && !facet.double_sided() {
            fate.backs += weight * blocked;
        }
        weight *= 1.0 - blocked;
        if weight < 1e-3 {
            return fate;
        }
        ray.near = hit.distance.next_up();
        ray.plane = NO_PLANE;
    }
    fate
}
