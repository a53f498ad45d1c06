//! `grassfire optimize` and `grassfire check`: work on a project file.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use grassfire::case::{Built, Case, CaseError, step_faces};
use grassfire::monitor::Monitor;
use grassfire::pipeline::{self, OptimizeJob, RunJob, Stage, VerifyJob};

use crate::args::{CaseArgs, ChainArgs, ChainEnd, CheckArgs, RunArgs, TetSolver, VerifyArgs};
use crate::failure::{Failure, chain};
use crate::{run, settings};

/// The project file as it is.
pub fn read(path: &Path) -> Result<Case, Failure> {
    Case::read(path).map_err(refused)
}

/// The project file with the settings of the command line.
pub fn load(path: &Path, args: &RunArgs) -> Result<Case, Failure> {
    let mut case = read(path)?;
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

/// `grassfire run`.
pub fn run_command(args: &ChainArgs) -> Result<u8, Failure> {
    let case = load(&args.case, &args.run)?;
    let job = RunJob {
        path: args.case.clone(),
        output: args.output.clone().unwrap_or_else(|| results(&args.case)),
        command: run::command_line(),
        to: match args.to {
            ChainEnd::Optimize => Stage::Optimize,
            ChainEnd::Reconstruct => Stage::Reconstruct,
            ChainEnd::Verify => Stage::Verify,
        },
        case,
    };
    run::run(job.case.threads, &job.output, &args.run, |monitor| {
        pipeline::run(&job, monitor)
    })
}

/// Where the results of a project file go: a file `case.toml` is named after its folder.
fn results(case: &Path) -> PathBuf {
    let whole = std::path::absolute(case).unwrap_or_else(|_| case.to_owned());
    let stem = whole.file_stem().filter(|stem| *stem != "case");
    let folder = whole.parent().and_then(Path::file_name);
    Path::new("out").join(stem.or(folder).unwrap_or("case".as_ref()))
}

/// `grassfire verify`.
pub fn verify_command(args: &VerifyArgs) -> Result<u8, Failure> {
    let is_case = args
        .input
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("toml"));
    let (path, part, proposal) = match (is_case, &args.case) {
        (false, Some(path)) => (path.clone(), args.input.clone(), args.proposal.clone()),
        (false, None) => {
            return Err(Failure::usage(
                "verify needs a project file with the loads",
                Some("give it with --case case.toml".to_owned()),
            ));
        }
        (true, Some(_)) => {
            return Err(Failure::usage(
                format!("{} is a project file, not a solid", args.input.display()),
                Some("grassfire verify part.step --case case.toml -o out".to_owned()),
            ));
        }
        (true, None) => {
            let part = left(&args.output, &["part.step", "part.stl"]).ok_or_else(|| {
                Failure::usage(
                    format!("there is no part.step in {}", args.output.display()),
                    Some("grassfire verify part.step --case case.toml -o out".to_owned()),
                )
            })?;
            let proposal = args.proposal.clone();
            let proposal = proposal.or_else(|| left(&args.output, &["density.vti"]));
            (args.input.clone(), part, proposal)
        }
    };
    let mut case = load(&path, &args.run)?;
    let ccx = args.solver == TetSolver::Ccx;
    case.verify.tetrahedra.enabled |= args.tetrahedra || ccx;
    case.verify.tetrahedra.calculix |= ccx;
    let job = VerifyJob {
        case,
        path,
        part,
        proposal,
        output: args.output.clone(),
        command: run::command_line(),
    };
    run::run(job.case.threads, &job.output, &args.run, |monitor| {
        pipeline::verify_solid(&job, monitor)
    })
}

/// The first of some files that an earlier run left in a folder. STEP needs the CAD kernel.
fn left(folder: &Path, names: &[&str]) -> Option<PathBuf> {
    let usable = |name: &&&str| cfg!(feature = "occt") || !name.ends_with(".step");
    let paths = names.iter().filter(usable).map(|name| folder.join(name));
    paths.into_iter().find(|path| path.is_file())
}

/// `grassfire faces`: a line for every face.
pub fn faces(file: &Path) -> Result<String, Failure> {
    let (_, faces) = step_faces(file).map_err(refused)?;
    let mut text = String::new();
    for (i, face) in faces.iter().enumerate() {
        text += &format!("{:4} {:8} {}", i + 1, face.surface, face.like);
        if !face.name.is_empty() {
            text += &format!(" name {:?}", face.name);
        }
        if let Some(colour) = &face.colour {
            text += &format!(" colour {colour:?}");
        }
        text.push('\n');
    }
    text += "area in mm2, middle in mm; in a project file: step_face = { path = \"...\", like = [{ ... }] }, or name, or colour\n";
    Ok(text)
}

/// `grassfire check`.
pub fn check_command(args: &CheckArgs) -> Result<u8, Failure> {
    let case = load(&args.case, &args.run)?;
    let monitor = Arc::new(Monitor::default());
    let built = pipeline::check_case(&case, &args.case, &monitor)?;
    for warning in monitor.warnings() {
        eprintln!("warning: {}: {}", warning.stage, warning.text);
    }
    let mut text = describe(&case, &built);
    if let Some(folder) = &args.output {
        for path in pipeline::draw_case(&built, folder)? {
            text += &format!("picture     {}\n", path.display());
        }
    }
    run::print(&text);
    Ok(0)
}

/// What a case came to, line by line.
fn describe(case: &Case, built: &Built) -> String {
    let problem = &built.problem;
    let [nx, ny, nz] = problem.dims;
    let cell = problem.h.powi(3);
    let design = problem.count(grassfire::topopt::DESIGN);
    let frozen = problem.count(grassfire::topopt::FROZEN);
    let (cases, weighs) = (problem.cases.len(), problem.has_body_force());
    let memory = grassfire::fe::memory_estimate((design + frozen) as f64, cases, weighs) / 1e6;
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
        "supports    {} fixed directions of nodes, {} nodes on springs\n",
        problem.fixed.len(),
        problem.springs.len()
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
        if load_case.body_force != [0.0; 3] {
            let full = (design + frozen) as f64 * cell;
            text += &format!(
                "  weight {} N if the space were full\n",
                place(load_case.body_force.map(|f| f * full))
            );
        }
    }
    text
}
