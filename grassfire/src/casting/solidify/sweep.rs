//! One time step: implicit sweeps along x, y and z, each conserving enthalpy.

use rayon::prelude::*;

use super::grid::{Cell, Grid, Laws};

/// Enthalpy (J/m3) and temperature (degrees Celsius) of every cell.
#[derive(Debug, Clone)]
pub(super) struct State {
    pub enthalpy: Vec<f64>,
    pub temperature: Vec<f64>,
}

/// Least share of an interface cell's face that counts; keeps faces along the surface finite.
const LEAST_SHARE: f64 = 1e-3;
/// Temperature changes below this need no second pass, K.
const STILL: f64 = 1e-7;

/// Lines of cells along one axis, side by side: entry `at * lanes + lane`.
#[derive(Default)]
struct Block {
    lanes: usize,
    enthalpy: Vec<f64>,
    temperature: Vec<f64>,
    cells: Vec<Cell>,
    /// Component of the normal along the axis, 255 for 1.
    normals: Vec<u8>,
    conductivity: Vec<f64>,
    /// Conductance to the next cell times the time step.
    conductance: Vec<f64>,
    capacity: Vec<f64>,
    upper: Vec<f64>,
    solution: Vec<f64>,
}

impl Block {
    fn resize(&mut self, length: usize, lanes: usize) {
        let n = length * lanes;
        self.lanes = lanes;
        self.enthalpy.resize(n, 0.0);
        self.temperature.resize(n, 0.0);
        self.cells.resize(n, Cell::Sand);
        self.normals.resize(n, 0);
        for list in [
            &mut self.conductivity,
            &mut self.conductance,
            &mut self.capacity,
            &mut self.upper,
            &mut self.solution,
        ] {
            list.resize(n, 0.0);
        }
    }

    /// Implicit heat conduction along all lines for `dt` seconds; no heat leaves at the ends.
    fn step(&mut self, widths: &[f64], laws: &Laws, dt: f64) {
        for ((k, &cell), &t) in self
            .conductivity
            .iter_mut()
            .zip(&self.cells)
            .zip(&self.temperature)
        {
            *k = laws.conductivity(cell, t);
        }
        for ((c, &cell), &h) in self
            .capacity
            .iter_mut()
            .zip(&self.cells)
            .zip(&self.enthalpy)
        {
            *c = laws.enthalpy(cell).capacity(h);
        }
        self.conduct(widths, laws, dt);
        self.solve(widths);
        self.follow(laws);
        self.solve(widths);
        for i in 0..self.enthalpy.len() {
            self.enthalpy[i] += self.capacity[i] * (self.solution[i] - self.temperature[i]);
            self.temperature[i] = laws.enthalpy(self.cells[i]).temperature(self.enthalpy[i]);
        }
    }

    fn conduct(&mut self, widths: &[f64], laws: &Laws, dt: f64) {
        let lanes = self.lanes;
        for at in 0..widths.len().saturating_sub(1) {
            let (wa, wb) = (widths[at], widths[at + 1]);
            for a in at * lanes..(at + 1) * lanes {
                let b = a + lanes;
                let (ka, kb) = (self.conductivity[a], self.conductivity[b]);
                let mut resistance = (wa * kb + wb * ka) / (2.0 * ka * kb);
                let metal = self.cells[a].is_metal();
                if metal != self.cells[b].is_metal() {
                    let m = if metal { a } else { b };
                    let share = (f64::from(self.normals[m]) / 255.0).max(LEAST_SHARE);
                    resistance += 1.0 / (laws.interface.at(self.temperature[m]) * share);
                }
                self.conductance[a] = dt / resistance;
            }
        }
    }

    /// Thomas' algorithm on all lines; `solution` are temperatures after the step.
    fn solve(&mut self, widths: &[f64]) {
        let lanes = self.lanes;
        let n = widths.len();
        for (at, width) in widths.iter().enumerate() {
            let row = at * lanes..(at + 1) * lanes;
            for i in row {
                let left = if at > 0 {
                    self.conductance[i - lanes]
                } else {
                    0.0
                };
                let right = if at + 1 < n { self.conductance[i] } else { 0.0 };
                let own = self.capacity[i] * width;
                let (upper, known) = if at > 0 {
                    (self.upper[i - lanes], self.solution[i - lanes])
                } else {
                    (0.0, 0.0)
                };
                let pivot = 1.0 / (own + left + right - left * upper);
                self.upper[i] = right * pivot;
                self.solution[i] = (own * self.temperature[i] + left * known) * pivot;
            }
        }
        for at in (0..n.saturating_sub(1)).rev() {
            for i in at * lanes..(at + 1) * lanes {
                self.solution[i] += self.upper[i] * self.solution[i + lanes];
            }
        }
    }

