//! The error of a run: which stage, and its own error.

use std::path::PathBuf;

use crate::cad::CadError;
use crate::case::CaseError;
use crate::casting::feed::FeedError;
use crate::casting::mould::MouldError;
use crate::casting::solidify::SolidifyError;
use crate::edit::{EditError, EditListError};
use crate::fe::FeError;
use crate::fit::FitError;
use crate::io::IoError;
use crate::medial::MedialError;
use crate::mesh::{RepairError, SolidError};
use crate::monitor::Cancelled;
use crate::remesh::RemeshError;
use crate::report::ReportError;
use crate::skeleton::SkeletonError;
use crate::spline::SplineError;
use crate::tet::TetError;
use crate::thicken::ThickenError;
use crate::topopt::TopoptError;
use crate::verify::VerifyError;

/// A run that could not go on.
#[derive(Debug, thiserror::Error)]
#[error("{stage}")]
pub struct PipelineError {
    /// Stage that failed, as in `report.json`.
    pub stage: &'static str,
    /// Why.
    pub source: StageError,
}

/// The error of one stage.
#[derive(Debug, thiserror::Error)]
#[allow(
    missing_docs,
    reason = "each variant is the error of the stage it is named after"
)]
pub enum StageError {
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    #[error(transparent)]
    Io(#[from] IoError),
    #[error(transparent)]
    Repair(#[from] RepairError),
    #[error(transparent)]
    Remesh(#[from] RemeshError),
    #[error(transparent)]
    Medial(#[from] MedialError),
    #[error(transparent)]
    Skeleton(#[from] SkeletonError),
    #[error(transparent)]
    Thicken(#[from] ThickenError),
    #[error(transparent)]
    Feed(#[from] FeedError),
    #[error(transparent)]
    Edit(#[from] EditError),
    #[error(transparent)]
    Edits(#[from] EditListError),
    #[error(transparent)]
    Mould(#[from] MouldError),
    #[error(transparent)]
    Solidify(#[from] SolidifyError),
    #[error(transparent)]
    Fit(#[from] FitError),
    #[error(transparent)]
    Spline(#[from] SplineError),
    #[error(transparent)]
    Cad(#[from] CadError),
    #[error(transparent)]
    Report(#[from] ReportError),
    #[error(transparent)]
    Case(#[from] CaseError),
    #[error(transparent)]
    Topopt(#[from] TopoptError),
    #[error(transparent)]
    Verify(#[from] VerifyError),
    #[error(transparent)]
    Tet(#[from] TetError),
    #[error("{} holds no densities; the proposal of a verification is the density.vti of the optimization", path.display())]
    NoDensity { path: PathBuf },
    #[error("{} is a STEP file; the proposal must be a mesh or a density", path.display())]
    StepProposal { path: PathBuf },
    #[error("{} holds densities; a non-design body must be a STEP solid or a closed mesh", path.display())]
    DensityBody { path: PathBuf },
    #[error("{} cannot be united: this build has no OpenCASCADE", path.display())]
    NoKernel { path: PathBuf },
    #[error(
        "the CAD bodies given are {bodies:.4} mm across, the proposal only {proposal:.4} mm: they are in different units"
    )]
    Unit { bodies: f64, proposal: f64 },
    #[error("{} is no STEP file; a design space must be given as STEP", path.display())]
    DesignSpace { path: PathBuf },
    #[error(
        "the last {most:.2} mm of growth on {broken} of {rules} edges of the skeleton are left out: {why}"
    )]
    Growth {
        most: f64,
        broken: usize,
        rules: usize,
        why: &'static str,
    },
    #[error(
        "its body of {quads} quads is too large to be fitted for a comparison ({most} quads at most)"
    )]
    LargeBody { quads: usize, most: usize },
    #[error("retry.quad_sizes is empty: no quad size to try")]
    NoQuadSize,
    #[error("the format {format} cannot be written: this build has no OpenCASCADE")]
    Format { format: &'static str },
    #[error("the format casting is the part with its feeders, and no feeder is given")]
    NoFeeders,
    #[error(
        "files.chord is {chord} mm; {} or more wanted",
        super::exchange::MIN_CHORD
    )]
    Chord { chord: f64 },
    #[error("cad.fillet is {radius} mm; more than 0 wanted, or rule, or off")]
    FilletRadius { radius: f64 },
    #[error("flats.crease_angle is {angle} degrees; more than 0 and less than 180 wanted")]
    CreaseAngle { angle: f64 },
    #[error("the triangles of {name} do not close: {source}")]
    Open { name: String, source: SolidError },
}

impl PipelineError {
    /// Exit code of the command line: 2 bad input, 3 a stage failed, 130 cancelled.
    pub fn exit_code(&self) -> u8 {
        if self.is_cancelled() {
            return 130;
        }
        match self.source {
            StageError::Io(_) | StageError::Repair(_) | StageError::Remesh(_) => 2,
            StageError::Feed(FeedError::Contradiction { .. }) => 3,
            StageError::Feed(_) | StageError::Edits(_) => 2,
            StageError::Solidify(SolidifyError::NotFrozen { .. }) => 3,
            StageError::Solidify(_) | StageError::Mould(_) => 2,
            StageError::Verify(VerifyError::Fe(
                FeError::NotConverged { .. } | FeError::Factor { .. },
            )) => 3,
            StageError::Verify(_) => 2,
            StageError::Tet(TetError::NotConverged { .. } | TetError::Factor { .. }) => 3,
            StageError::Tet(_) => 2,
            _ if matches!(
                self.stage,
                "options" | "case" | "read" | "non_design" | "recognise"
            ) =>
            {
                2
            }
            _ => 3,
        }
    }

    /// A way out, where there is one.
    pub fn hint(&self) -> Option<String> {
        match &self.source {
            StageError::Cancelled(_) => None,
            StageError::Io(e) => e.hint(),
            StageError::Repair(e) => e.hint(),
            StageError::Remesh(e) => e.hint(),
            StageError::Medial(e) => e.hint(),
            StageError::Skeleton(e) => e.hint(),
            StageError::Thicken(e) => e.hint(),
            StageError::Feed(e) => e.hint(),
            StageError::Edit(e) => e.hint(),
            StageError::Edits(e) => e.hint(),
            StageError::Mould(e) => e.hint(),
            StageError::Solidify(e) => e.hint(),
            StageError::Fit(e) => e.hint(),
            StageError::Spline(e) => e.hint(),
            StageError::Cad(e) => e.hint(),
            StageError::Report(e) => e.hint(),
            StageError::Case(e) => e.hint(),
            StageError::Topopt(e) => e.hint(),
            StageError::Verify(e) => e.hint(),
            StageError::Tet(e) => e.hint(),
            StageError::NoDensity { .. } => Some("leave --proposal out to do without".into()),
            StageError::StepProposal { .. } => {
                Some("give the optimization result, and this file with --non-design".into())
            }
            StageError::DensityBody { .. } => Some("export the body from CAD as STEP".into()),
            StageError::NoKernel { .. } => {
                Some("build with the default feature occt, or leave out --non-design".into())
            }
            StageError::Unit { bodies, proposal } => Some(unit_hint(bodies / proposal)),
            StageError::DesignSpace { .. } => Some("export it from CAD as STEP".into()),
            StageError::Format { .. } => Some("build with the default feature occt".into()),
            StageError::Chord { .. } => {
                Some("leave it out, or give a length such as files.chord=0.02".into())
            }
            StageError::FilletRadius { .. } => {
                Some("leave it out, or give a length such as cad.fillet=2".into())
            }
            StageError::CreaseAngle { .. } => {
                Some("leave it out, or give an angle such as flats.crease_angle=40".into())
            }
            StageError::Growth { .. } => Some("less feed.growth asks for less metal".into()),
            StageError::NoFeeders => Some("give one with --feeder x,y,z".into()),
            StageError::Open { .. } => Some("a smaller files.chord may help".into()),
            StageError::LargeBody { .. } => {
                Some("skeleton.layout=regular takes the layout without comparison".into())
            }
            StageError::NoQuadSize => {
                Some("give at least one factor, such as retry.quad_sizes=[1.0]".into())
            }
        }
    }

    pub(super) fn is_cancelled(&self) -> bool {
        matches!(
            self.source,
            StageError::Cancelled(_)
                | StageError::Io(IoError::Cancelled(_))
                | StageError::Repair(RepairError::Cancelled(_))
                | StageError::Remesh(RemeshError::Cancelled(_))
                | StageError::Medial(MedialError::Cancelled(_))
                | StageError::Skeleton(SkeletonError::Cancelled(_))
                | StageError::Thicken(ThickenError::Cancelled(_))
                | StageError::Feed(FeedError::Cancelled(_))
                | StageError::Mould(MouldError::Cancelled(_))
                | StageError::Solidify(SolidifyError::Cancelled(_))
                | StageError::Fit(FitError::Cancelled(_))
                | StageError::Spline(SplineError::Cancelled(_))
                | StageError::Cad(CadError::Cancelled(_))
                | StageError::Case(CaseError::Cancelled(_))
                | StageError::Verify(
                    VerifyError::Cancelled(_)
                        | VerifyError::Case(CaseError::Cancelled(_))
                        | VerifyError::Fe(FeError::Cancelled(_))
                        | VerifyError::Remesh(RemeshError::Cancelled(_))
                )
                | StageError::Tet(TetError::Cancelled(_) | TetError::Case(CaseError::Cancelled(_)))
                | StageError::Topopt(
                    TopoptError::Cancelled(_) | TopoptError::Fe(FeError::Cancelled(_))
                )
        )
    }
}

/// Names the unit whose size in mm is nearest to `factor`.
fn unit_hint(factor: f64) -> String {
    let units = [
        ("cm", 10.0),
        ("inches", 25.4),
        ("feet", 304.8),
        ("metres", 1000.0),
    ];
    let away = |mm: f64| (factor / mm).ln().abs();
    match units
        .into_iter()
        .min_by(|a, b| away(a.1).total_cmp(&away(b.1)))
    {
        Some((unit, mm)) if away(mm) < 0.35 => {
            format!("if the proposal is in {unit}, say so with --set read.scale={mm}")
        }
        _ => "give the proposal's unit with --set read.scale=MM_PER_UNIT".into(),
    }
}
