//! The same loads on the full voxels that an optimization left.

use std::path::Path;

use super::conditions::Conditions;
use super::{Fractions, GridResult, STAGE, VerifyError, measure};
use crate::Vec3;
use crate::case::{self, Case, conditions_on};
use crate::fe::SolverOptions;
use crate::monitor::Monitor;
use crate::topopt::{DESIGN, OUTSIDE};
use crate::voxel::VoxelGrid;

/// Full voxels solved as they are and with every voxel cut into eight.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ProposalResult {
    /// Volume of the full voxels, mm3.
    pub volume: f64,
    /// On the voxels of the optimization.
    pub coarse: GridResult,
    /// On voxels of half the edge: its figures count.
    pub fine: GridResult,
}

/// Origins closer than this share of a voxel are the same.
const SAME: f64 = 1e-3;

/// Solves the load cases on the full voxels (above 0.5) of an optimization of the same case.
///
/// 1. The voxels of the case are built; those of the design that are not full are taken out.
/// 2. Supports and loads are those of the optimization, also on the voxels of half the edge, whose nodes are chosen with
///    the tolerances of the whole ones.
///
/// # Errors
/// [`VerifyError::Proposal`] when the grids differ.
pub(super) fn solve(
    case: &Case,
    folder: &Path,
    full: &VoxelGrid<f32>,
    options: &SolverOptions,
    monitor: &Monitor,
) -> Result<ProposalResult, VerifyError> {
    let built = case::build(case, folder, monitor)?;
    let mut problem = built.problem;
    let corner = full.origin - Vec3::repeat(full.spacing / 2.0);
    let apart = (corner - problem.origin).amax() / problem.h;
    if full.dims != problem.dims || (full.spacing / problem.h - 1.0).abs() > SAME || apart > SAME {
        return Err(VerifyError::Proposal {
            dims: full.dims,
            h: full.spacing,
            wanted: problem.dims,
            wanted_h: problem.h,
        });
    }
    for (label, &value) in problem.labels.iter_mut().zip(&full.values) {
        if *label == DESIGN && value <= 0.5 {
            *label = OUTSIDE;
        }
    }
    let active = (0..problem.labels.len()).filter(|&v| problem.is_active(v));
    let volume = active.count() as f64 * problem.h.powi(3);
    let mut grids = Vec::new();
    for split in 1..=2 {
        let what = format!("proposal, voxels of {:.4} mm", problem.h / split as f64);
        monitor.step(STAGE, &what, 0.5 + 0.1 * split as f64)?;
        let problem = problem.cut(split);
        let found = conditions_on(case, &problem, folder, monitor)?;
        let conditions = Conditions {
            fixed: found.fixed,
            springs: found.springs,
            loads: found.cases.into_iter().map(|c| c.forces).collect(),
        };
        let value = |v: usize| f64::from(u8::from(problem.is_active(v)));
        let grid = Fractions {
            origin: problem.origin,
            h: problem.h,
            dims: problem.dims,
            values: (0..problem.labels.len()).map(value).collect(),
        };
        grids.push(measure::solve(
            case, grid, conditions, 1.0, options, monitor,
        )?);
    }
    let fine = grids.pop().unwrap_or_default();
    let coarse = grids.pop().unwrap_or_default();
    Ok(ProposalResult {
        volume,
        coarse,
        fine,
    })
}
