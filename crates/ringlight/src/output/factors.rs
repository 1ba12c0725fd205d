//! Matrices of view factors: dense and sparse CSV, NumPy.

use crate::view_factor::{Entry, Group, Row};
use std::fmt::Write as _;
use std::io::{self, Write};

/// How a matrix is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FactorForm {
    /// CSV with the header `name,area,‹names…›`, then a row for each group: F from it to each of them.
    Dense,
    /// CSV with the header `from,to,area,factor,error`: a line for each factor of at least this; `area` is that of `from`.
    Sparse(f64),
    /// NumPy's `.npy`: a square array of 64-bit floats, rows and columns in the order of the groups.
    Numpy,
}

/// Which numbers are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FactorValue {
    /// Area-averaged factors.
    Factor,
    /// Estimates of their errors.
    Error,
}

/// Writes a matrix row by row.
pub struct FactorWriter<'a, W: Write> {
    form: FactorForm,
    value: FactorValue,
    groups: &'a [Group],
    out: Out<W>,
    /// The row in full.
    dense: Vec<f64>,
    text: String,
}

enum Out<W: Write> {
    Table(Box<csv::Writer<W>>),
    Raw(W),
}

impl<'a, W: Write> FactorWriter<'a, W> {
    /// Writes the header. A sparse table has factors and errors side by side, whatever `value` is.
    pub fn new(form: FactorForm, value: FactorValue, groups: &'a [Group], mut out: W) -> io::Result<Self> {
        let out = match form {
            FactorForm::Numpy => {
                out.write_all(&numpy_header(groups.len()))?;
                Out::Raw(out)
            }
            FactorForm::Dense => {
                let mut table = Box::new(csv::Writer::from_writer(out));
                let names = groups.iter().map(|group| group.name.as_str());
                table.write_record(["name", "area"].into_iter().chain(names)).map_err(io::Error::other)?;
                Out::Table(table)
            }
            FactorForm::Sparse(_) => {
                let mut table = Box::new(csv::Writer::from_writer(out));
                table.write_record(["from", "to", "area", "factor", "error"]).map_err(io::Error::other)?;
                Out::Table(table)
            }
        };
        let dense = vec![0.0; if matches!(form, FactorForm::Sparse(_)) { 0 } else { groups.len() }];
        Ok(FactorWriter { form, value, groups, out, dense, text: String::new() })
    }

    /// Writes a row; they come in order.
    pub fn row(&mut self, row: &Row<'_>) -> io::Result<()> {
        let group = &self.groups[row.number];
        if !self.dense.is_empty() {
            for Entry { column, exchange } in row.entries {
                let value = if self.value == FactorValue::Factor { exchange.area } else { exchange.error };
                self.dense[*column as usize] = value / group.area;
            }
        }
        match (&mut self.out, self.form) {
            (Out::Table(table), FactorForm::Sparse(least)) => {
                for Entry { column, exchange } in row.entries {
                    let (factor, error) = (exchange.area / group.area, exchange.error / group.area);
                    if factor >= least {
                        let to = &self.groups[*column as usize].name;
                        table
                            .write_field(&group.name)
                            .and_then(|()| table.write_field(to))
                            .map_err(io::Error::other)?;
                        for number in [group.area, factor, error] {
                            write_number(table, number, &mut self.text)?;
                        }
                        table.write_record(None::<&[u8]>).map_err(io::Error::other)?;
                    }
                }
            }
            (Out::Table(table), _) => {
                table.write_field(&group.name).map_err(io::Error::other)?;
                write_number(table, group.area, &mut self.text)?;
                for &number in &self.dense {
                    write_number(table, number, &mut self.text)?;
                }
                table.write_record(None::<&[u8]>).map_err(io::Error::other)?;
            }
            (Out::Raw(out), _) => self.dense.iter().try_for_each(|number| out.write_all(&number.to_le_bytes()))?,
        }
        self.dense.fill(0.0);
        Ok(())
    }

