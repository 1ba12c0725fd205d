//! Tables of points in, tables of readings out (RFC 4180).

use super::{Point, Reading, Status};
use crate::quantity::photometric;
use serde::Serialize;
use std::io::{self, Write};

/// What is wrong with a table of points.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: found {found}; expected {expected}")]
pub struct PointsError {
    /// Line of the file, from 1.
    pub line: u64,
    /// What is there.
    pub found: String,
    /// What should be there.
    pub expected: String,
}

/// The columns that are needed.
const COLUMNS: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];

/// Coordinates end here, metres: single precision has nothing to say beyond.
const FARTHEST: f64 = 1e9;

/// Reads points from CSV with a header that names `x`, `y`, `z` (world coordinates, metres) and `nx`, `ny`, `nz` (a normal of
/// any length but 0), in any order. Other columns are ignored.
pub fn read_points(bytes: &[u8]) -> Result<Vec<Point>, PointsError> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(bytes);
    let header = reader.headers().map_err(|e| refused(bytes, e))?.clone();
    let mut places = [0; 6];
    for (place, name) in places.iter_mut().zip(COLUMNS) {
        let mut found = header.iter().enumerate().filter(|(_, h)| *h == name);
        *place = match (found.next(), found.next()) {
            (Some((k, _)), None) => k,
            (first, _) => {
                let names: Vec<&str> = header.iter().collect();
                let what = if first.is_some() { "twice" } else { "nowhere" };
                let found = format!("the column '{name}' {what} in the header '{}'", names.join(","));
                return Err(PointsError {
                    line: 1,
                    found,
                    expected: "a header with the columns x,y,z,nx,ny,nz".into(),
                });
            }
        };
    }
    let mut points = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|e| refused(bytes, e))?;
        let line = line_of(bytes, record.position());
        let mut numbers = [0.0; 6];
        for ((number, &place), name) in numbers.iter_mut().zip(&places).zip(COLUMNS) {
            let text = &record[place];
            *number = text.parse().ok().filter(|x: &f64| x.abs() <= FARTHEST).ok_or_else(|| PointsError {
                line,
                found: format!("'{text}' in the column '{name}'"),
                expected: "a finite number, in metres at most 1e9".into(),
            })?;
        }
        let [x, y, z, nx, ny, nz] = numbers;
        let length = glam::DVec3::new(nx, ny, nz).length();
        if length.partial_cmp(&1e-30) != Some(std::cmp::Ordering::Greater) {
            let found = format!("the normal {nx},{ny},{nz}");
            return Err(PointsError { line, found, expected: "a direction; its length does not matter".into() });
        }
        points.push(Point { position: [x, y, z], normal: [nx, ny, nz] });
    }
    Ok(points)
}

/// Line of a record; its position may lie before empty lines.
fn line_of(bytes: &[u8], position: Option<&csv::Position>) -> u64 {
    position.map_or(1, |p| {
        let before = bytes[(p.byte() as usize).min(bytes.len())..].iter().take_while(|&&b| b == b'\n' || b == b'\r');
        p.line() + before.filter(|&&b| b == b'\n').count() as u64
    })
}

/// What the reader of CSV found wrong.
fn refused(bytes: &[u8], error: csv::Error) -> PointsError {
    let line = line_of(bytes, error.position());
    let (found, expected) = match error.kind() {
        csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
            (format!("{len} columns"), format!("{expected_len}, as in the header"))
        }
        csv::ErrorKind::Utf8 { .. } => ("bytes that are no text".into(), "UTF-8".into()),
        _ => (error.to_string(), "comma-separated values".into()),
    };
    PointsError { line, found, expected }
}

/// One row; the fields' names are the header.
#[derive(Serialize)]
struct Row {
    x: f64,
    y: f64,
    z: f64,
    nx: f64,
    ny: f64,
    nz: f64,
    e_r: Option<f32>,
    e_g: Option<f32>,
    e_b: Option<f32>,
    e: Option<f32>,
    status: &'static str,
}

