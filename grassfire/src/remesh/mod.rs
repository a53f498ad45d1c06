//! Voxel remesh: soup in, closed solid and signed distance field out, topological noise removed.

use serde::Serialize;

use crate::Vec3;
use crate::mesh::Solid;
use crate::voxel::VoxelGrid;

/// What kind of topological noise was removed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ChangeKind {
    /// A tunnel narrower than the limit was closed.
    TunnelClosed,
    /// An enclosed void smaller than the limit was filled.
    CavityFilled,
    /// A bridge thinner than the limit was cut.
    BridgeCut,
    /// A separate piece smaller than the limit was dropped.
    IslandDropped,
}

/// One named change of topology.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TopologyChange {
    /// What was done.
    pub kind: ChangeKind,
    /// Centre of the change, mm.
    pub place: Vec3,
    /// Width of the tunnel, void, bridge or piece, mm.
    pub size: f64,
}

/// A closed solid with its signed distance field.
#[derive(Debug, Clone)]
pub struct Remeshed {
    /// The cleaned proposal as a closed surface (surface nets / dual contouring of `field`), mm.
    pub solid: Solid,
    /// Signed distance, mm, positive inside, lightly smoothed, narrow band exact and clamped beyond. The voxel set
    /// `{field > 0}` under 6-connectivity (empty: 26) has the topology of `solid`; at least 3 empty voxels of margin.
    pub field: VoxelGrid<f32>,
    /// Genus (sum over shells) before the clean-up.
    pub genus_before: i64,
    /// Genus after it.
    pub genus_after: i64,
    /// Every change, largest first.
    pub changes: Vec<TopologyChange>,
    /// Largest distance from the input surface (away from `changes`) to the new one, mm.
    pub distance_max: f64,
}
