//! The elements as an unstructured grid of VTK (`.vtu`), for ParaView and its like.
//!
//! XML with the arrays appended in binary ("VTK XML Formats", file version 1.0): each array is its length in bytes, as a
//! 64-bit number, and its values; all of them little-endian.

use crate::mesh::{Frame, Patch};
use crate::quantity::photometric;
use crate::solution::Solution;
use glam::DVec3;
use ringlight_visibility::Layout;
use std::io::{self, Write};

/// VTK's number for triangles.
const TRIANGLE: u8 = 5;
/// VTK's number for quadrilaterals.
const QUAD: u8 = 9;

/// One array of the file.
struct Array {
    /// Element of the file it belongs to.
    section: Section,
    name: &'static str,
    /// VTK's name of the type of number.
    kind: &'static str,
    components: u32,
    /// Length, bytes.
    bytes: u64,
    /// Appends the numbers of one element: patch, number within the patch, element.
    write: Append,
}

/// Appends the numbers of an element to the bytes; the last argument counts the points written before it.
type Append = fn(&Solution, &Patch, u32, u64, &mut Vec<u8>);

#[derive(Clone, Copy, PartialEq)]
enum Section {
    CellData,
    Points,
    Cells,
}

/// Writes the elements, in order, as cells with their own corners (metres, world coordinates), counter-clockwise seen from
/// the lit side. Cell data: `irradiance` (RGB, W/m² or lux, at the sample point), `illuminance` (its photometric sum),
/// `radiosity` (RGB), `patch`, `object` (number of the surface) and `valid` (share free of other geometry).
pub fn write_vtu(solution: &Solution, out: &mut dyn Write) -> io::Result<()> {
    let cells = solution.mesh.element_count() as u64;
    let points: u64 = solution
        .mesh
        .facets
        .iter()
        .map(|f| {
            let elements = f.sides().map(|back| solution.mesh.side_elements(f, back).len() as u64).sum::<u64>();
            elements * corner_count(f.layout())
        })
        .sum();
    let arrays = arrays(cells, points);
    writeln!(out, "<?xml version=\"1.0\"?>")?;
    writeln!(
        out,
        "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">"
    )?;
    writeln!(out, "<UnstructuredGrid>\n<Piece NumberOfPoints=\"{points}\" NumberOfCells=\"{cells}\">")?;
    let mut offset = 0;
    for (section, open, close) in [
        (Section::CellData, "CellData Scalars=\"illuminance\"", "CellData"),
        (Section::Points, "Points", "Points"),
        (Section::Cells, "Cells", "Cells"),
    ] {
        writeln!(out, "<{open}>")?;
        for Array { name, kind, components, bytes, .. } in arrays.iter().filter(|a| a.section == section) {
            writeln!(
                out,
                "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"appended\" \
                 offset=\"{offset}\"/>"
            )?;
            offset += 8 + bytes;
        }
        writeln!(out, "</{close}>")?;
    }
    write!(out, "</Piece>\n</UnstructuredGrid>\n<AppendedData encoding=\"raw\">\n_")?;
    for array in &arrays {
        out.write_all(&array.bytes.to_le_bytes())?;
        write_values(solution, array.write, out)?;
    }
    writeln!(out, "\n</AppendedData>\n</VTKFile>")
}

fn write_values(solution: &Solution, append: Append, out: &mut dyn Write) -> io::Result<()> {
    let (mut bytes, mut points) = (Vec::new(), 0);
    for id in 0..solution.mesh.patch_count() as u32 {
        let patch = solution.mesh.patch(id);
        for k in 0..patch.element_count() {
            append(solution, &patch, k, points, &mut bytes);
            points += corner_count(patch.frame.layout);
        }
        out.write_all(&bytes)?;
        bytes.clear();
    }
    Ok(())
}

