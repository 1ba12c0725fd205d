//! Which polygons can see each other at all, and how much at most: by planes and boxes, before anything is integrated.

use super::Polygon;
use glam::DVec3;
use std::f64::consts::PI;

/// A polygon's plane and box.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stance {
    normal: DVec3,
    /// Height of the plane over the origin.
    offset: f64,
    centre: DVec3,
    half: DVec3,
    area: f64,
    plane: u32,
    /// Rounding of heights, metres.
    slack: f64,
}

impl Stance {
    /// Of a polygon.
    pub fn of(polygon: &Polygon) -> Stance {
        let corners = || polygon.corners.iter().copied();
        let low = corners().fold(DVec3::INFINITY, DVec3::min);
        let high = corners().fold(DVec3::NEG_INFINITY, DVec3::max);
        let Polygon { normal, area, plane, .. } = *polygon;
        // The plane through the lowest corner: none of the polygon lies under it.
        let offset = corners().map(|c| c.dot(normal)).fold(f64::INFINITY, f64::min);
        let slack = 16.0 * f64::EPSILON * low.abs().max(high.abs()).element_sum();
        Stance { normal, offset, centre: low.midpoint(high), half: (high - low) / 2.0, area, plane, slack }
    }

    /// How far the other's box reaches over this plane, metres.
    fn reach(&self, other: &Stance) -> f64 {
        let centre = self.normal.dot(other.centre) - self.offset;
        centre + self.normal.abs().dot(other.half) + self.slack + other.slack
    }

    /// An upper bound of the exchange area A·F, m²; 0 if the two cannot face each other. Nothing in between is looked at.
    pub fn most(&self, other: &Stance) -> f64 {
        let (here, there) = (self.reach(other), other.reach(self));
        if self.plane == other.plane || here <= 0.0 || there <= 0.0 {
            return 0.0;
        }
        let gap = ((self.centre - other.centre).abs() - self.half - other.half).max(DVec3::ZERO).length();
        let all = self.area.min(other.area);
        if gap == 0.0 {
            return all;
        }
        // AF = ∬ cosθ₁ cosθ₂ / (π r²), with cosθ ≤ height / distance and r no less than the gap.
        let cosines = (here / gap).min(1.0) * (there / gap).min(1.0);
        (self.area * other.area * cosines / (PI * gap * gap)).min(all)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(at: DVec3, u: DVec3, v: DVec3, plane: u32) -> Stance {
        Stance::of(&Polygon::new(vec![at, at + u, at + u + v, at + v], plane).unwrap())
    }

    #[test]
    fn what_is_behind_sees_nothing_and_the_bound_is_one() {
        let floor = square(DVec3::ZERO, DVec3::X, DVec3::Y, 0);
        let ceiling = square(DVec3::Z, DVec3::Y, DVec3::X, 1);
        let roof = square(DVec3::Z, DVec3::X, DVec3::Y, 1);
        let beside = square(DVec3::X, DVec3::X, DVec3::Y, 0);
        assert_eq!((floor.most(&roof), roof.most(&floor), floor.most(&beside)), (0.0, 0.0, 0.0));
        // Opposite squares: F = 0.199825.
        assert!(floor.most(&ceiling) >= 0.199825 && floor.most(&ceiling) <= 1.0);
        assert_eq!(floor.most(&ceiling), ceiling.most(&floor));
        let far = square(DVec3::Z * 100.0, DVec3::Y, DVec3::X, 2);
        let exact = 1.0 / (PI * 1e4);
        assert!((floor.most(&far) / exact - 1.0).abs() < 1e-9 && floor.most(&far) >= exact * (1.0 - 1e-12));
    }
}
