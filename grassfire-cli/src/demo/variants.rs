//! `grassfire demo wishbone --all`: the variants of Mayer, Denk and Wartzack 2023 (figure 5, table 1) side by side.
//!
//! I is optimized freely, II so that it leaves its mould; both are reconstructed as they are. III is I, edited for casting in
//! the reconstruction: its undercuts are repaired (III-filled), its sections grow towards the feeder, and gaps too narrow for sand go
//! solid. IV is II with growing sections.

use std::path::{Path, PathBuf};

use grassfire::case::Case;
use grassfire::casting::mould::Repair;
use grassfire::io::atomic_write;
use grassfire::monitor::Monitor;
use grassfire::pipeline::{self, PipelineError, RunJob, SolidJob, VerifyJob};
use grassfire::report::Report;

use super::table::{Column, DRAWN_IN_OPTIMIZATION, column, table};
use crate::args::RunArgs;
use crate::failure::{Failure, chain};
use crate::{case, run};

const FREE: &str = include_str!("../../../examples/wishbone-free/case.toml");
const DRAWN: &str = include_str!("../../../examples/wishbone/case.toml");

/// The feeder stands on the boss, with a foot of 40 mm.
const FEEDER: [f64; 3] = [112.0, 0.0, 15.0];
const FOOT: f64 = 20.0;
/// Sand no thinner than the least wall of steel in sand, mm.
const MIN_GAP: f64 = 6.0;
/// Smoothing of proposals that are filled and grow, in their voxels: two thirds of a voxel of the optimization. Columns that are filled
/// carry the steps of its voxels along the whole wall as flutes.
const SMOOTHING: f64 = 2.5;

/// One variant: its name, its project file, whether undercuts are repaired, the slope with which radii grow towards the
/// feeder, and the variant whose optimization it takes.
struct Variant {
    name: &'static str,
    case: &'static str,
    repair: Repair,
    growth: Option<f64>,
    optimized_as: Option<&'static str>,
}

const VARIANTS: [Variant; 5] = [
    Variant {
        name: "I",
        case: FREE,
        repair: Repair::Off,
        growth: None,
        optimized_as: None,
    },
    Variant {
        name: "II",
        case: DRAWN,
        repair: Repair::Off,
        growth: None,
        optimized_as: None,
    },
    Variant {
        name: "III-filled",
        case: FREE,
        repair: Repair::Fill,
        growth: None,
        optimized_as: Some("I"),
    },
    Variant {
        name: "III",
        case: FREE,
        repair: Repair::Fill,
        // Arms that were filled are thick: what is left of the windows beside them closes when they grow.
        growth: Some(0.005),
        optimized_as: Some("I"),
    },
    Variant {
        name: "IV",
        case: DRAWN,
        repair: Repair::Off,
        growth: Some(0.015),
        optimized_as: Some("II"),
    },
];

/// Exit codes: the user cancelled; a stage failed.
const CANCELLED: u8 = 130;
const FAILED: u8 = 3;

/// Runs all variants into folders of their names and shows their table, which table.md holds too.
///
/// A variant that cannot be made does not end the others: its column is empty, and the table says why. Ends with exit code 3
/// then, and with 1 when a check of any variant is not met.
pub fn command(output: &Path, args: &RunArgs) -> Result<u8, Failure> {
    let jobs = jobs(output, args)?;
    let threads = jobs.first().map_or(0, |job| job.case.threads);
    let columns = run::guarded(threads, args, |monitor| columns(&jobs, output, monitor))?;
    let table = table(&columns);
    atomic_write(&output.join("table.md"), |file| {
        file.write_all(table.as_bytes())
    })
    .map_err(|e| Failure::usage(e.to_string(), None))?;
    if args.json {
        run::print(&format!("{:#}\n", serde_json::json!(columns)));
    } else if !args.quiet {
        run::print(&table);
    }
    Ok(exit_code(&columns))
}

fn exit_code(columns: &[Column]) -> u8 {
    if columns.iter().any(|c| !c.errors.is_empty()) {
        return FAILED;
    }
    u8::from(columns.iter().any(|c| c.checks_met < c.checks))
}

/// The project files, unpacked, with the edits of each variant.
fn jobs(output: &Path, args: &RunArgs) -> Result<Vec<RunJob>, Failure> {
    let job = |variant: &Variant| -> Result<RunJob, Failure> {
        let folder = output.join(variant.name);
        let text = variant.case.as_bytes();
        let path = super::unpack(&folder.join("input"), "case.toml", text)?;
        Ok(RunJob {
            case: edited(case::load(&path, args)?, variant),
            path,
            output: folder,
            command: format!("{} (variant {})", run::command_line(), variant.name),
            ..RunJob::default()
        })
    };
    VARIANTS.iter().map(job).collect()
}

fn edited(mut case: Case, variant: &Variant) -> Case {
    let options = &mut case.reconstruct;
    // Undercuts of all variants are measured.
    options.mould.draw = Some([0.0, 0.0, 1.0]);
    options.mould.repair = variant.repair;
    options.solidify.feeders = vec![FEEDER];
    if let Some(growth) = variant.growth {
        options.mould.min_gap = 0.0;
        if variant.repair != Repair::Off {
            options.mould.min_gap = MIN_GAP;
            options.remesh.smoothing = SMOOTHING;
        }
        options.feed.feeders = vec![FEEDER];
        options.feed.feeder_radius = FOOT;
        options.feed.growth = growth;
    }
    case
}

