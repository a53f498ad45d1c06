//! From pouring to the last cell frozen, and what every cell saw on the way.

use rayon::prelude::*;

use super::STAGE;
use super::error::SolidifyError;
use super::grid::{Cell, Grid, Laws};
use super::materials::{Metal, Sand};
use super::sweep::{State, step};
use crate::monitor::Monitor;

/// What the metal cells saw; one entry a metal cell, in the order of `cells`.
#[derive(Debug, Clone, Default)]
pub(super) struct History {
    /// Index of the cell.
    pub cells: Vec<u32>,
    /// When it was solid, s.
    pub solid: Vec<f64>,
    /// When feeding through it ended, s.
    pub critical: Vec<f64>,
    /// Niyama's criterion near the end of freezing, (K s)^0.5 / mm.
    pub niyama: Vec<f64>,
    pub steps: usize,
    /// Change of the total heat over the heat of the metal.
    pub drift: f64,
}

/// The first steps are this much shorter than the longest.
const FIRST: f64 = 20.0;
/// A step is at most this share of the time so far: what freezes early needs short steps.
const SHARE: f64 = 0.04;
/// Steps are shortened when a cell freezes by more than this share in one.
const MOST_FREEZING: f64 = 0.35;
/// The march is given up after this many times the steps expected.
const PATIENCE: usize = 40;

/// Enthalpies at which something is noted.
struct Marks {
    solid: f64,
    critical: f64,
    /// Temperature at which Niyama's criterion is taken.
    niyama: f64,
}

/// Marches until all metal is solid. `expected` is a guess of that time, s, and `steps` the steps for it.
pub(super) fn march(
    grid: &Grid,
    laws: &Laws,
    metal: &Metal,
    sand: &Sand,
    expected: f64,
    steps: usize,
    monitor: &Monitor,
) -> Result<History, SolidifyError> {
    let cells: Vec<u32> = (0..grid.cells.len())
        .filter(|&c| grid.cells[c].is_metal())
        .map(|c| c as u32)
        .collect();
    let mut state = filled(grid, laws, metal, sand);
    let heat = |state: &State| -> f64 {
        let each = state.enthalpy.iter().enumerate();
        each.map(|(c, h)| h * grid.volume(c)).sum()
    };
    let cold = laws.metal.of(sand.temperature);
    let poured = laws.metal.of(metal.pour) - cold;
    let volume: f64 = cells.iter().map(|&c| grid.volume(c as usize)).sum();
    let before = heat(&state);
    let marks = marks(laws, metal);
    let mut history = History {
        solid: vec![f64::NAN; cells.len()],
        critical: vec![f64::NAN; cells.len()],
        niyama: vec![f64::NAN; cells.len()],
        cells,
        ..History::default()
    };
    let longest = expected / steps as f64;
    let (mut time, mut damping) = (0.0, 1.0);
    let mut left = history.cells.len();
    let all = left.max(1) as f64;
    while left > 0 {
        let done = 1.0 - left as f64 / all;
        monitor.step(STAGE, "freezing", 0.1 + 0.8 * done)?;
        if history.steps >= PATIENCE * steps {
            return Err(SolidifyError::NotFrozen {
                cells: left,
                time,
                steps: history.steps,
            });
        }
        let dt = damping * longest.min((SHARE * time).max(longest / FIRST));
        let old: Vec<[f64; 2]> = history
            .cells
            .par_iter()
            .map(|&c| [state.enthalpy[c as usize], state.temperature[c as usize]])
            .collect();
        step(grid, laws, &mut state, dt, history.steps);
        let most = note(grid, laws, &state, &old, &marks, time, dt, &mut history);
        damping = if most > MOST_FREEZING {
            (damping * 0.7).max(0.05)
        } else {
            (damping * 1.1).min(1.0)
        };
        time += dt;
        history.steps += 1;
        left = history.solid.iter().filter(|t| t.is_nan()).count();
    }
    history.drift = (heat(&state) - before) / (poured * volume);
    Ok(history)
}

