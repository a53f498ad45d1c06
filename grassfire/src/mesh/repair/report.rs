//! What was wrong with an input and what was done about it.

use serde::Serialize;

use super::super::TriMesh;
use crate::monitor::Cancelled;

/// Kind of a repair or of a note about an input.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RepairKind {
    /// The file claims another number of elements than it holds.
    CountMismatch,
    /// Bytes behind the last element were ignored.
    TrailingData,
    /// The closing keyword is missing.
    MissingEnd,
    /// Elements that carry no triangles or densities were ignored.
    Skipped,
    /// The file leaves something open and a value was assumed.
    Assumed,
    /// Densities outside 0..=1 were clamped.
    Clamped,
    /// Densities were interpolated to cubic voxels.
    Resampled,
    /// Voxels of material touch only by edges and corners.
    Checkerboard,
    /// Faces with missing or repeated corners were dropped.
    BadFaces,
    /// Faces with coordinates that are not finite were dropped.
    NonFinite,
    /// The part is very small or far from the origin.
    Scale,
    /// The coordinates are coarser than the part needs.
    PrecisionLoss,
    /// Points within a tolerance were united.
    Welded,
    /// Faces that occur twice were dropped.
    DuplicateFaces,
    /// Faces without area were dropped.
    DegenerateFaces,
    /// Flaps that hang on the surface by one side were dropped.
    Fins,
    /// Faces were turned to agree with their neighbours.
    Reoriented,
    /// Neighbours that cannot be made to agree.
    OrientationConflict,
    /// Whole shells were inside out and were turned.
    InsideOut,
    /// A shell inside a body is a void.
    Cavity,
    /// Pieces too small to matter were dropped.
    Islands,
    /// Several separate bodies.
    Bodies,
    /// Bodies that overlap.
    Overlap,
    /// Holes were filled.
    HolesFilled,
    /// Open edges that are left.
    LeftOpen,
    /// Edges with more than two faces that are left.
    NonManifold,
    /// Faces that run through others.
    SelfIntersection,
}

impl RepairKind {
    /// The mesh was changed; otherwise it is a note.
    pub fn changes_mesh(self) -> bool {
        matches!(
            self,
            Self::CountMismatch
                | Self::Clamped
                | Self::BadFaces
                | Self::NonFinite
                | Self::Welded
                | Self::DuplicateFaces
                | Self::DegenerateFaces
                | Self::Fins
                | Self::Reoriented
                | Self::InsideOut
                | Self::Islands
                | Self::HolesFilled
        )
    }

    /// The user should know: it goes into the warnings of the report.
    pub fn is_warning(self) -> bool {
        matches!(
            self,
            Self::CountMismatch
                | Self::MissingEnd
                | Self::Clamped
                | Self::Checkerboard
                | Self::Scale
                | Self::PrecisionLoss
                | Self::NonFinite
                | Self::OrientationConflict
                | Self::Cavity
                | Self::Overlap
                | Self::LeftOpen
                | Self::SelfIntersection
        )
    }
}

/// One repair or note.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Repair {
    /// What it is about.
    pub kind: RepairKind,
    /// How many elements it touched.
    pub count: usize,
    /// One line for people, with place and value.
    pub text: String,
}

impl Repair {
    /// A repair of `count` elements.
    pub fn new(kind: RepairKind, count: usize, text: impl Into<String>) -> Self {
        Self {
            kind,
            count,
            text: text.into(),
        }
    }
}

/// Figures of an input and what was done to it: the block `input` of the report.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct RepairReport {
    /// Triangles that were handed in.
    pub triangles: usize,
    /// Volume of the repaired mesh, mm3; overlapping bodies count twice.
    pub volume: f64,
    /// Edges with one face, in the input after uniting equal points.
    pub open_edges: usize,
    /// Edges with more than two faces, likewise.
    pub non_manifold_edges: usize,
    /// Pieces connected by edges, likewise.
    pub components: usize,
    /// Everything that was done, in order.
    pub repairs: Vec<Repair>,
}

/// A mesh that is fit for the voxel remesh.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Repaired {
    /// Consistently oriented triangles; a few open or non-manifold edges may be left.
    pub mesh: TriMesh,
    /// What was found and done.
    pub report: RepairReport,
}

/// Why a mesh cannot be repaired.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RepairError {
    /// No usable triangle.
    #[error("the mesh has no usable triangle ({dropped} of {triangles} were dropped: {why})")]
    Empty {
        /// Triangles that were handed in.
        triangles: usize,
        /// How many were dropped.
        dropped: usize,
        /// What was wrong with them.
        why: &'static str,
    },
    /// More triangles than 32-bit half-edges can count.
    #[error("the mesh has {triangles} triangles, the limit is {limit}")]
    TooMany {
        /// Triangles that were handed in.
        triangles: usize,
        /// How many are possible.
        limit: usize,
    },
    /// Larger than any casting.
    #[error("the part is {size:.3e} mm long, the limit is {limit:.3e} mm")]
    TooLarge {
        /// Diagonal of its box, mm.
        size: f64,
        /// Limit, mm.
        limit: f64,
    },
    /// The coordinates carry no shape any more.
    #[error(
        "the coordinates lie {offset:.3e} mm from the origin, where numbers step by {step:.3e} mm; the part is only {size:.3e} mm long"
    )]
    PrecisionLost {
        /// Largest coordinate, mm.
        offset: f64,
        /// Step between numbers there, mm.
        step: f64,
        /// Diagonal of the part, mm.
        size: f64,
    },
    /// A sheet, or a piece of a surface.
    #[error("not a solid: {why}")]
    NotASolid {
        /// What shows it, with value and limit.
        why: String,
    },
    /// The mesh needs repair and the options forbid it.
    #[error("the mesh needs {count} repairs and `strict` forbids them; the first: {first}")]
    Strict {
        /// How many kinds of repair.
        count: usize,
        /// Text of the first.
        first: String,
    },
    /// Asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl RepairError {
    /// What to do about it.
    pub fn hint(&self) -> Option<String> {
        let text = match self {
            Self::Empty { .. } => "export the part again as STL or OBJ",
            Self::TooMany { .. } => "decimate the mesh first",
            Self::TooLarge { .. } => "set `scale` to millimetres per unit of the file",
            Self::PrecisionLost { .. } => "move the part near the origin before exporting it",
            Self::NotASolid { .. } => {
                "export a closed surface around the material; sheets have no inside"
            }
            Self::Strict { .. } => "leave out `strict` to have it repaired",
            Self::Cancelled(_) => return None,
        };
        Some(text.to_owned())
    }
}
