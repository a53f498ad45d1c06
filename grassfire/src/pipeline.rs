//! The whole chain: a mesh file in, STEP and report out.

use std::error::Error;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::monitor::{Cancelled, Monitor};
use crate::report::{Report, ReportOptions};

/// Options of all stages; one table a stage.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ReconstructOptions {
    /// Threads; 0 takes all cores.
    pub threads: usize,
    /// Reading of files.
    pub read: ReadOptions,
    /// Repair of the mesh.
    pub repair: RepairOptions,
    /// Voxel remesh.
    pub remesh: RemeshOptions,
    /// Quad skeleton.
    pub skeleton: SkeletonOptions,
    /// Report.
    pub report: ReportOptions,
}

/// Options of reading.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ReadOptions {
    /// Density at which material begins.
    pub threshold: f64,
}

/// Options of repair.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RepairOptions {
    /// Refuse a mesh that needs repair.
    pub strict: bool,
}

/// Options of the remesh.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RemeshOptions {
    /// Edge of a voxel, mm.
    pub voxel: Option<f64>,
    /// Narrowest tunnel that is kept, voxels.
    pub min_tunnel: f64,
}

/// Options of the skeleton.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SkeletonOptions {
    /// Edge of a quad, mm.
    pub quad_size: Option<f64>,
}

/// One reconstruction.
#[derive(Debug, Clone, PartialEq)]
pub struct ReconstructJob {
    /// The mesh or density.
    pub part: PathBuf,
    /// Bodies that must be in the solid as given.
    pub non_design: Vec<PathBuf>,
    /// The design space.
    pub design_space: Option<PathBuf>,
    /// A skeleton drawn elsewhere.
    pub skeleton: Option<PathBuf>,
    /// Folder of the results.
    pub output: PathBuf,
    /// What stands for the run in the report.
    pub command: String,
    /// Options of all stages.
    pub options: ReconstructOptions,
}

/// What a finished run gives.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// The report, as written.
    pub report: Report,
    /// Names of the checks that are not met.
    pub failed_checks: Vec<String>,
}

/// Why a run stopped.
#[derive(Debug, thiserror::Error)]
pub enum PipelineError {
    /// The input cannot be used; nothing was written.
    #[error("{stage}")]
    Input {
        /// Stage that refused.
        stage: &'static str,
        /// Why.
        source: Box<dyn Error + Send + Sync>,
        /// What to do about it.
        hint: Option<String>,
    },
    /// A stage failed on a sound input.
    #[error("{stage}")]
    Solver {
        /// Stage that failed.
        stage: &'static str,
        /// Why.
        source: Box<dyn Error + Send + Sync>,
        /// What to do about it.
        hint: Option<String>,
    },
    /// The user stopped the run.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl PipelineError {
    /// Exit code of the command line.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Input { .. } => 2,
            Self::Solver { .. } => 3,
            Self::Cancelled(_) => 130,
        }
    }

    /// What the user can do about it.
    pub fn hint(&self) -> Option<String> {
        match self {
            Self::Input { hint, .. } | Self::Solver { hint, .. } => hint.clone(),
            Self::Cancelled(_) => None,
        }
    }
}

/// Runs all stages.
///
/// # Errors
/// [`PipelineError`] names the stage.
pub fn reconstruct(job: &ReconstructJob, monitor: &Monitor) -> Result<Outcome, PipelineError> {
    monitor.step("input", "reading", 0.0)?;
    let refuse = |source| PipelineError::Input {
        stage: "input",
        source,
        hint: None,
    };
    let bytes = std::fs::read(&job.part)
        .map_err(|e| refuse(format!("{}: {e}", job.part.display()).into()))?;
    if bytes.is_empty() {
        return Err(refuse(
            format!("{}: the file is empty", job.part.display()).into(),
        ));
    }
    Err(PipelineError::Solver {
        stage: "remesh",
        source: "the stages are not joined yet".into(),
        hint: None,
    })
}
