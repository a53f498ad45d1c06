//! Thickening: skeleton with radii -> closed, oriented, manifold all-quad control mesh.

mod adopt;
mod beams;
mod check;
mod chords;
mod complex;
mod node;
mod regions;
mod sectors;

pub use adopt::adopt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Vec3;
use crate::monitor::{Cancelled, Monitor};
use crate::skeleton::Skeleton;
use crate::spline::ControlMesh;

/// Name of this stage in progress and warnings.
pub(crate) const STAGE: &str = "thicken";

/// The thickened body and where each of its points came from.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ThickenedBody {
    /// Closed quad mesh; may have several components (bodies) and inner shells.
    pub mesh: ControlMesh,
    /// Skeleton point of every mesh point: the offset is `mesh.points[i] - skeleton.points[source[i]]`.
    pub source: Vec<u32>,
    /// Exact foot of every mesh point on the skeleton, mm. It equals the source point except where
    /// thickening put a vertex of its own (middle of a one-edge beam or of a split
    /// strip, tie of two sheets that touch in a point). To apply an edited radius, scale `mesh.points[i] - foot[i]`.
    pub foot: Vec<Vec3>,
    /// One entry a connected component of the skeleton, in the order of their lowest point.
    pub bodies: Vec<BodyTopology>,
    /// How often each rule was used.
    pub rules: RuleCounts,
}

/// Topology of one body, already checked against the skeleton.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct BodyTopology {
    /// Euler number of the skeleton component.
    pub skeleton_chi: i64,
    /// Euler number of the surface, twice that of the skeleton.
    pub chi: i64,
    /// Closed surfaces: one, and one more for every cavity.
    pub shells: u32,
    /// Quads of all shells.
    pub quads: u32,
    /// Signed volume of the control mesh, mm3.
    pub volume: f64,
}

/// How often each thickening rule was used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct RuleCounts {
    /// Ring rule at a vertex with sheets (beam foot on a rim, bow-tie).
    pub ring_feet: u32,
    /// Ring rule at a vertex with beams only.
    pub ring_nodes: u32,
    /// Polyhedron at a vertex with beams only.
    pub polyhedron_nodes: u32,
    /// Beam set on a quad of the body.
    pub plug_feet: u32,
    /// Free beam tips.
    pub tips: u32,
    /// Closed beam loops.
    pub loops: u32,
    /// Rim ends inside a sheet.
    pub seam_ends: u32,
    /// Components split off a vertex and tied by a short beam.
    pub ties: u32,
    /// Edges whose strip of quads was split because its offsets would have coincided.
    pub strips: u32,
    /// Middle vertices put into one-edge beams.
    pub middles: u32,
    /// Valence-2 points removed by merging their two quads.
    pub doublets: u32,
}

/// Options of [`thicken`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ThickenOptions {
    /// Offsets are this times the radius. One half when a fit follows (calmer start at concave
    /// rims), 1 for bodies that are taken as they are.
    pub scale: f64,
    /// Largest ratio of a mitred offset to the radius.
    pub mitre_limit: f64,
    /// The ring rule is refused when a beam runs closer than this to the ring's axis, degrees.
    pub axis_angle: f64,
}

impl Default for ThickenOptions {
    fn default() -> Self {
        Self {
            scale: 0.5,
            mitre_limit: 2.2,
            axis_angle: 35.0,
        }
    }
}

/// Why a skeleton cannot be thickened.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ThickenError {
    /// No quads and no beams.
    #[error("the skeleton has neither quads nor beams")]
    Empty,
    /// An option is out of range.
    #[error("option {name} is {value}, allowed is {allowed}")]
    BadOption {
        /// Name of the option.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What is allowed.
        allowed: &'static str,
    },
    /// Points and radii differ in number, or too many.
    #[error("{points} points but {radii} radii")]
    BadCount {
        /// Number of points.
        points: usize,
        /// Number of radii.
        radii: usize,
    },
    /// A used point is not finite or its radius not positive.
    #[error("point {point} at ({}, {}, {}) with radius {radius} is unusable", place.x, place.y, place.z)]
    BadPoint {
        /// Index of the point.
        point: u32,
        /// Its position, mm.
        place: Vec3,
        /// Its radius, mm.
        radius: f64,
    },
    /// A quad names a missing point or a point twice.
    #[error("quad {quad} is degenerate or names a missing point")]
    BadQuad {
        /// Index of the quad.
        quad: u32,
    },
    /// A beam names a missing point or a point twice.
    #[error("beam {beam} is degenerate or names a missing point")]
    BadBeam {
        /// Index of the beam.
        beam: u32,
    },
    /// The surface is not closed, manifold and oriented at an edge.
    #[error(
        "edge of the body near ({:.3}, {:.3}, {:.3}) has {along} quads along and {against} against it (1 and 1 wanted); {count} such edges",
        place.x, place.y, place.z
    )]
    NotManifold {
        /// Skeleton points behind the first such edge.
        points: [u32; 2],
        /// Where, mm.
        place: Vec3,
        /// Quads that run along the edge.
        along: u32,
        /// Quads that run against the edge.
        against: u32,
        /// Number of such edges.
        count: usize,
    },
    /// The quads around a point form more than one fan, or fewer than three.
    #[error("body point of skeleton point {point} at ({:.3}, {:.3}, {:.3}): {what}", place.x, place.y, place.z)]
    BadVertex {
        /// Skeleton point.
        point: u32,
        /// Where, mm.
        place: Vec3,
        /// What is wrong.
        what: &'static str,
    },
    /// The Euler number is not twice that of the skeleton.
    #[error("body {body} near ({:.3}, {:.3}, {:.3}) has Euler number {chi}, its skeleton asks for {wanted}", place.x, place.y, place.z)]
    BadTopology {
        /// Index of the body.
        body: u32,
        /// First skeleton point of the body, mm.
        place: Vec3,
        /// Euler number of the surface.
        chi: i64,
        /// Twice the Euler number of the skeleton.
        wanted: i64,
    },
    /// A body is inside out.
    #[error("body {body} near ({:.3}, {:.3}, {:.3}) has volume {volume} mm3", place.x, place.y, place.z)]
    NotPositive {
        /// Index of the body.
        body: u32,
        /// First skeleton point of the body, mm.
        place: Vec3,
        /// Signed volume, mm3.
        volume: f64,
    },
    /// The user asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl ThickenError {
    /// What the user can do about it.
    pub fn hint(&self) -> Option<String> {
        let text = match self {
            Self::Empty => "the proposal vanished under the skeleton thresholds: use a finer grid",
            Self::BadOption { .. } | Self::Cancelled(_) => return None,
            Self::BadCount { .. }
            | Self::BadPoint { .. }
            | Self::BadQuad { .. }
            | Self::BadBeam { .. } => {
                "correct the skeleton file: finite points, positive radii, quads and beams over distinct points"
            }
            Self::NotManifold { .. } | Self::BadVertex { .. } | Self::BadTopology { .. } => {
                "sheets are folded onto each other at this place: refine or smooth the skeleton there"
            }
            Self::NotPositive { .. } => "the radii there are larger than the part: reduce them",
        };
        Some(text.to_owned())
    }
}

