//! Smoothness and folds of the patches.

use rayon::prelude::*;

use super::bezier::{Basis, basis, visit_grid};
use super::half_edges::connect;
use super::{ControlMesh, Patch, SplineError, evaluate};
use crate::Vec3;

/// Largest kink and gap between neighbouring patches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct G1Report {
    /// Largest angle between the normals of two patches at a shared point, degrees; 180 where a normal vanishes.
    pub max_angle_deg: f64,
    /// Where the largest angle is, mm.
    pub place: Vec3,
    /// The two quads of the largest angle.
    pub quads: [u32; 2],
    /// Largest distance between points that should be equal, mm.
    pub max_gap: f64,
}

/// Samples an edge from corner to corner, both included.
const EDGE_SAMPLES: usize = 33;

/// Measures the angle between the normals and the gap between the patches along all edges, corners included.
///
/// # Errors
/// As for [`super::patches`]; also when the number of patches is not that of the quads.
pub fn g1_max(mesh: &ControlMesh, patches: &[Patch]) -> Result<G1Report, SplineError> {
    let half_edges = connect(mesh)?;
    if patches.len() != mesh.quads.len() {
        return Err(SplineError::PatchCount {
            patches: patches.len(),
            quads: mesh.quads.len(),
        });
    }
    let edges: Vec<G1Report> = (0..half_edges.len())
        .into_par_iter()
        .filter(|&h| h < half_edges.twin[h as usize])
        .map(|h| edge_report(patches, h, half_edges.twin[h as usize]))
        .collect();
    let mut worst = edges[0];
    for edge in &edges[1..] {
        let max_gap = worst.max_gap.max(edge.max_gap);
        if edge.max_angle_deg > worst.max_angle_deg {
            worst = *edge;
        }
        worst.max_gap = max_gap;
    }
    Ok(worst)
}

/// Parameters of the point `t` of side `k`, counter-clockwise.
pub(super) fn side_parameters(k: u32, t: f64) -> [f64; 2] {
    match k & 3 {
        0 => [t, 0.0],
        1 => [1.0, t],
        2 => [1.0 - t, 1.0],
        _ => [0.0, 1.0 - t],
    }
}

fn edge_report(patches: &[Patch], h: u32, g: u32) -> G1Report {
    let quads = [h / 4, g / 4];
    let mut report = G1Report {
        max_angle_deg: -1.0,
        place: Vec3::zeros(),
        quads,
        max_gap: 0.0,
    };
    for k in 0..EDGE_SAMPLES {
        let t = k as f64 / (EDGE_SAMPLES - 1) as f64;
        let at = |h: u32, t: f64| {
            let [u, v] = side_parameters(h, t);
            evaluate(&patches[h as usize / 4], u, v)
        };
        let (p, q) = (at(h, t), at(g, 1.0 - t));
        let angle = if p.normal == Vec3::zeros() || q.normal == Vec3::zeros() {
            180.0
        } else {
            p.normal
                .cross(&q.normal)
                .norm()
                .atan2(p.normal.dot(&q.normal))
                .to_degrees()
        };
        if angle > report.max_angle_deg {
            report.max_angle_deg = angle;
            report.place = p.position;
        }
        report.max_gap = report.max_gap.max((p.position - q.position).norm());
    }
    report
}

/// How close a patch is to folding over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jacobian {
    /// Smallest normalised Jacobian: sine of the angle between the derivatives, times the cosine between the normals
    /// of this and the sample before. Near one for a good patch, zero where it is singular, negative where its normal
    /// flips over.
    pub value: f64,
    /// Where it is smallest, mm.
    pub place: Vec3,
}

/// Samples a direction, corners included.
const JACOBIAN_SAMPLES: usize = 9;

/// The smallest normalised Jacobian of each patch on a 9 x 9 grid.
pub fn jacobians(patches: &[Patch]) -> Vec<Jacobian> {
    let table: [Basis; JACOBIAN_SAMPLES] =
        std::array::from_fn(|k| basis(k as f64 / (JACOBIAN_SAMPLES - 1) as f64));
    patches
        .par_iter()
        .map(|patch| smallest_jacobian(patch, &table))
        .collect()
}

fn smallest_jacobian(patch: &Patch, table: &[Basis; JACOBIAN_SAMPLES]) -> Jacobian {
    let mut worst = Jacobian {
        value: f64::INFINITY,
        place: Vec3::zeros(),
    };
    // Normals of the row before, the sample before comes from this row.
    let mut before = [Vec3::zeros(); JACOBIAN_SAMPLES];
    visit_grid(patch, table, |i, j, place, du, dv| {
        let lengths = du.norm() * dv.norm();
        let cross = du.cross(&dv);
        let sine = if lengths > 0.0 {
            cross.norm() / lengths
        } else {
            0.0
        };
        let normal = cross.try_normalize(f64::MIN_POSITIVE).unwrap_or_default();
        let mut value = sine;
        if i > 0 {
            value = value.min(sine * normal.dot(&before[j]));
        }
        if j > 0 {
            value = value.min(sine * normal.dot(&before[j - 1]));
        }
        before[j] = normal;
        if value < worst.value {
            worst = Jacobian { value, place };
        }
    });
    worst
}
