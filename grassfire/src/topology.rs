//! Betti numbers, Euler number: the quantities that every stage must keep.

use serde::{Deserialize, Serialize};

/// Betti numbers and Euler number; `chi = b0 - b1 + b2`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Betti {
    /// Connected components.
    pub b0: i64,
    /// Independent loops (tunnels of a solid).
    pub b1: i64,
    /// Enclosed cavities.
    pub b2: i64,
    /// Euler number.
    pub chi: i64,
}

impl Betti {
    /// From components, cavities and Euler number: `b1 = b0 + b2 - chi`.
    pub fn from_chi(b0: i64, b2: i64, chi: i64) -> Self {
        Self {
            b0,
            b1: b0 + b2 - chi,
            b2,
            chi,
        }
    }
}

/// Topology of one closed surface component.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct SurfaceTopology {
    /// V - E + F.
    pub chi: i64,
    /// Handles: `(2 - chi) / 2`.
    pub genus: i64,
    /// No edge with one face.
    pub closed: bool,
    /// Every edge has two faces in opposite senses and every vertex one fan.
    pub manifold: bool,
}