/// All arrays, in the order in which they are described and appended.
fn arrays(cells: u64, points: u64) -> [Array; 10] {
    use Section::{CellData, Cells, Points};
    let array = |section, name, kind, components, bytes, write| Array { section, name, kind, components, bytes, write };
    [
        array(CellData, "irradiance", "Float32", 3, 12 * cells, |s, p, k, _, bytes| {
            put(bytes, s.irradiance(p.first_element + k).map(f32::to_le_bytes));
        }),
        array(CellData, "illuminance", "Float32", 1, 4 * cells, |s, p, k, _, bytes| {
            put(bytes, [photometric(s.irradiance(p.first_element + k)).to_le_bytes()]);
        }),
        array(CellData, "radiosity", "Float32", 3, 12 * cells, |s, p, k, _, bytes| {
            put(bytes, s.radiosity(p, p.first_element + k).map(f32::to_le_bytes));
        }),
        array(CellData, "patch", "UInt32", 1, 4 * cells, |_, p, _, _, bytes| put(bytes, [p.id.to_le_bytes()])),
        array(CellData, "object", "UInt32", 1, 4 * cells, |s, p, _, _, bytes| {
            put(bytes, [s.mesh.facets[p.facet as usize].surface.to_le_bytes()]);
        }),
        array(CellData, "valid", "Float32", 1, 4 * cells, |s, p, k, _, bytes| {
            put(bytes, [(s.mesh.valid_share(p.first_element + k) as f32).to_le_bytes()]);
        }),
        array(Points, "Points", "Float64", 3, 24 * points, |s, p, k, _, bytes| {
            let (corners, count) = corners(p, k);
            corners[..count].iter().for_each(|&c| put(bytes, s.mesh.to_world(c).to_array().map(f64::to_le_bytes)));
        }),
        array(Cells, "connectivity", "Int64", 1, 8 * points, |_, p, _, first, bytes| {
            put(bytes, (first..first + corner_count(p.frame.layout)).map(u64::to_le_bytes));
        }),
        array(Cells, "offsets", "Int64", 1, 8 * cells, |_, p, _, first, bytes| {
            put(bytes, [(first + corner_count(p.frame.layout)).to_le_bytes()]);
        }),
        array(Cells, "types", "UInt8", 1, cells, |_, p, _, _, bytes| {
            bytes.push(if p.frame.layout == Layout::Quad { QUAD } else { TRIANGLE });
        }),
    ]
}

fn put<const N: usize>(bytes: &mut Vec<u8>, values: impl IntoIterator<Item = [u8; N]>) {
    bytes.extend(values.into_iter().flatten());
}

fn corner_count(layout: Layout) -> u64 {
    Frame::corner_parameters(layout).len() as u64
}

/// Corners of the `k`-th element, mesh coordinates, counter-clockwise seen from its lit side.
fn corners(patch: &Patch, k: u32) -> ([DVec3; 4], usize) {
    let (mut corners, count) = patch.frame.tile(patch.element_tile(k)).corners();
    if patch.back {
        corners[..count].reverse();
    }
    (corners, count)
}

#[cfg(test)]
mod tests {
    use super::super::scenes;
    use super::*;

    /// The bytes of array `name`, found by its offset as a reader does.
    fn values(file: &[u8], name: &str) -> Vec<u8> {
        let text = String::from_utf8_lossy(file);
        let tag = text.lines().find(|l| l.contains(&format!("Name=\"{name}\""))).unwrap();
        let offset: usize = tag.split("offset=\"").nth(1).unwrap().split('"').next().unwrap().parse().unwrap();
        let mark = b"<AppendedData encoding=\"raw\">\n_";
        let start = file.windows(mark.len()).position(|w| w == mark).unwrap() + mark.len() + offset;
        let length = u64::from_le_bytes(file[start..start + 8].try_into().unwrap()) as usize;
        file[start + 8..start + 8 + length].to_vec()
    }

    #[test]
    fn a_reader_finds_every_array_at_its_offset() {
        let solution = scenes::solved(scenes::LAMP_OVER_FLOOR, 0.5);
        let mut file = Vec::new();
        write_vtu(&solution, &mut file).unwrap();
        let cells = solution.mesh.element_count();
        let types = values(&file, "types");
        assert_eq!(types.len(), cells);
        let corners: usize = types.iter().map(|&t| if t == QUAD { 4 } else { 3 }).sum();
        assert!(types.contains(&QUAD) && types.contains(&TRIANGLE));
        assert_eq!(values(&file, "Points").len(), corners * 24);
        let connectivity: Vec<u64> = bytemuck::pod_collect_to_vec(&values(&file, "connectivity"));
        assert_eq!(connectivity, (0..corners as u64).collect::<Vec<_>>());
        let offsets: Vec<u64> = bytemuck::pod_collect_to_vec(&values(&file, "offsets"));
        assert_eq!((offsets.len(), offsets.last()), (cells, Some(&(corners as u64))));
        let irradiance: Vec<[f32; 3]> = bytemuck::pod_collect_to_vec(&values(&file, "irradiance"));
        assert!(irradiance.iter().enumerate().all(|(e, &x)| x == solution.irradiance(e as u32)));
        assert!(String::from_utf8_lossy(&file).ends_with("\n</AppendedData>\n</VTKFile>\n"));
    }

    #[test]
    fn cells_turn_counter_clockwise_about_the_lit_side() {
        let solution = scenes::solved(scenes::LAMP_OVER_FLOOR, 0.5);
        for id in 0..solution.mesh.patch_count() as u32 {
            let patch = solution.mesh.patch(id);
            let ([a, b, c, _], _) = corners(&patch, 0);
            assert!((b - a).cross(c - a).dot(patch.normal) > 0.0);
        }
    }
}
