//! The blocks of topology, skeleton and body.

use serde::Serialize;

use crate::skeleton::{Deviation, Range};
use crate::topology::{Betti, SurfaceTopology};

/// Betti numbers of every stage; they must agree.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct TopologyBlock {
    /// The voxel solid.
    pub solid: Betti,
    /// The full interior Voronoi complex.
    pub complex: Betti,
    /// The quad skeleton with its beams.
    pub skeleton: Betti,
    /// Every closed surface of the thickened body.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub body: Vec<SurfaceTopology>,
    /// What the union with the non-design bodies must have, when these were cut out of the proposal before the skeleton;
    /// the rows above are then those of the design part.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub united: Option<Betti>,
}

/// The quad skeleton.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct SkeletonBlock {
    /// Layout of its quads, `regular` or `plain`; `drawn` for a skeleton drawn elsewhere.
    pub layout: String,
    /// Why the regular layout was given up for the plain one; none when it was not tried.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub regular_refused: Option<String>,
    /// Made with the steady limits, `retry.steady`.
    pub steady: bool,
    /// Why these were given up for the usual ones; none when they were not tried.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steady_refused: Option<String>,
    /// Of a design part that keeps the tips of its wedges beside non-design bodies, `retry.wedge`.
    pub wedges: bool,
    /// Quads of the size asked for gave no sound body; these have the default size.
    pub size_refused: bool,
    /// Voxel of the proposal that it is made of, mm; the body follows the proposal at the voxel of the remesh.
    pub voxel: f64,
    /// Quads.
    pub quads: usize,
    /// Edges without quads.
    pub beams: usize,
    /// Sheets: connected pieces between seams.
    pub sheets: usize,
    /// Curves where three or more sheets meet.
    pub seams: usize,
    /// Free borders of sheets.
    pub rims: usize,
    /// Medial spheres before the quads.
    pub spheres: usize,
    /// Share of inner points with four quads.
    pub regular_fraction: f64,
    /// Deviation of the quads' corners from a right angle, degrees.
    pub corner_deviation: Deviation,
    /// Radii, mm.
    pub radius: Range,
}

/// The thickened and fitted body.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct BodyBlock {
    /// Quads of the control mesh.
    pub quads: usize,
    /// Points with other than four quads.
    pub extraordinary: usize,
    /// Pairs of faces that cut each other.
    pub self_intersections: usize,
    /// Patches whose normal flips over somewhere.
    pub folds: usize,
    /// `thickened` from the skeleton, or `wrapped` around the proposal where the part is too bulky for that.
    pub construction: String,
}
