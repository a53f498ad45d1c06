//! The decomposition structure: an all-quad non-manifold skeleton with beams and one radius a point.

use crate::Vec3;

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
