//! Convex polygons cut by planes.

use glam::DVec3;

/// Keeps in `kept` the part of a convex polygon with height ≥ 0, after Sutherland & Hodgman (1974). `heights` are the corners'
/// heights over the plane, one a corner; corners with height 0 stay as they are, to the bit. Empty if nothing lies above.
pub(crate) fn keep_above(corners: &[DVec3], heights: impl Fn(DVec3) -> f64, kept: &mut Vec<DVec3>) {
    kept.clear();
    let Some(&last) = corners.last() else { return };
    let mut above = false;
    let (mut from, mut from_height) = (last, heights(last));
    for &to in corners {
        let to_height = heights(to);
        if (from_height > 0.0 && to_height < 0.0) || (from_height < 0.0 && to_height > 0.0) {
            kept.push(crossing(from, from_height, to, to_height));
        }
        if to_height >= 0.0 {
            kept.push(to);
        }
        above |= to_height > 0.0;
        (from, from_height) = (to, to_height);
    }
    if !above || kept.len() < 3 {
        kept.clear();
    }
}

/// Where an edge crosses the plane; the same bits whichever way it runs and whichever side is kept.
fn crossing(p: DVec3, p_height: f64, q: DVec3, q_height: f64) -> DVec3 {
    let forward = p.to_array() <= q.to_array();
    let (p, p_height, q, q_height) = if forward { (p, p_height, q, q_height) } else { (q, q_height, p, p_height) };
    p + p_height / (p_height - q_height) * (q - p)
}

/// Area vector of a flat polygon.
pub(crate) fn area_vector(corners: &[DVec3]) -> DVec3 {
    let first = corners[0];
    corners.windows(2).fold(DVec3::ZERO, |sum, w| sum + (w[0] - first).cross(w[1] - first)) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> [DVec3; 4] {
        [(0., 0.), (1., 0.), (1., 1.), (0., 1.)].map(|(x, y)| DVec3::new(x, y, 0.0))
    }

    #[test]
    fn keeps_what_lies_above() {
        let mut kept = Vec::new();
        for (offset, area) in
            [(-1.0, 1.0), (0.0, 1.0), (0.25, 1.0 - 0.5 * 0.25 * 0.25), (1.0, 0.5), (2.0, 0.0), (3.0, 0.0)]
        {
            keep_above(&square(), |p| p.x + p.y - offset, &mut kept);
            let found = if kept.is_empty() { 0.0 } else { area_vector(&kept).z };
            assert!((found - area).abs() < 1e-15, "{offset}: {found}");
        }
    }

    #[test]
    fn both_sides_of_a_cut_share_its_corners() {
        let (mut above, mut below) = (Vec::new(), Vec::new());
        let height = |p: DVec3| 0.3 * p.x - 0.7 * p.y + 0.1;
        keep_above(&square(), height, &mut above);
        keep_above(&square(), |p| -height(p), &mut below);
        let shared = above.iter().filter(|p| below.contains(p)).count();
        assert_eq!(shared, 2);
        assert!((area_vector(&above) + area_vector(&below)).distance(DVec3::Z) < 1e-15);
    }
}
