//! The whole chain of a project file: optimize, reconstruct, verify, in one folder and one report.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::deliver::{self, Delivery};
use super::error::{PipelineError, StageError};
use super::optimize::{self, OptimizeJob};
use super::record::Record;
use super::{
    Loads, Outcome, ReconstructJob, exchange, finish, inputs, rebuild, tetrahedra, verify,
};
use crate::case::Case;
use crate::io::{self, IoError};
use crate::monitor::{Cancelled, Monitor};
use crate::remesh::RemeshOptions;
use crate::report::{InputFile, OptimizeBlock, Picture};
use crate::topopt;
use crate::verify::{Verified, VerifyOptions, check_options};
use crate::voxel::VoxelGrid;

/// Where a run ends.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Stage {
    /// After the optimization.
    Optimize,
    /// After the reconstruction.
    Reconstruct,
    /// After the proof of stiffness.
    #[default]
    Verify,
}

/// One run of a project file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RunJob {
    /// The project file as read, with its settings changed.
    pub case: Case,
    /// Where it lies: its paths begin there, and its hash goes into the report.
    pub path: PathBuf,
    /// Folder for all results; made when it does not exist.
    pub output: PathBuf,
    /// What stands for the run in the report.
    pub command: String,
    /// The last stage.
    pub to: Stage,
}

/// What an earlier optimization was made from, and what it left.
const CACHE: &str = "optimize.cache.json";
/// The files that an optimization leaves.
const LEFT: [&str; 4] = [
    "density.vti",
    optimize::PROPOSAL,
    "proposal_raw.stl",
    "history.json",
];

/// Optimizes, reconstructs and verifies a project file.
///
/// 1. The optimization: taken from an earlier run into the same folder when its inputs and options have not changed and
///    its files are still as they were (`cached` in the stages of the report).
/// 2. Reconstruction of the densities, whose grid tells which holes are noise, united with the exact non-design bodies of
///    the project file. With a draw direction the mould of the finished part is looked at too.
/// 3. Verification of the finished part, and of the full voxels of the optimization for comparison.
///
/// The report has the blocks of all of them; their stages keep their names.
///
/// # Errors
/// [`PipelineError`] names the stage and its cause. A verification that fails is a failed check: the part is written.
pub fn run(job: &RunJob, monitor: &Monitor) -> Result<Outcome, PipelineError> {
    let mut record = Record::start(&job.command);
    record.stage("options", || check(&job.case))?;
    let options = &job.case.reconstruct.report;
    let (full, cancelled) = optimized(&mut record, job, monitor)?;
    let read = std::mem::take(&mut record.report.inputs);
    let later = files(&[deliver::FILES, verify::RESULTS]);
    record.stage("write", || Delivery::open(&job.output, &later))?;
    let delivery = Delivery::over(&job.output, &files(&[optimize::FILES, &later]));
    if job.to == Stage::Optimize || cancelled {
        record.report.inputs = read;
        let outcome = finish(record, &delivery, &[], options, monitor)?;
        return if cancelled {
            Err(stopped())
        } else {
            Ok(outcome)
        };
    }
    let grid = record.report.optimize.as_ref().map_or([0; 3], |o| o.grid);
    let rebuilt = rebuild(&mut record, &reconstruction(job, grid), monitor)?;
    record.report.inputs = read;
    let mut pictures: Vec<Picture> = rebuilt.pictures;
    if job.to == Stage::Reconstruct {
        return finish(record, &delivery, &pictures, options, monitor);
    }
    let (case, mesh) = (&job.case, &rebuilt.mesh);
    let found = match verify::prove(&mut record, case, folder(job), mesh, Some(&full), monitor) {
        Ok(found) => found,
        Err(error) if error.is_cancelled() => return Err(error),
        Err(error) => {
            // The part is there and reported: what is missing is its proof.
            let text = format!("the stiffness could not be computed: {}", error.source);
            monitor.warn("verify", text.clone());
            let mut outcome = finish(record, &delivery, &pictures, options, monitor)?;
            outcome.failed_checks.push(text);
            return Ok(outcome);
        }
    };
    warn_steps(&record, &found, monitor);
    record.stage("write", || verify::result(&delivery, &found))?;
    let part = job.output.join("part.step");
    if let Err(error) = tetrahedra::prove(
        &mut record,
        case,
        folder(job),
        &part,
        mesh,
        &delivery,
        monitor,
    ) {
        if error.is_cancelled() {
            return Err(error);
        }
        monitor.warn("tetrahedra", format!("left out: {}", error.source));
    }
    pictures.extend(record.stage("pictures", || verify::pictures(&found, mesh, options))?);
    finish(record, &delivery, &pictures, options, monitor)
}

