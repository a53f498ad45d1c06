//! Density filter: a linear map that takes away what is smaller than its radius.

use pulp::Arch;
use rayon::prelude::*;

use super::helmholtz::Helmholtz;
use super::options::{Boundary, FilterKind};
use super::problem::{DESIGN, FROZEN, Problem};
use crate::fe::cut;

/// `x~_e = sum_i w_ei x_i / sum_i w_ei`, and its transpose, for fields with one value a design voxel.
///
/// Frozen voxels count as full; what is outside takes no part.
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
    /// `radius` in voxels.
    pub fn new(kind: FilterKind, problem: &Problem, radius: f64, boundary: Boundary) -> Self {
        match kind {
            FilterKind::Cone => Self::Cone(Cone::new(problem, radius, boundary)),
            FilterKind::Helmholtz => Self::Helmholtz(Helmholtz::new(problem, radius)),
        }
    }

    /// The filtered field.
    pub fn forward(&self, problem: &Problem, x: &[f64]) -> Vec<f64> {
        match self {
            Self::Cone(cone) => {
                let mut out = cone.weigh(&problem.labels, x, 1.0);
                out.par_iter_mut()
                    .zip(&cone.inverse)
                    .for_each(|(v, s)| *v *= s);
                out
            }
            Self::Helmholtz(filter) => problem.at_design(&filter.solve(&problem.on_grid(x, 1.0))),
        }
    }

    /// The transpose.
    pub fn transpose(&self, problem: &Problem, mut g: Vec<f64>) -> Vec<f64> {
        match self {
            Self::Cone(cone) => {
                g.par_iter_mut()
                    .zip(&cone.inverse)
                    .for_each(|(g, s)| *g *= s);
                cone.weigh(&problem.labels, &g, 0.0)
            }
            // The operator is symmetric.
            Self::Helmholtz(filter) => problem.at_design(&filter.solve(&problem.on_grid(&g, 0.0))),
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
    /// Design voxels before every plane, and their number.
    first: Vec<usize>,
    /// One over the sum of the weights around every design voxel.
    inverse: Vec<f64>,
}

impl Cone {
    fn new(problem: &Problem, radius: f64, boundary: Boundary) -> Self {
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
        let mut first = vec![0];
        for plane in problem.labels.chunks(problem.dims[0] * problem.dims[1]) {
            let design = plane.iter().filter(|&&l| l == DESIGN).count();
            first.push(first[first.len() - 1] + design);
        }
        let mut cone = Self {
            dims: problem.dims,
            reach,
            rows,
            reflect: boundary == Boundary::Reflect,
            inverse: vec![1.0; first[first.len() - 1]],
            first,
        };
        let mut sums = cone.weigh(&problem.labels, &cone.inverse, 1.0);
        sums.iter_mut().for_each(|s| *s = 1.0 / *s);
        cone.inverse = sums;
        cone
    }

    /// Weighted sums around every design voxel; `frozen`: value of frozen voxels.
    ///
    /// The planes under the cone are written out in full, one after another, so that no field of the whole grid is needed.
    fn weigh(&self, labels: &[u8], x: &[f64], frozen: f64) -> Vec<f64> {
        let [nx, ny, _] = self.dims;
        let mut out = vec![0.0; x.len()];
        let planes = cut(&mut out, &self.first);
        planes.into_par_iter().enumerate().for_each_init(
            || Planes::new(self),
            |planes, (z, mut out)| {
                if out.is_empty() {
                    return;
                }
                planes.load(self, labels, x, frozen, z);
                let mut sums = vec![0.0; nx];
                for y in 0..ny {
                    let labels = &labels[(z * ny + y) * nx..][..nx];
                    let wanted = || (0..nx).filter(|&x| labels[x] == DESIGN);
                    let count = wanted().count();
                    if count == 0 {
                        continue;
                    }
                    Arch::new().dispatch(|| self.row(planes, y, z, &mut sums));
                    let (row, rest) = std::mem::take(&mut out).split_at_mut(count);
                    for (to, x) in row.iter_mut().zip(wanted()) {
                        *to = sums[x];
                    }
                    out = rest;
                }
            },
        );
        out
    }

    /// Weighted sums around all voxels of row (y, z).
    #[inline(always)]
    fn row(&self, planes: &Planes, y: usize, z: usize, sums: &mut [f64]) {
        let nx = self.dims[0];
        sums.fill(0.0);
        for ([dy, dz], weights) in &self.rows {
            let row = planes.row(y + dy, z + dz);
            for (dx, &w) in weights.iter().enumerate().filter(|(_, w)| **w > 1e-12) {
                for (sum, v) in sums.iter_mut().zip(&row[dx..dx + nx]) {
                    *sum += w * v;
                }
            }
        }
    }

    /// Where the value of padded place `i` comes from along an axis of `n` voxels: mirrored or nowhere beyond the ends.
    fn source(&self, i: usize, n: usize) -> Option<usize> {
        let at = i as i64 - self.reach as i64;
        if (0..n as i64).contains(&at) {
            return Some(at as usize);
        }
        let mirrored = if at < 0 {
            -1 - at
        } else {
            2 * n as i64 - 1 - at
        };
        (self.reflect && (0..n as i64).contains(&mirrored)).then_some(mirrored as usize)
    }
}

/// The planes under the cone, with `reach` more voxels on all sides.
struct Planes {
    /// Padded voxels along x and y.
    size: [usize; 2],
    /// Source of every padded column.
    columns: Vec<Option<usize>>,
    /// The padded plane in every place, by the remainder of its number.
    held: Vec<Option<usize>>,
    values: Vec<f64>,
}

impl Planes {
    fn new(cone: &Cone) -> Self {
        let [nx, ny, _] = cone.dims;
        let (width, size) = (2 * cone.reach + 1, [nx, ny].map(|n| n + 2 * cone.reach));
        Self {
            size,
            columns: (0..size[0]).map(|i| cone.source(i, nx)).collect(),
            held: vec![None; width],
            values: vec![0.0; width * size[0] * size[1]],
        }
    }

    /// Moves to plane `z`; planes that it holds already are kept.
    fn load(&mut self, cone: &Cone, labels: &[u8], x: &[f64], frozen: f64, z: usize) {
        let [nx, ny, nz] = cone.dims;
        let [px, py] = self.size;
        let mut plane = vec![0.0; nx * ny];
        for padded in z..z + self.held.len() {
            let place = padded % self.held.len();
            if self.held[place] == Some(padded) {
                continue;
            }
            self.held[place] = Some(padded);
            let to = &mut self.values[place * px * py..][..px * py];
            to.fill(0.0);
            let Some(from) = cone.source(padded, nz) else {
                continue;
            };
            let mut design = x[cone.first[from]..cone.first[from + 1]].iter();
            for (v, &label) in plane.iter_mut().zip(&labels[from * nx * ny..]) {
                *v = match label {
                    DESIGN => design.next().copied().unwrap_or_default(),
                    FROZEN => frozen,
                    _ => 0.0,
                };
            }
            for (y, row) in to.chunks_mut(px).enumerate() {
                let Some(y) = cone.source(y, ny) else {
                    continue;
                };
                let from = &plane[y * nx..][..nx];
                for (to, column) in row.iter_mut().zip(&self.columns) {
                    *to = column.map_or(0.0, |x| from[x]);
                }
            }
        }
    }

    #[inline(always)]
    fn row(&self, y: usize, padded: usize) -> &[f64] {
        let [px, py] = self.size;
        &self.values[(padded % self.held.len() * py + y) * px..][..px]
    }
}