/// Writes points with their readings as CSV: the numbers of the points as they were given, the irradiance of each channel
/// and its photometric sum (W/m² or lux), and the status. Where there is no light to tell of its columns are empty, so that
/// sums and means of spreadsheets leave them out.
pub fn write_readings(points: &[Point], readings: &[Reading], out: &mut dyn Write) -> io::Result<()> {
    let mut table = csv::Writer::from_writer(out);
    if points.is_empty() {
        table.write_record(COLUMNS.iter().chain(&["e_r", "e_g", "e_b", "e", "status"]))?;
    }
    for (point, reading) in points.iter().zip(readings) {
        let ([x, y, z], [nx, ny, nz]) = (point.position, point.normal);
        let [e_r, e_g, e_b] = reading.irradiance.map(|e| (reading.status == Status::Ok).then_some(e));
        let e = reading.illuminance();
        let row = Row { x, y, z, nx, ny, nz, e_r, e_g, e_b, e, status: reading.status.word() };
        table.serialize(row).map_err(io::Error::other)?;
    }
    table.flush()
}

impl Reading {
    /// Photometric sum of the irradiance, W/m² or lux; None where there is no light to tell of.
    pub fn illuminance(&self) -> Option<f32> {
        (self.status == Status::Ok).then(|| photometric(self.irradiance))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_come_in_any_order_with_others_between_them() {
        let text = "\u{feff}name,nz,ny,nx, x ,y,z\r\n\"a, b\",0,2,0,1.5,-2,1e3\r\n";
        let points = read_points(text.as_bytes()).unwrap();
        assert_eq!(points, [Point { position: [1.5, -2.0, 1e3], normal: [0.0, 2.0, 0.0] }]);
        assert_eq!(read_points(b"x,y,z,nx,ny,nz\n"), Ok(vec![]));
    }

    #[test]
    fn every_bad_table_is_refused_with_its_line() {
        let good = "x,y,z,nx,ny,nz\n0,0,0,0,1,0\n";
        let cases = [
            ("", 1, "x"),
            ("x,y,z,nx,ny\n0,0,0,0,1\n", 1, "'nz' nowhere"),
            ("x,y,z,nx,ny,nz,x\n0,0,0,0,1,0,0\n", 1, "'x' twice"),
            ("x;y;z;nx;ny;nz\n0;0;0;0;1;0\n", 1, "header 'x;y;z;nx;ny;nz'"),
            (&format!("{good}0,0,0,0,1\n"), 3, "5 columns"),
            (&format!("{good}\n0,0,0,0,1,0,7\n"), 4, "7 columns"),
            (&format!("{good}0,nan,0,0,1,0\n"), 3, "'nan' in the column 'y'"),
            (&format!("{good}0,0,inf,0,1,0\n"), 3, "'inf' in the column 'z'"),
            (&format!("{good}0,0,1e10,0,1,0\n"), 3, "'1e10' in the column 'z'"),
            (&format!("{good}0,0,,0,1,0\n"), 3, "'' in the column 'z'"),
            (&format!("{good}0,0,0,0,0,0\n"), 3, "the normal 0,0,0"),
            (&format!("{good}0,0,0,0,NaN,0\n"), 3, "'NaN' in the column 'ny'"),
        ];
        for (text, line, part) in cases {
            let error = read_points(text.as_bytes()).unwrap_err();
            assert!(error.line == line && error.found.contains(part), "{text:?}: {error}");
        }
        assert_eq!(read_points(b"x,y,z,nx,ny,nz\n0,0,0,0,1,\xff\n").unwrap_err().line, 2);
    }

    #[test]
    fn rows_without_light_have_empty_columns() {
        let points = [Point { position: [0.5, 0.0, -1.0], normal: [0.0, 2.0, 0.0] }; 2];
        let readings = [
            Reading { irradiance: [1.0, 0.5, 0.25], status: Status::Ok },
            Reading { irradiance: [0.0; 3], status: Status::Inside },
        ];
        let mut bytes = Vec::new();
        write_readings(&points, &readings, &mut bytes).unwrap();
        let expected = "x,y,z,nx,ny,nz,e_r,e_g,e_b,e,status\n\
            0.5,0.0,-1.0,0.0,2.0,0.0,1.0,0.5,0.25,0.58825,ok\n0.5,0.0,-1.0,0.0,2.0,0.0,,,,,inside\n";
        assert_eq!(String::from_utf8(bytes).unwrap(), expected);
        let mut empty = Vec::new();
        write_readings(&[], &[], &mut empty).unwrap();
        assert_eq!(empty, b"x,y,z,nx,ny,nz,e_r,e_g,e_b,e,status\n");
    }
}