    /// Gives back what was written to, everything in it.
    pub fn finish(self) -> io::Result<W> {
        match self.out {
            Out::Raw(mut out) => out.flush().map(|()| out),
            Out::Table(table) => table.into_inner().map_err(|error| io::Error::other(error.to_string())),
        }
    }
}

/// A number so short that it reads back to the same bits.
fn write_number<W: Write>(table: &mut csv::Writer<W>, number: f64, text: &mut String) -> io::Result<()> {
    text.clear();
    let plain = number == 0.0 || number.abs() >= 1e-4;
    // Writing to a string cannot fail.
    if plain {
        write!(text, "{number}").ok()
    } else {
        write!(text, "{number:e}").ok()
    };
    table.write_field(&text).map_err(io::Error::other)
}

/// Magic, version 1.0, length, and a dictionary padded with spaces so that the data begins at a multiple of 64 bytes
/// (NumPy Enhancement Proposal 1).
fn numpy_header(side: usize) -> Vec<u8> {
    const START: usize = 10;
    let mut text = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({side}, {side}), }}");
    while !(START + text.len() + 1).is_multiple_of(64) {
        text.push(' ');
    }
    text.push('\n');
    let mut header = b"\x93NUMPY\x01\x00".to_vec();
    header.extend_from_slice(&(text.len() as u16).to_le_bytes());
    header.extend_from_slice(text.as_bytes());
    header
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view_factor::Exchange;

    fn written(form: FactorForm, value: FactorValue) -> Vec<u8> {
        let groups = ["a \"quoted\", name", "b"].map(|name| Group { name: name.into(), area: 2.0, polygons: 0..0 });
        let mut writer = FactorWriter::new(form, value, &groups, Vec::new()).unwrap();
        let entry = |column, area, error| Entry { column, exchange: Exchange { area, error } };
        writer.row(&Row { number: 0, entries: &[entry(1, 0.5, 1e-9)], left_out: Exchange::default() }).unwrap();
        writer
            .row(&Row {
                number: 1,
                entries: &[entry(0, 0.5, 1e-9), entry(1, 2e-7, 0.0)],
                left_out: Exchange::default(),
            })
            .unwrap();
        writer.finish().unwrap()
    }

    #[test]
    fn tables_quote_names_and_numbers_read_back() {
        let text = |form, value| String::from_utf8(written(form, value)).unwrap();
        let quoted = "\"a \"\"quoted\"\", name\"";
        assert_eq!(
            text(FactorForm::Dense, FactorValue::Factor),
            format!("name,area,{quoted},b\n{quoted},2,0,0.25\nb,2,0.25,1e-7\n")
        );
        assert_eq!(
            text(FactorForm::Dense, FactorValue::Error),
            format!("name,area,{quoted},b\n{quoted},2,0,5e-10\nb,2,5e-10,0\n")
        );
        assert_eq!(
            text(FactorForm::Sparse(1e-6), FactorValue::Factor),
            format!("from,to,area,factor,error\n{quoted},b,2,0.25,5e-10\nb,{quoted},2,0.25,5e-10\n")
        );
    }

    #[test]
    fn numpy_arrays_begin_at_a_multiple_of_64_bytes() {
        let bytes = written(FactorForm::Numpy, FactorValue::Factor);
        assert!(bytes.starts_with(b"\x93NUMPY\x01\x00"));
        let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        assert_eq!((10 + length) % 64, 0);
        let header = std::str::from_utf8(&bytes[10..10 + length]).unwrap();
        assert_eq!(header.trim_end(), "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 2), }");
        assert!(header.ends_with('\n'));
        let numbers: Vec<f64> =
            bytes[10 + length..].as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
        assert_eq!(numbers, [0.0, 0.25, 0.25, 1e-7]);
        for side in [1, 10, 12_345, 1_234_567_890] {
            assert_eq!(numpy_header(side).len() % 64, 0);
        }
    }
}
