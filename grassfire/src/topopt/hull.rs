//! Draw hulls: running maxima along the draw direction, so that nothing is undercut.

use super::options::{OptimizeOptions, Parting};
use super::{Problem, TopoptError};

/// Smoothing of maxima and minima.
const SMOOTH: f64 = 1e-3;

/// A map that fills every column of a field so that a mould can leave.
///
/// With `max` along the columns from outside toward the parting:
/// - one-sided: `m(k) = max over j >= k`,
/// - two parts, fixed plane: the same on both sides toward the plane,
/// - two parts, free surface: `min(max over j <= k, max over j >= k)`: every column is one interval.
///
/// The smooth maximum `(a + b + sqrt((a - b)^2 + e^2)) / 2` gives a gradient to every voxel of a column; the hard one is
/// exact and idempotent, for the final field.
#[derive(Debug, Clone, PartialEq)]
pub struct Hull {
    dims: [usize; 3],
    /// Axis of the draw.
    pub axis: usize,
    /// One-sided: the mould leaves toward larger coordinates.
    upward: bool,
    parting: Parting,
    /// First layer above the parting plane.
    layer: usize,
}

fn smooth_max(a: f64, b: f64) -> f64 {
    0.5 * (a + b + ((a - b) * (a - b) + SMOOTH * SMOOTH).sqrt())
}

/// Derivative of the smooth maximum by `a`.
fn share(a: f64, b: f64) -> f64 {
    0.5 * (1.0 + (a - b) / ((a - b) * (a - b) + SMOOTH * SMOOTH).sqrt())
}

impl Hull {
    /// `layer`: first layer above the parting plane; used with [`Parting::Plane`] only.
    pub fn new(
        dims: [usize; 3],
        axis: usize,
        upward: bool,
        parting: Parting,
        layer: usize,
    ) -> Self {
        Self {
            dims,
            axis,
            upward,
            parting,
            layer: layer.min(dims[axis]),
        }
    }

    /// The hull that the options ask for.
    ///
    /// # Errors
    /// [`TopoptError::Plane`], [`TopoptError::DrawDirection`].
    pub fn of(problem: &Problem, options: &OptimizeOptions) -> Result<Option<Self>, TopoptError> {
        let Some(draw) = &options.draw else {
            return Ok(None);
        };
        let dir = draw.dir;
        let size = dir.iter().map(|d| d * d).sum::<f64>().sqrt();
        let axis = (0..3).find(|&a| size > 0.0 && dir[a].abs() >= (1.0 - 1e-9) * size);
        let Some(axis) = axis else {
            return Err(TopoptError::DrawDirection { dir });
        };
        let layers = (draw.at - problem.origin[axis]) / problem.h;
        let layer = layers.round();
        if draw.parting == Parting::Plane
            && ((layers - layer).abs() > 1e-6 || layer < 0.0 || layer > problem.dims[axis] as f64)
        {
            return Err(TopoptError::Plane {
                what: "the parting plane",
                at: draw.at,
                h: problem.h,
                nearest: problem.origin[axis]
                    + problem.h * layer.clamp(0.0, problem.dims[axis] as f64),
            });
        }
        let layer = layer.max(0.0) as usize;
        Ok(Some(Self::new(
            problem.dims,
            axis,
            dir[axis] > 0.0,
            draw.parting,
            layer,
        )))
    }

    /// First layer above the parting plane; none where there is no such plane.
    pub fn parting(&self) -> Option<usize> {
        (self.parting == Parting::Plane).then_some(self.layer)
    }

    /// The hull with smooth maxima.
    pub fn smooth(&self, x: &[f64]) -> Vec<f64> {
        let min = |a: f64, b: f64| a + b - smooth_max(a, b);
        self.map(x, smooth_max, min)
    }

    /// The exact hull.
    pub fn hard(&self, x: &[f64]) -> Vec<f64> {
        self.map(x, f64::max, f64::min)
    }

