//! The blocks of `report.json`; field names are the JSON keys.

use serde::{Deserialize, Serialize};

use super::{
    BodyBlock, Check, EditBlock, FeedBlock, FilletBlock, MouldBlock, RepairsBlock, SkeletonBlock,
    SolidifyBlock, TopologyBlock, VerifyBlock,
};
use crate::monitor::Warning;
use crate::remesh::{ChangeKind, TopologyChange};
use crate::spline::CurvatureJump;

/// Everything that a run reports.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Report {
    /// Version of grassfire.
    pub version: String,
    /// The command line or what stands for it.
    pub command: String,
    /// Files that were read.
    pub inputs: Vec<InputFile>,
    /// The mesh as read and its repairs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub input: Option<InputBlock>,
    /// The voxel remesh.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remesh: Option<RemeshBlock>,
    /// Topology of every stage.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub topology: Option<TopologyBlock>,
    /// The quad skeleton.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub skeleton: Option<SkeletonBlock>,
    /// The thickened and fitted body.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub body: Option<BodyBlock>,
    /// The CAD solid.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub solid: Option<SolidBlock>,
    /// Distance between the solid and the remeshed proposal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub distance: Option<DistanceBlock>,
    /// Volume of the solid against the proposal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volume: Option<VolumeBlock>,
    /// The list of edits.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub edits: Option<EditBlock>,
    /// The feeding edit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub feed: Option<FeedBlock>,
    /// The mould.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mould: Option<MouldBlock>,
    /// The search for the best repair of undercuts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub repairs: Option<RepairsBlock>,
    /// Solidification.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub solidify: Option<SolidifyBlock>,
    /// The non-design bodies.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub non_design: Vec<NonDesignBlock>,
    /// The topology optimization.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub optimize: Option<OptimizeBlock>,
    /// The stiffness of the finished solid.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub verify: Option<VerifyBlock>,
    /// Surfaces and bosses that were recognised in the proposal.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub candidates: Vec<CandidateBlock>,
    /// Flat faces that were to become exactly plane.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub flats: Vec<FlatBlock>,
    /// Inner edges that were to get fillets.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub fillets: Vec<FilletBlock>,
    /// Faces of the design space.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub design_space: Vec<DesignFaceBlock>,
    /// Verdicts.
    pub checks: Vec<Check>,
    /// Time and memory of every stage.
    pub stages: Vec<StageEntry>,
    /// Partial trouble.
    pub warnings: Vec<Warning>,
    /// Keys of the papers whose methods the run used (references.bib).
    pub papers: Vec<String>,
    /// Files that were written.
    pub files: Vec<FileEntry>,
    /// Files that were asked for and could not be written.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub refused: Vec<RefusedFile>,
}

/// A file that was asked for and could not be written.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct RefusedFile {
    /// Name inside the output folder.
    pub path: String,
    /// Why.
    pub reason: String,
}

/// A file that was read.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct InputFile {
    /// Path as given.
    pub path: String,
    /// SHA-256 of its bytes, hexadecimal.
    pub sha256: String,
}

/// A file that was written.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct FileEntry {
    /// Name inside the output folder.
    pub path: String,
    /// What it holds.
    pub text: String,
    /// Size.
    pub bytes: u64,
}

/// The mesh as read.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct InputBlock {
    /// Triangles in the file.
    pub triangles: usize,
    /// Enclosed volume after repair, mm3.
    pub volume: f64,
    /// Edges with one triangle.
    pub open_edges: usize,
    /// Edges with more than two triangles.
    pub non_manifold_edges: usize,
    /// Connected pieces.
    pub components: usize,
    /// What was repaired.
    pub repairs: Vec<RepairEntry>,
}

/// One kind of repair.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct RepairEntry {
    /// Short name, snake_case.
    pub kind: String,
    /// How often.
    pub count: usize,
    /// What was done.
    pub text: String,
}

