//! Trilinear interpolation between a grid and the next coarser one, and its transpose.

use rayon::prelude::*;

use super::grid::NodeGrid;

/// `coarse = P' (b - t)`.
pub(super) fn restrict(fine: &NodeGrid, b: &[f32], t: &[f32], grid: &NodeGrid, coarse: &mut [f32]) {
    const WEIGHTS: [f32; 3] = [0.5, 1.0, 0.5];
    let length = 2 * grid.n[0] + 3;
    grid.planes(coarse).enumerate().for_each(|(z, out)| {
        let mut sum = vec![0f32; length];
        for y in 0..=grid.n[1] {
            for c in 0..3 {
                sum.fill(0.0);
                let first = fine.node(0, 2 * y, 2 * z) + c * fine.sx - fine.plane - fine.row - 1;
                for (dz, wz) in WEIGHTS.into_iter().enumerate() {
                    for (dy, wy) in WEIGHTS.into_iter().enumerate() {
                        let at = first + dz * fine.plane + dy * fine.row;
                        let (b, t) = (&b[at..at + length], &t[at..at + length]);
                        let w = wz * wy;
                        for i in 0..length {
                            sum[i] += w * (b[i] - t[i]);
                        }
                    }
                }
                let row = &mut out[y * grid.row + c * grid.sx..][..=grid.n[0]];
                for (x, v) in row.iter_mut().enumerate() {
                    *v = 0.5 * (sum[2 * x] + sum[2 * x + 2]) + sum[2 * x + 1];
                }
            }
        }
    });
}

/// `x = x + P coarse`.
pub(super) fn prolong(grid: &NodeGrid, coarse: &[f32], fine: &NodeGrid, x: &mut [f32]) {
    fine.planes(x).enumerate().for_each(|(z, out)| {
        let mut sum = vec![0f32; grid.n[0] + 2];
        let length = sum.len();
        for y in 0..=fine.n[1] {
            for c in 0..3 {
                sum.fill(0.0);
                let weight = 1.0 / ((1 << (z % 2)) * (1 << (y % 2))) as f32;
                for zz in z / 2..=z.div_ceil(2) {
                    for yy in y / 2..=y.div_ceil(2) {
                        let at = grid.node(0, yy, zz) + c * grid.sx;
                        for (s, v) in sum.iter_mut().zip(&coarse[at..at + length]) {
                            *s += weight * v;
                        }
                    }
                }
                let row = &mut out[y * fine.row + c * fine.sx..][..=fine.n[0]];
                for (i, v) in row.iter_mut().enumerate() {
                    *v += 0.5 * (sum[i / 2] + sum[i.div_ceil(2)]);
                }
            }
        }
    });
}
