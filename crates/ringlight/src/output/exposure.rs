//! From radiance to display values.

use crate::solution::Solution;

/// Display value = radiance × `scale`; 1 is white.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposure {
    /// Display value of radiance 1 W/(m²·sr) or luminance 1 cd/m².
    pub scale: f32,
}

impl Exposure {
    /// From an exposure value at ISO 100: luminance 1.2 · 2^EV is white.
    pub fn from_ev(ev: f32) -> Exposure {
        Exposure { scale: 1.0 / (1.2 * ev.exp2()) }
    }

    /// From the light of a solution.
    pub fn automatic(solution: &Solution) -> Exposure {
        let _ = solution;
        Exposure { scale: 1.0 }
    }
}
