//! The preconditioner: one geometric multigrid cycle in single precision.

use std::sync::Arc;

use rayon::prelude::*;

use super::coarse::Coarse;
use super::frame::Frame;
use super::galerkin::{self, Tables};
use super::grid::{NodeGrid, dot};
use super::matrix_free::{MatrixFree, hold};
use super::smoother::{self, Diagonal, Vectors};
use super::stencil::Stencil;
use super::{FeError, SolverOptions, element, transfer};

/// Power iterations for the largest eigenvalue of a coarse level: the first time, and after small changes.
const POWER_FIRST: usize = 16;
const POWER_WARM: usize = 4;
/// The power iteration stays below the largest eigenvalue by less than this factor.
const POWER_MARGIN: f64 = 1.1;
/// Visits of the coarser levels below the second: a W cycle where it costs little.
const VISITS: usize = 2;

/// The operator of a level.
enum Operator {
    Fine(MatrixFree<f32>),
    Coarse(Stencil),
}

/// One level above the coarsest.
struct Level {
    grid: NodeGrid,
    operator: Operator,
    diagonal: Diagonal,
    coefficients: Vec<(f32, f32)>,
    /// Approximate eigenvector of the largest eigenvalue; empty on the finest level, whose elements bound it.
    probe: Vec<f32>,
    tables: Option<Tables<f32>>,
    b: Vec<f32>,
    x: Vec<f32>,
    d: Vec<f32>,
    t: Vec<f32>,
}

/// All levels.
pub(super) struct Multigrid {
    frame: Arc<Frame>,
    levels: Vec<Level>,
    coarsest: NodeGrid,
    tables: Tables<f64>,
    coarse: Coarse,
    coarse_b: Vec<f32>,
    coarse_x: Vec<f32>,
    /// Diagonal entry of the unit element, and the bound of the largest eigenvalue.
    unit: (f64, f64),
    options: SolverOptions,
}

impl Multigrid {
    /// Allocates `count` levels; the finest grid divides by `2^(count - 1)`. `e` tells where there may be stiffness.
    pub fn new(
        frame: &Arc<Frame>,
        nu: f64,
        count: usize,
        e: &[f32],
        options: &SolverOptions,
    ) -> Self {
        let stiffness = element::stiffness(nu);
        let side = |level: usize| frame.grid.n.map(|n| n >> level);
        let level = |l: usize| {
            let grid = NodeGrid::new(side(l));
            let fine = l == 0;
            Level {
                operator: if fine {
                    Operator::Fine(MatrixFree::new(&grid, &stiffness))
                } else {
                    Operator::Coarse(Stencil::new(galerkin::places(frame, l, &grid, e)))
                },
                diagonal: if fine {
                    Diagonal::Node(vec![0.0; grid.element_plane() * (grid.n[2] + 1)])
                } else {
                    Diagonal::Component(grid.field())
                },
                coefficients: Vec::new(),
                probe: if fine { Vec::new() } else { start(&grid) },
                tables: (!fine).then(|| Tables::new(&stiffness, l, frame)),
                b: grid.field(),
                x: grid.field(),
                d: grid.field(),
                t: grid.field(),
                grid,
            }
        };
        let last = count - 1;
        let coarsest = NodeGrid::new(side(last));
        let occupied = galerkin::occupied(frame, last, &coarsest, e);
        Self {
            frame: Arc::clone(frame),
            levels: (0..last).map(level).collect(),
            tables: Tables::new(&stiffness, last, frame),
            coarse: Coarse::new(&coarsest, &occupied),
            coarse_b: coarsest.field(),
            coarse_x: coarsest.field(),
            coarsest,
            unit: (stiffness[0][0], element::jacobi_bound(&stiffness)),
            options: options.clone(),
        }
    }

