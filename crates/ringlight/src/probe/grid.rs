//! Calculation grids: points in the middles of equal cells, and the numbers that lighting calculations state of them.

use super::nearest::closest_on_facet;
use super::{Point, Reading, Status};
use crate::solution::Solution;
use glam::{DVec2, DVec3};
use std::str::FromStr;

/// Where a grid lies.
#[derive(Clone, Debug, PartialEq)]
pub struct GridRequest {
    /// What it covers.
    pub area: Area,
    /// Largest distance between neighbouring points, metres.
    pub spacing: f64,
}

/// What a grid covers.
#[derive(Clone, Debug, PartialEq)]
pub enum Area {
    /// The top of the surfaces of this name, or their front if they are one flat piece.
    Object(String),
    /// A parallelogram: a corner and the edges from it, metres. The normal is u × v.
    Parallelogram {
        /// Corner.
        corner: DVec3,
        /// First edge.
        u: DVec3,
        /// Second edge.
        v: DVec3,
    },
}

/// Points in the middles of columns × rows equal cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Columns, along the first edge.
    pub columns: u32,
    /// Rows, along the second edge.
    pub rows: u32,
    /// Size of a cell along both edges, metres.
    pub cell: [f64; 2],
    /// The points, row by row; none where the object has no surface.
    pub points: Vec<Option<Point>>,
}

/// A grid has at most this many points.
const MOST_POINTS: f64 = 1e7;

/// A side looks up if its normal is less than 26° from the vertical.
const UP: f64 = 0.9;

impl FromStr for GridRequest {
    type Err = String;

    /// `AREA@SPACING`; AREA is `x,y,z;x,y,z` (two opposite corners of a rectangle that stands or lies), `x,y,z;x,y,z;x,y,z`
    /// (a corner of a parallelogram and those beside it), or an object's name.
    fn from_str(text: &str) -> Result<GridRequest, String> {
        let (area, spacing) = text.rsplit_once('@').ok_or("expected AREA@SPACING, as in floor@0.25")?;
        let spacing = f64::from_str(spacing.trim()).map_err(|_| format!("'{spacing}' is not a number of metres"))?;
        if !(spacing > 0.0 && spacing.is_finite()) {
            return Err(format!("a spacing of {spacing} m is not above 0"));
        }
        let corners: Option<Vec<DVec3>> = if area.contains(';') { area.split(';').map(corner).collect() } else { None };
        let area = match corners.as_deref() {
            None if area.is_empty() => return Err("expected an object or corners before the @".into()),
            None => Area::Object(area.into()),
            Some(&[a, b]) => rectangle(a, b)?,
            Some(&[a, b, c]) => Area::Parallelogram { corner: a, u: b - a, v: c - a },
            Some(more) => return Err(format!("found {} corners; expected 2 or 3", more.len())),
        };
        match &area {
            Area::Parallelogram { u, v, .. } if u.cross(*v) == DVec3::ZERO => Err("the corners enclose no area".into()),
            _ => Ok(GridRequest { area, spacing }),
        }
    }
}

fn corner(text: &str) -> Option<DVec3> {
    let numbers: Vec<f64> = text.split(',').map(|t| t.trim().parse().ok()).collect::<Option<_>>()?;
    match *numbers {
        [x, y, z] if numbers.iter().all(|n| n.abs() <= 1e9) => Some(DVec3::new(x, y, z)),
        _ => None,
    }
}

/// The rectangle between two opposite corners that agree in one coordinate. A lying one looks up; a standing one to the
/// right of whoever goes from the first corner to the second: (horizontal way) × up.
fn rectangle(a: DVec3, b: DVec3) -> Result<Area, String> {
    let d = b - a;
    let (corner, u, v) = match d.to_array() {
        // x × −z = up: columns along x, rows towards −z.
        [_, 0.0, _] => (DVec3::new(a.x.min(b.x), a.y, a.z.max(b.z)), DVec3::X * d.x.abs(), DVec3::NEG_Z * d.z.abs()),
        [0.0, _, _] => (DVec3::new(a.x, a.y.min(b.y), a.z), DVec3::Z * d.z, DVec3::Y * d.y.abs()),
        [_, _, 0.0] => (DVec3::new(a.x, a.y.min(b.y), a.z), DVec3::X * d.x, DVec3::Y * d.y.abs()),
        _ => return Err("two corners must agree in x, y or z; give three for a tilted grid".into()),
    };
    Ok(Area::Parallelogram { corner, u, v })
}

