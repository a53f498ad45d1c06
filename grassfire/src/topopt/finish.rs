//! From densities to full and empty voxels.

use super::problem::{DESIGN, FROZEN};
use super::{Chain, Problem};
use crate::fe::components;

/// The 0/1 field and what is measured on it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Binary {
    /// Full voxels, `[z][y][x]`.
    pub solid: Vec<bool>,
    /// Density above which a voxel is full.
    pub threshold: f64,
    /// Volume of the design voxels that a mould could not leave, mm3.
    pub undercut_volume: f64,
    /// Full voxels whose mirror image is empty, over all full ones.
    pub symmetry_error: f64,
    /// Face-connected pieces.
    pub components: usize,
    /// Voxels that were dropped with small pieces.
    pub dropped: usize,
}

/// Makes the densities full or empty so that `target` voxels are full, draws applied exactly.
///
/// 1. Bisection on the threshold: voxels above it are full, frozen ones always, and with a draw the hard hull fills what
///    would be undercut; the volume after the hull counts.
/// 2. Pieces that hold no frozen voxel and are not the largest one are dropped, where there is no draw to break by that.
pub fn binary(problem: &Problem, chain: &Chain, rho: &[f64], target: f64) -> Binary {
    let at = |threshold: f64| -> Vec<f64> {
        let labels = problem.labels.iter();
        let full = |(&r, &l): (&f64, &u8)| l == FROZEN || l == DESIGN && r > threshold;
        let field: Vec<f64> = rho
            .iter()
            .zip(labels)
            .map(|p| f64::from(u8::from(full(p))))
            .collect();
        match &chain.hull {
            None => field,
            Some(hull) => {
                let mut out = hull.hard(&field);
                (0..out.len())
                    .filter(|&v| !problem.is_active(v))
                    .for_each(|v| out[v] = 0.0);
                out
            }
        }
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if at(middle).iter().sum::<f64>() > target {
            low = middle;
        } else {
            high = middle;
        }
    }
    let mut field = at(high);
    let mut solid: Vec<bool> = field.iter().map(|&v| v > 0.5).collect();
    let (labels, pieces) = components(problem.dims, &solid);
    let mut keeps = vec![false; pieces.len()];
    if let Some(i) = (0..pieces.len()).max_by_key(|&i| pieces[i].size) {
        keeps[i] = true;
    }
    for v in (0..solid.len()).filter(|&v| problem.labels[v] == FROZEN) {
        if let Some(keep) = keeps.get_mut(labels[v] as usize) {
            *keep = true;
        }
    }
    let mut dropped = 0;
    for v in 0..solid.len() {
        if solid[v] && !keeps[labels[v] as usize] {
            solid[v] = false;
            field[v] = 0.0;
            dropped += 1;
        }
    }
    let undercut = chain.hull.as_ref().map_or(0, |hull| {
        let shadow = hull.hard(&field);
        (0..solid.len())
            .filter(|&v| problem.labels[v] == DESIGN && !solid[v] && shadow[v] > 0.5)
            .count()
    });
    let (difference, _) = chain.symmetry.error(problem, &field);
    Binary {
        threshold: high,
        undercut_volume: undercut as f64 * problem.h.powi(3),
        symmetry_error: difference,
        components: keeps.iter().filter(|k| **k).count(),
        dropped,
        solid,
    }
}
