//! Trilinear interpolation between a grid and the next coarser one, and its transpose.

use rayon::prelude::*;

use super::grid::NodeGrid;

/// `coarse = P' (b - t)`, in single precision.
pub(super) fn restrict<B: Copy + Into<f64> + Sync>(
    fine: &NodeGrid,
    b: &[B],
    t: &[f32],
    grid: &NodeGrid,
    coarse: &mut [f32],
) {
    // The row of the finer grid, with one more node at both ends.
    let row = || vec![0f32; 2 * grid.n[0] + 3];
    let planes = grid.planes(3, coarse).enumerate();
    planes.for_each_init(row, |sum, (z, out)| {
        for y in 0..=grid.n[1] {
            if grid.row(y, z).is_empty() {
                continue;
            }
            for c in 0..3 {
                sum.fill(0.0);
                for zz in around(z, fine.n[2]) {
                    for yy in around(y, fine.n[1]) {
                        let halves = u32::from(zz != 2 * z) + u32::from(yy != 2 * y);
                        let weight = 1.0 / (1u32 << halves) as f32;
                        let plane = 3 * fine.first(zz) + c * fine.count(zz);
                        for run in fine.row(yy, zz) {
                            let at = plane + run.at;
                            let to = &mut sum[run.x + 1..][..run.len];
                            let (b, t) = (&b[at..at + run.len], &t[at..at + run.len]);
                            for i in 0..run.len {
                                to[i] += weight * (b[i].into() as f32 - t[i]);
                            }
                        }
                    }
                }
                for run in grid.row(y, z) {
                    let to = &mut out[c * grid.count(z) + run.at..][..run.len];
                    for (x, v) in (run.x..).zip(to) {
                        *v = 0.5 * (sum[2 * x] + sum[2 * x + 2]) + sum[2 * x + 1];
                    }
                }
            }
        }
    });
}

/// Rows of the finer grid, which ends at `last`, next to row `i` of the coarser one.
fn around(i: usize, last: usize) -> std::ops::Range<usize> {
    (2 * i).saturating_sub(1)..(2 * i + 2).min(last + 1)
}

/// `x = x + P coarse`.
pub(super) fn prolong(grid: &NodeGrid, coarse: &[f32], fine: &NodeGrid, x: &mut [f32]) {
    let row = || vec![0f32; grid.n[0] + 2];
    let planes = fine.planes(3, x).enumerate();
    planes.for_each_init(row, |sum, (z, out)| {
        for y in 0..=fine.n[1] {
            if fine.row(y, z).is_empty() {
                continue;
            }
            let weight = 1.0 / ((1 << (z % 2)) * (1 << (y % 2))) as f32;
            for c in 0..3 {
                sum.fill(0.0);
                for zz in z / 2..=z.div_ceil(2) {
                    for yy in y / 2..=y.div_ceil(2) {
                        let plane = 3 * grid.first(zz) + c * grid.count(zz);
                        for run in grid.row(yy, zz) {
                            let from = &coarse[plane + run.at..][..run.len];
                            for (s, v) in sum[run.x..][..run.len].iter_mut().zip(from) {
                                *s += weight * v;
                            }
                        }
                    }
                }
                for run in fine.row(y, z) {
                    let to = &mut out[c * fine.count(z) + run.at..][..run.len];
                    for (i, v) in (run.x..).zip(to) {
                        *v += 0.5 * (sum[i / 2] + sum[i.div_ceil(2)]);
                    }
                }
            }
        }
    });
}
