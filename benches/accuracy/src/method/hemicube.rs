//! The hemicube (Cohen & Greenberg 1985): half a cube over the receiving point, its faces divided into pixels; every pixel
//! has its share of the form factor, and goes to the polygon that a depth buffer finds nearest behind it.

use super::clip::{Corners, edge_planes, split};
use glam::DVec3;
use std::f64::consts::PI;

/// A hemicube of a resolution: the full top, and the upper halves of the four sides.
pub struct Hemicube {
    /// Pixels along an edge; even.
    resolution: usize,
}

/// A face of the cube at distance 1: what it looks along, and how its pixels run.
struct Face {
    axis: DVec3,
    across: DVec3,
    up: DVec3,
    /// Lowest coordinate along `up`: −1 for the top, 0 for the sides.
    lowest: f64,
}

impl Hemicube {
    /// With this many pixels along an edge.
    pub fn new(resolution: usize) -> Hemicube {
        assert!(resolution >= 2 && resolution.is_multiple_of(2), "the sides are cut in half");
        Hemicube { resolution }
    }

    /// The one with about as many pixels as `samples`.
    pub fn of_samples(samples: f64) -> Hemicube {
        Hemicube::new(2 * ((samples / 12.0).sqrt().round() as usize).max(1))
    }

    /// Pixels of the five faces.
    pub fn samples(&self) -> usize {
        3 * self.resolution * self.resolution
    }

    /// Form factors from `point` with unit `normal` to all polygons, each hiding what is behind it.
    pub fn form_factors(&self, point: DVec3, normal: DVec3, polygons: &[Corners]) -> Vec<f64> {
        let (tangent, bitangent) = normal.any_orthonormal_pair();
        let relative: Vec<Corners> =
            polygons.iter().map(|polygon| polygon.iter().map(|corner| corner - point).collect()).collect();
        let mut factors = vec![0.0; polygons.len()];
        let top = Face { axis: normal, across: tangent, up: bitangent, lowest: -1.0 };
        self.add_face(&top, &relative, |x, y| 1.0 / (x * x + y * y + 1.0).powi(2), &mut factors);
        for (axis, across) in [(tangent, bitangent), (-tangent, bitangent), (bitangent, tangent), (-bitangent, tangent)]
        {
            let side = Face { axis, across, up: normal, lowest: 0.0 };
            self.add_face(&side, &relative, |x, y| y / (x * x + y * y + 1.0).powi(2), &mut factors);
        }
        factors
    }

    /// Adds the delta form factors of a face's pixels, `delta` / π per area, to the polygons that they show.
    fn add_face(&self, face: &Face, polygons: &[Corners], delta: impl Fn(f64, f64) -> f64, factors: &mut [f64]) {
        let pixel = 2.0 / self.resolution as f64;
        let rows = ((1.0 - face.lowest) / pixel).round() as usize;
        let mut items: Vec<Option<usize>> = vec![None; self.resolution * rows];
        let mut nearest = vec![f64::INFINITY; items.len()];
        for (number, polygon) in polygons.iter().enumerate() {
            self.draw(face, rows, polygon, |i, distance| {
                if distance < nearest[i] {
                    (nearest[i], items[i]) = (distance, Some(number));
                }
            });
        }
        for (i, item) in items.iter().enumerate() {
            if let Some(number) = item {
                let (x, y) = self.centre(face, i);
                factors[*number] += delta(x, y) * pixel * pixel / PI;
            }
        }
    }

    /// Middle of pixel `i` on its face.
    fn centre(&self, face: &Face, i: usize) -> (f64, f64) {
        let at = |k: usize| (k as f64 + 0.5) * 2.0 / self.resolution as f64;
        (at(i % self.resolution) - 1.0, at(i / self.resolution) + face.lowest)
    }

    /// Calls with every pixel whose middle shows the polygon, and the polygon's distance along the face's axis.
    fn draw(&self, face: &Face, rows: usize, polygon: &[DVec3], mut set: impl FnMut(usize, f64)) {
        let Face { axis, across, up, lowest } = *face;
        let mut seen = polygon.to_vec();
        for plane in [axis + across, axis - across, axis - up, up - lowest * axis] {
            let [inside, _] = split(&seen, plane, 0.0);
            seen = inside;
        }
        let normal = (polygon[1] - polygon[0]).cross(polygon[2] - polygon[0]);
        let offset = normal.dot(polygon[0]);
        if seen.is_empty() || offset.abs() <= 1e-12 * normal.length() {
            return;
        }
        // The pixels of the box around what is seen.
        let range = |along: DVec3, low: f64, count: usize| {
            let places = seen.iter().map(|p| (along.dot(*p) / axis.dot(*p) - low) / 2.0 * self.resolution as f64);
            let (first, last) = places.fold((f64::INFINITY, 0.0f64), |(a, b), t| {
                if t.is_nan() { (0.0, count as f64) } else { (a.min(t), b.max(t)) }
            });
            (first.max(0.0) as usize)..(last.ceil() as usize).min(count)
        };
        let planes: Vec<DVec3> = edge_planes(&seen).collect();
        for row in range(up, lowest, rows) {
            for column in range(across, -1.0, self.resolution) {
                let i = row * self.resolution + column;
                let (x, y) = self.centre(face, i);
                let direction = axis + x * across + y * up;
                if planes.iter().all(|plane| plane.dot(direction) >= 0.0) {
                    set(i, offset / normal.dot(direction));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_closed_room_gets_every_pixel_and_the_pixels_make_one() {
        let faces: Vec<Corners> = (0..6)
            .map(|i| {
                [(-1., -1.), (1., -1.), (1., 1.), (-1., 1.)]
                    .map(|(a, b)| {
                        let mut p = [0.0; 3];
                        (p[i / 2], p[(i / 2 + 1) % 3], p[(i / 2 + 2) % 3]) = (if i % 2 == 0 { -1. } else { 1. }, a, b);
                        DVec3::from(p)
                    })
                    .to_vec()
            })
            .collect();
        let normal = DVec3::new(0.3, 0.4, 0.87).normalize();
        for resolution in [16, 64, 256] {
            let factors = Hemicube::new(resolution).form_factors(DVec3::new(0.1, -0.2, 0.3), normal, &faces);
            // The midpoint rule over smooth faces: its error falls with the square of the resolution.
            let sum: f64 = factors.iter().sum();
            assert!((sum - 1.0).abs() < 1.0 / (resolution * resolution) as f64, "{resolution}: {sum}");
        }
    }
}
