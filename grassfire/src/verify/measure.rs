//! One grid: solution, and what is read off it.

use super::conditions::{ActiveNodes, Conditions, around};
use super::{Fractions, VerifyError};
use crate::Vec3;
use crate::case::{Case, CaseError};
use crate::fe::{Solver, SolverOptions, VoxelModel, free_modes, von_mises};
use crate::monitor::Monitor;
use crate::topopt::Problem;

/// Stress counts this many voxels away from fixed nodes, in voxels that are full: where the surface cuts a voxel or a
/// support begins it does not converge.
const AWAY: usize = 2;
const FULL: f64 = 0.999;
/// Displacements count at nodes of voxels with at least this share: those of slivers mean nothing.
const SOLID: f64 = 0.5;

/// One load case on one grid.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CaseResult {
    /// Name.
    pub name: String,
    /// Half of f'u without the energy in springs, N mm.
    pub strain_energy: f64,
    /// Largest displacement, mm.
    pub u_max: f64,
    /// Where, mm.
    pub u_place: [f64; 3],
    /// Sum of the reactions and of the loads, over that of the sizes of the loads.
    pub reaction_error: f64,
    /// Largest von Mises stress away from fixed places and cut voxels, MPa; none when every voxel is cut.
    pub stress_max: Option<f64>,
    /// Where, mm.
    pub stress_place: [f64; 3],
    /// Iterations of the solver.
    pub iterations: usize,
    /// Displacement of every node that touches material, in their order, mm.
    pub displacement: Vec<[f32; 3]>,
}

/// One grid.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct GridResult {
    /// The grid and its shares of material.
    pub grid: Fractions,
    /// Voxels with material.
    pub elements: usize,
    /// Nodes that touch material, `[z][y][x]` order.
    pub nodes: Vec<[usize; 3]>,
    /// Weighted sum over the cases, N mm.
    pub strain_energy: f64,
    /// The cases.
    pub cases: Vec<CaseResult>,
    /// Von Mises stress in every voxel with material, in their order, largest over the cases, MPa.
    pub von_mises: Vec<f32>,
}

impl GridResult {
    /// Largest displacement of all cases, mm.
    pub fn u_max(&self) -> f64 {
        self.cases.iter().map(|c| c.u_max).fold(0.0, f64::max)
    }

