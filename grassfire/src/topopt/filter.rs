//! Density filter: a linear map that takes away what is smaller than its radius.

use pulp::Arch;
use rayon::prelude::*;

use super::helmholtz::Helmholtz;
use super::options::{Boundary, FilterKind};

/// `x~_e = sum_i w_ei x_i / sum_i w_ei`, and its transpose.
///
/// Cone: `w_ei = max(0, R - |c_e - c_i|)`. T. E. Bruns, D. A. Tortorelli: Topology optimization of non-linear elastic
/// structures and compliant mechanisms, 2001, doi:10.1016/S0045-7825(00)00278-4.
#[derive(Debug, Clone)]
pub enum Filter {
    /// The cone.
    Cone(Cone),
    /// The Helmholtz equation.
    Helmholtz(Helmholtz),
}

impl Filter {
    /// `radius` in voxels; `inside`: voxels that take part, `[z][y][x]`.
    pub fn new(
        kind: FilterKind,
        dims: [usize; 3],
        radius: f64,
        inside: &[bool],
        boundary: Boundary,
    ) -> Self {
        match kind {
            FilterKind::Cone => Self::Cone(Cone::new(dims, radius, inside, boundary)),
            FilterKind::Helmholtz => Self::Helmholtz(Helmholtz::new(dims, radius, inside)),
        }
    }

    /// The filtered field; zero where nothing takes part.
    pub fn forward(&self, x: &[f64]) -> Vec<f64> {
        match self {
            Self::Cone(cone) => {
                let mut out = cone.weigh(x.par_iter().copied());
                out.par_iter_mut()
                    .zip(&cone.inverse)
                    .for_each(|(v, s)| *v *= s);
                out
            }
            Self::Helmholtz(filter) => filter.solve(x),
        }
    }

    /// The transpose.
    pub fn transpose(&self, g: &[f64]) -> Vec<f64> {
        match self {
            Self::Cone(cone) => {
                let mut out = cone.weigh(g.par_iter().zip(&cone.inverse).map(|(g, s)| g * s));
                out.par_iter_mut()
                    .zip(&cone.inverse)
                    .for_each(|(v, s)| *v = if *s > 0.0 { *v } else { 0.0 });
                out
            }
            // The operator is symmetric.
            Self::Helmholtz(filter) => filter.solve(g),
        }
    }
}

/// The cone filter.
#[derive(Debug, Clone)]
pub struct Cone {
    dims: [usize; 3],
    /// Voxels that the cone reaches.
    reach: usize,
    /// Rows of the cone: steps along y and z, and weights from `-reach` to `reach` along x.
    rows: Vec<([usize; 2], Vec<f64>)>,
    reflect: bool,
    /// One over the sum of the weights; 0 where a voxel does not take part.
    inverse: Vec<f64>,
}

impl Cone {
    fn new(dims: [usize; 3], radius: f64, inside: &[bool], boundary: Boundary) -> Self {
        // A radius of one or less is the identity.
        let radius = radius.max(1.0);
        let reach = (radius - 1e-9).ceil() as usize - 1;
        let reach = reach.max(1);
        let weight = |d: [usize; 3]| {
            let square = |i: usize| (i as f64 - reach as f64).powi(2);
            (radius - d.into_iter().map(square).sum::<f64>().sqrt()).max(0.0)
        };
        let width = 2 * reach + 1;
        let rows = (0..width * width)
            .map(|i| {
                let (y, z) = (i % width, i / width);
                (
                    [y, z],
                    (0..width).map(|x| weight([x, y, z])).collect::<Vec<_>>(),
                )
            })
            .filter(|(_, weights)| weights.iter().any(|&w| w > 1e-12))
            .collect();
        let mut cone = Self {
            dims,
            reach,
            rows,
            reflect: boundary == Boundary::Reflect,
            inverse: Vec::new(),
        };
        let sums = cone.weigh(inside.par_iter().map(|&i| f64::from(u8::from(i))));
        cone.inverse = sums
            .iter()
            .zip(inside)
            .map(|(&s, &inside)| if inside && s > 0.0 { 1.0 / s } else { 0.0 })
            .collect();
        cone
    }

    /// Weighted sums around every voxel.
    fn weigh(&self, x: impl IndexedParallelIterator<Item = f64>) -> Vec<f64> {
        let [nx, ny, nz] = self.dims;
        let k = self.reach;
        let (px, py) = (nx + 2 * k, ny + 2 * k);
        let x: Vec<f64> = x.collect();
        let padded = self.pad(&x);
        let mut out = vec![0.0; nx * ny * nz];
        out.par_chunks_mut(nx * ny)
            .enumerate()
            .for_each(|(z, plane)| {
                Arch::new().dispatch(|| {
                    for y in 0..ny {
                        let out = &mut plane[y * nx..(y + 1) * nx];
                        for ([dy, dz], weights) in &self.rows {
                            let from = ((z + dz) * py + y + dy) * px;
                            let row = &padded[from..from + px];
                            for (dx, &w) in weights.iter().enumerate().filter(|(_, w)| **w > 1e-12)
                            {
                                for (o, v) in out.iter_mut().zip(&row[dx..dx + nx]) {
                                    *o += w * v;
                                }
                            }
                        }
                    }
                });
            });
        out
    }

    /// The field with `reach` more voxels on all sides: mirrored or zero.
    fn pad(&self, x: &[f64]) -> Vec<f64> {
        let k = self.reach;
        let [px, py, pz] = self.dims.map(|n| n + 2 * k);
        let source = |i: usize, n: usize| -> Option<usize> {
            let at = i as i64 - k as i64;
            if (0..n as i64).contains(&at) {
                return Some(at as usize);
            }
            let mirrored = if at < 0 {
                -1 - at
            } else {
                2 * n as i64 - 1 - at
            };
            (self.reflect && (0..n as i64).contains(&mirrored)).then_some(mirrored as usize)
        };
        let [nx, ny, nz] = self.dims;
        let columns: Vec<Option<usize>> = (0..px).map(|i| source(i, nx)).collect();
        let mut out = vec![0.0; px * py * pz];
        out.par_chunks_mut(px * py)
            .enumerate()
            .for_each(|(z, plane)| {
                let Some(z) = source(z, nz) else { return };
                for (y, row) in plane.chunks_mut(px).enumerate() {
                    let Some(y) = source(y, ny) else { continue };
                    let from = &x[(z * ny + y) * nx..][..nx];
                    for (to, column) in row.iter_mut().zip(&columns) {
                        *to = column.map_or(0.0, |x| from[x]);
                    }
                }
            });
        out
    }
}