/// Full voxels that are softer than the densities by more than this factor hang together by corners.
const SOFTER: f64 = 1.1;

/// Warns where the full voxels of the optimization do not hold what its densities did.
fn warn_steps(record: &Record, found: &Verified, monitor: &Monitor) {
    let optimized = record.report.optimize.as_ref();
    let grey = optimized.map_or(0.0, |o| o.case_compliance.iter().sum::<f64>() / 2.0);
    let full = found
        .proposal
        .as_ref()
        .map_or(0.0, |p| p.coarse.strain_energy);
    if grey > 0.0 && full > SOFTER * grey {
        let text = format!(
            "the full voxels of the optimization are {:.2} times as soft as its densities: walls hang together by the corners of their voxels; --set optimize.robust=0.03 makes them hold",
            full / grey
        );
        monitor.warn("verify", text);
    }
}

/// Refuses options of late stages before anything is computed.
fn check(case: &Case) -> Result<(), StageError> {
    exchange::check(&case.reconstruct)?;
    check_options(&case.verify)?;
    Ok(crate::tet::check_options(&case.verify.tetrahedra)?)
}

fn stopped() -> PipelineError {
    PipelineError {
        stage: "optimize",
        source: StageError::Cancelled(Cancelled),
    }
}

fn folder(job: &RunJob) -> &Path {
    job.path.parent().unwrap_or(Path::new(""))
}

/// Lists of files in one, each name once.
fn files(lists: &[&[(&'static str, &'static str)]]) -> Vec<(&'static str, &'static str)> {
    let mut out: Vec<(&str, &str)> = Vec::new();
    for &(name, text) in lists.iter().copied().flatten() {
        // The report comes last, as in all folders.
        out.retain(|(known, _)| *known != name);
        out.push((name, text));
    }
    out
}

/// The reconstruction of what the optimization on `grid` left.
fn reconstruction(job: &RunJob, grid: [usize; 3]) -> ReconstructJob {
    let case = &job.case;
    let mut options = case.reconstruct.clone();
    if let (None, Some(draw)) = (options.mould.draw, &case.optimize.draw) {
        options.mould.draw = Some(draw.dir);
    }
    options.read.field = Some(optimize::ARRAY.to_owned());
    let filter = case.optimize.radius(case.grid.h);
    if options.remesh.min_tunnel == RemeshOptions::default().min_tunnel {
        // The filter leaves no window narrower than its radius; what is narrower is the steps of a thin wall.
        options.remesh.min_tunnel = options.remesh.min_tunnel.min(filter);
    }
    // Widths are meant in voxels of the optimization.
    options.remesh.min_tunnel *= topopt::split(grid, filter) as f64;
    ReconstructJob {
        part: job.output.join(optimize::PROPOSAL),
        bodies: case.non_design.clone(),
        folder: folder(job).to_owned(),
        loads: Some(Loads {
            case: case.clone(),
            path: job.path.clone(),
        }),
        output: job.output.clone(),
        command: job.command.clone(),
        options,
        ..ReconstructJob::default()
    }
}

/// The stage `optimize`, or what an earlier run left of it: the full voxels, and whether the user stopped it.
fn optimized(
    record: &mut Record,
    job: &RunJob,
    monitor: &Monitor,
) -> Result<(VoxelGrid<f32>, bool), PipelineError> {
    let work = OptimizeJob {
        case: job.case.clone(),
        path: job.path.clone(),
        output: job.output.clone(),
        command: job.command.clone(),
        resume: false,
    };
    let inputs = record.stage("case", || optimize::fingerprints(&work, monitor))?;
    let key = key(&job.case, &inputs);
    if let Some(block) = cached(&job.output, &key) {
        record.report.inputs = inputs;
        record.report.optimize = Some(block);
        record.cached("optimize");
        let path = job.output.join(LEFT[0]);
        let options = &job.case.reconstruct.read;
        let full = record.stage("read", || verify::full_voxels(&path, options, monitor))?;
        return Ok((full, false));
    }
    let done = optimize::optimized(record, &work, monitor)?;
    if !done.cancelled {
        record.stage("write", || remember(&done.block, &job.output, &key))?;
    }
    Ok((done.full, done.cancelled))
}