    /// Takes new moduli (times edge), element field of the finest grid.
    pub fn set(&mut self, e: &[f64]) -> Result<(), FeError> {
        let elements = galerkin::elements(&self.frame, &self.coarsest, &self.tables, e);
        self.coarse.factor(&self.coarsest, &elements)?;
        let Some((first, rest)) = self.levels.split_first_mut() else {
            return Ok(());
        };
        let Operator::Fine(fine) = &mut first.operator else {
            return Ok(());
        };
        fine.e
            .par_iter_mut()
            .zip(e)
            .for_each(|(to, &v)| *to = v as f32);
        let e32 = &fine.e;
        if let Diagonal::Node(inverse) = &mut first.diagonal {
            node_diagonal(&first.grid, e32, self.unit.0, inverse);
        }
        let options = &self.options;
        first.coefficients =
            smoother::coefficients(options.smoother_degree, self.unit.1, options.smoother_ratio);
        for level in rest {
            if let (Operator::Coarse(stencil), Some(tables)) = (&mut level.operator, &level.tables)
            {
                galerkin::fill(&self.frame, &level.grid, tables, e32, stencil);
                if let Diagonal::Component(inverse) = &mut level.diagonal {
                    component_diagonal(&level.grid, stencil, inverse);
                }
            }
            let high = POWER_MARGIN * level.largest_eigenvalue();
            level.coefficients =
                smoother::coefficients(options.smoother_degree, high, options.smoother_ratio);
        }
        Ok(())
    }

    /// One cycle for the residual `r`; the result is [`Multigrid::result`].
    pub fn cycle(&mut self, r: &[f64]) {
        let b = match self.levels.first_mut() {
            Some(level) => &mut level.b,
            None => &mut self.coarse_b,
        };
        b.par_iter_mut().zip(r).for_each(|(to, &v)| *to = v as f32);
        self.solve(0);
    }

    /// The correction of the last [`Multigrid::cycle`].
    pub fn result(&self) -> &[f32] {
        self.levels.first().map_or(&self.coarse_x, |level| &level.x)
    }

    fn solve(&mut self, l: usize) {
        if l == self.levels.len() {
            self.coarse.solve(&self.coarse_b, &mut self.coarse_x);
            return;
        }
        let frame = Arc::clone(&self.frame);
        let level = &mut self.levels[l];
        level.smooth(&frame, true);
        for _ in 0..if l == 0 { 1 } else { VISITS } {
            self.levels[l].apply_x(&frame);
            let (above, below) = self.levels.split_at_mut(l + 1);
            let fine = &above[l];
            let (grid, b) = match below.first_mut() {
                Some(next) => (&next.grid, &mut next.b),
                None => (&self.coarsest, &mut self.coarse_b),
            };
            transfer::restrict(&fine.grid, &fine.b, &fine.t, grid, b);
            self.solve(l + 1);
            let (above, below) = self.levels.split_at_mut(l + 1);
            let fine = &mut above[l];
            let (grid, x) = match below.first() {
                Some(next) => (&next.grid, &next.x),
                None => (&self.coarsest, &self.coarse_x),
            };
            transfer::prolong(grid, x, &fine.grid, &mut fine.x);
            if l == 0 {
                hold(&frame.fixed, &mut fine.x);
            }
        }
        self.levels[l].smooth(&frame, false);
    }
}

impl Level {
    /// `t = K x`.
    fn apply_x(&mut self, frame: &Frame) {
        match &self.operator {
            Operator::Fine(op) => {
                op.apply(
                    &self.grid,
                    &frame.active,
                    &frame.fixed,
                    &self.x,
                    &mut self.t,
                );
            }
            Operator::Coarse(stencil) => stencil.apply(&self.grid, &self.x, &mut self.t),
        }
    }

