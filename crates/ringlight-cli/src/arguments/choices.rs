//! What flags choose among.

use clap::ValueEnum;

/// Presets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum QualityChoice {
    /// About 6 thousand elements, 4 cells
    Draft,
    /// About 25 thousand elements, 16 cells
    Normal,
    /// About 100 thousand elements, 64 cells
    High,
}

/// Units of length.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum UnitChoice {
    /// Millimetres
    Mm,
    /// Centimetres
    Cm,
    /// Metres
    M,
    /// Inches
    In,
}

/// Methods.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SolverChoice {
    /// Plain progressive refinement
    Plain,
    /// Group shooting
    Group,
}

/// What has a row of the matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum PerChoice {
    /// Every named object
    Object,
    /// Every face of the file; its name is followed by / and its number in the file
    Face,
}

/// Which sides of faces see.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SidesChoice {
    /// The front
    Front,
    /// Both; areas count both
    Both,
}

/// What a patch shoots.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ShootChoice {
    /// Each cell the light of the elements under it
    Elements,
    /// The average everywhere
    Average,
}

/// Where probes take light from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum HowChoice {
    /// All patches, lamps and the sky, obstructed
    Gather,
    /// The nearest surface that faces the same way, interpolated as it is displayed
    Surface,
}

/// Tone mappings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ToneChoice {
    /// Filmic
    Filmic,
    /// None: clipped at 1
    None,
}

/// Ways to divide pictures among ranks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SplitChoice {
    /// A rectangle for each rank
    Tiles,
    /// Every N-th row for each of N ranks
    Scanlines,
}

/// Quantities that false colour shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum FalseColourChoice {
    /// Illuminance
    Lux,
}

/// Ways to show progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ProgressChoice {
    /// A bar on terminals, else plain lines
    Auto,
    /// A line every few seconds
    Plain,
    /// One JSON object a line
    Json,
    /// Nothing
    None,
}

/// How geometry is dealt out to the members of a ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ShardsChoice {
    /// Compact in space
    Spatial,
    /// Pseudo-random
    Random,
}

/// Which members of a ring a packet visits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum RoutingChoice {
    /// Those whose boxes stand between its points and the shooter
    Boxes,
    /// All
    All,
}
