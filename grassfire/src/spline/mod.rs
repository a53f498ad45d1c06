//! Control mesh -> exact G1 bi-5/bi-3 patches -> few B-spline faces -> boundary representation.

mod bezier;
mod blocks;
mod brep;
pub mod catmull_clark;
mod coarsen;
mod corner;
mod curvature;
mod error;
mod gauss;
pub(crate) mod half_edges;
mod independent;
mod measure;
mod motorcycle;
mod patches;
mod quality;
mod refit;
mod removal;
mod sink;
mod slide;
mod stencils;
mod tessellate;

pub use bezier::{SurfacePoint, evaluate};
pub use brep::{BrepOptions, FaceMode, build_brep};
pub use coarsen::{Coarse, coarsen};
pub use curvature::{CurvatureJump, curvature_jump};
pub use error::SplineError;
pub use measure::{area, volume};
pub use patches::{PatchOptions, patches};
pub use quality::{G1Report, Jacobian, g1_max, jacobians};
pub use removal::{CoarserStep, take_quads_out};
pub use sink::sink_flush;
pub use slide::{Crowded, slide_borders};
pub use tessellate::{SurfaceSample, TessellateOptions, Tessellation, tessellate};

use crate::Vec3;

/// Name of this stage in progress and warnings.
const STAGE: &str = "spline";

/// A closed quad mesh: the control net of a Catmull-Clark surface.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ControlMesh {
    /// Control points, mm.
    pub points: Vec<Vec3>,
    /// Quads, counter-clockwise seen from outside, every edge used once in each sense.
    pub quads: Vec<[u32; 4]>,
}

/// One bi-5 Bezier patch: `control[i][j]` with i along u (first to second corner of the quad) and j along v.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Patch {
    /// 6 x 6 control points, mm.
    pub control: [[Vec3; 6]; 6],
}

/// A B-spline curve edge of a [`Brep`]: degree 5, knots 0..=spans with multiplicity 6,4,..,4,6.
#[derive(Debug, Clone, PartialEq)]
pub struct BrepEdge {
    /// Start and end vertex.
    pub vertices: [u32; 2],
    /// Bezier spans.
    pub spans: u32,
    /// `4 * spans + 2` control points, mm.
    pub control: Vec<Vec3>,
}

/// One use of an edge by a face, counter-clockwise, with its exact straight pcurve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BrepUse {
    /// Index of the edge.
    pub edge: u32,
    /// The face runs against the edge.
    pub reversed: bool,
    /// Surface parameters at the start of the EDGE (not of the use).
    pub start: [f64; 2],
    /// Surface parameters at the end of the EDGE.
    pub end: [f64; 2],
}

/// A B-spline face: degree 5 x 5, knots 0..=spans with multiplicity 6,4,..,4,6 in both directions.
#[derive(Debug, Clone, PartialEq)]
pub struct BrepFace {
    /// Spans along u and v.
    pub spans: [u32; 2],
    /// `(4 * spans[0] + 2) * (4 * spans[1] + 2)` control points, mm; v runs fastest.
    pub control: Vec<Vec3>,
    /// The outer loop around the whole patch rectangle, counter-clockwise.
    pub uses: Vec<BrepUse>,
}

/// Boundary representation of one or more closed shells, ready for a CAD kernel.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Brep {
    /// Corner points, mm.
    pub vertices: Vec<Vec3>,
    /// Edges, each used by two faces, once in each sense.
    pub edges: Vec<BrepEdge>,
    /// Faces.
    pub faces: Vec<BrepFace>,
    /// Faces of each connected shell (indices into `faces`).
    pub shells: Vec<Vec<u32>>,
    /// Volume by exact Gauss integration of the patches, mm3 (signed sum over shells).
    pub volume: f64,
}
