//! The table of elements: one row of comma-separated values for each.

use crate::mesh::{Frame, Patch};
use crate::quantity::photometric;
use crate::solution::Solution;
use glam::DVec3;
use serde::Serialize;
use std::io::{self, Write};

/// One row; the fields' names are the header.
#[derive(Serialize)]
struct Row<'a> {
    element: u32,
    patch: u32,
    object: &'a str,
    x: f64,
    y: f64,
    z: f64,
    nx: f32,
    ny: f32,
    nz: f32,
    area: f32,
    e_r: f32,
    e_g: f32,
    e_b: f32,
    b_r: f32,
    b_g: f32,
    b_b: f32,
    e: f32,
    valid: f32,
    level: u32,
}

/// Writes the elements as CSV (RFC 4180, numbers so short that they read back to the same bits).
///
/// `object` is the surface's name; x, y, z the sample point in world coordinates, metres (the middle of an element that is
/// covered altogether); nx, ny, nz the normal of the lit side; `area` in m²; `e_*` the irradiance at the point and `b_*` the
/// radiosity, W/m² or lux; `e` the photometric sum of the irradiance; `valid` the share of the element that lies free of
/// other geometry; `level` how often its patch's elements were halved (log₂ of their subdivision, rounded).
pub fn write_table(solution: &Solution, out: &mut dyn Write) -> io::Result<()> {
    let mesh = &solution.mesh;
    let mut table = csv::Writer::from_writer(out);
    for id in 0..mesh.patch_count() as u32 {
        let patch = mesh.patch(id);
        let surface = mesh.facets[patch.facet as usize].surface;
        let object = solution.description.surfaces.get(surface as usize).map_or("", |s| &s.name);
        // Twice the logarithm is the square's, so rounding is exact.
        let level = mesh.subdivision(id).pow(2).ilog2().div_ceil(2);
        let [nx, ny, nz] = patch.normal.as_vec3().to_array();
        for (k, element) in patch.elements().enumerate() {
            let [x, y, z] = mesh.to_world(sample_point(&patch, k as u32, mesh.valid[element as usize])).to_array();
            let [e_r, e_g, e_b] = solution.irradiance(element);
            let [b_r, b_g, b_b] = solution.radiosity(&patch, element);
            let row = Row {
                element,
                patch: id,
                object,
                x,
                y,
                z,
                nx,
                ny,
                nz,
                area: patch.element_area(k as u32) as f32,
                e_r,
                e_g,
                e_b,
                b_r,
                b_g,
                b_b,
                e: photometric([e_r, e_g, e_b]),
                valid: mesh.valid_share(element) as f32,
                level,
            };
            table.serialize(row).map_err(io::Error::other)?;
        }
    }
    table.flush()
}

/// Where the light of the `k`-th element of a patch was evaluated, or its middle if it has no such place.
fn sample_point(patch: &Patch, k: u32, valid: u32) -> DVec3 {
    let middle = || patch.frame.at(patch.element_tile(k).at(Frame::middle(patch.frame.layout)));
    patch.sample_point(k, valid).unwrap_or_else(middle)
}

#[cfg(test)]
mod tests {
    use super::super::{fixture, scenes};
    use super::write_table;

    fn table(obj: &str) -> String {
        let mut bytes = Vec::new();
        write_table(&scenes::solved(obj, 0.5), &mut bytes).unwrap();
        String::from_utf8(bytes).unwrap()
    }

    #[test]
    fn every_element_has_a_row_under_the_header_that_scripts_rely_on() {
        let solution = scenes::solved(scenes::LAMP_OVER_FLOOR, 0.5);
        let text = table(scenes::LAMP_OVER_FLOOR);
        let mut lines = text.lines();
        let header = "element,patch,object,x,y,z,nx,ny,nz,area,e_r,e_g,e_b,b_r,b_g,b_b,e,valid,level";
        assert_eq!(lines.next(), Some(header));
        assert_eq!(lines.count(), solution.mesh.element_count());
    }

    #[test]
    fn levels_count_halvings() {
        let levels = |subdivision: u8| {
            let scene = fixture::read(scenes::LAMP_OVER_FLOOR);
            let solution =
                fixture::solve_refined(scene, [2.0, 1.0], 1.0, |patch| if patch < 2 { 1 } else { subdivision });
            let mut bytes = Vec::new();
            write_table(&solution, &mut bytes).unwrap();
            let mut reader = csv::Reader::from_reader(bytes.as_slice());
            let mut levels: Vec<u32> = reader.records().map(|row| row.unwrap()[18].parse().unwrap()).collect();
            levels.dedup();
            levels
        };
        for (subdivision, level) in [(2, 1), (3, 2), (4, 2), (5, 2), (6, 3), (11, 3), (12, 4)] {
            assert_eq!(levels(subdivision), [0, level], "{subdivision}");
        }
        assert_eq!(levels(1), [0]);
    }

    #[test]
    fn numbers_read_back_to_the_bits_of_the_solution() {
        let solution = scenes::solved(scenes::LAMP_OVER_FLOOR, 0.5);
        let text = table(scenes::LAMP_OVER_FLOOR);
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        for (element, row) in reader.records().enumerate() {
            let row = row.unwrap();
            assert_eq!(row[0].parse(), Ok(element));
            let read: [f32; 3] = std::array::from_fn(|c| row[10 + c].parse().unwrap());
            assert_eq!(read, solution.irradiance(element as u32));
        }
    }

    #[test]
    fn names_with_commas_quotes_and_spaces_are_quoted() {
        let obj = scenes::LAMP_OVER_FLOOR.replace("o floor", "o floor, \"old\" part");
        let text = table(&obj);
        assert!(text.contains(",\"floor, \"\"old\"\" part\","), "{}", text.lines().nth(1).unwrap_or(""));
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let named = reader.records().filter(|r| &r.as_ref().unwrap()[2] == "floor, \"old\" part").count();
        assert!(named > 0);
    }
}
