//! `grassfire demo wishbone --all`: the variants of Mayer, Denk and Wartzack 2023 (figure 5, table 1) side by side.
//!
//! I is optimized freely, II so that it leaves its mould; both are reconstructed as they are. III is I, edited for casting in
//! the reconstruction: its undercuts are repaired (III-filled), its sections grow towards the feeder, and gaps too narrow for sand go
//! solid. IV is II with growing sections.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use grassfire::case::Case;
use grassfire::casting::mould::Repair;
use grassfire::io::atomic_write;
use grassfire::monitor::Monitor;
use grassfire::pipeline::{self, PipelineError, RunJob, SolidJob, VerifyJob};
use grassfire::report::Report;
use serde::Serialize;

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

/// The variant whose stiffness the others are compared with.
const DRAWN_IN_OPTIMIZATION: &str = "II";
/// The variant that the paper says is better than it, before and after its sections grow.
const EDITED: [&str; 2] = ["III-filled", "III"];

/// Exit codes: the user cancelled; a stage failed.
const CANCELLED: u8 = 130;
const FAILED: u8 = 3;

/// Figures of one variant; none where it has no such figure.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
struct Column {
    name: String,
    /// mm3.
    volume: Option<f64>,
    /// Volume over that of the design space.
    fraction: Option<f64>,
    elements: Option<f64>,
    /// mm.
    u_max: Option<f64>,
    /// J.
    energy: Option<f64>,
    /// Energy times volume, kJ mm3.
    cv: Option<f64>,
    /// The same of II, its surface moved evenly until it has the volume of this variant.
    cv_drawn: Option<f64>,
    /// MPa.
    stress: Option<f64>,
    /// mm3.
    undercut: Option<f64>,
    /// Hot spots that no feeder reaches, in steel, and their volume in cm3.
    hot_spots: Option<f64>,
    hot_volume: Option<f64>,
    /// Metal of the part over metal poured, %.
    casting_yield: Option<f64>,
    /// Rules of feeding that are broken.
    broken: Option<f64>,
    /// Share of the ways to the feeder where inscribed balls shrink, %.
    falling: Option<f64>,
    /// Root mean square to the proposal, as edited, voxels.
    distance: Option<f64>,
    faces: Option<f64>,
    checks_met: Option<f64>,
    checks: Option<f64>,
    seconds: Option<f64>,
    /// Why figures are missing: what failed, and how.
    errors: Vec<String>,
}

