//! Thickening: skeleton with radii -> closed, oriented, manifold all-quad control mesh.

use crate::spline::ControlMesh;

/// The thickened body and where each of its points came from.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ThickenedBody {
    /// Closed quad mesh; may have several components (bodies) and inner shells.
    pub mesh: ControlMesh,
    /// Skeleton point of every mesh point: the offset is `mesh.points[i] - skeleton.points[source[i]]`.
    pub source: Vec<u32>,
}
