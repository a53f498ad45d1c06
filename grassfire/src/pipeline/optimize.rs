//! From a project file to densities and a raw proposal.

use std::path::{Path, PathBuf};

use serde_json::json;

use super::check::check_case;
use super::deliver::Delivery;
use super::error::{PipelineError, StageError};
use super::proposal::{self, ISO, kept};
use super::record::Record;
use super::{Outcome, finish, inputs};
use crate::Vec3;
use crate::case::{Built, Case, Shape};
use crate::io;
use crate::monitor::{Cancelled, Monitor};
use crate::remesh::{Draw, RemeshOptions, drawn_surface, iso_surface};
use crate::report::{InputFile, OptimizeBlock};
use crate::topopt::{self, Hull, OptimizeOptions, Optimized, Problem, State, TopoptError};
use crate::voxel::VoxelGrid;

/// The field whose surface is the proposal, without the steps of the voxels, and its array.
pub(super) const PROPOSAL: &str = "proposal.vti";
pub(super) const ARRAY: &str = "proposal";
/// Density of dropped pieces of a part that is drawn.
const BELOW: f32 = 0.49;
/// Saved states.
const STATE: &str = "optimize.state";
/// Files that `optimize` writes.
pub(super) const FILES: &[(&str, &str)] = &[
    ("density.vti", "densities of the optimization"),
    (
        PROPOSAL,
        "the optimized part without the steps of its voxels: its surface is at 0.5",
    ),
    (
        "proposal_raw.stl",
        "optimized part: the surface of density 0.5, with the non-design bodies",
    ),
    ("history.json", "all iterations of the optimization"),
    ("report.html", "report to read"),
    ("report.json", "report for programs"),
    ("manifest.json", "inputs, versions, times"),
];

/// One optimization: what to read, where to write, and how.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct OptimizeJob {
    /// The project file as read, with its settings changed.
    pub case: Case,
    /// Where it lies: its paths begin there, and its hash goes into the report.
    pub path: PathBuf,
    /// Folder for all results.
    pub output: PathBuf,
    /// What stands for the run in the report.
    pub command: String,
    /// Go on from the state saved in `output`, if there is one.
    pub resume: bool,
}

impl OptimizeJob {
    fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    /// Files that the case names.
    fn files(&self) -> Vec<PathBuf> {
        let case = &self.case;
        let bodies = case
            .non_design
            .iter()
            .flat_map(|b| b.shapes.iter().chain(&b.cut));
        let keep = case.keep_out.iter().flat_map(|k| &k.shapes);
        let shapes = case
            .design
            .space
            .iter()
            .chain(&case.design.cut)
            .chain(bodies)
            .chain(keep);
        let path = |shape: &Shape| match shape {
            Shape::File { path, .. } => Some(self.folder().join(path)),
            _ => None,
        };
        std::iter::once(self.path.clone())
            .chain(shapes.filter_map(path))
            .collect()
    }
}

/// Optimizes a case.
///
/// 1. Voxels, supports and loads are made and checked; nothing is written when that is refused.
/// 2. The optimization runs; its state is saved now and then if `optimize.save_every` says so.
/// 3. `density.vti`, `history.json`, `proposal_raw.stl` and the report are written; also when the user stopped the run.
///
/// # Errors
/// [`PipelineError`] names the stage and its cause.
pub fn optimize(job: &OptimizeJob, monitor: &Monitor) -> Result<Outcome, PipelineError> {
    let mut record = Record::start(&job.command);
    let done = optimized(&mut record, job, monitor)?;
    let options = &job.case.reconstruct.report;
    let outcome = finish(record, &done.delivery, &[], options, monitor)?;
    if done.cancelled {
        return Err(PipelineError {
            stage: "optimize",
            source: StageError::Cancelled(Cancelled),
        });
    }
    Ok(outcome)
}

/// A finished or stopped optimization.
pub(super) struct Done {
    pub(super) delivery: Delivery,
    pub(super) block: OptimizeBlock,
    /// 1 in full voxels, 0 in others.
    pub(super) full: VoxelGrid<f32>,
    /// The user stopped it.
    pub(super) cancelled: bool,
}

/// Name and SHA-256 of the project file, which comes first, and of the files that it names.
pub(super) fn fingerprints(
    job: &OptimizeJob,
    monitor: &Monitor,
) -> Result<Vec<InputFile>, StageError> {
    let files = job.files();
    let one = |path: &PathBuf| inputs::fingerprint(path, monitor);
    files.iter().map(one).collect()
}

