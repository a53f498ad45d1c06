//! What can be wrong with a medial mesh, a skeleton or the options.

use crate::monitor::Cancelled;
use crate::topology::Betti;

/// Why no quad skeleton could be made, or why a given one is refused. Indices count from 0.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SkeletonError {
    /// Nothing there.
    #[error("{0} has no faces and no edges")]
    Empty(&'static str),
    /// An option is out of its range.
    #[error("{name} is {value}, allowed is {range}")]
    Option {
        /// Name of the option.
        name: &'static str,
        /// Value given.
        value: f64,
        /// Range in words.
        range: &'static str,
    },
    /// A coordinate is not a finite number.
    #[error("point {point} has a coordinate that is not a finite number")]
    BadPoint {
        /// Index of the point.
        point: usize,
    },
    /// Not one radius a point.
    #[error("{radii} radii for {points} points")]
    RadiiCount {
        /// Radii given.
        radii: usize,
        /// Points given.
        points: usize,
    },
    /// A radius is negative, zero or infinite.
    #[error("the radius of point {point} is {value} mm, it must be positive")]
    BadRadius {
        /// Index of the point.
        point: usize,
        /// Value, mm.
        value: f64,
    },
    /// A face or an edge names a point that does not exist.
    #[error("{what} {index} names point {point}, there are {points}")]
    MissingPoint {
        /// "triangle", "quad", "edge" or "beam".
        what: &'static str,
        /// Its index.
        index: usize,
        /// The point named.
        point: u32,
        /// Number of points.
        points: usize,
    },
    /// A face or an edge uses a point twice.
    #[error("{what} {index} uses point {point} twice")]
    Degenerate {
        /// "triangle", "quad", "edge" or "beam".
        what: &'static str,
        /// Its index.
        index: usize,
        /// The point used twice.
        point: u32,
    },
    /// Two faces or beams use the same points, or a beam lies on the edge of a quad.
    #[error("{what} {index} repeats {other_what} {other}")]
    Duplicate {
        /// "quad" or "beam".
        what: &'static str,
        /// Its index.
        index: usize,
        /// "quad" or "beam".
        other_what: &'static str,
        /// Index of the one that was there before.
        other: usize,
    },
    /// A point that no quad and no beam uses.
    #[error("point {point} belongs to no quad and no beam; {count} such points")]
    Isolated {
        /// Index of the first one.
        point: usize,
        /// How many there are.
        count: usize,
    },
    /// A phase changed the topology. Never expected; nothing is written then.
    #[error("{phase} changed the topology from {before:?} to {after:?}")]
    Topology {
        /// The phase at fault.
        phase: &'static str,
        /// Before it.
        before: Betti,
        /// After it.
        after: Betti,
    },
    /// The user asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl SkeletonError {
    /// What the user can do about it.
    pub fn hint(&self) -> Option<String> {
        let text = match self {
            Self::Empty(_) => {
                "the medial axis was pruned away: use a finer voxel size or a smaller pruning threshold"
            }
            Self::Isolated { .. } => {
                "delete loose points before saving the skeleton (Blender: Mesh > Clean Up > Delete Loose)"
            }
            Self::Duplicate { .. } => {
                "merge or delete doubled faces (Blender: Mesh > Clean Up > Merge by Distance)"
            }
            Self::Degenerate { .. } => {
                "dissolve degenerate faces (Blender: Mesh > Clean Up > Degenerate Dissolve)"
            }
            Self::Topology { .. } => {
                "please report this part; a different skeleton.quad_size may get round it"
            }
            Self::BadRadius { .. } | Self::RadiiCount { .. } => {
                "leave the radius property out: radii are then taken from the part"
            }
            _ => return None,
        };
        Some(text.to_owned())
    }
}
