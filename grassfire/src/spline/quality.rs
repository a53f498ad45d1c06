//! Smoothness and folds of the patches.

use rayon::prelude::*;

use super::half_edges::HalfEdges;
use super::{ControlMesh, Patch, SplineError, SurfacePoint, evaluate};
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
    let half_edges = HalfEdges::new(mesh)?;
    if patches.len() != mesh.quads.len() {
        return Err(SplineError::PatchCount { patches: patches.len(), quads: mesh.quads.len() });
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
    let mut report = G1Report { max_angle_deg: -1.0, place: Vec3::zeros(), quads, max_gap: 0.0 };
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
            p.normal.cross(&q.normal).norm().atan2(p.normal.dot(&q.normal)).to_degrees()
        };
        if angle > report.max_angle_deg {
            report.max_angle_deg = angle;
            report.place = p.position;
        }
        report.max_gap = report.max_gap.max((p.position - q.position).norm());
    }
    report
}

/// The place where the patches are closest to folding over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FoldReport {
    /// Smallest normalised Jacobian: sine of the angle between the derivatives, times the cosine between the normals
    /// of this and the next sample. Zero where the patch is singular, negative where its normal flips over.
    pub value: f64,
    /// The quad.
    pub quad: u32,
    /// Where, mm.
    pub place: [f64; 3],
    /// Patches with a value below the limit.
    pub count: usize,
}

const FOLD_SAMPLES: usize = 9;

/// Finds the smallest normalised Jacobian on a 9 x 9 grid a patch, corners included; `None` without patches.
pub fn worst_fold(patches: &[Patch], limit: f64) -> Option<FoldReport> {
    let all: Vec<(f64, Vec3)> = patches.par_iter().map(smallest_jacobian).collect();
    let count = all.iter().filter(|(value, _)| *value < limit).count();
    let (quad, (value, place)) = all.iter().enumerate().min_by(|x, y| x.1.0.total_cmp(&y.1.0))?;
    Some(FoldReport { value: *value, quad: quad as u32, place: (*place).into(), count })
}

fn smallest_jacobian(patch: &Patch) -> (f64, Vec3) {
    let samples: [[SurfacePoint; FOLD_SAMPLES]; FOLD_SAMPLES] = std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let [u, v] = [i, j].map(|k| k as f64 / (FOLD_SAMPLES - 1) as f64);
            evaluate(patch, u, v)
        })
    });
    let mut worst = (f64::INFINITY, Vec3::zeros());
    for i in 0..FOLD_SAMPLES {
        for j in 0..FOLD_SAMPLES {
            let point = &samples[i][j];
            let lengths = point.du.norm() * point.dv.norm();
            let sine = if lengths > 0.0 { point.du.cross(&point.dv).norm() / lengths } else { 0.0 };
            let after = [&samples[(i + 1).min(FOLD_SAMPLES - 1)][j], &samples[i][(j + 1).min(FOLD_SAMPLES - 1)]];
            let value = after.iter().map(|p| sine * p.normal.dot(&point.normal)).fold(sine, f64::min);
            if value < worst.0 {
                worst = (value, point.position);
            }
        }
    }
    worst
}
