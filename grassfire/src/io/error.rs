//! Why a file was refused.

use crate::monitor::Cancelled;

/// Why a file was refused or could not be written. Every message is one line.
#[derive(Debug, thiserror::Error)]
pub enum IoError {
    /// The file is not there or not readable.
    #[error("{file}: cannot be read: {source}")]
    Open {
        /// Path.
        file: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file cannot be written.
    #[error("{file}: cannot be written: {source}")]
    Write {
        /// Path.
        file: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// The content is of another kind.
    #[error("{file}: not {expected}: {found}")]
    NotA {
        /// Path.
        file: String,
        /// What it should be, with article.
        expected: &'static str,
        /// What it looks like.
        found: String,
    },
    /// Valid, but nothing in it.
    #[error("{file}: empty: {what}")]
    Empty {
        /// Path.
        file: String,
        /// What is missing.
        what: &'static str,
    },
    /// Trouble in a line of text.
    #[error("{file}: line {line}: {what}")]
    Line {
        /// Path.
        file: String,
        /// Counted from 1.
        line: usize,
        /// What is wrong there.
        what: String,
    },
    /// Trouble at a byte.
    #[error("{file}: byte {byte}: {what}")]
    Byte {
        /// Path.
        file: String,
        /// Counted from 0.
        byte: usize,
        /// What is wrong there.
        what: String,
    },
    /// Trouble in a counted element.
    #[error("{file}: {element} {index}: {what}")]
    Element {
        /// Path.
        file: String,
        /// Facet, face, cell, point, ...
        element: &'static str,
        /// Counted from 0.
        index: usize,
        /// What is wrong there.
        what: String,
    },
    /// Trouble with the file as a whole.
    #[error("{file}: {what}")]
    Format {
        /// Path.
        file: String,
        /// What is wrong.
        what: String,
    },
    /// Too much of something.
    #[error("{file}: {what} is {value}, the limit is {limit}")]
    Limit {
        /// Path.
        file: String,
        /// What there is too much of.
        what: String,
        /// How much.
        value: u64,
        /// How much may be.
        limit: u64,
    },
    /// No density reaches the threshold.
    #[error("{file}: empty at threshold {threshold}: the largest density is {largest}")]
    EmptyAtThreshold {
        /// Path.
        file: String,
        /// Where material begins.
        threshold: f64,
        /// The largest density in the file.
        largest: f32,
    },
    /// These are no densities.
    #[error(
        "{file}: {count} of {total} values lie outside 0..1 (smallest {smallest}, largest {largest}); the limit is {limit} of them"
    )]
    OutsideRange {
        /// Path.
        file: String,
        /// Values outside.
        count: usize,
        /// All values.
        total: usize,
        /// Smallest value.
        smallest: f32,
        /// Largest value.
        largest: f32,
        /// How many may lie outside.
        limit: usize,
    },
    /// An array of the wrong shape.
    #[error("{file}: the array has shape {shape:?}, a density has three axes (z, y, x)")]
    Shape {
        /// Path.
        file: String,
        /// Shape as the file states it.
        shape: Vec<usize>,
    },
    /// No array, or no one array, holds the densities.
    #[error("{file}: no array is {wanted}; there are: {present}")]
    Field {
        /// Path.
        file: String,
        /// What was looked for.
        wanted: String,
        /// Names of the arrays.
        present: String,
    },
    /// A STEP reference to an entity that does not exist.
    #[error(
        "{file}: line {line}: reference to #{id}, which is not defined ({count} such references)"
    )]
    DanglingReference {
        /// Path.
        file: String,
        /// Line of the first such reference.
        line: usize,
        /// The id.
        id: u64,
        /// How many such references there are.
        count: usize,
    },
    /// An option has no sense.
    #[error("option `{name}` is {value}, it must be {want}")]
    Option {
        /// Name of the option.
        name: &'static str,
        /// Its value.
        value: String,
        /// What it must be.
        want: &'static str,
    },
    /// Asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl IoError {
    /// What to do about it.
    pub fn hint(&self) -> Option<String> {
        let text = match self {
            Self::NotA { .. } => "readable are STL, OBJ, PLY, OFF, 3MF, STEP, VTI, VTU and NPY",
            Self::Empty { .. } => {
                "export the part again; look whether it was hidden or on another layer"
            }
            Self::Line { what, .. } if what.contains("comma") => {
                "export with a decimal point (locale C or English)"
            }
            Self::Line { .. } | Self::Byte { .. } => {
                "the file is damaged or cut short: export or copy it again"
            }
            Self::Limit { .. } => "raise the limit in the options if the file is really that large",
            Self::EmptyAtThreshold { .. } => {
                "lower `threshold`, or check that the array holds densities"
            }
            Self::OutsideRange { .. } => {
                "set `density_scale` (0.01 for percent), or name another array with `field`"
            }
            Self::Shape { .. } => "set `extrude_layers` to extrude a 2-D array along z",
            Self::Field { .. } => "name the array with `field`",
            Self::DanglingReference { .. } => "the STEP file is damaged: export it again",
            _ => return None,
        };
        Some(text.to_owned())
    }
}