/// All stages of [`optimize`] but the report.
pub(super) fn optimized(
    record: &mut Record,
    job: &OptimizeJob,
    monitor: &Monitor,
) -> Result<Done, PipelineError> {
    let case = &job.case;
    let built = record.stage("case", || -> Result<Built, StageError> {
        check_case(case, &job.path, monitor).map_err(|e| e.source)
    })?;
    let problem = &built.problem;
    record.report.inputs = record.stage("case", || fingerprints(job, monitor))?;
    let state_path = job.output.join(STATE);
    let resume = record.stage("case", || -> Result<Option<State>, StageError> {
        if !(job.resume && state_path.exists()) {
            return Ok(None);
        }
        Ok(Some(State::load(&state_path, problem, &case.optimize)?))
    })?;
    let delivery = record.stage("write", || Delivery::open(&job.output, FILES))?;
    let save = |state: &State| -> Result<(), TopoptError> {
        Ok(state.save(&state_path, problem, &case.optimize)?)
    };
    let result = record.stage("optimize", || {
        topopt::optimize(
            problem,
            &case.optimize,
            &case.solver,
            resume,
            &save,
            monitor,
        )
    })?;
    let block = block(problem, &result);
    record.report.optimize = Some(block.clone());
    record.stage("write", || {
        write(&delivery, problem, &case.optimize, &result, monitor)
    })?;
    Ok(Done {
        full: full(problem, &result),
        delivery,
        block,
        cancelled: result.cancelled,
    })
}

/// Values on the voxels of a problem.
fn grid(problem: &Problem, values: Vec<f32>) -> VoxelGrid<f32> {
    VoxelGrid {
        origin: problem.origin + Vec3::repeat(problem.h / 2.0),
        spacing: problem.h,
        dims: problem.dims,
        values,
    }
}

/// The full voxels.
fn full(problem: &Problem, result: &Optimized) -> VoxelGrid<f32> {
    let solid = result.binary.solid.iter();
    grid(problem, solid.map(|&s| f32::from(u8::from(s))).collect())
}

/// The `optimize` block of the report.
fn block(problem: &Problem, result: &Optimized) -> OptimizeBlock {
    let history = &result.history;
    let count = history.len().max(1) as f64;
    let last = history.last().cloned().unwrap_or_default();
    let cases = problem.cases.len().max(1) as f64;
    let active = (0..problem.labels.len())
        .filter(|&v| problem.is_active(v))
        .count();
    let full = result.binary.solid.iter().filter(|&&s| s).count();
    OptimizeBlock {
        elements: active,
        grid: problem.dims,
        voxel: problem.h,
        iterations: last.iteration,
        converged: result.converged,
        volume_fraction: last.volume_fraction,
        volume: full as f64 * problem.h.powi(3),
        first_compliance: result.first_compliance,
        compliance: last.compliance,
        case_compliance: result.cases.clone(),
        grayness: last.grayness,
        change: last.change,
        seconds_per_iteration: history.iter().map(|h| h.seconds).sum::<f64>() / count,
        solver_iterations: history
            .iter()
            .map(|h| h.solver_iterations as f64)
            .sum::<f64>()
            / (count * cases),
        fallbacks: result.fallbacks,
        threshold: result.binary.threshold,
        components: result.binary.components,
        undercut_volume: result.binary.undercut_volume,
        symmetry_error: result.symmetry_error.max(result.binary.symmetry_error),
    }
}

/// Densities, history and the raw proposal.
fn write(
    delivery: &Delivery,
    problem: &Problem,
    options: &OptimizeOptions,
    result: &Optimized,
    monitor: &Monitor,
) -> Result<(), StageError> {
    let grid = |values| grid(problem, values);
    let density = grid(result.rho.iter().map(|&r| r as f32).collect());
    let hull = Hull::of(problem, options)?;
    let draw = hull.as_ref().map(|hull| Draw {
        axis: hull.axis,
        parting: hull.parting(),
    });
    let full = full(problem, result);
    // Capped below the surface, columns of a draw still fall away from the parting.
    let dropped = if draw.is_some() { BELOW } else { 0.0 };
    let surface = grid(kept(&density.values, &full, dropped));
    let smooth = proposal::field(problem, &result.smooth, &full, dropped, monitor)?;
    let label = grid(problem.labels.iter().map(|&l| f32::from(l)).collect());
    io::write_vti(
        &delivery.path("density.vti"),
        &[("density", &density), ("full", &full), ("label", &label)],
    )?;
    io::write_vti(&delivery.path(PROPOSAL), &[(ARRAY, &smooth)])?;
    let history = format!("{:#}\n", json!(result.history));
    io::atomic_write(&delivery.path("history.json"), |out| {
        out.write_all(history.as_bytes())
    })?;
    let remesh = RemeshOptions::default();
    let mesh = match draw {
        Some(draw) => drawn_surface(&surface, ISO, draw, &remesh, monitor)?,
        None => iso_surface(&surface, ISO, &remesh, monitor)?,
    };
    delivery.stl("proposal_raw.stl", &mesh)?;
    Ok(())
}
