//! What a run reads: the proposal, the non-design bodies, a skeleton drawn elsewhere.

use std::path::Path;

use sha2::{Digest, Sha256};

use super::bodies::Bodies;
use super::error::StageError;
use super::follow::same_topology;
use super::{ReconstructJob, ReconstructOptions};
use crate::Vec3;
use crate::io::{self, Input, IoError};
use crate::mesh::{Repair, RepairKind, RepairReport, Repaired, TriMesh, repair};
use crate::monitor::Monitor;
use crate::remesh::{Remeshed, remesh_density, skeleton_voxel};
use crate::report::{InputBlock, InputFile, RepairEntry};
use crate::skeleton::{self, Skeleton};
use crate::voxel::VoxelGrid;

/// Share of faces that run through others in a surface that is noise.
const NOISE: f64 = 0.05;

/// The proposal as read and repaired.
pub(super) enum Proposal {
    Mesh {
        mesh: TriMesh,
        report: RepairReport,
    },
    Density {
        grid: VoxelGrid<f32>,
        report: RepairReport,
    },
}

impl Proposal {
    /// Lower and upper corner, mm; none when it is empty.
    pub(super) fn bounds(&self) -> Option<(Vec3, Vec3)> {
        match self {
            Self::Mesh { mesh, .. } => mesh.bounds(),
            Self::Density { grid, .. } => {
                let size = grid.dims.map(|n| n as f64 * grid.spacing);
                Some((grid.origin, grid.origin + Vec3::from(size)))
            }
        }
    }

    /// So many of its faces run through others that its skeleton's quads need not be laid out twice.
    pub(super) fn is_noise(&self) -> bool {
        let (Self::Mesh { report, .. } | Self::Density { report, .. }) = self;
        let found = report.repairs.iter();
        let found = found.filter(|r| r.kind == RepairKind::SelfIntersection);
        let crossing: usize = found.map(|r| r.count).sum();
        crossing as f64 > NOISE * report.triangles as f64
    }

    /// The `input` block of the report.
    pub(super) fn block(&self) -> InputBlock {
        let (Self::Mesh { report, .. } | Self::Density { report, .. }) = self;
        let entry = |r: &Repair| RepairEntry {
            kind: kind_name(r.kind),
            count: r.count,
            text: r.text.clone(),
        };
        InputBlock {
            triangles: report.triangles,
            volume: report.volume,
            open_edges: report.open_edges,
            non_manifold_edges: report.non_manifold_edges,
            components: report.components,
            repairs: report.repairs.iter().map(entry).collect(),
        }
    }
}

/// Reads and repairs the proposal.
pub(super) fn proposal(job: &ReconstructJob, monitor: &Monitor) -> Result<Proposal, StageError> {
    let options = &job.options;
    match io::read_input(&job.part, &options.read, monitor)? {
        Input::Mesh { mesh, notes } => {
            let mut repaired = repair(mesh, &options.repair, monitor)?;
            for note in notes.iter().filter(|note| note.kind.is_warning()) {
                monitor.warn("read", note.text.clone());
            }
            repaired.report.repairs.splice(0..0, notes);
            enlarge(&mut repaired, monitor);
            Ok(Proposal::Mesh {
                mesh: repaired.mesh,
                report: repaired.report,
            })
        }
        Input::Density { grid, notes } => {
            let cell = grid.spacing.powi(3);
            let volume = grid.values.iter().map(|v| f64::from(*v)).sum::<f64>() * cell;
            let report = RepairReport {
                volume,
                components: 1,
                repairs: notes,
                ..RepairReport::default()
            };
            Ok(Proposal::Density { grid, report })
        }
        Input::Step(path) => Err(StageError::StepProposal { path }),
    }
}

/// CAD kernels do not tell points apart that are nearer than 1e-7 mm: no part shorter than this can be built, mm.
const TOO_SMALL: f64 = 0.01;

