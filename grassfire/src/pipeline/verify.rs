//! `verify`: a finished solid and the loads of its project file in, its stiffness and a report out.

use std::path::{Path, PathBuf};

use super::casting::solid;
use super::deliver::Delivery;
use super::error::{PipelineError, StageError};
use super::record::Record;
use super::{Outcome, SolidJob, finish, inputs, tetrahedra};
use crate::case::Case;
use crate::io::{self, Elements, Input, ReadOptions};
use crate::mesh::TriMesh;
use crate::monitor::Monitor;
use crate::remesh::split_long_edges;
use crate::report::render::pictures::Studio;
use crate::report::{
    LoadCaseBlock, Picture, ProposalBlock, ReportError, ReportOptions, VerifyBlock,
};
use crate::verify::{CaseResult, Verified, VerifyError, space, verify};
use crate::voxel::VoxelGrid;

/// One verification: what to read, where to write, and how.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct VerifyJob {
    /// The project file as read, with its settings changed.
    pub case: Case,
    /// Where it lies: its paths begin there, and its hash goes into the report.
    pub path: PathBuf,
    /// The finished solid: a closed mesh or STEP.
    pub part: PathBuf,
    /// The densities that `optimize` left of the same case (`density.vti`).
    pub proposal: Option<PathBuf>,
    /// Folder for all results; made when it does not exist.
    pub output: PathBuf,
    /// What stands for the run in the report.
    pub command: String,
}

/// Files that `verify` writes.
const FILES: &[(&str, &str)] = &[
    RESULTS[0],
    RESULTS[1],
    RESULTS[2],
    ("report.html", "report to read"),
    ("report.json", "report for programs"),
    ("manifest.json", "inputs, versions, times"),
];

/// Displacement and stress.
const RESULT: &str = "result.vtu";
/// Files of the proof, and what they hold.
pub(super) const RESULTS: &[(&str, &str)] = &[
    (
        RESULT,
        "displacement, von Mises stress and share of material on the finer grid",
    ),
    (
        tetrahedra::RESULT,
        "displacement and von Mises stress on tetrahedra",
    ),
    (tetrahedra::DECK, "the tetrahedra as input of CalculiX"),
];

/// Computes the stiffness of a finished solid.
///
/// 1. Reads the solid: a mesh is repaired, a STEP file tessellated; and the proposal, when there is one.
/// 2. Solves the load cases on two grids ([`verify()`]).
/// 3. Does the same on body-fitted tetrahedra when that is asked for ([`crate::tet`]).
/// 4. Writes result.vtu, tetrahedra.vtu and tetrahedra.inp, pictures, the report.
///
/// # Errors
/// [`PipelineError`] names the stage and its cause; nothing is written when the input is refused.
pub fn verify_solid(job: &VerifyJob, monitor: &Monitor) -> Result<Outcome, PipelineError> {
    let mut record = Record::start(&job.command);
    record.stage("options", || {
        crate::tet::check_options(&job.case.verify.tetrahedra)
    })?;
    let read = SolidJob {
        part: job.part.clone(),
        options: job.case.reconstruct.clone(),
        ..SolidJob::default()
    };
    let mesh = record.stage("read", || solid(&read, monitor))?;
    let proposal = record.stage("read", || match &job.proposal {
        Some(path) => full_voxels(path, &job.case.reconstruct.read, monitor).map(Some),
        None => Ok(None),
    })?;
    record.report.inputs = record.stage("read", || {
        let files = [&job.part, &job.path].into_iter().chain(&job.proposal);
        files
            .map(|path| inputs::fingerprint(path, monitor))
            .collect::<Result<_, _>>()
    })?;
    let folder = job.path.parent().unwrap_or(Path::new(""));
    let found = prove(
        &mut record,
        &job.case,
        folder,
        &mesh,
        proposal.as_ref(),
        monitor,
    )?;
    let delivery = record.stage("write", || Delivery::open(&job.output, FILES))?;
    record.stage("write", || result(&delivery, &found))?;
    tetrahedra::prove(
        &mut record,
        &job.case,
        folder,
        &job.part,
        &mesh,
        &delivery,
        monitor,
    )?;
    let options = &job.case.reconstruct.report;
    let pictures = record.stage("pictures", || pictures(&found, &mesh, options))?;
    finish(record, &delivery, &pictures, options, monitor)
}

/// The stage `verify` and its block of the report.
pub(super) fn prove(
    record: &mut Record,
    case: &Case,
    folder: &Path,
    mesh: &TriMesh,
    proposal: Option<&VoxelGrid<f32>>,
    monitor: &Monitor,
) -> Result<Verified, PipelineError> {
    let (found, space) = record.stage("verify", || {
        let found = verify(case, folder, mesh, proposal, monitor)?;
        Ok::<_, VerifyError>((found, space(case, folder, &Monitor::default())?))
    })?;
    record.report.verify = Some(block(case, &found, space));
    Ok(found)
}

/// The full voxels of a density file: its array `full` where it has one, else what is above the threshold.
pub(super) fn full_voxels(
    path: &Path,
    options: &ReadOptions,
    monitor: &Monitor,
) -> Result<VoxelGrid<f32>, StageError> {
    let full = ReadOptions {
        field: Some("full".to_owned()),
        ..options.clone()
    };
    let read =
        io::read_input(path, &full, monitor).or_else(|_| io::read_input(path, options, monitor));
    match read? {
        Input::Density { mut grid, .. } => {
            let above = |v: &f32| f64::from(*v) > options.threshold;
            grid.values = grid
                .values
                .iter()
                .map(|v| f32::from(u8::from(above(v))))
                .collect();
            Ok(grid)
        }
        Input::Mesh { .. } | Input::Step(_) => Err(StageError::NoDensity {
            path: path.to_owned(),
        }),
    }
}