impl GridRequest {
    /// The points, lifted by `height` metres along their normals; what is wrong if there are none.
    pub fn points(&self, solution: &Solution, height: f64) -> Result<Grid, String> {
        match &self.area {
            Area::Parallelogram { corner, u, v } => {
                let normal = u.cross(*v).normalize();
                let (columns, rows) = counts(u.length(), v.length(), self.spacing)?;
                let at = |s: f64, t: f64| {
                    Some(Point {
                        position: (*corner + s * *u + t * *v + height * normal).to_array(),
                        normal: normal.to_array(),
                    })
                };
                Ok(Grid::new(columns, rows, [u.length(), v.length()], at))
            }
            Area::Object(name) => object_grid(solution, name, self.spacing, height),
        }
    }
}

fn counts(width: f64, height: f64, spacing: f64) -> Result<(u32, u32), String> {
    let [columns, rows] = [width, height].map(|l| (l / spacing - 1e-6).ceil().max(1.0));
    if columns * rows > MOST_POINTS {
        return Err(format!("{columns} × {rows} points are too many; expected at most {MOST_POINTS}"));
    }
    Ok((columns as u32, rows as u32))
}

/// A lit side of a facet that a grid may cover.
#[derive(Clone, Copy)]
struct Side {
    facet: u32,
    back: bool,
    normal: DVec3,
}

fn object_grid(solution: &Solution, name: &str, spacing: f64, height: f64) -> Result<Grid, String> {
    let mesh = &solution.mesh;
    let surfaces = &solution.description.surfaces;
    if !surfaces.iter().any(|s| &*s.name == name) {
        let mut names: Vec<&str> = surfaces.iter().map(|s| &*s.name).collect();
        names.sort_unstable();
        names.dedup();
        let more = if names.len() > 100 { ", …" } else { "" };
        names.truncate(100);
        return Err(format!("there is no object '{name}'; there are {}{more}", names.join(", ")));
    }
    let mut sides = Vec::new();
    for (number, facet) in mesh.facets.iter().enumerate() {
        if surfaces[facet.surface as usize].name.as_ref() == name {
            let front = facet.frame().area_vector().normalize();
            sides.push(Side { facet: number as u32, back: false, normal: front });
            if facet.double_sided() {
                sides.push(Side { facet: number as u32, back: true, normal: -front });
            }
        }
    }
    let normal = direction(solution, &sides).ok_or_else(|| {
        format!("'{name}' is not flat and has no top; give the corners of the grid instead of its name")
    })?;
    let flat = |side: &&Side| side.normal.dot(normal) > UP;
    let covered: Vec<Side> = sides.iter().filter(flat).copied().collect();
    // Columns run along the horizontal of a slope or wall, along x on what lies flat.
    let u = if normal.y.abs() > UP { DVec3::Y.cross(DVec3::Z).normalize() } else { DVec3::Y.cross(normal).normalize() };
    let u = (u - u.dot(normal) * normal).normalize();
    let v = normal.cross(u);
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for corner in covered.iter().flat_map(|s| mesh.facets[s.facet as usize].corners) {
        let at = DVec2::new(u.dot(corner.as_dvec3()), v.dot(corner.as_dvec3()));
        (low, high) = (low.min(at), high.max(at));
    }
    let extent = high - low;
    let (columns, rows) = counts(extent.x, extent.y, spacing)?;
    let at = |s: f64, t: f64| {
        let place = low + DVec2::new(s, t) * extent;
        let foot = place.x * u + place.y * v;
        // The highest side over this place.
        let heights = covered.iter().filter_map(|side| height_over(solution, side, foot, normal));
        let (top, normal_there) = heights.fold(None, |best: Option<(f64, DVec3)>, (h, n)| match best {
            Some((b, _)) if b >= h => best,
            _ => Some((h, n)),
        })?;
        let position = mesh.to_world(foot + top * normal + height * normal_there);
        Some(Point { position: position.to_array(), normal: normal_there.to_array() })
    };
    let grid = Grid::new(columns, rows, extent.to_array(), at);
    if grid.points.iter().all(|p| p.is_none()) {
        return Err(format!("a spacing of {spacing} m leaves no point on '{name}'"));
    }
    Ok(grid)
}

