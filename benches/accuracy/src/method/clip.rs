//! Cutting flat convex polygons by planes.

use glam::DVec3;

/// A flat convex polygon.
pub type Corners = Vec<DVec3>;

/// The parts of a polygon in front of the plane `normal`·p = `offset` and behind it (Sutherland & Hodgman 1974); a part
/// without area has no corners.
pub fn split(polygon: &[DVec3], normal: DVec3, offset: f64) -> [Corners; 2] {
    let mut parts = [Vec::new(), Vec::new()];
    for (k, &corner) in polygon.iter().enumerate() {
        let next = polygon[(k + 1) % polygon.len()];
        let (here, there) = (normal.dot(corner) - offset, normal.dot(next) - offset);
        if here >= 0.0 {
            parts[0].push(corner);
        }
        if here <= 0.0 {
            parts[1].push(corner);
        }
        if here * there < 0.0 {
            let cut = corner + here / (here - there) * (next - corner);
            parts.iter_mut().for_each(|part| part.push(cut));
        }
    }
    parts.map(|part| if part.len() < 3 { Vec::new() } else { part })
}

/// The normals of the planes through the origin and a polygon's edges, pointing inwards.
pub fn edge_planes(polygon: &[DVec3]) -> impl Iterator<Item = DVec3> {
    let middle = polygon.iter().sum::<DVec3>();
    (0..polygon.len()).map(move |k| {
        let normal = polygon[k].cross(polygon[(k + 1) % polygon.len()]);
        if normal.dot(middle) < 0.0 { -normal } else { normal }
    })
}