fn filled(grid: &Grid, laws: &Laws, metal: &Metal, sand: &Sand) -> State {
    let temperature = |cell: &Cell| {
        if cell.is_metal() {
            metal.pour
        } else {
            sand.temperature
        }
    };
    let temperatures: Vec<f64> = grid.cells.iter().map(temperature).collect();
    let hot = laws.metal.of(metal.pour);
    let cold = laws.sand.of(sand.temperature);
    State {
        enthalpy: grid
            .cells
            .iter()
            .map(|cell| if cell.is_metal() { hot } else { cold })
            .collect(),
        temperature: temperatures,
    }
}

fn marks(laws: &Laws, metal: &Metal) -> Marks {
    let (mut low, mut high) = (metal.solidus, metal.liquidus);
    for _ in 0..60 {
        let middle = (low + high) / 2.0;
        if laws.solid.at(middle) > metal.feeding_ends {
            low = middle;
        } else {
            high = middle;
        }
    }
    Marks {
        solid: laws.metal.of(metal.solidus),
        critical: laws.metal.of((low + high) / 2.0),
        niyama: metal.solidus + 0.1 * (metal.liquidus - metal.solidus),
    }
}

/// Notes what happened in a step; gives the largest share that froze in it.
#[allow(clippy::too_many_arguments, reason = "one place calls it")]
fn note(
    grid: &Grid,
    laws: &Laws,
    state: &State,
    old: &[[f64; 2]],
    marks: &Marks,
    time: f64,
    dt: f64,
    history: &mut History,
) -> f64 {
    let each = history
        .cells
        .par_iter()
        .zip(old)
        .zip(&mut history.solid)
        .zip(&mut history.critical)
        .zip(&mut history.niyama);
    each.map(|((((&c, before), solid), critical), niyama)| {
        if !solid.is_nan() {
            return 0.0;
        }
        let c = c as usize;
        let after = [state.enthalpy[c], state.temperature[c]];
        let crossed =
            |mark: f64| (after[0] <= mark).then(|| time + dt * share(before[0], after[0], mark));
        if critical.is_nan() {
            *critical = crossed(marks.critical).unwrap_or(f64::NAN);
        }
        *solid = crossed(marks.solid).unwrap_or(f64::NAN);
        if niyama.is_nan() && after[1] <= marks.niyama {
            let rate = ((before[1] - after[1]) / dt).max(1e-12);
            *niyama = gradient(grid, state, c) * 1e-3 / rate.sqrt();
        }
        (laws.solid.at(after[1]) - laws.solid.at(before[1])).max(0.0)
    })
    .reduce(|| 0.0, f64::max)
}

/// Where between `before` and `after` the value `mark` lies.
fn share(before: f64, after: f64, mark: f64) -> f64 {
    if before > after {
        ((before - mark) / (before - after)).clamp(0.0, 1.0)
    } else {
        1.0
    }
}

/// Slope of the temperature in the metal, K/m.
fn gradient(grid: &Grid, state: &State, c: usize) -> f64 {
    let at = grid.ijk(c);
    let stride = [1, grid.dims[0], grid.dims[0] * grid.dims[1]];
    let mut sum = 0.0;
    for a in 0..3 {
        let back = at[a] > 0 && grid.cells[c - stride[a]].is_metal();
        let ahead = at[a] + 1 < grid.dims[a] && grid.cells[c + stride[a]].is_metal();
        let low = if back { c - stride[a] } else { c };
        let high = if ahead { c + stride[a] } else { c };
        let cells = usize::from(back) + usize::from(ahead);
        if cells > 0 {
            let span = cells as f64 * grid.widths[a][at[a]];
            sum += ((state.temperature[high] - state.temperature[low]) / span).powi(2);
        }
    }
    sum.sqrt()
}
