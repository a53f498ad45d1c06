//! Why solidification cannot be computed.

use crate::Vec3;
use crate::monitor::Cancelled;
use crate::remesh::RemeshError;

/// Why solidification cannot be computed.
#[derive(Debug, thiserror::Error)]
pub enum SolidifyError {
    /// An option is out of its range.
    #[error("solidify.{name} is {value}, allowed is {allowed}")]
    Option {
        /// Name of the option.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What is allowed.
        allowed: &'static str,
    },
    /// A material has no data where it needs some.
    #[error("{material}: {what}")]
    Material {
        /// Name of the material.
        material: String,
        /// What is missing or wrong.
        what: String,
    },
    /// The part could not be put on a grid.
    #[error("the part cannot be put on a grid of {cell} mm")]
    Grid {
        /// Edge of a cell, mm.
        cell: f64,
        /// Why.
        source: RemeshError,
    },
    /// Too many cells.
    #[error("cells of {cell} mm make {cells} cells, solidify.max_cells allows {limit}")]
    TooMany {
        /// Edge of a cell, mm.
        cell: f64,
        /// Cells that are needed.
        cells: usize,
        /// Cells allowed.
        limit: usize,
    },
    /// A feeder stands away from the part.
    #[error("feeder {feeder} at ({:.1}, {:.1}, {:.1}) is {distance:.1} mm from the part, {limit:.1} mm are allowed", place.x, place.y, place.z)]
    Feeder {
        /// Number of the feeder.
        feeder: usize,
        /// Its place, mm.
        place: Vec3,
        /// Distance to the part, mm.
        distance: f64,
        /// Largest distance allowed, mm.
        limit: f64,
    },
    /// The mould is smaller than the part or too thin to hold its heat.
    #[error("solidify.padding is {padding} mm: the sand must be at least {least:.1} mm thick")]
    Mould {
        /// Sand around the part, mm.
        padding: f64,
        /// Least thickness, mm.
        least: f64,
    },
    /// Some metal does not freeze.
    #[error("{cells} cells are still liquid after {time:.0} s and {steps} steps")]
    NotFrozen {
        /// Cells that are not solid.
        cells: usize,
        /// Time reached, s.
        time: f64,
        /// Steps made.
        steps: usize,
    },
    /// The user asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl SolidifyError {
    /// What the user can do about it.
    pub fn hint(&self) -> Option<String> {
        match self {
            Self::Option { .. } => Some("`grassfire schema` lists all options".to_owned()),
            Self::Material { .. } => Some(
                "tables are pairs of temperature and value in ascending order; `grassfire schema` tells the units"
                    .to_owned(),
            ),
            Self::Grid { source, .. } => source.hint(),
            Self::TooMany { .. } => {
                Some("raise solidify.cell, or solidify.max_cells when memory allows (about 60 bytes a cell)".to_owned())
            }
            Self::Feeder { .. } => Some("place the feeder on the part, in its coordinates".to_owned()),
            Self::Mould { .. } => Some("leave solidify.padding out to have it chosen".to_owned()),
            Self::NotFrozen { .. } => {
                Some("the mould takes no more heat: give it more sand with solidify.padding".to_owned())
            }
            Self::Cancelled(_) => None,
        }
    }
}