    /// Case with the largest stress, and that.
    pub fn stress(&self) -> Option<(&CaseResult, f64)> {
        let found = self.cases.iter().filter_map(|c| Some((c, c.stress_max?)));
        found.max_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Size of the displacement at points, mm: that of the nearest node with material around the point, NaN where there is
    /// none.
    pub fn displacement_at(&self, case: &CaseResult, points: &[Vec3]) -> Vec<f64> {
        let size = |u: &[f32; 3]| u.iter().map(|v| f64::from(v * v)).sum::<f64>().sqrt();
        let at = |p: &Vec3| {
            let r = (p - self.grid.origin) / self.grid.h;
            let node = [0, 1, 2].map(|d| r[d].round().max(0.0) as usize);
            let key = |n: &[usize; 3]| [n[2], n[1], n[0]];
            let found = self.nodes.binary_search_by_key(&key(&node), key).ok()?;
            case.displacement.get(found).map(size)
        };
        points.iter().map(|p| at(p).unwrap_or(f64::NAN)).collect()
    }

    /// Von Mises stress at points, MPa: that of the voxel around the point, NaN where that is empty.
    pub fn stress_at(&self, points: &[Vec3]) -> Vec<f64> {
        let mut numbers = vec![u32::MAX; self.grid.values.len()];
        let solid = (0..numbers.len()).filter(|&v| self.grid.values[v] > 0.0);
        for (i, v) in solid.enumerate() {
            numbers[v] = i as u32;
        }
        let at = |p: &Vec3| {
            let [x, y, z] = self.grid.cell_of(p);
            let v = (z * self.grid.dims[1] + y) * self.grid.dims[0] + x;
            self.von_mises.get(numbers[v] as usize).copied()
        };
        let value = |p: &Vec3| at(p).map_or(f64::NAN, f64::from);
        points.iter().map(value).collect()
    }

    /// Largest imbalance of all cases.
    pub fn reaction_error(&self) -> f64 {
        self.cases
            .iter()
            .map(|c| c.reaction_error)
            .fold(0.0, f64::max)
    }
}

/// Solves all cases on one grid. The modulus of a voxel is its share of material times that of the case, at least `alpha`
/// of it.
///
/// # Errors
/// [`CaseError::Mechanism`], and those of the solver.
pub(super) fn solve(
    case: &Case,
    grid: Fractions,
    conditions: Conditions,
    alpha: f64,
    options: &SolverOptions,
    monitor: &Monitor,
) -> Result<GridResult, VerifyError> {
    let modes = free_modes(&conditions.fixed, &conditions.springs);
    if !modes.is_empty() {
        return Err(CaseError::Mechanism { modes }.into());
    }
    let young = case.material.young;
    let modulus = |&f: &f64| if f > 0.0 { young * f.max(alpha) } else { 0.0 };
    let moduli: Vec<f64> = grid.values.iter().map(modulus).collect();
    let model = VoxelModel {
        dims: grid.dims,
        h: grid.h,
        nu: case.material.nu,
        fixed: conditions.fixed,
        springs: conditions.springs,
        loads: conditions.loads,
        body_forces: case
            .case
            .iter()
            .map(|table| table.body_force(&case.material).into())
            .collect(),
    };
    let problem = grid.problem();
    let mut solver = Solver::new(model, &moduli, options)?;
    drop(moduli);
    let voxels: Vec<usize> = (0..grid.values.len())
        .filter(|&v| grid.values[v] > 0.0)
        .collect();
    let shares: Vec<f64> = voxels.iter().map(|&v| grid.values[v]).collect();
    let places: Vec<u32> = voxels.iter().map(|&v| v as u32).collect();
    solver.set_shares(&places, &shares);
    drop((shares, places));
    let trusted = trusted(&problem, &grid, &solver.model().fixed);
    let mut out = GridResult {
        elements: voxels.len(),
        nodes: ActiveNodes::new(&grid).nodes,
        von_mises: vec![0.0; voxels.len()],
        ..GridResult::default()
    };
    for (k, table) in case.case.iter().enumerate() {
        let stats = solver.solve(k, monitor)?;
        let mut result = CaseResult {
            name: table.name.clone(),
            strain_energy: solver.compliance() / 2.0 - solver.spring_energy(),
            iterations: stats.iterations,
            reaction_error: reaction_error(&solver, k),
            ..CaseResult::default()
        };
        displacements(&solver, &problem, &grid, &out.nodes, &mut result);
        let stress = von_mises(&solver, young, &voxels);
        for (i, (&v, &s)) in voxels.iter().zip(&stress).enumerate() {
            out.von_mises[i] = out.von_mises[i].max(s as f32);
            if trusted[v] && result.stress_max.is_none_or(|most| s > most) {
                result.stress_max = Some(s);
                result.stress_place = problem.centre(v).into();
            }
        }
        out.strain_energy += table.weight * result.strain_energy;
        out.cases.push(result);
    }
    out.grid = grid;
    Ok(out)
}

/// Voxels whose stress counts: full ones away from fixed nodes.
fn trusted(problem: &Problem, grid: &Fractions, fixed: &[([usize; 3], usize)]) -> Vec<bool> {
    let mut out: Vec<bool> = grid.values.iter().map(|&f| f >= FULL).collect();
    for (node, _) in fixed {
        let range = |d: usize| node[d].saturating_sub(AWAY)..(node[d] + AWAY).min(problem.dims[d]);
        for z in range(2) {
            for y in range(1) {
                for x in range(0) {
                    out[problem.index([x, y, z])] = false;
                }
            }
        }
    }
    out
}

/// How far the reactions are from balancing the loads, relative to the loads. Forces on fixed nodes never enter the solver.
fn reaction_error(solver: &Solver, case: usize) -> f64 {
    let length = |v: &[f64; 3]| v.iter().map(|v| v * v).sum::<f64>().sqrt();
    let (mut sum, weight) = (solver.reactions(), solver.weight());
    let model = solver.model();
    let mut size = length(&weight);
    sum.iter_mut().zip(weight).for_each(|(s, w)| *s += w);
    for (node, force) in &model.loads[case] {
        size += length(force);
        for c in 0..3 {
            if model.fixed.binary_search(&(*node, c)).is_err() {
                sum[c] += force[c];
            }
        }
    }
    if size > 0.0 { length(&sum) / size } else { 0.0 }
}

/// Displacements of all nodes and the largest one.
fn displacements(
    solver: &Solver,
    problem: &Problem,
    grid: &Fractions,
    nodes: &[[usize; 3]],
    result: &mut CaseResult,
) {
    for &node in nodes {
        let u = solver.displacement(node);
        let size = u.iter().map(|v| v * v).sum::<f64>().sqrt();
        let solid = || around(problem, node).any(|v| grid.values[v] >= SOLID);
        if size > result.u_max && solid() {
            result.u_max = size;
            result.u_place = problem.node(node).into();
        }
        result.displacement.push(u.map(|v| v as f32));
    }
}