    /// A Chebyshev sweep; `from_zero` when x is still to be made.
    fn smooth(&mut self, frame: &Frame, from_zero: bool) {
        for i in 0..self.coefficients.len() {
            let zero = from_zero && i == 0;
            if !zero {
                self.apply_x(frame);
            }
            let vectors = Vectors {
                b: &self.b,
                t: &self.t,
                x: &mut self.x,
                d: &mut self.d,
            };
            smoother::step(
                &self.grid,
                &self.diagonal,
                vectors,
                zero,
                self.coefficients[i],
            );
            if matches!(self.operator, Operator::Fine(_)) {
                hold(&frame.fixed, &mut self.d);
                hold(&frame.fixed, &mut self.x);
            }
        }
    }

    /// Largest eigenvalue of D^-1 K by power iteration from the last vector.
    fn largest_eigenvalue(&mut self) -> f64 {
        let (Operator::Coarse(stencil), Diagonal::Component(inverse)) =
            (&self.operator, &self.diagonal)
        else {
            return 0.0;
        };
        let mut largest = 0.0;
        let rounds = if self.coefficients.is_empty() {
            POWER_FIRST
        } else {
            POWER_WARM
        };
        for _ in 0..rounds {
            stencil.apply(&self.grid, &self.probe, &mut self.t);
            let before = dot(&self.probe, &self.probe).sqrt();
            self.t
                .par_iter_mut()
                .zip(inverse)
                .for_each(|(t, d)| *t *= d);
            let after = dot(&self.t, &self.t).sqrt();
            if before <= 0.0 || after <= 0.0 {
                break;
            }
            largest = after / before;
            let scale = (1.0 / after) as f32;
            self.probe
                .par_iter_mut()
                .zip(&self.t)
                .for_each(|(p, t)| *p = t * scale);
        }
        if largest > 0.0 { largest } else { 1.0 }
    }
}

/// A field of pseudo-random numbers (xorshift), the same in every run.
fn start(grid: &NodeGrid) -> Vec<f32> {
    let mut out = grid.field();
    let mut state = 88_172_645_463_325_252u64;
    for z in 0..=grid.n[2] {
        for y in 0..=grid.n[1] {
            for x in 0..=grid.n[0] {
                for c in 0..3 {
                    state ^= state << 13;
                    state ^= state >> 7;
                    state ^= state << 17;
                    out[grid.node(x, y, z) + c * grid.sx] =
                        ((state >> 11) as f64 / (1u64 << 53) as f64 - 0.5) as f32;
                }
            }
        }
    }
    out
}

/// Inverse diagonal of the finest grid: all three entries of a node are `k` times the sum of the moduli around it.
fn node_diagonal(grid: &NodeGrid, e: &[f32], k: f64, inverse: &mut [f32]) {
    let plane = grid.element_plane();
    inverse
        .par_chunks_mut(plane)
        .enumerate()
        .for_each(|(z, out)| {
            for y in 0..=grid.n[1] {
                let at = grid.element(0, y, z);
                let row = &mut out[y * grid.sx..][..=grid.n[0]];
                for (x, inverse) in row.iter_mut().enumerate() {
                    let sum: f64 = (0..8)
                        .map(|i| at + x - (i & 1) - (i >> 1 & 1) * grid.sx - (i >> 2) * plane)
                        .map(|i| f64::from(e[i]))
                        .sum();
                    *inverse = if sum > 0.0 {
                        (1.0 / (k * sum)) as f32
                    } else {
                        0.0
                    };
                }
            }
        });
}

/// Inverse diagonal of a stencil.
fn component_diagonal(grid: &NodeGrid, stencil: &Stencil, inverse: &mut [f32]) {
    grid.planes(inverse).enumerate().for_each(|(z, out)| {
        for y in 0..=grid.n[1] {
            for x in 0..=grid.n[0] {
                let entries = [0, 1, 2].map(|c| stencil.diagonal(grid, [x, y, z], c));
                let trace: f32 = entries.iter().sum();
                for (c, &entry) in entries.iter().enumerate() {
                    let live = entry > 1e-12 * trace && entry > 0.0;
                    out[y * grid.row + c * grid.sx + x] = if live { 1.0 / entry } else { 0.0 };
                }
            }
        }
    });
}