/// What is known of an earlier optimization.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
struct Cache {
    /// Hash of everything that it depends on.
    key: String,
    /// Hashes of the files that it left.
    files: BTreeMap<String, String>,
    /// Its figures.
    block: OptimizeBlock,
}

/// Hash of what an optimization depends on: this program, the case without what other stages take from it, the files it
/// names. Threads are no part: results do not depend on them.
fn key(case: &Case, inputs: &[InputFile]) -> String {
    let own = Case {
        title: String::new(),
        threads: 0,
        reconstruct: super::ReconstructOptions::default(),
        verify: VerifyOptions::default(),
        ..case.clone()
    };
    // The first input is the project file itself, whose contents are in `own`.
    let files: Vec<&str> = inputs.iter().skip(1).map(|f| f.sha256.as_str()).collect();
    let text = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "part": optimize::PROPOSAL,
        "case": own,
        "files": files,
    });
    inputs::hash(text.to_string().as_bytes())
}

/// The figures of an earlier optimization with this key whose files are as it left them.
fn cached(output: &Path, key: &str) -> Option<OptimizeBlock> {
    let text = std::fs::read(output.join(CACHE)).ok()?;
    let cache: Cache = serde_json::from_slice(&text).ok()?;
    let same = |name: &&str| -> bool {
        let bytes = std::fs::read(output.join(name)).ok();
        bytes.map(|b| inputs::hash(&b)).as_ref() == cache.files.get(*name)
    };
    (cache.key == key && LEFT.iter().all(same)).then_some(cache.block)
}

/// Copies what an optimization left to another folder: a run of the same problem there takes it instead of optimizing again,
/// whatever its later stages are.
///
/// # Errors
/// Files that cannot be read or written: [`IoError`] in the stage `write`.
pub fn share_optimization(from: &Path, to: &Path) -> Result<(), PipelineError> {
    let copy = |name: &&str| std::fs::copy(from.join(name), to.join(name)).map(drop);
    let copied =
        std::fs::create_dir_all(to).and_then(|()| LEFT.iter().chain([&CACHE]).try_for_each(copy));
    copied.map_err(|source| PipelineError {
        stage: "write",
        source: StageError::Io(IoError::Write {
            file: to.display().to_string(),
            source,
        }),
    })
}

/// Notes what the optimization was made from.
fn remember(block: &OptimizeBlock, output: &Path, key: &str) -> Result<(), StageError> {
    let mut cache = Cache {
        key: key.to_owned(),
        block: block.clone(),
        ..Cache::default()
    };
    for name in LEFT {
        let path = output.join(name);
        let file = inputs::fingerprint(&path, &Monitor::default())?;
        cache.files.insert(name.to_owned(), file.sha256);
    }
    let text = format!("{:#}\n", json!(cache));
    Ok(io::atomic_write(&output.join(CACHE), |out| {
        out.write_all(text.as_bytes())
    })?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cached_optimization_is_used_only_for_the_same_inputs_and_files() {
        let folder = tempfile::tempdir().expect("a folder");
        let output = folder.path();
        for name in LEFT {
            std::fs::write(output.join(name), name).expect("writable");
        }
        let mut case = Case::default();
        let file = |sha256: &str| InputFile {
            sha256: sha256.to_owned(),
            ..InputFile::default()
        };
        let files = [file("the case"), file("a body")];
        let first = key(&case, &files);
        let block = OptimizeBlock {
            iterations: 7,
            compliance: 0.1,
            ..OptimizeBlock::default()
        };
        remember(&block, output, &first).expect("writable");
        assert_eq!(cached(output, &first).as_ref(), Some(&block));
        let other = output.join("other");
        share_optimization(output, &other).expect("writable");
        assert_eq!(cached(&other, &first), Some(block));
        // Other stages do not matter.
        case.reconstruct.feed.growth = 0.5;
        case.verify.h = Some(1.0);
        assert_eq!(key(&case, &[file("changed"), file("a body")]), first);
        assert_ne!(key(&case, &[file("the case"), file("b")]), first);
        case.grid.h = 2.0;
        assert_ne!(key(&case, &files), first);
        assert_eq!(cached(output, "other"), None);
        std::fs::write(output.join(LEFT[2]), "changed").expect("writable");
        assert_eq!(cached(output, &first), None);
    }

    #[test]
    fn every_file_is_listed_once() {
        let all = files(&[optimize::FILES, deliver::FILES]);
        for (name, _) in &all {
            assert_eq!(all.iter().filter(|(n, _)| n == name).count(), 1, "{name}");
        }
    }
}
