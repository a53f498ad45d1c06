//! Options of the remesh.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Vec3;

/// All points within `radius` of the segment `a`-`b`, mm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Capsule {
    /// One end of the axis, mm.
    #[schemars(with = "[f64; 3]")]
    pub a: Vec3,
    /// Other end of the axis, mm.
    #[schemars(with = "[f64; 3]")]
    pub b: Vec3,
    /// Radius, mm.
    pub radius: f64,
}

impl Capsule {
    /// Whether `p` lies in the capsule.
    pub fn contains(&self, p: &Vec3) -> bool {
        let axis = self.b - self.a;
        let length2 = axis.norm_squared();
        let t = if length2 > 0.0 {
            ((p - self.a).dot(&axis) / length2).clamp(0.0, 1.0)
        } else {
            0.0
        };
        (p - (self.a + axis * t)).norm_squared() <= self.radius * self.radius
    }

    /// Depth of `p` in the cylinder about `a`-`b`, without the round ends, mm; negative outside.
    pub fn depth_in_cylinder(&self, p: &Vec3) -> f64 {
        let axis = self.b - self.a;
        let length = axis.norm();
        if length <= 0.0 {
            return f64::NEG_INFINITY;
        }
        let along = (p - self.a).dot(&axis) / length;
        let radial = (p - self.a - axis * (along / length)).norm();
        (self.radius - radial).min(along).min(length - along)
    }
}

/// Options of [`super::remesh`] and [`super::remesh_density`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RemeshOptions {
    /// Voxel edge, mm. Without it [`super::default_voxel`] chooses from wall thickness, edge length and size.
    pub voxel: Option<f64>,
    /// Tunnels, cavities, bridges and islands narrower than this many voxels of the source grid are noise and are
    /// removed; 0 keeps everything. The source grid is the grid that a marching-cubes mesh or a density came from,
    /// otherwise the remesh grid. A closed manifold mesh that was not made on a grid keeps all its tunnels and cavities:
    /// there only what sampling added is removed, and pieces smaller than this.
    pub min_tunnel: f64,
    /// Places where nothing is filled or cut, but islands go: the bores of non-design bodies.
    pub keep_open: Vec<Capsule>,
    /// Standard deviation of the Gaussian filter on the signed distance, voxels; 0 = none.
    pub smoothing: f64,
    /// Most voxels of the grid; a finer voxel than that is refused or, when it was not asked for, made coarser.
    pub max_voxels: usize,
    /// Points sampled on the input surface for `distance_max`.
    pub samples: usize,
}

impl Default for RemeshOptions {
    fn default() -> Self {
        Self {
            voxel: None,
            min_tunnel: 3.0,
            keep_open: Vec::new(),
            smoothing: 0.7,
            max_voxels: 60_000_000,
            samples: 30_000,
        }
    }
}