/// Closed quad body around a skeleton: the boundary of a neighbourhood of its sheets and beams.
///
/// A small sphere around a skeleton vertex is cut into regions by the faces there. The algorithm:
/// 1. Beams of one edge get a middle vertex. A vertex whose neighbourhood falls into several pieces
///    that no ring can join is split, and the copies are tied by a short beam (same homotopy). Strips
///    of quads through an edge with the same region twice at both ends (one-edge seams) are split.
/// 2. Region rule: corners of quads on the same side of the complex are united around every edge
///    (faces sorted by angle, edges of one vertex brought into agreement where sheets run close together; the
///    side comes from the cycle of the face, never from a normal); each region gives one offset point, each group of rims another one outward.
/// 3. Ring rule: a vertex of plain fans and beams only, none along the axis, gets two poles and one
///    point between neighbours; each beam leaves through a 4-gon.
/// 4. Polyhedron rule: any other beam node gets a rotated cube whose sides are divided until every
///    beam has a quad of its own that faces it.
/// 5. Plug rule: a beam on any other vertex replaces the body quad that looks most along it.
/// 6. Beams become tubes of 4-gons along rotation-minimising frames; free ends are capped, loops
///    closed with the nearest quarter turn.
/// 7. Quads around valence-2 points are merged.
///
/// The result is checked, per body: closed, manifold, oriented outward (cavities inward), no point of
/// valence 2, Euler number twice that of the skeleton, positive volume.
///
/// Lengths in mm. The surface may intersect itself where radii are larger than gaps; the fit finds
/// such places. Duplicate beams and beams along a quad's edge are dropped with a warning.
///
/// # Errors
/// Invalid input, or a place where the result would not be the surface described above.
pub fn thicken(
    skeleton: &Skeleton,
    options: &ThickenOptions,
    monitor: &Monitor,
) -> Result<ThickenedBody, ThickenError> {
    check_options(options)?;
    monitor.step(STAGE, "regions", 0.0)?;
    let mut rules = RuleCounts::default();
    let complex = complex::prepare(skeleton, options, &mut rules, monitor)?;
    monitor.step(STAGE, "offsets", 0.3)?;
    let mut body = regions::offset_sheets(&complex, options, &mut rules);
    monitor.step(STAGE, "beams", 0.6)?;
    beams::add_beams(&complex, &mut body, &mut rules, monitor)?;
    monitor.step(STAGE, "checks", 0.8)?;
    check::finish(&complex, body, rules)
}

fn check_options(options: &ThickenOptions) -> Result<(), ThickenError> {
    let inside = |name, value: f64, lo: f64, hi: f64, allowed| {
        if value.is_finite() && value > lo && value <= hi {
            Ok(())
        } else {
            Err(ThickenError::BadOption {
                name,
                value,
                allowed,
            })
        }
    };
    inside(
        "scale",
        options.scale,
        0.0,
        100.0,
        "more than 0, at most 100",
    )?;
    inside("mitre_limit", options.mitre_limit, 0.999, 100.0, "1 to 100")?;
    inside(
        "axis_angle",
        options.axis_angle,
        0.0,
        80.0,
        "more than 0, at most 80",
    )
}

/// Unit vector of `v`, or any unit vector when `v` is zero.
pub(crate) fn unit(v: Vec3) -> Vec3 {
    v.try_normalize(1e-12).unwrap_or_else(Vec3::z)
}

/// A unit vector perpendicular to the unit vector `d`.
pub(crate) fn perpendicular(d: &Vec3) -> Vec3 {
    let across = d.cross(&Vec3::new(0.3, 0.5, 0.8));
    match across.try_normalize(1e-3) {
        Some(across) => across,
        None => unit(d.cross(&Vec3::x())),
    }
}
