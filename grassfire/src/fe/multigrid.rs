//! The preconditioner: one geometric multigrid cycle in single precision.

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::coarse::Coarse;
use super::frame::Frame;
use super::galerkin::{self, Tables};
use super::grid::{NodeGrid, dot};
use super::matrix_free::{MatrixFree, hold};
use super::smoother::{self, Diagonal, Vectors};
use super::springs::add_forces;
use super::stencil::Stencil;
use super::window::sums_around;
use super::{FeError, SolverOptions, element, transfer};

/// Power iterations for the largest eigenvalue of a coarse level: the first time, after small changes, and where the cycle was not
/// positive.
const POWER_FIRST: usize = 16;
const POWER_WARM: usize = 4;
pub(super) const POWER_AGAIN: usize = 60;
/// The power iteration stays below the largest eigenvalue by less than this factor.
const POWER_MARGIN: f64 = 1.1;
/// Visits of the coarser levels below the second: a W cycle where it costs little.
const VISITS: usize = 2;

/// Coarse levels, which cost little, are smoothed by polynomials of so many times the degree, down to eigenvalues so many
/// times smaller.
const COARSE_WORK: usize = 2;

/// The finest grid as it is now.
#[derive(Clone, Copy)]
pub(super) struct Fine<'a> {
    pub frame: &'a Frame,
    /// Field of elements: modulus times edge.
    pub e: &'a [f64],
}

/// The operator of a level.
enum Operator {
    Fine(MatrixFree<f32>),
    Coarse(Stencil, Tables<f32>),
}

/// One level above the coarsest.
struct Level {
    grid: NodeGrid,
    operator: Operator,
    diagonal: Diagonal,
    coefficients: Vec<(f32, f32)>,
    /// Approximate eigenvector of the largest eigenvalue; empty on the finest level, whose elements bound it.
    probe: Vec<f32>,
    /// Right side; empty on the finest level, where it is the residual of the conjugate gradients.
    b: Vec<f32>,
    x: Vec<f32>,
    d: Vec<f32>,
    t: Vec<f32>,
}

/// All levels.
pub(super) struct Multigrid {
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
    /// Allocates `count` levels; the finest grid divides by `2^(count - 1)`. `occupied`: its elements that may have stiffness.
    pub fn new(
        frame: &Frame,
        nu: f64,
        count: usize,
        mut occupied: Vec<bool>,
        options: &SolverOptions,
    ) -> Self {
        let stiffness = element::stiffness(nu);
        let mut levels = Vec::new();
        let mut grid = frame.grid.clone();
        for l in 0..count - 1 {
            let coarser = galerkin::coarsen(grid.n, &occupied);
            let next = NodeGrid::new(grid.n.map(|n| n / 2), &coarser);
            levels.push(Level::new(grid, l, &stiffness, frame));
            (grid, occupied) = (next, coarser);
        }
        Self {
            levels,
            tables: Tables::new(&stiffness, count - 1, frame),
            coarse: Coarse::new(&grid, &occupied),
            coarse_b: grid.field(),
            coarse_x: grid.field(),
            coarsest: grid,
            unit: (stiffness[0][0], element::jacobi_bound(&stiffness)),
            options: options.clone(),
        }
    }

    /// Takes new moduli.
    pub fn set(&mut self, Fine { frame, e }: Fine) -> Result<(), FeError> {
        let elements = galerkin::elements(frame, &self.coarsest, &self.tables, e);
        self.coarse.factor(&self.coarsest, &elements)?;
        for level in &mut self.levels {
            match (&mut level.operator, &mut level.diagonal) {
                (Operator::Fine(_), Diagonal::Node { inverse, blocks }) => {
                    node_diagonal(&level.grid, e, self.unit.0, inverse);
                    *blocks = spring_blocks(frame, inverse);
                }
                (Operator::Coarse(stencil, tables), Diagonal::Component(inverse)) => {
                    galerkin::fill(frame, &level.grid, tables, e, stencil);
                    component_diagonal(&level.grid, stencil, inverse);
                }
                _ => {}
            }
        }
        self.set_smoothers(POWER_WARM);
        Ok(())
    }

