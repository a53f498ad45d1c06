//! The method of moving asymptotes for one constraint.

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Variables that are summed together: sums do not depend on the threads.
const CHUNK: usize = 1 << 14;

/// Constants of the asymptotes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MmaOptions {
    /// Distance of the first asymptotes.
    pub initial: f64,
    /// Factor after an oscillation.
    pub narrower: f64,
    /// Factor after two steps the same way.
    pub wider: f64,
    /// Nearest and farthest asymptote.
    pub nearest: f64,
    /// See `nearest`.
    pub farthest: f64,
}

impl Default for MmaOptions {
    fn default() -> Self {
        Self {
            initial: 0.5,
            narrower: 0.7,
            wider: 1.2,
            nearest: 0.01,
            farthest: 10.0,
        }
    }
}

/// What the asymptotes follow from; empty at first.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mma {
    /// Constants.
    pub options: MmaOptions,
    /// Signs of the last step, 0 where a variable stood still.
    pub steps: Vec<i8>,
    /// Distance of both asymptotes from the variable.
    pub reach: Vec<f32>,
}

/// The separable approximation at one variable: `p / (high - x) + q / (x - low)` of objective and constraint.
#[derive(Debug, Clone, Copy, Default)]
struct Term {
    p: [f64; 2],
    q: [f64; 2],
    low: f64,
    high: f64,
    range: [f64; 2],
}

impl Mma {
    /// New variables for `min f` under `g <= 0`, all in 0..=1, within `step` of `x`.
    ///
    /// 1. The asymptotes move: together after an oscillation, apart after two steps the same way.
    /// 2. Objective and constraint become separable convex functions with the given gradients at x.
    /// 3. The multiplier of the constraint is found by bisection; each variable is then a formula.
    ///
    /// Variables whose gradients `df` and `dg` are both 0 stay. K. Svanberg: The method of moving asymptotes, 1987,
    /// doi:10.1002/nme.1620240207.
    pub fn update(&mut self, x: &mut [f64], df: &[f64], g: f64, dg: &[f64], step: f64) {
        self.start(x.len());
        // Terms are made again for every multiplier: storing them would take more memory than all else here.
        let sum = |of: &(dyn Fn(&Term, f64) -> f64 + Sync)| -> f64 {
            let parts: Vec<f64> = (0..x.len().div_ceil(CHUNK))
                .into_par_iter()
                .map(|chunk| {
                    let all = chunk * CHUNK..x.len().min((chunk + 1) * CHUNK);
                    all.map(|i| of(&self.term(i, x[i], [df[i], dg[i]], step), x[i]))
                        .sum()
                })
                .collect();
            parts.iter().sum()
        };
        let rest = g - sum(&|term, x| term.constraint(x));
        let violation = |m: f64| rest + sum(&|term, _| term.constraint(term.best(m)));
        let (mut a, mut b) = (1e-12f64, 1e12f64);
        while b / a > 1.0 + 1e-7 {
            let middle = (a * b).sqrt();
            if violation(middle) > 0.0 {
                a = middle;
            } else {
                b = middle;
            }
        }
        let new: Vec<f64> = (0..x.len())
            .into_par_iter()
            .map(|i| {
                let term = self.term(i, x[i], [df[i], dg[i]], step);
                if term.high > term.low {
                    term.best(b)
                } else {
                    x[i]
                }
            })
            .collect();
        self.move_asymptotes(x, &new);
        x.copy_from_slice(&new);
    }

    /// Takes the memory for `n` variables; a new start when there were others.
    pub fn start(&mut self, n: usize) {
        if self.reach.len() != n {
            self.steps = vec![0; n];
            self.reach = vec![self.options.initial as f32; n];
        }
    }

    /// Nearer after an oscillation, farther after two steps the same way.
    fn move_asymptotes(&mut self, x: &[f64], new: &[f64]) {
        let o = &self.options;
        let state = self.steps.par_iter_mut().zip(&mut self.reach);
        let steps = x.par_iter().zip(new);
        steps.zip(state).for_each(|((x, new), (before, reach))| {
            let now = (new > x) as i8 - (new < x) as i8;
            let factor = match now * *before {
                1 => o.wider,
                -1 => o.narrower,
                _ => 1.0,
            };
            *reach = (factor * f64::from(*reach)).clamp(o.nearest, o.farthest) as f32;
            *before = now;
        });
    }

    fn term(&self, i: usize, x: f64, gradients: [f64; 2], step: f64) -> Term {
        if gradients == [0.0; 2] {
            return Term::default();
        }
        let reach = f64::from(self.reach[i]);
        let (low, high) = (x - reach, x + reach);
        let (above, below) = ((high - x).powi(2), (x - low).powi(2));
        let p = |d: f64| above * (1.001 * d.max(0.0) + 0.001 * (-d).max(0.0) + 1e-5);
        let q = |d: f64| below * (0.001 * d.max(0.0) + 1.001 * (-d).max(0.0) + 1e-5);
        Term {
            p: gradients.map(p),
            q: gradients.map(q),
            low,
            high,
            range: [
                (low + 0.1 * (x - low)).max(x - step).max(0.0),
                (high - 0.1 * (high - x)).min(x + step).min(1.0),
            ],
        }
    }
}

impl Term {
    fn constraint(&self, x: f64) -> f64 {
        if self.high > self.low {
            self.p[1] / (self.high - x) + self.q[1] / (x - self.low)
        } else {
            0.0
        }
    }

    /// The minimizer of objective plus multiplier times constraint.
    fn best(&self, multiplier: f64) -> f64 {
        let p = (self.p[0] + multiplier * self.p[1]).sqrt();
        let q = (self.q[0] + multiplier * self.q[1]).sqrt();
        if p + q <= 0.0 {
            return 0.5 * (self.range[0] + self.range[1]);
        }
        let x = (p * self.low + q * self.high) / (p + q);
        x.max(self.range[0]).min(self.range[1])
    }
}