/// Enlarges a part that no CAD kernel could hold by a power of ten, to some 100 mm: its file was written in another
/// unit. The report and a warning say so.
fn enlarge(repaired: &mut Repaired, monitor: &Monitor) {
    let Some((lo, hi)) = repaired.mesh.bounds() else {
        return;
    };
    let size = (hi - lo).norm();
    if size >= TOO_SMALL || size <= 0.0 {
        return;
    }
    let factor = 10_f64.powf((100.0 / size).log10().ceil());
    for point in &mut repaired.mesh.points {
        *point *= factor;
    }
    repaired.report.volume *= factor.powi(3);
    let text = format!(
        "the part is only {size:.3e} mm across, below what a CAD kernel resolves: it was enlarged {factor:e} times; give its unit with --set read.scale=MM_PER_UNIT"
    );
    monitor.warn("read", text.clone());
    repaired
        .report
        .repairs
        .push(Repair::new(RepairKind::Scale, 1, text));
}

/// Reads the skeleton that the user drew, when there is one.
pub(super) fn skeleton(
    job: &ReconstructJob,
    monitor: &Monitor,
) -> Result<Option<Skeleton>, StageError> {
    let Some(path) = &job.skeleton else {
        return Ok(None);
    };
    let drawn = io::read_skeleton(path, &job.options.read, monitor)?;
    skeleton::check(&drawn)?;
    Ok(Some(drawn))
}

/// Remeshes the proposal at a voxel, or at the default one; the bores of the non-design bodies stay open.
pub(super) fn remesh(
    proposal: &Proposal,
    bodies: &Bodies,
    options: &ReconstructOptions,
    voxel: Option<f64>,
    monitor: &Monitor,
) -> Result<Remeshed, StageError> {
    let on_grid = bodies.kept_open(&options.remesh, voxel);
    Ok(match proposal {
        Proposal::Mesh { mesh, .. } => crate::remesh::remesh(mesh, &on_grid, monitor)?,
        Proposal::Density { grid, .. } => {
            remesh_density(grid, options.read.threshold, &on_grid, monitor)?
        }
    })
}

/// The proposal at the voxel that its skeleton is made at, where that is coarser than that of `fine` and its topology the same.
///
/// # Errors
/// Cancelled; a coarser grid on which the proposal cannot be remeshed is no error.
pub(super) fn coarser(
    proposal: &Proposal,
    bodies: &Bodies,
    fine: &Remeshed,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<Option<Remeshed>, StageError> {
    let voxel = skeleton_voxel(fine.field.spacing, fine.default_voxel);
    if voxel <= fine.field.spacing {
        return Ok(None);
    }
    let told = monitor.warnings().len();
    let voxel = (voxel < fine.default_voxel).then_some(voxel);
    let coarse = remesh(proposal, bodies, options, voxel, monitor);
    // Those of the fine one are told.
    monitor.keep_warnings(told);
    monitor.check()?;
    let coarser = |coarse: &Remeshed| coarse.field.spacing > fine.field.spacing;
    let kept = coarse.ok().filter(coarser);
    Ok(kept.filter(|coarse| same_topology(coarse, fine)))
}

/// Name and SHA-256 of every file that a run reads.
pub(super) fn fingerprints(
    job: &ReconstructJob,
    monitor: &Monitor,
) -> Result<Vec<InputFile>, StageError> {
    let paths = std::iter::once(&job.part)
        .chain(&job.non_design)
        .chain(&job.design_space)
        .chain(&job.skeleton);
    paths.map(|path| fingerprint(path, monitor)).collect()
}

/// Name and SHA-256 of a file.
pub(super) fn fingerprint(path: &Path, monitor: &Monitor) -> Result<InputFile, StageError> {
    monitor.check()?;
    let bytes = std::fs::read(path).map_err(|source| IoError::Open {
        file: path.display().to_string(),
        source,
    })?;
    Ok(InputFile {
        path: path.display().to_string(),
        sha256: hash(&bytes),
    })
}

/// SHA-256 as hexadecimal digits.
pub(super) fn hash(bytes: &[u8]) -> String {
    let digest = Sha256::digest(bytes);
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The kind as it stands in `report.json`.
fn kind_name(kind: RepairKind) -> String {
    serde_json::to_value(kind)
        .ok()
        .and_then(|v| v.as_str().map(str::to_owned))
        .unwrap_or_default()
}
