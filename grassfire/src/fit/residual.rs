//! What the limit surface misses of the iso-surface, quad by quad.

use super::round::Solver;
use super::surface::LEVELS;
use crate::Vec3;

/// Residual of every control quad, voxel units.
pub(super) struct Residual {
    /// Sum of squared distances times area; far places count more, since one of them exceeds a limit by itself.
    pub energy: Vec<f64>,
    /// Area.
    pub area: Vec<f64>,
    /// Share of the residual that varies along edge 0 of the quad; the rest varies along edge 1.
    pub along: Vec<f64>,
}

impl Residual {
    /// 1. Signed distance of every sample to f = 0, or of the farthest iso-surface sample that is nearest to it.
    /// 2. Its square times area summed over the quad.
    /// 3. Squared differences along the two directions of the quad: a residual that alternates along a direction is what
    ///    more points along that direction can follow.
    ///
    /// Quads without a sample farther than `beyond` have no residual.
    pub fn of(solver: &Solver, points: &[Vec3], beyond: f64) -> Self {
        let surface = &solver.surface;
        let (signed, areas) = solver.signed_distances(points);
        let count = surface.coarse.quads.len();
        let mut residual = Self {
            energy: vec![0.0; count],
            area: vec![0.0; count],
            along: vec![0.5; count],
        };
        let per_quad = surface.fine.quads.len() / count.max(1);
        for (q, fine) in surface.fine.quads.chunks_exact(per_quad).enumerate() {
            let (mut change, mut farthest) = ([1e-12; 2], 0.0_f64);
            for (child, corners) in fine.iter().enumerate() {
                let d = corners.map(|v| signed[v as usize]);
                farthest = d.iter().fold(farthest, |m, x| m.max(x.abs()));
                let area: f64 = corners
                    .iter()
                    .map(|&v| areas[v as usize] / f64::from(surface.fine.valence[v as usize]))
                    .sum();
                let mean = |f: fn(f64) -> f64| d.iter().map(|&x| f(x)).sum::<f64>() / 4.0;
                residual.energy[q] += area * mean(|x| x * x + x.powi(4));
                residual.area[q] += area;
                // A split turns child k by k corners.
                let turns: usize = (0..LEVELS).map(|level| child >> (2 * level) & 3).sum();
                for k in 0..4 {
                    change[(turns + k) % 2] += (d[(k + 1) % 4] - d[k]).powi(2);
                }
            }
            if farthest <= beyond {
                residual.energy[q] = 0.0;
            }
            residual.along[q] = change[0] / (change[0] + change[1]);
        }
        residual
    }
}
