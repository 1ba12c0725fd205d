//! The slow, obvious form factor: the integral of cosθᵣ cosθₛ / (π r²) over the polygon.

use glam::DVec3;

/// Form factor from `point` with unit `normal` to the parallelogram `origin`, `edge_u`, `edge_v` with unit normal towards
/// its lit side, by the midpoint rule on `n` × `n` parts (Siegel & Howell, the definition). For tests.
pub fn midpoint(point: DVec3, normal: DVec3, [origin, edge_u, edge_v]: [DVec3; 3], lit: DVec3, n: u32) -> f64 {
    let area = edge_u.cross(edge_v).length() / f64::from(n * n);
    let mut sum = 0.0;
    for i in 0..n {
        for j in 0..n {
            let (u, v) = ((f64::from(i) + 0.5) / f64::from(n), (f64::from(j) + 0.5) / f64::from(n));
            let r = origin + u * edge_u + v * edge_v - point;
            let r2 = r.length_squared();
            sum += (r.dot(normal)).max(0.0) * (-r.dot(lit)).max(0.0) / (std::f64::consts::PI * r2 * r2) * area;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::form_factor::contour;

    #[test]
    fn contour_equals_the_integral() {
        let (point, normal) = (DVec3::new(0.2, 0.1, 0.0), DVec3::new(0.3, -0.2, 0.93).normalize());
        let (o, u, v) = (DVec3::new(0.5, -1.0, 0.4), DVec3::new(0.0, 1.5, 0.3), DVec3::new(-0.2, 0.1, 1.0));
        let mut lit = u.cross(v).normalize();
        if lit.dot(point - o) < 0.0 {
            lit = -lit;
        }
        let closed = contour(point, normal, &[o, o + u, o + u + v, o + v]);
        // The midpoint rule converges with the square of the step.
        assert!((midpoint(point, normal, [o, u, v], lit, 400) / closed - 1.0).abs() < 1e-4);
    }
}
