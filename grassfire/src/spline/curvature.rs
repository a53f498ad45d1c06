//! Jumps of curvature across patch edges: what a zebra or comb display shows, as numbers.

use rayon::prelude::*;

use super::bezier::second_derivatives;
use super::half_edges::{QuadTopology, connect};
use super::quality::side_parameters;
use super::{ControlMesh, Patch, SplineError, evaluate};
use crate::Vec3;

/// Jump of the normal curvature across the edges of the quads around extraordinary points.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CurvatureJump {
    /// Largest difference between the two sides of an edge, 1/mm.
    pub max: f64,
    /// Where it is, mm.
    pub place: Vec3,
    /// 95 % of the samples have less, 1/mm.
    pub p95: f64,
    /// Root mean square over all samples, 1/mm.
    pub rms: f64,
    /// The root mean square difference as a share of the root mean square curvature there (the larger principal one of
    /// either side): 0 where the curvature is continuous.
    pub relative: f64,
    /// Edges that were measured.
    pub edges: usize,
}

/// Samples an edge, corners included.
const SAMPLES: usize = 17;

/// One place on an edge.
#[derive(Clone, Copy)]
struct Sample {
    jump: f64,
    /// Mean square of the larger principal curvatures of both sides.
    square: f64,
    place: Vec3,
}

/// Measures how much the normal curvature jumps at the edges of all quads with an extraordinary corner: the spokes, where
/// patches meet tangent-continuously only, and the ring around them.
///
/// 1. At each sample both patches give their second fundamental form.
/// 2. The normal curvature of each, in the tangent direction across the edge, is compared. (Along the edge both are equal,
///    as long as the normals are.)
///
/// Samples where a patch is singular are left out. All zeros without extraordinary points.
///
/// # Errors
/// As for [`super::patches`]; also when the number of patches is not that of the quads.
pub fn curvature_jump(mesh: &ControlMesh, patches: &[Patch]) -> Result<CurvatureJump, SplineError> {
    let half_edges = connect(mesh)?;
    if patches.len() != mesh.quads.len() {
        return Err(SplineError::PatchCount {
            patches: patches.len(),
            quads: mesh.quads.len(),
        });
    }
    let near: Vec<bool> = (0..mesh.quads.len() as u32)
        .map(|q| (4 * q..4 * q + 4).any(|h| !half_edges.is_regular(half_edges.origin(h))))
        .collect();
    let edges: Vec<u32> = measured_edges(&half_edges, &near);
    let samples: Vec<Vec<Sample>> = edges
        .par_iter()
        .map(|&h| edge_samples(patches, h, half_edges.twin[h as usize]))
        .collect();
    Ok(summary(&samples))
}

fn measured_edges(half_edges: &QuadTopology, near: &[bool]) -> Vec<u32> {
    (0..half_edges.len())
        .filter(|&h| {
            let twin = half_edges.twin[h as usize];
            h < twin && (near[h as usize / 4] || near[twin as usize / 4])
        })
        .collect()
}

fn summary(edges: &[Vec<Sample>]) -> CurvatureJump {
    let samples: Vec<Sample> = edges.iter().flatten().copied().collect();
    let Some(worst) = samples.iter().max_by(|a, b| a.jump.total_cmp(&b.jump)) else {
        return CurvatureJump::default();
    };
    let count = samples.len() as f64;
    let mut jumps: Vec<f64> = samples.iter().map(|s| s.jump).collect();
    jumps.sort_unstable_by(f64::total_cmp);
    let rms = (jumps.iter().map(|j| j * j).sum::<f64>() / count).sqrt();
    let curvature = (samples.iter().map(|s| s.square).sum::<f64>() / count).sqrt();
    CurvatureJump {
        max: worst.jump,
        place: worst.place,
        p95: jumps[(jumps.len() - 1) * 95 / 100],
        rms,
        relative: if curvature > 0.0 {
            rms / curvature
        } else {
            0.0
        },
        edges: edges.len(),
    }
}

