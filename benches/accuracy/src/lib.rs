//! Ringlight's accuracy, measured beside exact values, published tables and other methods.
//!
//! A [`suite`] is a function that measures and gives a [`Section`]: rows that compare what was found with what is exact,
//! each with the bound that it is held to. The tests assert every row of every suite; `cargo xtask accuracy` writes them
//! as `docs/accuracy.md`.

pub mod method;
pub mod oracle;
pub mod page;
pub mod plot;
pub mod scene;
pub mod suite;
pub mod view_factor;

/// What one suite measured: a section of the page.
#[derive(Clone, Debug, Default)]
pub struct Section {
    /// Heading.
    pub title: String,
    /// What was compared with what, and where the values are from. Markdown.
    pub text: String,
    /// Comparisons.
    pub rows: Vec<Row>,
    /// Further measurements that have no exact value beside them: headings, then rows of cells.
    pub table: Option<(Vec<String>, Vec<Vec<String>>)>,
    /// Diagrams.
    pub plots: Vec<plot::Plot>,
}

/// A comparison: a row of the page and an assertion of the tests.
#[derive(Clone, Debug)]
pub struct Row {
    /// What is compared, with its source where it is not the section's.
    pub case: String,
    /// The exact or published value.
    pub expected: f64,
    /// What Ringlight (or the method under test) gives.
    pub found: f64,
    /// How far off it may be.
    pub bound: Bound,
}

/// How far a value may be off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bound {
    /// Share of the expected value.
    Relative(f64),
    /// In the value's own unit.
    Absolute(f64),
    /// The larger of a share of the expected value and an amount.
    Larger {
        /// Share of the expected value.
        relative: f64,
        /// In the value's own unit.
        absolute: f64,
    },
    /// The value itself may be at most the expected one.
    AtMost,
}

impl Row {
    /// Found minus expected, as a share of the expected value where that is not 0.
    pub fn deviation(&self) -> f64 {
        let difference = self.found - self.expected;
        if self.expected == 0.0 { difference } else { difference / self.expected.abs() }
    }

    /// Whether the value lies within its bound.
    pub fn holds(&self) -> bool {
        let difference = (self.found - self.expected).abs();
        match self.bound {
            Bound::Relative(share) => difference <= share * self.expected.abs(),
            Bound::Absolute(amount) => difference <= amount,
            Bound::Larger { relative, absolute } => difference <= absolute.max(relative * self.expected.abs()),
            Bound::AtMost => self.found <= self.expected,
        }
    }
}

impl Section {
    /// Panics with all rows that are out of bounds.
    pub fn assert(&self) {
        assert!(!self.rows.is_empty(), "{}: nothing was compared", self.title);
        let wrong: Vec<String> = self
            .rows
            .iter()
            .filter(|row| !row.holds())
            .map(|r| {
                format!(
                    "{}: expected {}, found {} ({:+.2e}), bound {:?}",
                    r.case,
                    r.expected,
                    r.found,
                    r.deviation(),
                    r.bound
                )
            })
            .collect();
        assert!(wrong.is_empty(), "{}:\n{}", self.title, wrong.join("\n"));
    }
}