/// The voxel remesh.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct RemeshBlock {
    /// Edge of a voxel, mm.
    pub voxel: f64,
    /// Triangles of the proposal.
    pub triangles: usize,
    /// Volume of the proposal, mm3.
    pub volume: f64,
    /// Largest distance from the input surface to the proposal, away from the changes, mm.
    pub distance_max: f64,
    /// Genus before the removal of topological noise.
    pub genus_before: i64,
    /// Genus after it.
    pub genus_after: i64,
    /// Every change of topology.
    pub changes: Vec<TopologyChangeEntry>,
}

/// One change of topology.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TopologyChangeEntry {
    /// What was done.
    pub kind: ChangeKind,
    /// Where, mm.
    pub place: [f64; 3],
    /// Width, mm.
    pub size: f64,
}

impl From<&TopologyChange> for TopologyChangeEntry {
    fn from(change: &TopologyChange) -> Self {
        Self {
            kind: change.kind,
            place: change.place.into(),
            size: change.size,
        }
    }
}

/// The CAD solid.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct SolidBlock {
    /// The CAD kernel's own check.
    pub valid: bool,
    /// Solids.
    pub bodies: usize,
    /// Faces.
    pub faces: usize,
    /// Volume, mm3.
    pub volume: f64,
    /// Surface, mm2.
    pub area: f64,
    /// Handles, all shells together.
    pub genus: i64,
    /// Largest normal angle across edges meant to be smooth, degrees.
    pub g1_max: f64,
    /// Jump of curvature across the edges around extraordinary points, before the union.
    pub curvature_jump: CurvatureBlock,
    /// Shortest edge, mm.
    pub shortest_edge: f64,
    /// Largest tolerance of the CAD model, mm.
    pub max_tolerance: f64,
    /// Relative difference between the CAD kernel's volume and ours.
    pub volume_check: f64,
    /// How far the surface moved for the sake of fewer faces (`brep.faces = fewest`), mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub faces_deviation: Option<f64>,
}

/// Jump of the normal curvature across the edges of all faces around extraordinary points.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct CurvatureBlock {
    /// Largest, 1/mm.
    pub max: f64,
    /// Where, mm.
    pub place: [f64; 3],
    /// 95 % are smaller, 1/mm.
    pub p95: f64,
    /// Root mean square, 1/mm.
    pub rms: f64,
    /// `rms` over the root mean square of the curvature there.
    pub relative: f64,
    /// Edges measured.
    pub edges: usize,
}

impl From<&CurvatureJump> for CurvatureBlock {
    fn from(jump: &CurvatureJump) -> Self {
        Self {
            max: jump.max,
            place: jump.place.into(),
            p95: jump.p95,
            rms: jump.rms,
            relative: jump.relative,
            edges: jump.edges,
        }
    }
}

/// Two-sided distance between the solid and the remeshed proposal, non-design regions left out, mm.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct DistanceBlock {
    /// Root mean square.
    pub rms: f64,
    /// 95 % of the surface is nearer.
    pub p95: f64,
    /// Largest.
    pub max: f64,
    /// Edge of a voxel.
    pub voxel: f64,
    /// Largest distance from the solid's non-design faces to the input CAD.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub non_design_max: Option<f64>,
}

/// Volume of the solid against the proposal.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct VolumeBlock {
    /// Remeshed proposal, mm3.
    pub proposal: f64,
    /// CAD solid, mm3.
    pub solid: f64,
    /// (solid - proposal) / proposal.
    pub relative_difference: f64,
}

