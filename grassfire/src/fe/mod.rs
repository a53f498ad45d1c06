//! Linear elasticity on voxels: matrix-free trilinear hexahedra, geometric multigrid, conjugate gradients.
//!
//! Units: mm, N, MPa. One element a voxel of a regular grid; its modulus may be anything from 0 (not there) upwards.

mod cholesky;
mod coarse;
mod element;
mod energy;
mod frame;
mod galerkin;
mod grid;
mod islands;
mod kernel;
pub(crate) mod material;
mod matrix_free;
mod mechanism;
mod multigrid;
mod parity;
mod pcg;
mod rigid;
mod rows;
mod smoother;
mod solver;
mod springs;
mod stencil;
mod stress;
mod transfer;
mod weight;
mod window;

#[cfg(test)]
mod tests;

pub(crate) use cholesky::cholesky;
pub(crate) use grid::cut;
pub use islands::{Component, components};
pub use mechanism::{RIGID_MODES, free_modes, free_modes_of};
pub use pcg::SolveStats;
pub use solver::{Solver, VoxelModel, memory_estimate};
pub use stress::von_mises;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::monitor::Cancelled;

/// Options of the solver.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SolverOptions {
    /// Residual over load at which a solution is accepted.
    pub tolerance: f64,
    /// Iterations of conjugate gradients at most.
    pub max_iterations: usize,
    /// Degree of the Chebyshev smoother on the finest grid; twice that on coarser ones.
    pub smoother_degree: usize,
    /// The smoother works on the eigenvalues above the largest one over this; over twice this on coarser grids.
    pub smoother_ratio: f64,
    /// Unknowns of the coarsest grid at most; it is solved directly. Small problems have a smaller one.
    pub coarsest: usize,
    /// Memory that a solver may take, MB.
    pub max_memory: f64,
}

impl Default for SolverOptions {
    fn default() -> Self {
        Self {
            tolerance: 1e-5,
            max_iterations: 400,
            smoother_degree: 2,
            smoother_ratio: 8.0,
            coarsest: 13_000,
            max_memory: 16_000.0,
        }
    }
}

/// Why a finite element computation was refused or failed.
#[derive(Debug, thiserror::Error)]
pub enum FeError {
    /// Nothing to compute.
    #[error("the grid of {dims:?} voxels with an edge of {h} mm has no element with stiffness")]
    Empty {
        /// Voxels along x, y, z.
        dims: [usize; 3],
        /// Edge, mm.
        h: f64,
    },
    /// The estimate is above the limit.
    #[error("{voxels:.0} voxels need about {needed:.0} MB, the limit is {limit:.0} MB")]
    Memory {
        /// Voxels that may have stiffness.
        voxels: f64,
        /// Estimate, MB.
        needed: f64,
        /// Limit, MB.
        limit: f64,
    },
    /// A force on a node that no material touches.
    #[error("load case {case} pulls at node {node:?}, which touches no voxel with stiffness")]
    LoadOnVoid {
        /// Number of the load case, from 0.
        case: usize,
        /// The node.
        node: [usize; 3],
    },
    /// The coarsest matrix could not be factored.
    #[error("the coarsest matrix ({unknowns} unknowns) cannot be factored: {what}")]
    Factor {
        /// Its size.
        unknowns: usize,
        /// What the factorization said.
        what: String,
    },
    /// The iteration did not reach the tolerance.
    #[error(
        "load case {case}: the residual is {residual:.1e} after {iterations} iterations, {tolerance:.0e} is wanted"
    )]
    NotConverged {
        /// Number of the load case, from 0.
        case: usize,
        /// Iterations made.
        iterations: usize,
        /// Residual over load.
        residual: f64,
        /// What is wanted.
        tolerance: f64,
    },
    /// An option is out of range.
    #[error("solver.{name} is {value}, {wanted} is wanted")]
    Option {
        /// Name.
        name: &'static str,
        /// Value.
        value: f64,
        /// What is wanted.
        wanted: &'static str,
    },
    /// The user asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl FeError {
    /// What the user can do about it.
    pub fn hint(&self) -> Option<String> {
        match self {
            Self::Empty { .. } => Some("check the units of the design space and grid.h".into()),
            Self::Memory {
                needed, limit, ..
            } => Some(format!(
                "a grid.h {:.2} times as large fits; or raise solver.max_memory",
                (needed / limit).cbrt() * 1.01
            )),
            Self::NotConverged { .. } => Some(
                "parts that hang on nothing slow the solver down; raise optimize.e_min to 1e-3 or solver.max_iterations"
                    .into(),
            ),
            Self::LoadOnVoid { .. } => Some("put loads on non-design bodies".into()),
            Self::Option { .. } => Some("`grassfire schema` lists all options".into()),
            Self::Factor { .. } | Self::Cancelled(_) => None,
        }
    }
}