fn columns(
    jobs: &[RunJob],
    output: &Path,
    monitor: &Monitor,
) -> Result<Vec<Column>, PipelineError> {
    let mut columns: Vec<Column> = Vec::new();
    for (job, variant) in jobs.iter().zip(&VARIANTS) {
        columns.push(made(job, variant, output, monitor)?);
    }
    let of = |name: &str| VARIANTS.iter().position(|v| v.name == name);
    let Some(drawn) = of(DRAWN_IN_OPTIMIZATION).filter(|&n| columns[n].volume.is_some()) else {
        return Ok(columns);
    };
    for (column, variant) in columns.iter_mut().zip(&VARIANTS) {
        if variant.optimized_as.is_some() && column.volume.is_some() {
            let found = at_volume(&jobs[drawn], column.volume, output, monitor);
            let what = format!("{DRAWN_IN_OPTIMIZATION} at the volume of {}", variant.name);
            column.cv_drawn = tried(found, &what, &mut column.errors)?.flatten();
            monitor.clear_warnings();
        }
    }
    Ok(columns)
}

/// One variant, made and frozen as far as that goes.
fn made(
    job: &RunJob,
    variant: &Variant,
    output: &Path,
    monitor: &Monitor,
) -> Result<Column, PipelineError> {
    let run = || {
        if let Some(other) = variant.optimized_as {
            pipeline::share_optimization(&output.join(other), &job.output)?;
        }
        Ok(pipeline::run(job, monitor)?.report)
    };
    let mut errors = Vec::new();
    let report = tried(run(), variant.name, &mut errors)?;
    monitor.clear_warnings();
    let frozen = match &report {
        Some(_) => tried(
            frozen(job, monitor),
            &format!("{} freezing", variant.name),
            &mut errors,
        )?,
        None => None,
    };
    monitor.clear_warnings();
    Ok(Column {
        errors,
        ..column(
            variant.name,
            &report.unwrap_or_default(),
            &frozen.unwrap_or_default(),
        )
    })
}

/// What was made, or a line in `errors` that says why not. Only cancelling ends everything.
fn tried<T>(
    result: Result<T, PipelineError>,
    what: &str,
    errors: &mut Vec<String>,
) -> Result<Option<T>, PipelineError> {
    match result {
        Err(error) if error.exit_code() == CANCELLED => Err(error),
        Err(error) => {
            errors.push(format!("{what} was not made: {}", chain(&error)));
            Ok(None)
        }
        Ok(made) => Ok(Some(made)),
    }
}

fn part(job: &RunJob) -> PathBuf {
    let step = job.output.join("part.step");
    if step.exists() {
        return step;
    }
    job.output.join("part.stl")
}

/// How the finished part freezes.
fn frozen(job: &RunJob, monitor: &Monitor) -> Result<Report, PipelineError> {
    let work = SolidJob {
        part: part(job),
        output: job.output.join("solid"),
        command: job.command.clone(),
        options: job.case.reconstruct.clone(),
    };
    Ok(pipeline::solidify_solid(&work, monitor)?.report)
}

/// Energy times volume of a finished part whose surface is moved evenly until it has another volume.
fn at_volume(
    job: &RunJob,
    volume: Option<f64>,
    output: &Path,
    monitor: &Monitor,
) -> Result<Option<f64>, PipelineError> {
    let mut case = job.case.clone();
    case.verify.equal_volume = volume;
    case.reconstruct.report.pictures = false;
    let work = VerifyJob {
        case,
        path: job.path.clone(),
        part: part(job),
        output: output.join("equal"),
        command: job.command.clone(),
        ..VerifyJob::default()
    };
    let report = pipeline::verify_solid(&work, monitor)?.report;
    Ok(report
        .verify
        .and_then(|block| block.cv_equal_volume)
        .map(|cv| cv / 1e6))
}

#[cfg(test)]
mod tests {
    use grassfire::monitor::Cancelled;
    use grassfire::pipeline::StageError;

    use super::*;

    #[test]
    fn a_variant_that_fails_does_not_lose_the_table() {
        let failed = |stage, source| -> Result<Report, _> { Err(PipelineError { stage, source }) };
        let mut errors = Vec::new();
        let source = || StageError::NoQuadSize;
        let none = tried(failed("fit", source()), "III", &mut errors);
        assert!(matches!(none, Ok(None)));
        let mut ours = [
            Column {
                name: "II".to_owned(),
                cv: Some(2000.0),
                ..Column::default()
            },
            column("III", &Report::default(), &Report::default()),
        ];
        assert_eq!(exit_code(&ours), 0);
        ours[1].errors = errors;
        assert_eq!(exit_code(&ours), FAILED);
        let text = table(&ours);
        assert!(text.contains("here unknown"), "{text}");
        let why = format!("III was not made: fit: {}", source());
        assert!(text.trim_end().ends_with(&why), "{text}");
        let cancelled = failed("fit", StageError::Cancelled(Cancelled));
        assert!(tried(cancelled, "III", &mut Vec::new()).is_err());
    }

    #[test]
    fn variants_that_share_an_optimization_share_its_project_file() {
        for variant in &VARIANTS {
            let Some(other) = variant.optimized_as else {
                continue;
            };
            let from = VARIANTS.iter().find(|v| v.name == other);
            assert_eq!(from.map(|v| v.case), Some(variant.case));
        }
    }
}
