//! Light over one element: linear in the triangles between its sides and its sample point.
//!
//! The mean of the corners is twice the mean of neighbours: at the sample point it errs by h²/4·∇²E, and at shadow edges by
//! a share of the step. The fan keeps the value that was found there, and is the corners' on the element's border, so that
//! there is no seam.

use crate::mesh::Frame;
use crate::quantity::Rgb;
use glam::DVec2;
use ringlight_visibility::Layout;

/// Light over one element.
#[derive(Clone, Copy, Debug)]
pub struct Fan {
    /// Quadrilateral or triangle.
    pub layout: Layout,
    /// Light at the corners; a triangle repeats the last one.
    pub corners: [Rgb; 4],
    /// Where the sides are joined to, strictly inside: parameters within the element.
    pub middle: DVec2,
    /// Light there.
    pub light: Rgb,
}

impl Fan {
    /// Light at parameters within the element.
    pub fn at(&self, within: DVec2) -> Rgb {
        let parameters = Frame::corner_parameters(self.layout);
        let n = parameters.len();
        let away = within - self.middle;
        // Of the triangles' coordinates along their two corners, those of the triangle that holds the point are both
        // positive; the largest least one is the most positive in the presence of rounding.
        let (mut best, mut holder) = (f64::NEG_INFINITY, (0, 1, DVec2::ZERO));
        for k in 0..n {
            let next = (k + 1) % n;
            let (a, b) = (parameters[k] - self.middle, parameters[next] - self.middle);
            let shares = DVec2::new(away.perp_dot(b), a.perp_dot(away)) / a.perp_dot(b);
            if shares.min_element() > best {
                (best, holder) = (shares.min_element(), (k, next, shares));
            }
        }
        let (k, next, shares) = holder;
        let shares = shares.max(DVec2::ZERO);
        let shares = shares / (shares.x + shares.y).max(1.0);
        let [a, b, m] = [shares.x, shares.y, 1.0 - shares.x - shares.y].map(|x| x as f32);
        std::array::from_fn(|c| a * self.corners[k][c] + b * self.corners[next][c] + m * self.light[c])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fan_is_linear_on_its_sides_and_meets_its_middle() {
        let corners = [[1.0; 3], [2.0; 3], [4.0; 3], [8.0; 3]];
        let middle = DVec2::new(0.375, 0.625);
        let fan = Fan { layout: Layout::Quad, corners, middle, light: [16.0; 3] };
        let at = |x: f64, y: f64| fan.at(DVec2::new(x, y))[0];
        assert_eq!(fan.at(middle), [16.0; 3]);
        for (&corner, light) in Frame::corner_parameters(Layout::Quad).iter().zip(corners) {
            assert_eq!(fan.at(corner), light);
        }
        assert_eq!([at(0.5, 0.0), at(1.0, 0.25), at(0.5, 1.0), at(0.0, 0.75)], [1.5, 2.5, 6.0, 6.25]);
        // Halfway from the middle to a corner.
        assert!((at(0.1875, 0.3125) - 8.5).abs() < 1e-5);
        // Outside, the nearest of the triangle that points there.
        assert!(at(1.5, 0.5) <= 4.0);
    }

    #[test]
    fn linear_light_stays_linear_in_a_triangle() {
        let light = |p: DVec2| [(1.0 + 2.0 * p.x + 3.0 * p.y) as f32; 3];
        let [a, b, c] = [DVec2::ZERO, DVec2::X, DVec2::Y].map(light);
        let middle = DVec2::new(0.25, 0.5);
        let fan = Fan { layout: Layout::Triangle, corners: [a, b, c, c], middle, light: light(middle) };
        for i in 0..10 {
            for j in 0..10 - i {
                let p = DVec2::new(f64::from(i), f64::from(j)) / 10.0;
                assert!((fan.at(p)[0] - light(p)[0]).abs() < 1e-5, "{p}");
            }
        }
    }
}
