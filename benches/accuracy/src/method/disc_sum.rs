//! The disc sum (Wallace, Elmquist & Haines 1989): cells of a shooter as discs, Σ cosθᵣ cosθₛ A/(πr² + A) over those that
//! a ray reaches.

use glam::DVec3;
use std::f64::consts::PI;

/// A cell of a shooter: position, area, and whether it is seen.
#[derive(Clone, Copy, Debug)]
pub struct Cell {
    /// Middle, metres.
    pub position: DVec3,
    /// Area, m².
    pub area: f64,
    /// Whether the receiver sees it.
    pub seen: bool,
}

/// Form factor from `point` with unit `normal` to the seen cells of a shooter with unit normal `shooter`.
pub fn form_factor(point: DVec3, normal: DVec3, shooter: DVec3, cells: impl IntoIterator<Item = Cell>) -> f64 {
    cells
        .into_iter()
        .filter(|cell| cell.seen)
        .map(|cell| {
            let way = cell.position - point;
            let r2 = way.length_squared();
            way.dot(normal).max(0.0) * (-way.dot(shooter)).max(0.0) / r2 * cell.area / (PI * r2 + cell.area)
        })
        .sum()
}