fn edge_samples(patches: &[Patch], h: u32, g: u32) -> Vec<Sample> {
    (0..SAMPLES)
        .filter_map(|k| {
            let t = k as f64 / (SAMPLES - 1) as f64;
            let [left, right] = [(h, t), (g, 1.0 - t)].map(|(h, t)| side(patches, h, t));
            let (left, right) = (left?, right?);
            Some(Sample {
                jump: (left.across - right.across).abs(),
                square: (left.largest * left.largest + right.largest * right.largest) / 2.0,
                place: left.place,
            })
        })
        .collect()
}

/// Curvatures of one patch at a point of its border, 1/mm.
struct Side {
    /// Normal curvature across the border.
    across: f64,
    /// The larger principal curvature, without sign.
    largest: f64,
    place: Vec3,
}

fn side(patches: &[Patch], h: u32, t: f64) -> Option<Side> {
    let patch = &patches[h as usize / 4];
    let [u, v] = side_parameters(h, t);
    let at = evaluate(patch, u, v);
    let [e, f, g] = [at.du.dot(&at.du), at.du.dot(&at.dv), at.dv.dot(&at.dv)];
    let determinant = e * g - f * f;
    let along = if h & 1 == 0 { at.du } else { at.dv };
    // Both sides take the direction in their own sense: a normal curvature does not depend on it.
    let across = at.normal.cross(&along).try_normalize(f64::MIN_POSITIVE)?;
    if at.normal == Vec3::zeros() || determinant <= 1e-12 * e * g {
        return None;
    }
    let [l, m, n] = second_derivatives(patch, u, v).map(|d| d.dot(&at.normal));
    let [p, q] = [across.dot(&at.du), across.dot(&at.dv)];
    let (a, b) = ((g * p - f * q) / determinant, (e * q - f * p) / determinant);
    let mean = (e * n - 2.0 * f * m + g * l) / (2.0 * determinant);
    let gauss = (l * n - m * m) / determinant;
    Some(Side {
        across: a * a * l + 2.0 * a * b * m + b * b * n,
        largest: mean.abs() + (mean * mean - gauss).max(0.0).sqrt(),
        place: at.position,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// z = (a x^2 + c y^2) / 2 over the unit square as a patch of degree 5.
    fn paraboloid(a: f64, c: f64) -> Patch {
        let square = |k: usize| (k * k.saturating_sub(1)) as f64 / 20.0;
        let point = |i: usize, j: usize| {
            let z = (a * square(i) + c * square(j)) / 2.0;
            Vec3::new(i as f64 / 5.0, j as f64 / 5.0, z)
        };
        Patch {
            control: std::array::from_fn(|i| std::array::from_fn(|j| point(i, j))),
        }
    }

    #[test]
    fn curvatures_of_a_paraboloid_at_its_apex() {
        let patch = [paraboloid(3.0, -0.5)];
        // Along the bottom side the direction across is y, along the left side it is x.
        for (h, t, across) in [(0, 0.0, -0.5), (3, 1.0, 3.0)] {
            let side = side(&patch, h, t).expect("a regular point");
            assert!((side.across - across).abs() < 1e-12, "{}", side.across);
            assert!((side.largest - 3.0).abs() < 1e-12);
            assert!(side.place.norm() < 1e-12);
        }
    }

    #[test]
    fn two_paraboloids_jump_by_the_difference() {
        // Side by side along the line x = 0, where y is along and the jump is that of x.
        let left = paraboloid(1.0, 2.0);
        let mut right = paraboloid(4.0, 2.0);
        right.control.reverse();
        right.control.iter_mut().flatten().for_each(|p| p.x = -p.x);
        let samples = edge_samples(&[left, right], 3, 5);
        assert_eq!(samples.len(), SAMPLES);
        let apex = samples[SAMPLES - 1];
        assert!((apex.jump - 3.0).abs() < 1e-12, "{}", apex.jump);
        assert!((apex.square - (4.0 + 16.0) / 2.0).abs() < 1e-9);
        let jump = summary(&[samples]);
        assert!(jump.max >= 3.0 - 1e-12 && jump.edges == 1);
        assert!(jump.rms <= jump.max && jump.relative > 0.0);
    }
}