    fn map(
        &self,
        x: &[f64],
        max: impl Fn(f64, f64) -> f64,
        min: impl Fn(f64, f64) -> f64,
    ) -> Vec<f64> {
        let mut out = x.to_vec();
        for column in self.columns() {
            match self.parting {
                Parting::Free => {
                    let up = run(x, &column, &max);
                    let back: Vec<usize> = column.iter().rev().copied().collect();
                    let down = run(x, &back, &max);
                    for (k, &v) in column.iter().enumerate() {
                        out[v] = min(up[k], down[column.len() - 1 - k]);
                    }
                }
                _ => {
                    for part in self.parts(&column) {
                        for (&v, m) in part.iter().zip(run(x, &part, &max)) {
                            out[v] = m;
                        }
                    }
                }
            }
        }
        out
    }

    /// The transpose of the derivative of [`Hull::smooth`] at `x`, applied to `g`.
    pub fn transpose(&self, x: &[f64], g: &[f64]) -> Vec<f64> {
        let mut out = g.to_vec();
        for column in self.columns() {
            match self.parting {
                Parting::Free => {
                    let up = run(x, &column, &smooth_max);
                    let back: Vec<usize> = column.iter().rev().copied().collect();
                    let down = run(x, &back, &smooth_max);
                    let n = column.len();
                    // The derivative of the minimum by its first argument is the share of the other.
                    let of_up: Vec<f64> = (0..n)
                        .map(|k| g[column[k]] * share(down[n - 1 - k], up[k]))
                        .collect();
                    let of_down: Vec<f64> = (0..n)
                        .rev()
                        .map(|k| g[column[k]] * share(up[k], down[n - 1 - k]))
                        .collect();
                    let a = run_back(x, &column, &up, of_up);
                    let b = run_back(x, &back, &down, of_down);
                    for (k, &v) in column.iter().enumerate() {
                        out[v] = a[k] + b[n - 1 - k];
                    }
                }
                _ => {
                    for part in self.parts(&column) {
                        let m = run(x, &part, &smooth_max);
                        let of = part.iter().map(|&v| g[v]).collect();
                        for (&v, value) in part.iter().zip(run_back(x, &part, &m, of)) {
                            out[v] = value;
                        }
                    }
                }
            }
        }
        out
    }

    /// All columns, lowest voxel first.
    fn columns(&self) -> impl Iterator<Item = Vec<usize>> + '_ {
        let strides = [1, self.dims[0], self.dims[0] * self.dims[1]];
        let (u, v) = ((self.axis + 1) % 3, (self.axis + 2) % 3);
        let n = self.dims;
        (0..n[v]).flat_map(move |j| {
            (0..n[u]).map(move |i| {
                let first = i * strides[u] + j * strides[v];
                (0..n[self.axis])
                    .map(|k| first + k * strides[self.axis])
                    .collect()
            })
        })
    }

    /// The parts of a column, each from outside toward the parting.
    fn parts(&self, column: &[usize]) -> Vec<Vec<usize>> {
        let reversed = |part: &[usize]| part.iter().rev().copied().collect();
        match (self.parting, self.upward) {
            (Parting::OneSided, true) => vec![reversed(column)],
            (Parting::OneSided, false) => vec![column.to_vec()],
            _ => vec![
                column[..self.layer].to_vec(),
                reversed(&column[self.layer..]),
            ],
        }
    }
}

/// Running maxima along `part`.
fn run(x: &[f64], part: &[usize], max: &impl Fn(f64, f64) -> f64) -> Vec<f64> {
    let mut out = Vec::with_capacity(part.len());
    for (k, &v) in part.iter().enumerate() {
        out.push(if k == 0 { x[v] } else { max(x[v], out[k - 1]) });
    }
    out
}

/// The transpose of the derivative of [`run`]; `m` is its result.
fn run_back(x: &[f64], part: &[usize], m: &[f64], mut g: Vec<f64>) -> Vec<f64> {
    for k in (1..part.len()).rev() {
        let own = share(x[part[k]], m[k - 1]);
        let here = g[k];
        g[k] = here * own;
        g[k - 1] += here * (1.0 - own);
    }
    g
}
