//! Runs a reconstruction and says how it went.

use std::io::Write;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use grassfire::monitor::Monitor;
use grassfire::pipeline::{
    Format, Loads, Outcome, PipelineError, ReconstructJob, ReconstructOptions, SolidJob,
    mould_solid, reconstruct, solidify_solid,
};
use grassfire::report;

use crate::args::{
    Faces, FileFormat, MouldArgs, Recognise, ReconstructArgs, RunArgs, SolidifyArgs,
};
use crate::failure::{Failure, chain};
use crate::progress::{Bar, Shared, Talk};
use crate::{case, settings, summary};

/// `grassfire reconstruct`.
pub fn reconstruct_command(args: &ReconstructArgs) -> Result<u8, Failure> {
    let mut short = Vec::new();
    short.extend(args.voxel.map(|mm| ("remesh.voxel", mm.to_string())));
    short.extend(
        args.crease_angle
            .map(|degrees| ("flats.crease_angle", degrees.to_string())),
    );
    short.extend(
        args.quad_size
            .map(|mm| ("skeleton.quad_size", mm.to_string())),
    );
    short.extend(args.iso.map(|value| ("read.threshold", value.to_string())));
    short.extend(args.strict.then(|| ("repair.strict", "true".to_owned())));
    short.extend(args.recognise.map(|mode| {
        let mode = match mode {
            Recognise::Off => "off",
            Recognise::List => "list",
            Recognise::Auto => "auto",
        };
        ("non_design.recognise", mode.to_owned())
    }));
    if !args.format.is_empty() {
        short.push(("files.formats", formats(&args.format)));
    }
    short.extend(args.faces.map(|mode| {
        let mode = match mode {
            Faces::Exact => "exact",
            Faces::Fewest => "fewest",
            Faces::Quads => "quads",
        };
        ("brep.faces", mode.to_owned())
    }));
    if !args.feeder.is_empty() {
        short.push(("feed.feeders", format!("{:?}", args.feeder)));
    }
    short.extend(args.growth.map(|g| ("feed.growth", g.to_string())));
    for key in ["feed.draw", "mould.draw"] {
        short.extend(args.draw.map(|d| (key, format!("{d:?}"))));
    }
    let loads = match &args.case {
        Some(path) => Some(Loads {
            case: case::read(path)?,
            path: path.clone(),
        }),
        None => None,
    };
    let job = ReconstructJob {
        part: args.part.clone(),
        loads,
        non_design: args.non_design.clone(),
        design_space: args.design_space.clone(),
        skeleton: args.skeleton.clone(),
        output: args.output.clone(),
        command: command_line(),
        options: options(&short, &args.run)?,
        ..ReconstructJob::default()
    };
    let work = |monitor: &Monitor| reconstruct(&job, monitor);
    run(job.options.threads, &job.output, &args.run, work)
}

/// `grassfire solidify`.
pub fn solidify_command(args: &SolidifyArgs) -> Result<u8, Failure> {
    let mut short = Vec::new();
    if !args.feeder.is_empty() {
        short.push(("solidify.feeders", format!("{:?}", args.feeder)));
    }
    let job = SolidJob {
        part: args.part.clone(),
        output: args.output.clone(),
        command: command_line(),
        options: options(&short, &args.run)?,
    };
    let work = |monitor: &Monitor| solidify_solid(&job, monitor);
    run(job.options.threads, &job.output, &args.run, work)
}

/// `grassfire mould`.
pub fn mould_command(args: &MouldArgs) -> Result<u8, Failure> {
    let draw = args.draw.map(|d| ("mould.draw", format!("{d:?}")));
    let short: Vec<_> = draw.into_iter().collect();
    let job = SolidJob {
        part: args.part.clone(),
        output: args.output.clone(),
        command: command_line(),
        options: options(&short, &args.run)?,
    };
    let work = |monitor: &Monitor| mould_solid(&job, monitor);
    run(job.options.threads, &job.output, &args.run, work)
}

