//! The decomposition structure: an all-quad non-manifold skeleton with beams and one radius a point.

mod anneal;
mod arcs;
mod bends;
mod body_valence;
mod build;
mod check;
mod coarsen;
mod complex;
mod cut;
mod edges;
mod error;
mod layout;
mod members;
mod nearest;
mod nodes;
mod pairing;
mod polygons;
mod quad_mesh;
mod quad_moves;
mod reduce;
mod reference;
mod shape_cost;
mod split_chords;
mod square;
mod stats;
mod tidy;
mod walk;

pub use build::{SkeletonOptions, quad_skeleton};
pub use check::check;
pub(crate) use edges::{EdgeTable, UnionFind, edge};
pub use error::SkeletonError;
pub use layout::Layout;
pub(crate) use nearest::PointGrid;
pub use stats::{Deviation, Range, SkeletonStats, stats, topology};

use crate::Vec3;
use crate::topology::Betti;

/// Quads (sheets) and beams (curves) with a radius at every point; what a user may edit.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Skeleton {
    /// Positions, mm.
    pub points: Vec<Vec3>,
    /// Radii, mm, one a point.
    pub radii: Vec<f64>,
    /// Quads; not consistently oriented; an edge with three or more quads is a seam, with one a rim.
    pub quads: Vec<[u32; 4]>,
    /// Edges without quads.
    pub beams: Vec<[u32; 2]>,
}

/// The skeleton of a medial axis, with the proof that its topology was kept and its figures.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct QuadSkeleton {
    /// The skeleton.
    pub skeleton: Skeleton,
    /// Betti numbers of the skeleton, equal to those of the medial mesh.
    pub topology: Betti,
    /// Counts and quality.
    pub stats: SkeletonStats,
}