    /// Estimates the largest eigenvalues of the coarse levels anew, from so many power iterations at least.
    pub fn set_smoothers(&mut self, rounds: usize) {
        let (degree, ratio) = (self.options.smoother_degree, self.options.smoother_ratio);
        for level in &mut self.levels {
            let (work, high) = match level.operator {
                Operator::Fine(_) => (1, self.unit.1),
                Operator::Coarse(..) => {
                    let first = level.coefficients.is_empty();
                    let rounds = if first {
                        POWER_FIRST.max(rounds)
                    } else {
                        rounds
                    };
                    (COARSE_WORK, POWER_MARGIN * level.largest_eigenvalue(rounds))
                }
            };
            level.coefficients = smoother::coefficients(work * degree, high, work as f64 * ratio);
        }
    }

    /// One cycle for the residual `r`; the result is [`Multigrid::result`].
    pub fn cycle(&mut self, fine: Fine, r: &[f64]) {
        if self.levels.is_empty() {
            let b = self.coarse_b.iter_mut().zip(r);
            b.for_each(|(to, &v)| *to = v as f32);
        }
        self.solve(fine, r, 0);
    }

    /// The correction of the last [`Multigrid::cycle`].
    pub fn result(&self) -> &[f32] {
        self.levels.first().map_or(&self.coarse_x, |level| &level.x)
    }

    /// [`Multigrid::result`], to be corrected.
    pub fn result_mut(&mut self) -> &mut [f32] {
        let first = self.levels.first_mut();
        first.map_or(&mut self.coarse_x, |level| &mut level.x)
    }

    fn solve(&mut self, finest: Fine, r: &[f64], l: usize) {
        if l == self.levels.len() {
            self.coarse.solve(&self.coarse_b, &mut self.coarse_x);
            return;
        }
        let level = &mut self.levels[l];
        level.smooth(finest, r, true);
        for _ in 0..if l == 0 { 1 } else { VISITS } {
            self.levels[l].apply_x(finest);
            let (above, below) = self.levels.split_at_mut(l + 1);
            let fine = &above[l];
            let (grid, b) = match below.first_mut() {
                Some(next) => (&next.grid, &mut next.b),
                None => (&self.coarsest, &mut self.coarse_b),
            };
            if l == 0 {
                transfer::restrict(&fine.grid, r, &fine.t, grid, b);
            } else {
                transfer::restrict(&fine.grid, &fine.b, &fine.t, grid, b);
            }
            self.solve(finest, r, l + 1);
            let (above, below) = self.levels.split_at_mut(l + 1);
            let fine = &mut above[l];
            let (grid, x) = match below.first() {
                Some(next) => (&next.grid, &next.x),
                None => (&self.coarsest, &self.coarse_x),
            };
            transfer::prolong(grid, x, &fine.grid, &mut fine.x);
            if l == 0 {
                hold(&finest.frame.fixed, &mut fine.x);
            }
        }
        self.levels[l].smooth(finest, r, false);
    }
}

impl Level {
    fn new(grid: NodeGrid, l: usize, stiffness: &[[f64; 24]; 24], frame: &Frame) -> Self {
        let (operator, diagonal, probe) = if l == 0 {
            let operator = Operator::Fine(MatrixFree::new(stiffness));
            let diagonal = Diagonal::Node {
                inverse: grid.scalar(),
                blocks: Vec::new(),
            };
            (operator, diagonal, Vec::new())
        } else {
            let tables = Tables::new(stiffness, l, frame);
            let operator = Operator::Coarse(Stencil::new(&grid), tables);
            (operator, Diagonal::Component(grid.field()), start(&grid))
        };
        Self {
            operator,
            diagonal,
            coefficients: Vec::new(),
            probe,
            b: if l == 0 { Vec::new() } else { grid.field() },
            x: grid.field(),
            d: grid.field(),
            t: grid.field(),
            grid,
        }
    }

