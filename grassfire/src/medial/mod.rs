//! Medial axis: voxel solid -> exact Delaunay -> interior Voronoi complex -> burn-order pruning -> spheres.

mod axis;
mod burn;
mod complex;
mod curves;
mod delaunay;
mod necks;
mod options;
mod poles;
mod predicates;
mod refit;
mod spatial_order;
mod union_find;
mod voxel_solid;

pub use axis::medial_axis;
pub use delaunay::{Delaunay, NONE, Tet, delaunay, delaunay_lattice};
pub use options::{MedialError, MedialOptions};
pub use poles::{PoleOptions, Poles, poles};

use crate::Vec3;
use crate::topology::Betti;

/// A 2-complex of medial spheres: triangles (sheets) and edges without triangles (curves).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MedialMesh {
    /// Centres, mm.
    pub points: Vec<Vec3>,
    /// Radii, mm, one a point.
    pub radii: Vec<f64>,
    /// Edges that belong to no triangle.
    pub edges: Vec<[u32; 2]>,
    /// Triangles; not consistently oriented, edges may have any number of triangles.
    pub triangles: Vec<[u32; 3]>,
}

/// The pruned medial axis and the proof that its topology was kept.
#[derive(Debug, Clone, Default)]
pub struct MedialAxis {
    /// The pruned complex, triangulated, geometry refitted to the surface.
    pub mesh: MedialMesh,
    /// Topology of the voxel solid (6-connected).
    pub solid: Betti,
    /// Topology of the full interior Voronoi complex.
    pub complex: Betti,
    /// Topology of `mesh`.
    pub pruned: Betti,
    /// Lattice corners that entered the Delaunay triangulation.
    pub samples: usize,
}