/// Where a grid on these sides looks: up if some do and not all lie in one direction; else to the brighter side of what is
/// flat.
fn direction(solution: &Solution, sides: &[Side]) -> Option<DVec3> {
    let first = sides.first()?.normal;
    if sides.iter().any(|s| s.normal.dot(first).abs() < 0.999) {
        return sides.iter().any(|s| s.normal.y > UP).then_some(DVec3::Y);
    }
    let power = |sign: f64| -> f64 {
        let facing = sides.iter().filter(|s| s.normal.dot(first) * sign > 0.0);
        facing.map(|s| received(solution, s)).sum()
    };
    let backs = sides.iter().any(|s| s.normal.dot(first) < 0.0);
    Some(if backs && power(-1.0) > power(1.0) { -first } else { first })
}

/// Power that a side receives, summed over channels.
fn received(solution: &Solution, side: &Side) -> f64 {
    let mesh = &solution.mesh;
    let light = |e: u32| solution.irradiance(e).iter().map(|&x| f64::from(x)).sum::<f64>();
    let of_patch = |id: u32| {
        let patch = mesh.patch(id);
        patch.elements().map(light).sum::<f64>() * patch.area / f64::from(patch.element_count())
    };
    mesh.facets[side.facet as usize].patch_range(side.back).map(of_patch).sum()
}

/// Height along `up` at which the line from `foot` meets a side, and the side's normal.
fn height_over(solution: &Solution, side: &Side, foot: DVec3, up: DVec3) -> Option<(f64, DVec3)> {
    let facet = &solution.mesh.facets[side.facet as usize];
    let corner = facet.corners[0].as_dvec3();
    let height = side.normal.dot(corner - foot) / side.normal.dot(up);
    let place = foot + height * up;
    let (_, closest) = closest_on_facet(facet, place);
    let slack = 1e-6 * solution.mesh.diagonal;
    ((closest - place).length() <= slack).then_some((height, side.normal))
}

impl Grid {
    /// `at` gives the point at a share of both edges.
    fn new(columns: u32, rows: u32, size: [f64; 2], at: impl Fn(f64, f64) -> Option<Point>) -> Grid {
        let share = |k: u32, n: u32| (f64::from(k) + 0.5) / f64::from(n);
        let points = (0..columns * rows).map(|k| at(share(k % columns, columns), share(k / columns, rows))).collect();
        Grid { columns, rows, cell: [size[0] / f64::from(columns), size[1] / f64::from(rows)], points }
    }
}

/// What lighting calculations state of a grid (EN 12464-1).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Points with light.
    pub points: usize,
    /// Points without: inside things, or far from surfaces.
    pub left_out: usize,
    /// Least illuminance, W/m² or lux.
    pub minimum: f64,
    /// Mean illuminance.
    pub mean: f64,
    /// Greatest illuminance.
    pub maximum: f64,
}

impl Statistics {
    /// Of readings; those without light are counted and left out.
    pub fn new(readings: &[Reading]) -> Statistics {
        let values: Vec<f64> = readings.iter().filter_map(|r| r.illuminance()).map(f64::from).collect();
        let left_out = readings.iter().filter(|r| r.status != Status::Ok).count();
        if values.is_empty() {
            return Statistics { left_out, ..Statistics::default() };
        }
        Statistics {
            points: values.len(),
            left_out,
            minimum: values.iter().copied().fold(f64::INFINITY, f64::min),
            mean: values.iter().sum::<f64>() / values.len() as f64,
            maximum: values.iter().copied().fold(0.0, f64::max),
        }
    }

    /// Uniformity U0 = minimum / mean; 0 in the dark.
    pub fn uniformity(&self) -> f64 {
        if self.mean > 0.0 { self.minimum / self.mean } else { 0.0 }
    }