/// The `verify` block of the report.
fn block(case: &Case, found: &Verified, space: f64) -> VerifyBlock {
    let fine = &found.fine;
    let stress = fine.stress();
    let cv = |energy: f64, volume: f64| energy * volume;
    let equal = found.equal.as_ref();
    let cv_equal_volume = equal.map(|e| cv(e.strain_energy, e.volume));
    let proposal = found.proposal.as_ref().map(|p| {
        let own = cv(p.fine.strain_energy, p.volume);
        ProposalBlock {
            volume: p.volume,
            elements: p.fine.elements,
            strain_energy: p.fine.strain_energy,
            u_max: p.fine.u_max(),
            cv: own,
            energy_error_estimate: p.energy_error_estimate(),
            strain_energy_coarse: p.coarse.strain_energy,
            cv_ratio: cv_equal_volume.map(|ours| ours / own),
        }
    });
    let largest = fine.cases.iter().max_by(|a, b| a.u_max.total_cmp(&b.u_max));
    VerifyBlock {
        solver: "trilinear voxels with partial volumes, multigrid conjugate gradients".to_owned(),
        elements: fine.elements,
        nodes: fine.nodes.len(),
        voxel: fine.grid.h,
        voxel_coarse: found.coarse.grid.h,
        volume: found.volume,
        volume_fraction: found.volume / space,
        u_max: fine.u_max(),
        u_place: largest.map(|c| c.u_place).unwrap_or_default(),
        strain_energy: fine.strain_energy,
        strain_energy_coarse: found.coarse.strain_energy,
        cv: cv(fine.strain_energy, found.volume),
        cv_equal_volume,
        equal_volume: equal.map(|e| e.volume),
        equal_volume_offset: equal.map(|e| e.offset),
        stress_max: stress.map(|(_, s)| s),
        stress_place: stress.map(|(c, _)| c.stress_place),
        yield_strength: case.material.yield_strength,
        yield_margin: stress
            .and_then(|(_, s)| Some(case.material.yield_strength? / s - 1.0))
            .filter(|m| m.is_finite()),
        reaction_error: fine.reaction_error(),
        energy_error_estimate: found.energy_error_estimate(),
        cases: fine.cases.iter().map(case_block).collect(),
        proposal,
        tetrahedra: None,
    }
}

fn case_block(result: &CaseResult) -> LoadCaseBlock {
    LoadCaseBlock {
        name: result.name.clone(),
        strain_energy: result.strain_energy,
        u_max: result.u_max,
        u_place: result.u_place,
        stress_max: result.stress_max,
        reaction_error: result.reaction_error,
        iterations: result.iterations,
    }
}

/// Writes the finer grid with displacements and stress.
pub(super) fn result(delivery: &Delivery, found: &Verified) -> Result<(), StageError> {
    let fine = &found.fine;
    let grid = &fine.grid;
    let counts = grid.dims.map(|n| n + 1);
    let key = |[x, y, z]: [usize; 3]| (z * counts[1] + y) * counts[0] + x;
    let mut numbers = vec![u32::MAX; counts.iter().product()];
    for (i, &node) in fine.nodes.iter().enumerate() {
        numbers[key(node)] = i as u32;
    }
    let [nx, ny, _] = grid.dims;
    let voxels = (0..grid.values.len()).filter(|&v| grid.values[v] > 0.0);
    let corners = [
        [0, 0, 0],
        [1, 0, 0],
        [1, 1, 0],
        [0, 1, 0],
        [0, 0, 1],
        [1, 0, 1],
        [1, 1, 1],
        [0, 1, 1],
    ];
    let cell = |v: usize| {
        let at = [v % nx, v / nx % ny, v / (nx * ny)];
        corners.map(|c| numbers[key([at[0] + c[0], at[1] + c[1], at[2] + c[2]])])
    };
    let several = fine.cases.len() > 1;
    let vectors = fine.cases.iter().map(|c| {
        let name = if several {
            format!("displacement {}", c.name)
        } else {
            "displacement".to_owned()
        };
        (name, c.displacement.clone())
    });
    let shares = voxels.clone().map(|v| grid.values[v] as f32).collect();
    let out = Elements {
        points: fine.nodes.iter().map(|n| grid.node_place(*n)).collect(),
        cells: voxels.map(cell).collect(),
        vectors: vectors.collect(),
        node_values: Vec::new(),
        values: vec![
            ("von_mises".to_owned(), fine.von_mises.clone()),
            ("share".to_owned(), shares),
        ],
    };
    Ok(io::write_vtu(&delivery.path(RESULT), &out)?)
}

/// Displacement and stress on the surface of the part.
pub(super) fn pictures(
    found: &Verified,
    mesh: &TriMesh,
    options: &ReportOptions,
) -> Result<Vec<Picture>, ReportError> {
    if !options.pictures {
        return Ok(Vec::new());
    }
    let fine = &found.fine;
    let mesh = split_long_edges(mesh, 3.0 * fine.grid.h);
    let studio = Studio::new(&mesh.points, options.picture_size());
    let first = fine.cases.iter().max_by(|a, b| a.u_max.total_cmp(&b.u_max));
    let (title, moved) = match first {
        Some(case) => (case.name.as_str(), fine.displacement_at(case, &mesh.points)),
        None => ("", vec![f64::NAN; mesh.points.len()]),
    };
    Ok(vec![
        studio.displacement(&mesh, &moved, title)?,
        studio.stress(&mesh, &fine.stress_at(&mesh.points))?,
    ])
}
