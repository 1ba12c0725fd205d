//! Written by the example `obstructed_reference`.

/// Name of the case, F from its first polygon, and the standard error of that.
pub const REFERENCES: &[(&str, f64, f64)] = &[];
