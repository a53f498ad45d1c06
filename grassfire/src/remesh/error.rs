//! What can go wrong in a remesh.

use crate::mesh::SolidError;
use crate::monitor::Cancelled;

/// Why a remesh failed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RemeshError {
    /// No usable triangle.
    #[error("the mesh has no triangle with finite corners and positive extent")]
    Empty,
    /// Nowhere does the surface enclose anything.
    #[error(
        "not a solid: the surface encloses nothing; at {sampled} places the winding number lies between {lowest:.3} and {highest:.3}, more than 0.5 is wanted"
    )]
    NotSolid {
        /// Smallest winding number met.
        lowest: f64,
        /// Largest winding number met.
        highest: f64,
        /// Places looked at.
        sampled: usize,
    },
    /// The grid would be too large.
    #[error("a voxel of {voxel} mm needs {wanted:.3e} voxels, the limit is {limit}")]
    TooManyVoxels {
        /// Voxel edge, mm.
        voxel: f64,
        /// Voxels of the grid.
        wanted: f64,
        /// `max_voxels`.
        limit: usize,
        /// A voxel edge that fits, mm.
        finest: f64,
    },
    /// An option makes no sense.
    #[error("remesh.{name} is {value}, {wanted} is wanted")]
    BadOption {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it should be.
        wanted: &'static str,
    },
    /// An option of [`super::CutOutOptions`] makes no sense.
    #[error("cut_out.{name} is {value} voxels, 0 to {most} are wanted")]
    BadCutOut {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The largest that is allowed.
        most: f64,
    },
    /// A density grid whose parts do not fit together.
    #[error(
        "the density grid is {dims:?} with {values} values and spacing {spacing} mm; at least 2 voxels a side, one value a voxel and a positive spacing are wanted"
    )]
    BadGrid {
        /// Voxels along x, y, z.
        dims: [usize; 3],
        /// Values given.
        values: usize,
        /// Spacing, mm.
        spacing: f64,
    },
    /// No density above the threshold.
    #[error("no material: the largest density is {highest}, the threshold is {iso}")]
    NoMaterial {
        /// Largest finite density.
        highest: f64,
        /// The threshold.
        iso: f64,
    },
    /// All material was thinner than the grid can hold or smaller than `min_tunnel`.
    #[error(
        "nothing is left at a voxel of {voxel} mm: every part is thinner than that or smaller than {width} mm"
    )]
    Vanished {
        /// Voxel edge, mm.
        voxel: f64,
        /// Smallest feature kept, mm.
        width: f64,
    },
    /// The surface does not have the topology of the voxels it was made from.
    #[error("the surface has Euler number {surface}, twice the voxels' {voxels} is wanted")]
    Topology {
        /// Euler number of the surface.
        surface: i64,
        /// Euler number of the voxels.
        voxels: i64,
    },
    /// The extracted surface is not closed and manifold.
    #[error("the new surface is not a solid")]
    Surface(#[from] SolidError),
    /// The user asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl RemeshError {
    /// What to try next.
    pub fn hint(&self) -> Option<String> {
        match self {
            Self::NotSolid { lowest, .. } if *lowest < -0.5 => {
                Some("the normals point inward: flip the mesh".into())
            }
            Self::NotSolid { .. } => Some(
                "close the surface, or give the sheet a thickness, before it is remeshed".into(),
            ),
            Self::TooManyVoxels { finest, .. } => Some(format!(
                "set remesh.voxel to {finest:.4} or more, or raise remesh.max_voxels"
            )),
            Self::Vanished { .. } => Some("set a smaller remesh.voxel or remesh.min_tunnel".into()),
            Self::NoMaterial { .. } => Some("lower the density threshold".into()),
            Self::Empty => Some("check that the file holds a surface".into()),
            Self::Topology { .. } | Self::Surface(_) => {
                Some("try a slightly different remesh.voxel".into())
            }
            Self::BadOption { .. }
            | Self::BadCutOut { .. }
            | Self::BadGrid { .. }
            | Self::Cancelled(_) => None,
        }
    }
}