    /// Capacities that give the temperature which belongs to the enthalpy after the step (secant).
    fn follow(&mut self, laws: &Laws) {
        for i in 0..self.capacity.len() {
            let change = self.solution[i] - self.temperature[i];
            if change.abs() < STILL {
                continue;
            }
            let heat = self.capacity[i] * change;
            let law = laws.enthalpy(self.cells[i]);
            let after = law.temperature(self.enthalpy[i] + heat) - self.temperature[i];
            if after.abs() > STILL {
                self.capacity[i] = heat / after;
            }
        }
    }
}

/// One step of `dt` seconds.
///
/// 1. Locally one-dimensional: backward Euler along one axis after the other; the order changes from step to step.
/// 2. In every sweep `C (T' - T) = dt * net conduction` with tridiagonal systems; `H += C (T' - T)`, then `T` from `H`. What
///    leaves one cell enters its neighbour, so the sum of H changes by rounding only, whatever C is.
/// 3. C is the slope of H(T) first and the secant over the step in a second pass.
///
/// Faces between metal and mould have the interface resistance divided by the share that the face has in the true
/// surface: the steps of a voxel surface are up to 3/2 times too large. No result depends on the number of threads.
pub(super) fn step(grid: &Grid, laws: &Laws, state: &mut State, dt: f64, number: usize) {
    let axes = if number.is_multiple_of(2) {
        [0, 1, 2]
    } else {
        [2, 1, 0]
    };
    for axis in axes {
        if grid.dims[axis] < 2 {
            continue;
        }
        if axis == 2 {
            across_planes(grid, laws, state, dt);
        } else {
            in_planes(grid, laws, state, dt, axis);
        }
    }
}

fn in_planes(grid: &Grid, laws: &Laws, state: &mut State, dt: f64, axis: usize) {
    let [nx, ny, _] = grid.dims;
    let plane = nx * ny;
    let lanes = if axis == 0 { ny } else { nx };
    let planes = state
        .enthalpy
        .par_chunks_mut(plane)
        .zip(state.temperature.par_chunks_mut(plane))
        .zip(grid.cells.par_chunks(plane))
        .zip(grid.normals.par_chunks(plane));
    planes.for_each_init(Block::default, |block, (((h, t), cells), normals)| {
        block.resize(grid.dims[axis], lanes);
        // Entry of a plane that stands at an entry of the block.
        let place = |b: usize| match axis {
            0 => (b % lanes) * nx + b / lanes,
            _ => b,
        };
        for b in 0..plane {
            let p = place(b);
            block.enthalpy[b] = h[p];
            block.temperature[b] = t[p];
            block.cells[b] = cells[p];
            block.normals[b] = normals[p][axis];
        }
        block.step(&grid.widths[axis], laws, dt);
        for b in 0..plane {
            let p = place(b);
            h[p] = block.enthalpy[b];
            t[p] = block.temperature[b];
        }
    });
}

fn across_planes(grid: &Grid, laws: &Laws, state: &mut State, dt: f64) {
    let [nx, ny, nz] = grid.dims;
    let plane = nx * ny;
    let swept = (0..ny)
        .into_par_iter()
        .map_init(Block::default, |block, j| {
            block.resize(nz, nx);
            for k in 0..nz {
                let from = grid.index(0, j, k);
                let (b, row) = (k * nx, from..from + nx);
                block.enthalpy[b..b + nx].copy_from_slice(&state.enthalpy[row.clone()]);
                block.temperature[b..b + nx].copy_from_slice(&state.temperature[row.clone()]);
                block.cells[b..b + nx].copy_from_slice(&grid.cells[row.clone()]);
                let normals = grid.normals[row].iter().map(|n| n[2]);
                block.normals[b..b + nx]
                    .iter_mut()
                    .zip(normals)
                    .for_each(|(to, n)| *to = n);
            }
            block.step(&grid.widths[2], laws, dt);
            (block.enthalpy.clone(), block.temperature.clone())
        });
    let swept: Vec<(Vec<f64>, Vec<f64>)> = swept.collect();
    let planes = state
        .enthalpy
        .par_chunks_mut(plane)
        .zip(state.temperature.par_chunks_mut(plane))
        .enumerate();
    planes.for_each(|(k, (h, t))| {
        for (j, (rows_h, rows_t)) in swept.iter().enumerate() {
            h[j * nx..(j + 1) * nx].copy_from_slice(&rows_h[k * nx..(k + 1) * nx]);
            t[j * nx..(j + 1) * nx].copy_from_slice(&rows_t[k * nx..(k + 1) * nx]);
        }
    });
}
