//! A project file looked at, without any optimization.

use std::path::{Path, PathBuf};

use super::error::{PipelineError, StageError};
use crate::case::{self, Built, Case};
use crate::io::{IoError, atomic_write};
use crate::monitor::Monitor;
use crate::report::ReportError;
use crate::report::render::{PictureSize, conditions::conditions};
use crate::topopt;

/// Builds the voxels of a case and checks everything that can be checked without solving.
///
/// # Errors
/// [`PipelineError`] with the stage `case`.
pub fn check_case(case: &Case, path: &Path, monitor: &Monitor) -> Result<Built, PipelineError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let fail = |source: StageError| PipelineError {
        stage: "case",
        source,
    };
    let built = case::build(case, folder, monitor).map_err(|e| fail(e.into()))?;
    topopt::validate(&built.problem, &case.optimize, &case.solver).map_err(|e| fail(e.into()))?;
    Ok(built)
}

/// Writes pictures of a case's voxels with what holds and loads them into `folder`, which is made where it is missing; their paths.
///
/// # Errors
/// [`PipelineError`] with the stage `case`.
pub fn draw_case(built: &Built, folder: &Path) -> Result<Vec<PathBuf>, PipelineError> {
    let fail = |source: StageError| PipelineError {
        stage: "case",
        source,
    };
    let cannot = |source| IoError::Write {
        file: folder.display().to_string(),
        source,
    };
    std::fs::create_dir_all(folder).map_err(|e| fail(cannot(e).into()))?;
    let pictures = conditions(&built.problem, PictureSize::default());
    let pictures = pictures.map_err(|e| fail(ReportError::from(e).into()))?;
    let mut paths = Vec::new();
    for (picture, name) in pictures.iter().zip(["check.png", "check-below.png"]) {
        let path = folder.join(name);
        atomic_write(&path, |out| out.write_all(&picture.png)).map_err(|e| fail(e.into()))?;
        paths.push(path);
    }
    Ok(paths)
}
