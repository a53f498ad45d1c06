//! `grassfire optimize` and `grassfire check`: work on a project file.

use std::path::Path;
use std::sync::Arc;

use grassfire::case::{Built, Case, CaseError};
use grassfire::monitor::Monitor;
use grassfire::pipeline::{self, OptimizeJob};

use crate::args::{CaseArgs, CheckArgs, RunArgs};
use crate::failure::{Failure, chain};
use crate::{run, settings};

/// The project file with the settings of the command line.
pub fn load(path: &Path, args: &RunArgs) -> Result<Case, Failure> {
    let mut case = Case::read(path).map_err(refused)?;
    if let Some(threads) = args.threads {
        case.threads = threads;
    }
    for setting in &args.set {
        let (key, value) = settings::split(setting)?;
        case = set(&case, key, value)?;
    }
    case.check().map_err(refused)?;
    Ok(case)
}

/// Keys of `grassfire reconstruct`, such as `remesh.voxel`, stand for those in the table `reconstruct`.
fn set(case: &Case, key: &str, value: &str) -> Result<Case, Failure> {
    let direct = settings::set(case, key, value);
    if let Err(settings::SettingError::UnknownKey { .. }) = &direct
        && let Ok(case) = settings::set(case, &format!("reconstruct.{key}"), value)
    {
        return Ok(case);
    }
    Ok(direct?)
}

fn refused(error: CaseError) -> Failure {
    Failure::usage(chain(&error), error.hint())
}

/// `grassfire optimize`.
pub fn optimize_command(args: &CaseArgs) -> Result<u8, Failure> {
    let case = load(&args.case, &args.run)?;
    let job = OptimizeJob {
        path: args.case.clone(),
        output: args.output.clone(),
        command: run::command_line(),
        resume: args.resume,
        case,
    };
    run::run(job.case.threads, &job.output, &args.run, |monitor| {
        pipeline::optimize(&job, monitor)
    })
}

/// `grassfire check`.
pub fn check_command(args: &CheckArgs) -> Result<u8, Failure> {
    let case = load(&args.case, &args.run)?;
    let monitor = Arc::new(Monitor::default());
    let built = pipeline::check_case(&case, &args.case, &monitor)?;
    for warning in monitor.warnings() {
        eprintln!("warning: {}: {}", warning.stage, warning.text);
    }
    run::print(&describe(&case, &built));
    Ok(0)
}

/// What a case came to, line by line.
fn describe(case: &Case, built: &Built) -> String {
    let problem = &built.problem;
    let [nx, ny, nz] = problem.dims;
    let cell = problem.h.powi(3);
    let design = problem.count(grassfire::topopt::DESIGN);
    let frozen = problem.count(grassfire::topopt::FROZEN);
    let memory = grassfire::fe::memory_estimate(problem.dims, problem.cases.len()) / 1e6;
    let mut text = format!(
        "{}\ngrid        {nx} x {ny} x {nz} voxels of {} mm, about {memory:.0} MB\nspace       {} voxels, {:.0} mm3\nnon-design  {frozen} voxels, {:.0} mm3\n",
        case.title,
        problem.h,
        design + frozen,
        (design + frozen) as f64 * cell,
        frozen as f64 * cell,
    );
    for (name, voxels) in &built.bodies {
        text += &format!(
            "  body {name}: {voxels} voxels, {:.0} mm3\n",
            *voxels as f64 * cell
        );
    }
    let place = |p: [f64; 3]| format!("({:.2}, {:.2}, {:.2})", p[0], p[1], p[2]);
    for info in &built.selections {
        let on = if info.on_frozen {
            " on non-design bodies"
        } else {
            ""
        };
        text += &format!(
            "select      {}: {} nodes{on}, centre {}, from {} to {} mm\n",
            info.name,
            info.nodes,
            place(info.centre),
            place(info.low),
            place(info.high)
        );
    }
    text += &format!(
        "supports    {} fixed directions of nodes\n",
        problem.fixed.len()
    );
    for load_case in &problem.cases {
        let sum = [0, 1, 2].map(|c| load_case.forces.iter().map(|(_, f)| f[c]).sum::<f64>());
        text += &format!(
            "case        {}: weight {}, total force {} N on {} nodes\n",
            load_case.name,
            load_case.weight,
            place(sum),
            load_case.forces.len()
        );
    }
    text
}