/// A line of the table: text, decimals, figure.
type Line = (&'static str, usize, fn(&Column) -> Option<f64>);

const LINES: [Line; 19] = [
    ("volume V, mm3", 0, |c| c.volume),
    ("V over design space", 3, |c| c.fraction),
    ("elements", 0, |c| c.elements),
    ("largest displacement, mm", 3, |c| c.u_max),
    ("strain energy c, J", 3, |c| c.energy),
    ("c V, kJ mm3", 0, |c| c.cv),
    ("c V of II at this volume", 0, |c| c.cv_drawn),
    ("largest stress, MPa", 0, |c| c.stress),
    ("undercut along z, mm3", 0, |c| c.undercut),
    ("isolated hot spots, steel", 0, |c| c.hot_spots),
    ("their volume, cm3", 2, |c| c.hot_volume),
    ("casting yield, %", 0, |c| c.casting_yield),
    ("feeding rules broken", 0, |c| c.broken),
    ("sections falling, % of ways", 0, |c| c.falling),
    ("distance rms, voxels", 2, |c| c.distance),
    ("CAD faces", 0, |c| c.faces),
    ("checks met", 0, |c| c.checks_met),
    ("checks", 0, |c| c.checks),
    ("seconds", 0, |c| c.seconds),
];

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

fn column(name: &str, report: &Report, frozen: &Report) -> Column {
    let proof = report.verify.as_ref();
    let feed = report.feed.as_ref();
    let solidify = frozen.solidify.as_ref();
    let distance = report.distance.as_ref();
    let stages = report.stages.iter().chain(&frozen.stages);
    Column {
        name: name.to_owned(),
        volume: proof.map(|p| p.volume),
        fraction: proof.map(|p| p.volume_fraction),
        elements: proof.map(|p| p.elements as f64),
        u_max: proof.map(|p| p.u_max),
        energy: proof.map(|p| p.strain_energy / 1e3),
        cv: proof.map(|p| p.cv / 1e6),
        stress: proof.and_then(|p| p.stress_max),
        undercut: report.mould.as_ref().map(|m| m.undercut_volume),
        hot_spots: solidify.map(|s| s.hot_spots.iter().filter(|h| !h.fed).count() as f64),
        hot_volume: solidify.map(|s| s.isolated_volume / 1e3),
        casting_yield: feed.map(|f| 100.0 * f.casting_yield),
        broken: feed.map(|f| f.violations as f64),
        falling: feed.map(|f| 100.0 * f.falling.falling),
        distance: distance.map(|d| d.rms / d.voxel),
        faces: report.solid.as_ref().map(|s| s.faces as f64),
        checks_met: proof.map(|_| report.checks.iter().filter(|c| c.met).count() as f64),
        checks: proof.map(|_| report.checks.len() as f64),
        seconds: proof.map(|_| stages.map(|s| s.seconds).sum()),
        ..Column::default()
    }
}

/// Table 1 of the paper, as far as it goes.
fn paper() -> Vec<Column> {
    let column =
        |(name, [volume, u_max, energy, cv]): (&str, [f64; 4]), fraction, elements| Column {
            name: name.to_owned(),
            volume: Some(volume),
            fraction: Some(fraction),
            elements: Some(elements),
            u_max: Some(u_max),
            energy: Some(energy),
            cv: Some(cv),
            ..Column::default()
        };
    let [second, third] = super::PAPER;
    vec![
        column(second, 0.23, 21_794.0),
        column(third, 0.39, 36_956.0),
    ]
}

/// The variants beside the paper's as a table in Markdown, and what comes of the paper's claim.
fn table(ours: &[Column]) -> String {
    let columns: Vec<Column> = paper().into_iter().chain(ours.iter().cloned()).collect();
    let mut text = String::from(
        "Mayer et al. 2023, table 1 (their wishbone is not published; ours is rebuilt from their numbers)\n\n",
    );
    let names = columns.iter().map(|c| format!(" {:>10} |", c.name));
    // Writing to a String cannot fail.
    let _ = writeln!(text, "| {:28} |{}", "", names.collect::<String>());
    let _ = writeln!(text, "|{}", "---|".repeat(columns.len() + 1));
    for (name, decimals, figure) in LINES {
        let cell = |column: &Column| match figure(column) {
            Some(value) => format!(" {value:>10.decimals$} |"),
            None => format!(" {:>10} |", ""),
        };
        let cells = columns.iter().map(cell).collect::<String>();
        let _ = writeln!(text, "| {name:28} |{cells}");
    }
    text += &claim(ours);
    for error in ours.iter().flat_map(|c| &c.errors) {
        let _ = writeln!(text, "\n{error}");
    }
    text
}

/// The paper says that c V of III is smaller than that of II: as they are, and at equal volume, a line a column that is III.
fn claim(ours: &[Column]) -> String {
    let of = |name: &str| ours.iter().find(|c| c.name == name);
    let Some(second) = of(DRAWN_IN_OPTIMIZATION) else {
        return String::new();
    };
    let mut text = String::new();
    for third in EDITED.into_iter().filter_map(of) {
        let ratio = |over: Option<f64>| match (third.cv, over) {
            (Some(a), Some(b)) => format!("{:.2}", a / b),
            _ => "unknown".to_owned(),
        };
        let _ = writeln!(
            text,
            "\nc V of {0} over that of II: paper 0.80, here {1}; with II as thick as {0}, since thickness alone makes it better, {2}",
            third.name,
            ratio(second.cv),
            ratio(third.cv_drawn)
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use grassfire::monitor::Cancelled;
    use grassfire::pipeline::StageError;

    use super::*;

    #[test]
    fn the_table_compares_with_the_paper_also_at_equal_volume() {
        let column = |name: &str, cv: f64, cv_drawn| Column {
            name: name.to_owned(),
            cv: Some(cv),
            cv_drawn,
            ..Column::default()
        };
        let ours = [
            column("II", 2000.0, None),
            column("III", 1500.0, Some(1000.0)),
        ];
        let text = table(&ours);
        let line = text.lines().find(|l| l.starts_with("| c V, kJ mm3"));
        let cells: Vec<&str> = line.unwrap_or("").split('|').map(str::trim).collect();
        assert_eq!(&cells[2..6], ["1859", "1487", "2000", "1500"]);
        assert!(text.contains("paper 0.80, here 0.75;"), "{text}");
        assert!(text.trim_end().ends_with("1.50"), "{text}");
        assert!(claim(&ours[..1]).is_empty());
    }

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
