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

/// The variables of the last iteration, and what the asymptotes follow from.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mma {
    /// Constants.
    pub options: MmaOptions,
    /// Variables one iteration ago; empty before.
    pub last: Vec<f64>,
    /// Signs of the last step, 0 where a variable stood still; empty before there was one.
    pub steps: Vec<i8>,
    /// Distance of both asymptotes from the variable.
    pub reach: Vec<f64>,
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
    pub fn update(&mut self, x: &[f64], df: &[f64], g: f64, dg: &[f64], step: f64) -> Vec<f64> {
        self.move_asymptotes(x);
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
        self.last.clear();
        self.last.extend_from_slice(x);
        new
    }

    fn move_asymptotes(&mut self, x: &[f64]) {
        let o = &self.options;
        if self.last.len() != x.len() {
            self.reach = vec![o.initial; x.len()];
            return;
        }
        let step = |(x, last): (&f64, &f64)| (x > last) as i8 - (x < last) as i8;
        if self.steps.len() != x.len() {
            self.steps = x.iter().zip(&self.last).map(step).collect();
            return;
        }
        let state = self.steps.par_iter_mut().zip(&mut self.reach);
        x.par_iter().zip(&self.last).zip(state).for_each(|(pair, (before, reach))| {
            let now = step(pair);
            let factor = match now * *before {
                1 => o.wider,
                -1 => o.narrower,
                _ => 1.0,
            };
            *reach = (factor * *reach).clamp(o.nearest, o.farthest);
            *before = now;
        });
    }

    fn term(&self, i: usize, x: f64, gradients: [f64; 2], step: f64) -> Term {
        if gradients == [0.0; 2] {
            return Term::default();
        }
        let (low, high) = (x - self.reach[i], x + self.reach[i]);
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