/// The topology optimization.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct OptimizeBlock {
    /// Voxels of the design space with its non-design bodies.
    pub elements: usize,
    /// Voxels of the whole grid.
    pub grid: [usize; 3],
    /// Edge of a voxel, mm.
    pub voxel: f64,
    /// Iterations.
    pub iterations: usize,
    /// It ended by itself, not at the limit of iterations.
    pub converged: bool,
    /// Volume of the densities over that of the space.
    pub volume_fraction: f64,
    /// Volume of the full voxels, mm3.
    pub volume: f64,
    /// f'u over the weighted cases in the first iteration, N mm.
    pub first_compliance: f64,
    /// The same in the last iteration.
    pub compliance: f64,
    /// f'u of every case in the last iteration, N mm.
    pub case_compliance: Vec<f64>,
    /// `4 mean(rho (1 - rho))`.
    pub grayness: f64,
    /// Mean change of density in the last iteration.
    pub change: f64,
    /// Mean wall time of an iteration.
    pub seconds_per_iteration: f64,
    /// Mean iterations of the solver, a case.
    pub solver_iterations: f64,
    /// Solutions for which the smallest modulus had to be raised.
    pub fallbacks: usize,
    /// Density above which a voxel counts as full.
    pub threshold: f64,
    /// Pieces of the full voxels.
    pub components: usize,
    /// Volume of the full voxels that a mould could not leave, mm3.
    pub undercut_volume: f64,
    /// Largest difference of densities across the planes of symmetry.
    pub symmetry_error: f64,
}

/// One non-design body.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct NonDesignBlock {
    /// Name of the body.
    pub name: String,
    /// File it came from.
    pub source: String,
    /// Its faces.
    pub faces: usize,
    /// Share of its surface that analytic faces cover.
    pub coverage: f64,
    /// It is in the solid as given.
    pub kept: bool,
    /// Radii of its bores, mm.
    pub bore_radii: Vec<f64>,
    /// Its bores.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub bores: Vec<BoreBlock>,
    /// The file with the body alone, its bores filled; present with the format `pieces`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub piece: Option<String>,
}

/// A bore of a non-design body.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct BoreBlock {
    /// Point of the axis, mm.
    pub origin: [f64; 3],
    /// Unit direction of the axis.
    pub axis: [f64; 3],
    /// Radius, mm.
    pub radius: f64,
    /// Where its wall begins and ends, mm along the axis from the origin.
    pub extent: [f64; 2],
    /// Where it was cut out of the part: beyond open ends.
    pub cut: [f64; 2],
}

/// A surface or a boss that was recognised in the proposal.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct CandidateBlock {
    /// `boss`: a through bore with a sleeve; `hollow`: any other concave cylinder; `wall`: a convex one; `plane`.
    pub kind: String,
    /// Radius of a cylinder or of a boss's bore, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius: Option<f64>,
    /// Outer radius of a boss's sleeve, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub outer_radius: Option<f64>,
    /// Middle, mm.
    pub place: [f64; 3],
    /// Direction of the axis; normal of a plane.
    pub axis: [f64; 3],
    /// Length along the axis, mm.
    pub length: f64,
    /// Area found, mm2.
    pub area: f64,
    /// Share of the whole cylinder between its ends that was found.
    pub coverage: f64,
    /// Angle of the circumference that was found, degrees.
    pub angle: f64,
    /// Root mean square distance of the points to the surface, mm.
    pub rms: f64,
    /// Largest distance, mm.
    pub residual: f64,
    /// It is united with the part.
    pub used: bool,
    /// Why it is no boss, or not used.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

/// A flat face of the proposal with a sharp border.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct FlatBlock {
    /// Middle, mm.
    pub place: [f64; 3],
    /// Unit normal, out of the material.
    pub normal: [f64; 3],
    /// Area in the proposal, mm2.
    pub area: f64,
    /// The part is exactly plane there.
    pub plane: bool,
    /// Why not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

/// A face of the design space.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct DesignFaceBlock {
    /// Number in the file, from 1.
    pub face: usize,
    /// Solid that it belongs to, from 1.
    pub solid: usize,
    /// `plane`, `cylinder`, `cone`, `sphere`, `torus` or `freeform`.
    pub kind: String,
    /// Area, mm2.
    pub area: f64,
    /// Middle, mm.
    pub place: [f64; 3],
    /// Share of its area that the proposal follows.
    pub coverage: f64,
    /// It is a non-design face.
    pub non_design: bool,
}

/// Time and memory of a stage.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct StageEntry {
    /// Name of the stage.
    pub name: String,
    /// Wall-clock time, s.
    pub seconds: f64,
    /// Highest memory of the process until its end, MB.
    pub peak_memory: f64,
    /// The result was taken from an earlier run.
    pub cached: bool,
}