/// The list of formats as a setting.
fn formats(asked: &[FileFormat]) -> String {
    let name = |format: &FileFormat| {
        let format = match format {
            FileFormat::Step => Format::Step,
            FileFormat::Brep => Format::Brep,
            FileFormat::Iges => Format::Iges,
            FileFormat::ThreeMf => Format::ThreeMf,
            FileFormat::Casting => Format::Casting,
            FileFormat::Pieces => Format::Pieces,
        };
        format!("{:?}", format.name())
    };
    let names: Vec<String> = asked.iter().map(name).collect();
    format!("[{}]", names.join(","))
}

/// The command line as it stands in the report.
pub fn command_line() -> String {
    std::env::args_os()
        .map(|arg| arg.to_string_lossy().into_owned())
        .enumerate()
        .fold(String::new(), |line, (n, arg)| {
            let arg = if n == 0 { "grassfire".to_owned() } else { arg };
            let quoted = if arg.contains([' ', '\'', '"']) {
                format!("{arg:?}")
            } else {
                arg
            };
            if line.is_empty() {
                quoted
            } else {
                format!("{line} {quoted}")
            }
        })
}

/// Defaults, then the short options, then every `--set` in its order.
fn options(short: &[(&str, String)], args: &RunArgs) -> Result<ReconstructOptions, Failure> {
    let mut options = ReconstructOptions::default();
    if let Some(threads) = args.threads {
        options = settings::set(&options, "threads", &threads.to_string())?;
    }
    for (key, value) in short {
        options = settings::set(&options, key, value)?;
    }
    for setting in &args.set {
        let (key, value) = settings::split(setting)?;
        options = settings::set(&options, key, value)?;
    }
    Ok(options)
}

/// Runs `work` with threads, progress and Ctrl-C set up, and says how it went.
pub fn run(
    threads: usize,
    output: &Path,
    args: &RunArgs,
    work: impl FnOnce(&Monitor) -> Result<Outcome, PipelineError>,
) -> Result<u8, Failure> {
    let outcome = guarded(threads, args, work)?;
    say(&outcome, output, args)?;
    Ok(if outcome.failed_checks.is_empty() {
        0
    } else {
        1
    })
}

/// Runs `work` with threads, progress and Ctrl-C set up; prints its warnings.
pub fn guarded<T>(
    threads: usize,
    args: &RunArgs,
    work: impl FnOnce(&Monitor) -> Result<T, PipelineError>,
) -> Result<T, Failure> {
    let talk = match (args.quiet, args.verbose) {
        (true, _) => Talk::Quiet,
        (_, true) => Talk::Verbose,
        _ => Talk::Normal,
    };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build_global();
    pool.map_err(|e| Failure::usage(format!("cannot start {threads} threads: {e}"), None))?;
    let bar = Arc::new(Bar::new(talk));
    let monitor = Arc::new(Monitor::with_progress(Box::new(Shared(Arc::clone(&bar)))));
    cancel_on_interrupt(&monitor)?;
    let result = work(&monitor);
    bar.finish();
    if talk != Talk::Quiet {
        for warning in monitor.warnings() {
            eprintln!("warning: {}: {}", warning.stage, warning.text);
        }
    }
    Ok(result?)
}

/// The first Ctrl-C asks the stages to stop, the second ends the program at once.
fn cancel_on_interrupt(monitor: &Arc<Monitor>) -> Result<(), Failure> {
    let monitor = Arc::clone(monitor);
    let asked = AtomicBool::new(false);
    let handler = move || {
        if asked.swap(true, Ordering::SeqCst) {
            std::process::exit(130);
        }
        monitor.cancel();
    };
    ctrlc::set_handler(handler)
        .map_err(|e| Failure::usage(format!("cannot catch Ctrl-C: {e}"), None))
}

fn say(outcome: &Outcome, output: &Path, args: &RunArgs) -> Result<(), Failure> {
    let text = if args.json {
        report::to_json(&outcome.report).map_err(|e| Failure::usage(chain(&e), None))?
    } else if args.quiet {
        String::new()
    } else {
        summary::text(&outcome.report, output)
    };
    print(&text);
    Ok(())
}

/// Prints on stdout; a reader that went away (`| head`) is no error.
pub fn print(text: &str) {
    let _ = std::io::stdout().lock().write_all(text.as_bytes());
}
