//! What can be wrong with a control mesh.

use super::catmull_clark::CatmullClarkError;
use crate::monitor::Cancelled;

/// Why a control mesh has no smooth closed surface; indices name the first offender, places are in mm.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SplineError {
    /// Nothing there.
    #[error("the control mesh has no quads")]
    Empty,
    /// Indices would not fit.
    #[error("the control mesh has {quads} quads, the limit is {limit}")]
    TooLarge {
        /// Number of quads.
        quads: usize,
        /// Largest number of quads.
        limit: usize,
    },
    /// A quad names a point that does not exist.
    #[error("quad {quad} names point {point} of {points}")]
    MissingPoint {
        /// Index of the quad.
        quad: usize,
        /// The index that it names.
        point: u32,
        /// Number of points.
        points: usize,
    },
    /// A coordinate is infinite, not a number or beyond 1e12 mm.
    #[error("point {point} has a coordinate that is not a number of at most 1e12 mm")]
    NotFinite {
        /// Index of the point.
        point: usize,
    },
    /// A quad uses a point twice.
    #[error("quad {quad} uses point {point} twice at {place:.3?}")]
    DegenerateQuad {
        /// Index of the quad.
        quad: usize,
        /// Index of the point.
        point: u32,
        /// Where, mm.
        place: [f64; 3],
    },
    /// An edge has one quad only.
    #[error("edge {edge:?} of quad {quad} is open at {place:.3?}; {count} such edges")]
    OpenEdge {
        /// The two point indices.
        edge: [u32; 2],
        /// Index of the quad.
        quad: usize,
        /// Middle of the edge, mm.
        place: [f64; 3],
        /// How many such edges there are.
        count: usize,
    },
    /// An edge has not exactly one quad on either side.
    #[error(
        "edge {edge:?} has {along} quads running along it and {against} against it (1 and 1 wanted) at {place:.3?}; {count} such edges"
    )]
    NonManifoldEdge {
        /// The two point indices.
        edge: [u32; 2],
        /// Quads that run along it.
        along: usize,
        /// Quads that run against it.
        against: usize,
        /// Middle of the edge, mm.
        place: [f64; 3],
        /// How many such edges there are.
        count: usize,
    },
    /// The quads around a point form more than one fan.
    #[error(
        "point {point} is pinched at {place:.3?}: its quads form more than one fan; {count} such points"
    )]
    PinchedPoint {
        /// Index of the point.
        point: u32,
        /// Where, mm.
        place: [f64; 3],
        /// How many such points there are.
        count: usize,
    },
    /// Too few quads around a point: there is no tangent plane.
    #[error(
        "point {point} has {valence} quads around it (3 or more wanted) at {place:.3?}; {count} such points"
    )]
    Valence {
        /// Index of the point.
        point: u32,
        /// Quads around it.
        valence: u32,
        /// Where, mm.
        place: [f64; 3],
        /// How many such points there are.
        count: usize,
    },
    /// The patches do not belong to the control mesh.
    #[error("{patches} patches for {quads} quads")]
    PatchCount {
        /// Number of patches.
        patches: usize,
        /// Number of quads.
        quads: usize,
    },
    /// A group of quads that should form one rectangle does not.
    #[error("the block of quad {quad} at {place:.3?} is not a rectangle")]
    NotRectangular {
        /// A quad of the block.
        quad: usize,
        /// Its first corner, mm.
        place: [f64; 3],
    },
    /// Patches of one face do not join smoothly.
    #[error(
        "the patches of the face of quad {quad} at {place:.3?} miss a smooth joint by {value:.3e} mm (limit {limit:.3e})"
    )]
    NotSmooth {
        /// A quad of the face.
        quad: usize,
        /// Its first corner, mm.
        place: [f64; 3],
        /// Distance between the control points and the smooth joint, mm.
        value: f64,
        /// Largest distance allowed, mm.
        limit: f64,
    },
    /// The boundary representation breaks one of its own rules.
    #[error("boundary representation: {rule} is broken at index {index}")]
    Inconsistent {
        /// The rule.
        rule: &'static str,
        /// Index of the face or edge.
        index: usize,
    },
    /// The boundary representation has another topology than the control mesh.
    #[error("boundary representation has Euler number {value}, the control mesh {expected}")]
    Euler {
        /// V - E + F of the boundary representation.
        value: i64,
        /// V - E + F of the control mesh.
        expected: i64,
    },
    /// The control mesh cannot be subdivided.
    #[error(transparent)]
    Subdivision(#[from] CatmullClarkError),
    /// Stopped by the user.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl SplineError {
    /// What the user can do about it.
    pub fn hint(&self) -> Option<String> {
        let text = match self {
            Self::Empty => "the thickened body is empty: check the skeleton",
            Self::TooLarge { .. } => "use a larger quad size",
            Self::MissingPoint { .. } | Self::NotFinite { .. } => {
                "the control mesh file is damaged: write it again"
            }
            Self::DegenerateQuad { .. } => "merge or remove the quad",
            Self::OpenEdge { .. } => "the control mesh must be closed: fill the hole",
            Self::NonManifoldEdge { .. } => {
                "orient all quads alike and separate walls that touch along an edge"
            }
            Self::PinchedPoint { .. } => "separate the parts that touch in this point",
            Self::Valence { .. } => {
                "merge the two quads around the point or split one of its neighbours"
            }
            Self::PatchCount { .. } => "compute the patches again from this control mesh",
            Self::NotRectangular { .. }
            | Self::NotSmooth { .. }
            | Self::Inconsistent { .. }
            | Self::Euler { .. } => "build one face a quad: faces = \"quads\"",
            Self::Subdivision(inner) => return inner.hint(),
            Self::Cancelled(_) => return None,
        };
        Some(text.to_owned())
    }
}