    /// `t = K x`.
    fn apply_x(&mut self, Fine { frame, e }: Fine) {
        match &self.operator {
            Operator::Fine(op) => {
                op.apply(&self.grid, e, &frame.fixed, &self.x, &mut self.t);
                add_forces(&frame.springs, &self.x, &mut self.t);
            }
            Operator::Coarse(stencil, _) => stencil.apply(&self.grid, &self.x, &mut self.t),
        }
    }

    /// A Chebyshev sweep; `r`: right side of the finest level; `from_zero` when x is still to be made.
    fn smooth(&mut self, fine: Fine, r: &[f64], from_zero: bool) {
        for i in 0..self.coefficients.len() {
            let zero = from_zero && i == 0;
            if !zero {
                self.apply_x(fine);
            }
            let vectors = Vectors {
                t: &self.t,
                x: &mut self.x,
                d: &mut self.d,
            };
            let factors = self.coefficients[i];
            if matches!(self.operator, Operator::Fine(_)) {
                smoother::step(&self.grid, &self.diagonal, r, vectors, zero, factors);
                hold(&fine.frame.fixed, &mut self.d);
                hold(&fine.frame.fixed, &mut self.x);
            } else {
                smoother::step(&self.grid, &self.diagonal, &self.b, vectors, zero, factors);
            }
        }
    }

    /// Largest eigenvalue of D^-1 K by power iteration from the last vector.
    fn largest_eigenvalue(&mut self, rounds: usize) -> f64 {
        let (Operator::Coarse(stencil, _), Diagonal::Component(inverse)) =
            (&self.operator, &self.diagonal)
        else {
            return 0.0;
        };
        let mut largest = 0.0;
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
                    if let Some(at) = grid.node([x, y, z], c) {
                        out[at] = ((state >> 11) as f64 / (1u64 << 53) as f64 - 0.5) as f32;
                    }
                }
            }
        }
    }
    out
}

/// Inverse diagonal of the finest grid: all three entries of a node are `k` times the sum of the moduli around it.
fn node_diagonal(grid: &NodeGrid, e: &[f64], k: f64, inverse: &mut [f32]) {
    let of_sum = |sum: f64| {
        if sum > 0.0 {
            (1.0 / (k * sum)) as f32
        } else {
            0.0
        }
    };
    // Rounded, as the operator of the cycle rounds them.
    sums_around(grid, e, |e| f64::from(e as f32), inverse, of_sum);
}

/// The inverse diagonal blocks of the nodes that springs hold: they take the place of the numbers there, which become zero.
fn spring_blocks(frame: &Frame, inverse: &mut [f32]) -> Vec<([usize; 3], Matrix3<f32>)> {
    let mut out = Vec::new();
    for spring in &frame.springs {
        let z = spring.at[2];
        let Some(place) = frame.grid.place(spring.at) else {
            continue;
        };
        let of_elements = &mut inverse[frame.grid.first(z) + place];
        if *of_elements > 0.0 {
            let block = spring.stiffness + Matrix3::identity() / f64::from(*of_elements);
            *of_elements = 0.0;
            let inverse = block.try_inverse().unwrap_or_else(Matrix3::zeros);
            out.push((spring.places, inverse.cast()));
        }
    }
    out
}

/// Inverse diagonal of a stencil.
fn component_diagonal(grid: &NodeGrid, stencil: &Stencil, inverse: &mut [f32]) {
    grid.planes(3, inverse).enumerate().for_each(|(z, out)| {
        let count = grid.count(z);
        for place in 0..count {
            let entries = [0, 1, 2].map(|c| stencil.diagonal(z, place, c));
            let trace: f32 = entries.iter().sum();
            for (c, &entry) in entries.iter().enumerate() {
                let live = entry > 1e-12 * trace && entry > 0.0;
                out[c * count + place] = if live { 1.0 / entry } else { 0.0 };
            }
        }
    });
}
