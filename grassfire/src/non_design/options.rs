//! Options of the recognition.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What is done with the non-design bodies that are recognised in the proposal.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RecogniseMode {
    /// Nothing is looked for.
    Off,
    /// They are listed in the report.
    List,
    /// They are listed; without `--non-design` bodies, those that can be solids are united with the part. When that
    /// union fails, the part is made without them and the report says so.
    #[default]
    Auto,
}

/// How planes, cylinders and bosses are found in the proposal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RecogniseOptions {
    /// Seed of the random choices.
    pub seed: u64,
    /// A vertex belongs to a surface within this distance, in edge lengths (the lower quartile of the mesh's).
    pub tolerance: f64,
    /// A triangle belongs to a surface when its normal is within this angle of the surface's, degrees.
    pub normal_angle: f64,
    /// Random pairs of triangles tried around each seed.
    pub tries: u32,
    /// Smallest surface listed, squared edge lengths.
    pub min_area: f64,
    /// A hole is a bore when its wall covers at least this angle of the circumference, degrees.
    pub min_bore_angle: f64,
    /// A concentric outer wall counts when it covers at least this angle, degrees.
    pub min_wall_angle: f64,
    /// Where a bore has no outer wall of its own: its sleeve reaches this share of the material around it.
    pub sleeve_share: f64,
    /// Ends move to a flat face across the axis that is no farther than this share of the radius.
    pub end_gap: f64,
    /// Surfaces in the report, the largest first.
    pub max_listed: usize,
}

impl Default for RecogniseOptions {
    fn default() -> Self {
        Self {
            seed: 1,
            tolerance: 0.1,
            normal_angle: 20.0,
            tries: 12,
            min_area: 30.0,
            min_bore_angle: 300.0,
            min_wall_angle: 120.0,
            sleeve_share: 0.6,
            end_gap: 0.25,
            max_listed: 40,
        }
    }
}

/// How faces of a design space are matched with the proposal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct DomainOptions {
    /// Largest distance of the proposal to a point of a face that it covers, voxels.
    pub tolerance: f64,
    /// Largest angle between their normals, degrees.
    pub normal_angle: f64,
    /// Share of a face that must be covered.
    pub min_coverage: f64,
}

impl Default for DomainOptions {
    fn default() -> Self {
        Self {
            tolerance: 0.75,
            normal_angle: 30.0,
            min_coverage: 0.8,
        }
    }
}

/// Which flat faces of the proposal become exactly plane.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FlatOptions {
    /// Flat faces whose border turns by at least this become exactly plane with sharp edges, degrees; none: all faces stay
    /// smooth.
    pub crease_angle: Option<f64>,
    /// Share of the border that must be as sharp as that.
    pub min_sharp: f64,
    /// Smallest face, squared voxels.
    pub min_area: f64,
    /// The fitted body bulges this far over the plane before it is cut there, voxels: more gives sharper edges.
    pub raise: f64,
    /// What bulges at most this far is cut off, voxels.
    pub height: f64,
}

impl Default for FlatOptions {
    fn default() -> Self {
        Self {
            crease_angle: None,
            min_sharp: 0.6,
            min_area: 100.0,
            raise: 0.8,
            height: 4.0,
        }
    }
}