    /// Diversity Ud = minimum / maximum; 0 in the dark.
    pub fn diversity(&self) -> f64 {
        if self.maximum > 0.0 { self.minimum / self.maximum } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::fixture::{read, solve};

    fn request(text: &str) -> GridRequest {
        text.parse().unwrap()
    }

    #[test]
    fn rectangles_look_up_or_to_the_side_of_their_corners() {
        let looks = |text: &str| match request(text).area {
            Area::Parallelogram { u, v, .. } => u.cross(v).normalize(),
            Area::Object(_) => panic!("{text} is an object"),
        };
        assert_eq!(looks("0,1,0;2,1,3@1"), DVec3::Y);
        assert_eq!(looks("2,1,3;0,1,0@1"), DVec3::Y);
        assert_eq!(looks("0,0,0;2,1,0@1"), DVec3::Z);
        assert_eq!(looks("2,0,0;0,1,0@1"), DVec3::NEG_Z);
        assert_eq!(looks("0,0,0;0,1,2@1"), DVec3::NEG_X);
        assert_eq!(looks("0,3,0;1,3,0;0,3,1@1"), DVec3::NEG_Y);
        assert_eq!(request("desk;top@0.5").area, Area::Object("desk;top".into()));
        assert_eq!(request("a@b@0.5"), GridRequest { area: Area::Object("a@b".into()), spacing: 0.5 });
        for bad in [
            "floor",
            "floor@0",
            "floor@-1",
            "floor@nan",
            "@1",
            "0,0,0;1,1,1@1",
            "0,0,0;0,0,0@1",
            "0,0,0;1,0,0@1",
            "0,0,0;1,0,0;2,0,0@1",
            "0,0,0;1,0,0;0,1,0;1,1,0@1",
        ] {
            assert!(bad.parse::<GridRequest>().is_err(), "{bad}");
        }
    }

    /// A table top, 2 m × 1 m, 10 cm thick, at 0.7 m, and a single L-shaped floor.
    const FURNITURE: &str = "v 0 .6 0\nv 2 .6 0\nv 2 .6 1\nv 0 .6 1\nv 0 .7 0\nv 2 .7 0\nv 2 .7 1\nv 0 .7 1\n\
        o top\nusemtl grey\nf 1 2 3 4\nf 5 8 7 6\nf 1 5 6 2\nf 4 3 7 8\nf 1 4 8 5\nf 2 6 7 3\n\
        v -2 0 -2\nv 4 0 -2\nv 4 0 0\nv 0 0 0\nv 0 0 4\nv -2 0 4\no floor\nf 14 13 12 11 10 9\n\
        v -1 2 -1\nv -1 2 1\nv 1 2 1\nv 1 2 -1\no lamp\nusemtl lamp\nf 18 17 16 15\n";

    #[test]
    fn objects_get_points_on_their_top_and_none_beside_it() {
        let solution = solve(read(FURNITURE), 0.5, 0.1);
        let grid = request("top@0.25").points(&solution, 0.0).unwrap();
        assert_eq!((grid.columns, grid.rows, grid.points.iter().flatten().count()), (8, 4, 32));
        for point in grid.points.iter().flatten() {
            assert!((point.position[1] - 0.7).abs() < 1e-6 && point.normal[1] > 0.999, "{point:?}");
        }
        // Three square 2 m corners of six: 6 × 6 − 4 × 4 of them at 1 m.
        let floor = request("floor@1").points(&solution, 0.85).unwrap();
        assert_eq!((floor.columns, floor.rows, floor.points.iter().flatten().count()), (6, 6, 20));
        assert!(floor.points.iter().flatten().all(|p| (p.position[1] - 0.85).abs() < 1e-6 && p.normal[1] > 0.999));
        assert!(request("wall@1").points(&solution, 0.0).unwrap_err().contains("floor, lamp, top"));
        assert!(request("floor@1e-5").points(&solution, 0.0).is_err());
    }

    #[test]
    fn cells_are_no_larger_than_asked() {
        let solution = solve(read(FURNITURE), 1.0, 0.5);
        let grid = request("0,1,0;1,1,0.9@0.3").points(&solution, 0.0).unwrap();
        assert_eq!((grid.columns, grid.rows), (4, 3));
        assert!((grid.cell[0] - 0.25).abs() < 1e-12 && (grid.cell[1] - 0.3).abs() < 1e-12);
        assert_eq!(grid.points[0].unwrap().position, [0.125, 1.0, 0.75]);
    }

    #[test]
    fn statistics_leave_out_what_has_no_light() {
        let ok = |e: f32| Reading { irradiance: [e; 3], status: Status::Ok };
        let found = Statistics::new(&[ok(100.0), ok(300.0), Reading::without_light(Status::Inside)]);
        assert_eq!((found.points, found.left_out), (2, 1));
        for (value, expected) in
            [(found.minimum, 100.0), (found.mean, 200.0), (found.uniformity(), 0.5), (found.diversity(), 1.0 / 3.0)]
        {
            assert!((value / expected - 1.0).abs() < 1e-6);
        }
        assert_eq!(Statistics::new(&[ok(0.0)]).uniformity(), 0.0);
    }
}
