//! Topology optimization on voxels: minimum compliance with a bound on the volume (SIMP).
//!
//! The chain from the variables to the densities is: symmetry, density filter, draw hull, projection; every map has its
//! exact transpose, through which the gradients go back.

mod chain;
mod filter;
mod finish;
mod helmholtz;
mod hull;
mod interpolation;
mod mma;
mod oc;
mod options;
mod problem;
mod projection;
mod run;
mod smooth;
mod state;
mod symmetry;

#[cfg(test)]
mod tests;

pub use chain::{Chain, Fields};
pub use filter::Filter;
pub use finish::{Binary, binary};
pub use hull::Hull;
pub use mma::{Mma, MmaOptions};
pub use options::{
    Boundary, DrawOptions, FilterKind, Objective, OptimizeOptions, Parting, Plane, SymmetryPlane,
    UpdateKind,
};
pub use problem::{CORE, DESIGN, FROZEN, LoadCase, OUTSIDE, Problem};
pub use run::{HistoryEntry, Optimized, optimize, validate};
pub use smooth::{Smooth, smooth, split, spread};
pub use state::State;

use crate::fe::FeError;
use crate::io::IoError;
use crate::monitor::Cancelled;

/// Why an optimization was refused or failed.
#[derive(Debug, thiserror::Error)]
pub enum TopoptError {
    /// An option is out of range.
    #[error("optimize.{name} is {value}, {wanted} is wanted")]
    Option {
        /// Name.
        name: &'static str,
        /// Value.
        value: f64,
        /// What is wanted.
        wanted: &'static str,
    },
    /// The bound on the volume cannot be met or means nothing.
    #[error(
        "optimize.volume_fraction is {value}: the non-design bodies alone take {frozen:.4} of the space"
    )]
    VolumeFraction {
        /// As given.
        value: f64,
        /// Share of the frozen voxels.
        frozen: f64,
    },
    /// Optimality criteria want compliances that fall with material.
    #[error(
        "optimize.update is \"oc\", but load case {name:?} has gravity: more material may bend the part more"
    )]
    Weight {
        /// The load case.
        name: String,
    },
    /// There is nothing to design.
    #[error("the design space holds no voxel to design ({frozen} are frozen, {outside} outside)")]
    NoDesign {
        /// Frozen voxels.
        frozen: usize,
        /// Voxels outside.
        outside: usize,
    },
    /// The draw direction is not along an axis of the grid.
    #[error("optimize.draw.dir is {dir:?}; a direction along x, y or z is wanted")]
    DrawDirection {
        /// As given.
        dir: [f64; 3],
    },
    /// A plane does not lie on a face or the centre of voxels.
    #[error(
        "{what} at {at} mm lies between voxels: with grid.h {h} mm the nearest is {nearest} mm"
    )]
    Plane {
        /// Which plane.
        what: &'static str,
        /// Where, mm.
        at: f64,
        /// Edge of a voxel, mm.
        h: f64,
        /// A plane that fits, mm.
        nearest: f64,
    },
    /// Frozen material cannot be drawn.
    #[error(
        "the non-design bodies cannot be drawn: {count} empty voxels lie in their shadow, first {places}"
    )]
    FrozenUndercut {
        /// Voxels in the shadow.
        count: usize,
        /// Some of them, with their centres in mm.
        places: String,
    },
    /// A saved state belongs to another problem.
    #[error("{file} was saved by another problem: {what}")]
    State {
        /// Path.
        file: String,
        /// What differs.
        what: String,
    },
    /// The finite element solver.
    #[error(transparent)]
    Fe(#[from] FeError),
    /// Files.
    #[error(transparent)]
    Io(#[from] IoError),
    /// The user asked to stop before there was any result.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl TopoptError {
    /// What the user can do about it.
    pub fn hint(&self) -> Option<String> {
        match self {
            Self::Fe(e) => e.hint(),
            Self::Io(e) => e.hint(),
            Self::Option { .. } => Some("`grassfire schema` lists all options".into()),
            Self::VolumeFraction { frozen, .. } => {
                Some(format!("give a number between {frozen:.3} and 1"))
            }
            Self::Weight { .. } => Some("leave optimize.update out: \"mma\" can do it".into()),
            Self::NoDesign { .. } => {
                Some("check the design space, and that grid.h is finer than its walls".into())
            }
            Self::DrawDirection { .. } => {
                Some("turn the part so that it is drawn along an axis".into())
            }
            Self::Plane { nearest, .. } => Some(format!(
                "move it to {nearest}, or choose grid.h or grid.origin to suit"
            )),
            Self::FrozenUndercut { .. } => Some(
                "where a core is put in, say so: a keep_out with core = true over the empty space"
                    .into(),
            ),
            Self::State { .. } => Some("start afresh without --resume".into()),
            Self::Cancelled(_) => None,
        }
    }
}
