//! Options and errors of the medial stage.

use serde::{Deserialize, Serialize};

use crate::monitor::Cancelled;
use crate::topology::Betti;

/// What [`medial_axis`](super::medial_axis) keeps. Erosion thickness is how much longer than its radius R a
/// place of the medial axis lasts in the grassfire; in a bar of half thickness a and half width b it is
/// 0.41 a on the corner sheets and 0.41 a + x on the middle sheet, x from its end.
///
/// The ratios decide, so that results hardly depend on the resolution; the limits in voxels only
/// matter for members less than about five voxels thick, where lattice noise is not small against the radius.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MedialOptions {
    /// Least erosion thickness of a sheet in voxels: below is lattice noise.
    pub sheet_noise: f64,
    /// Least erosion thickness of a sheet as a multiple of its radius.
    pub sheet_ratio: f64,
    /// A curve between sheets that is shorter than this multiple of its radius is a neck; 0 looks for none.
    pub neck_length: f64,
    /// Least erosion thickness of a sheet at a neck as a multiple of its radius, if that is less than `sheet_ratio`.
    pub neck_ratio: f64,
    /// A sheet whose erosion thickness is below this multiple of its radius everywhere becomes a curve.
    pub ribbon_ratio: f64,
    /// Sine of half the object angle above which burnt rims grow back.
    pub regrow_sine: f64,
    /// A sheet without seams whose area is below the square of this multiple of its mean radius becomes a curve.
    pub island_ratio: f64,
    /// Least erosion thickness of a dangling curve at its root in voxels.
    pub curve_noise: f64,
    /// Least erosion thickness of a dangling curve at its root as a multiple of the radius there.
    pub curve_ratio: f64,
    /// A dangling curve is cut back to a ball that holds all beyond it but this multiple of its radius
    /// (at least two voxels).
    pub tip_ratio: f64,
    /// Weight of the old sphere against its surface planes when spheres are refitted.
    pub refit_rest: f64,
    /// Longest move of a sphere's centre in voxels when it is refitted.
    pub refit_move: f64,
}

impl Default for MedialOptions {
    fn default() -> Self {
        Self {
            sheet_noise: 2.5,
            sheet_ratio: 0.75,
            neck_length: 0.0,
            neck_ratio: 0.8,
            ribbon_ratio: 2.0,
            regrow_sine: 0.75,
            island_ratio: 3.0,
            curve_noise: 4.0,
            curve_ratio: 1.6,
            tip_ratio: 0.25,
            refit_rest: 0.3,
            refit_move: 1.5,
        }
    }
}

impl MedialOptions {
    /// Erosion thickness (voxels) up to which a face of radius `r` (voxels) burns.
    pub(super) fn sheet_limit(&self, r: f32) -> f32 {
        (self.sheet_noise as f32).max(self.sheet_ratio as f32 * r)
    }

    /// The same at a neck.
    pub(super) fn neck_limit(&self, r: f32) -> f32 {
        (self.sheet_noise as f32).max(self.neck_ratio.min(self.sheet_ratio) as f32 * r)
    }

    /// Erosion thickness (voxels) up to which a curve of radius `r` (voxels) at its root burns.
    pub(super) fn curve_limit(&self, r: f32) -> f32 {
        (self.curve_noise as f32).max(self.curve_ratio as f32 * r)
    }

    /// How far (voxels) balls may stick out of a tip's ball of radius `r` (voxels) and still count as a spur.
    pub(super) fn tip_limit(&self, r: f32) -> f32 {
        (self.tip_ratio as f32 * r).max(2.0)
    }

    pub(super) fn check(&self) -> Result<(), MedialError> {
        let options = [
            ("sheet_noise", self.sheet_noise),
            ("sheet_ratio", self.sheet_ratio),
            ("neck_length", self.neck_length),
            ("neck_ratio", self.neck_ratio),
            ("ribbon_ratio", self.ribbon_ratio),
            ("regrow_sine", self.regrow_sine),
            ("island_ratio", self.island_ratio),
            ("curve_noise", self.curve_noise),
            ("curve_ratio", self.curve_ratio),
            ("tip_ratio", self.tip_ratio),
            ("refit_rest", self.refit_rest),
            ("refit_move", self.refit_move),
        ];
        match options
            .into_iter()
            .find(|(_, value)| !(value.is_finite() && *value >= 0.0))
        {
            Some((name, value)) => Err(MedialError::BadOption { name, value }),
            None => Ok(()),
        }
    }
}

/// Why there is no medial axis.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MedialError {
    /// No voxel is above zero.
    #[error("the field has no solid voxel")]
    Empty,
    /// Dimensions, number of values and spacing do not fit each other.
    #[error("the grid of {dims:?} voxels of {spacing} mm holds {values} values")]
    BadGrid {
        /// Voxels along x, y, z.
        dims: [usize; 3],
        /// Number of values.
        values: usize,
        /// Edge of a voxel, mm.
        spacing: f64,
    },
    /// An option is negative or not finite.
    #[error("medial.{name} is {value}, it must be finite and not negative")]
    BadOption {
        /// Name of the option.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A coordinate is not a number.
    #[error("point {index} has a coordinate that is not finite")]
    NotFinite {
        /// Index of the point.
        index: usize,
    },
    /// A coordinate is beyond the reach of the exact predicates.
    #[error("point {index} has a coordinate of {value}, the limit is {limit}")]
    TooLarge {
        /// Index of the point.
        index: usize,
        /// The coordinate.
        value: f64,
        /// Largest allowed absolute value.
        limit: f64,
    },
    /// More points than 32-bit facet numbers allow.
    #[error("{count} points, the limit is {limit}")]
    TooMany {
        /// Number of points.
        count: usize,
        /// Largest allowed number.
        limit: usize,
    },
    /// All points lie in one plane, on one line or at one place: there is no tetrahedron.
    #[error("{points} points span only {dimension} dimensions")]
    Flat {
        /// Number of points.
        points: usize,
        /// Dimension of their hull: 0, 1 or 2.
        dimension: usize,
    },
    /// The topology was lost: a bug or a broken guarantee, never a tuning matter.
    #[error("the {at} has Betti numbers {found:?}, the voxel solid has {wanted:?}")]
    Topology {
        /// Which complex.
        at: &'static str,
        /// Of the voxel solid.
        wanted: Betti,
        /// Of the complex.
        found: Betti,
    },
    /// An internal invariant broke.
    #[error("internal: {what} (index {index})")]
    Internal {
        /// What happened.
        what: &'static str,
        /// Where.
        index: usize,
    },
    /// The user asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl MedialError {
    /// What the user can do about it.
    pub fn hint(&self) -> Option<String> {
        Some(match self {
            Self::Empty => "use a smaller voxel (`--voxel`) or check that the part is closed and its normals point outwards".into(),
            Self::TooLarge { .. } => "check the unit of the part: coordinates are millimetres".into(),
            Self::TooMany { .. } => "use a larger voxel (`--voxel`)".into(),
            Self::Flat { .. } => "the part has no volume; check that it is a solid".into(),
            Self::Topology { .. } | Self::Internal { .. } => "please report this with the input file; a slightly different voxel (`--voxel`) may get round it".into(),
            _ => return None,
        })
    }
}
