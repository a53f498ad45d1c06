//! The optimization loop.

use std::time::Instant;

use rayon::prelude::*;
use serde::Serialize;

use super::finish::{Binary, binary};
use super::interpolation::Interpolation;
use super::options::{Objective, OptimizeOptions, UpdateKind};
use super::problem::{DESIGN, FROZEN, LoadCase};
use super::smooth::{Smooth, smooth};
use super::state::State;
use super::{Chain, Fields, Problem, TopoptError, oc};
use crate::fe::{FeError, Solver, SolverOptions};
use crate::monitor::Monitor;

const STAGE: &str = "optimize";
/// Floor of the moduli when the solver does not converge otherwise.
const RAISED_MIN: f64 = 1e-3;
/// Exponent of the norm that stands for the worst load case.
const NORM: f64 = 8.0;
/// Quiet iterations in a row that end the run.
const QUIET: usize = 5;

/// What happened in one iteration.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct HistoryEntry {
    /// From 1.
    pub iteration: usize,
    /// f'u over the weighted cases, N mm; with the robust formulation of the eroded structure.
    pub compliance: f64,
    /// Volume over that of the space.
    pub volume_fraction: f64,
    /// `4 mean(rho (1 - rho))`: 0 when all voxels are full or empty.
    pub grayness: f64,
    /// Mean change of density.
    pub change: f64,
    /// Penalty exponent.
    pub penalty: f64,
    /// Sharpness of the projection; 0 without.
    pub beta: f64,
    /// Iterations of conjugate gradients, all cases together.
    pub solver_iterations: usize,
    /// Wall time, s.
    pub seconds: f64,
}

/// The result of an optimization.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Optimized {
    /// Densities, `[z][y][x]`.
    pub rho: Vec<f64>,
    /// The part without the steps of the voxels.
    pub smooth: Smooth,
    /// Full and empty voxels.
    pub binary: Binary,
    /// All iterations.
    pub history: Vec<HistoryEntry>,
    /// f'u over the weighted cases of the first iteration, N mm.
    pub first_compliance: f64,
    /// f'u of the last iteration's cases, N mm.
    pub cases: Vec<f64>,
    /// Largest difference of densities across the planes of symmetry.
    pub symmetry_error: f64,
    /// The stopping limits were met.
    pub converged: bool,
    /// The user asked to stop; the densities are the last ones.
    pub cancelled: bool,
    /// Solutions for which the smallest modulus had to be raised.
    pub fallbacks: usize,
}

/// Makes the structure as stiff as a given volume allows.
///
/// 1. Variables start equal, so that the volume is the bound. A saved state goes on instead.
/// 2. Each iteration: densities (filter, draw hull, projection), moduli `e_min + rho^p (1 - e_min)`, body forces that follow
///    the densities, one solution a load case, compliance and its gradient, volume and its gradient, new variables by MMA or
///    optimality criteria. With body forces a sixteenth of the moduli follows the densities themselves, so that thin material
///    does not weigh more than it carries.
/// 3. The penalty grows first, then the sharpness of the projection; after that the run ends when densities and compliance
///    are quiet five times in a row, at `max_iterations`, or when the user stops it.
/// 4. The densities are made full or empty with the same volume ([`binary`]).
///
/// `save` is called every `options.save_every` iterations. M. P. Bendsoe, O. Sigmund: Material interpolation schemes in
/// topology optimization, 1999, doi:10.1007/s004190050248.
///
/// # Errors
/// [`TopoptError`]; when the user stops after the first iteration the last densities are the result instead.
pub fn optimize(
    problem: &Problem,
    options: &OptimizeOptions,
    solver_options: &SolverOptions,
    resume: Option<State>,
    save: &dyn Fn(&State) -> Result<(), TopoptError>,
    monitor: &Monitor,
) -> Result<Optimized, TopoptError> {
    check(problem, options)?;
    let mut run = Run::new(problem, options, solver_options, resume, monitor)?;
    run.warn_asymmetry(monitor);
    let mut out = Optimized::default();
    while run.state.iteration < options.max_iterations {
        let i = run.state.iteration;
        let done = i as f64 / options.max_iterations as f64;
        let asked = monitor.step(STAGE, &format!("iteration {}", i + 1), done);
        let stopped = match asked.map_err(TopoptError::from) {
            Err(e) => Err(e),
            Ok(()) => run.iterate(monitor, &mut out),
        };
        match stopped {
            Ok(ended) => {
                if options.save_every > 0 && run.state.iteration.is_multiple_of(options.save_every)
                {
                    save(&run.state)?;
                }
                if ended {
                    out.converged = true;
                    break;
                }
            }
            Err(TopoptError::Cancelled(_) | TopoptError::Fe(FeError::Cancelled(_)))
                if !out.history.is_empty() =>
            {
                out.cancelled = true;
                break;
            }
            Err(e) => return Err(e),
        }
    }
    let Run {
        chain,
        solver,
        state,
        last,
        target,
        fallbacks,
        mut fields,
        ..
    } = run;
    drop(solver);
    out.rho = problem.on_grid(&state.rho, 1.0);
    let x = last.map_or(state.x, |x| x.into_iter().map(f64::from).collect());
    let beta = options.projects_at(state.iteration.saturating_sub(1));
    chain.forward(&x, beta, &mut fields);
    let eta = chain.threshold(&fields);
    out.smooth = smooth(problem, options, &x, eta)?;
    out.binary = binary(problem, &chain, &out.rho, target);
    out.symmetry_error = chain.symmetry.error(problem, &out.rho).0;
    out.fallbacks = fallbacks;
    out.first_compliance = state.compliance[0];
    Ok(out)
}

/// Refuses what [`optimize`] would refuse, without solving anything.
///
/// # Errors
/// [`TopoptError`].
pub fn validate(
    problem: &Problem,
    options: &OptimizeOptions,
    solver: &SolverOptions,
) -> Result<(), TopoptError> {
    check(problem, options)?;
    target(problem, options)?;
    let voxels = (problem.count(DESIGN) + problem.count(FROZEN)) as f64;
    let (cases, weighs) = (problem.cases.len(), problem.has_body_force());
    let needed = crate::fe::memory_estimate(voxels, cases, weighs) / 1e6;
    if needed > solver.max_memory {
        return Err(TopoptError::Fe(FeError::Memory {
            voxels,
            needed,
            limit: solver.max_memory,
        }));
    }
    Chain::new(problem, options).map(drop)
}

/// Refuses options out of range, and optimality criteria where more material may bend a part more.
fn check(problem: &Problem, options: &OptimizeOptions) -> Result<(), TopoptError> {
    options.check(problem.h)?;
    let weighs = |case: &LoadCase| case.body_force != [0.0; 3];
    match problem.cases.iter().find(|case| weighs(case)) {
        Some(case) if options.update == UpdateKind::Oc => Err(TopoptError::Weight {
            name: case.name.clone(),
        }),
        _ => Ok(()),
    }
}

/// Full voxels allowed.
fn target(problem: &Problem, options: &OptimizeOptions) -> Result<f64, TopoptError> {
    let (design, frozen) = (problem.count(DESIGN), problem.count(FROZEN));
    if design == 0 {
        return Err(TopoptError::NoDesign {
            frozen,
            outside: problem.labels.len() - frozen,
        });
    }
    let active = (design + frozen) as f64;
    let target = options.volume_fraction * active;
    if target <= frozen as f64 {
        return Err(TopoptError::VolumeFraction {
            value: options.volume_fraction,
            frozen: frozen as f64 / active,
        });
    }
    Ok(target)
}

/// The parts of a run.
struct Run<'a> {
    problem: &'a Problem,
    options: &'a OptimizeOptions,
    chain: Chain<'a>,
    solver: Solver,
    state: State,
    /// The variables of the last iteration allowed: those of the state are for the next one.
    last: Option<Vec<f32>>,
    /// Voxels of the variables.
    design: Vec<u32>,
    /// What lives as long as a solution has its place once: fields that come and go would split the memory.
    fields: Fields,
    /// Strain energy of every design voxel for modulus 1, weighted with the derivative of the objective.
    energy: Vec<f64>,
    /// Work of the body force on every design voxel if it were full, weighted likewise; empty without body forces.
    work: Vec<f64>,
    /// Full voxels allowed.
    target: f64,
    /// Design and frozen voxels.
    active: f64,
    fallbacks: usize,
}

/// Compliances.
struct Response {
    cases: Vec<f64>,
    compliance: f64,
    iterations: usize,
}

impl<'a> Run<'a> {
    fn new(
        problem: &'a Problem,
        options: &'a OptimizeOptions,
        solver_options: &SolverOptions,
        resume: Option<State>,
        monitor: &Monitor,
    ) -> Result<Self, TopoptError> {
        let target = target(problem, options)?;
        let (design, frozen) = (problem.count(DESIGN) as f64, problem.count(FROZEN) as f64);
        let active = design + frozen;
        let chain = Chain::new(problem, options)?;
        let mut state = resume.unwrap_or_else(|| {
            let start = ((target - frozen) / design).min(1.0);
            State {
                x: vec![start; design as usize],
                rho: vec![0.0; design as usize],
                ..State::default()
            }
        });
        state.mma.start(state.x.len());
        monitor.step(STAGE, "setting up the solver", 0.0)?;
        let present = problem.on_grid(&vec![problem.young; design as usize], problem.young);
        let solver = Solver::new(problem.model(), &present, solver_options)?;
        Ok(Self {
            problem,
            options,
            chain,
            solver,
            state,
            last: None,
            design: problem.design().map(|v| v as u32).collect(),
            fields: Fields::default(),
            energy: vec![0.0; design as usize],
            work: if problem.has_body_force() {
                vec![0.0; design as usize]
            } else {
                Vec::new()
            },
            target,
            active,
            fallbacks: 0,
        })
    }

    fn warn_asymmetry(&self, monitor: &Monitor) {
        let labels: Vec<f64> = self.problem.labels.iter().map(|&l| f64::from(l)).collect();
        let (_, alone) = self.chain.symmetry.error(self.problem, &labels);
        if alone > 0 {
            let text = format!(
                "{alone} voxels of the space have no mirror image across the planes of symmetry: they are designed alone"
            );
            monitor.warn(STAGE, text);
        }
    }

    /// One iteration; true when the run has converged.
    fn iterate(&mut self, monitor: &Monitor, out: &mut Optimized) -> Result<bool, TopoptError> {
        let start = Instant::now();
        let i = self.state.iteration;
        let penalty = self.options.penalty_at(i);
        let beta = self.options.projects_at(i);
        let chain = &self.chain;
        chain.forward(&self.state.x, beta, &mut self.fields);
        let rho = chain.densities(&self.fields);
        let change = mean_change(&self.state.rho, &rho, self.active);
        self.state.rho.copy_from_slice(&rho);
        drop(rho);
        let response = self.respond(penalty, monitor)?;
        let rho = &self.state.rho;
        let frozen = self.active - rho.len() as f64;
        let volume: f64 = frozen + rho.iter().sum::<f64>();
        let grayness = 4.0 * rho.iter().map(|r| r * (1.0 - r)).sum::<f64>() / self.active;
        let last = std::mem::replace(&mut self.state.compliance[1], response.compliance);
        if i == 0 {
            self.state.compliance[0] = response.compliance;
        }
        let quiet = self.options.is_final(i)
            && change < self.options.stop_change
            && ((response.compliance - last) / response.compliance).abs()
                < self.options.stop_compliance;
        self.state.quiet = if quiet { self.state.quiet + 1 } else { 0 };
        self.state.iteration = i + 1;
        let ended = self.state.quiet >= QUIET;
        if !ended {
            if i + 1 == self.options.max_iterations {
                self.last = Some(self.state.x.iter().map(|&x| x as f32).collect());
            }
            self.update(penalty, volume);
        }
        out.cases = response.cases;
        out.history.push(HistoryEntry {
            iteration: i + 1,
            compliance: response.compliance,
            volume_fraction: volume / self.active,
            grayness,
            change,
            penalty,
            beta: beta.unwrap_or(0.0),
            solver_iterations: response.iterations,
            seconds: start.elapsed().as_secs_f64(),
        });
        Ok(ended)
    }

    /// Gradients of compliance and volume by the variables.
    fn gradients(&self, penalty: f64) -> (Vec<f64>, Vec<f64>) {
        let eroded = self.chain.eroded(&self.fields);
        let rho = eroded.as_ref().unwrap_or(&self.state.rho);
        let law = Interpolation::new(self.problem, self.options.e_min, penalty);
        let g = self.energy.par_iter().zip(rho);
        let mut g: Vec<f64> = g.map(|(e, &rho)| law.gradient(*e, rho)).collect();
        // The work of forces that follow the densities counts twice: f'u changes by f and by u.
        let works = g.par_iter_mut().zip(&self.work);
        works.for_each(|(g, work)| *g += 2.0 * work);
        let df = self.chain.gradient(&self.fields, g);
        (df, self.chain.volume_gradient(&self.fields))
    }

    /// New variables.
    fn update(&mut self, penalty: f64, volume: f64) {
        let (mut df, mut dv) = self.gradients(penalty);
        let step = self.options.limit();
        match self.options.update {
            UpdateKind::Oc => {
                let room = self.target - volume;
                let x = oc::update(&self.state.x, &df, &dv, room, step);
                self.state.x.copy_from_slice(&x);
            }
            UpdateKind::Mma => {
                scale(&mut df, 100.0 / self.state.compliance[0]);
                scale(&mut dv, 1.0 / self.target);
                let over = volume / self.target - 1.0;
                let State { mma, x, .. } = &mut self.state;
                mma.update(x, &df, over, &dv, step);
            }
        }
        self.chain.symmetry.copy(&mut self.state.x);
    }

    /// Solves all load cases.
    fn respond(&mut self, penalty: f64, monitor: &Monitor) -> Result<Response, TopoptError> {
        let count = self.problem.cases.len();
        self.set_material(penalty, self.options.e_min)?;
        let mut out = Response {
            cases: Vec::new(),
            compliance: 0.0,
            iterations: 0,
        };
        let mut top = 0.0;
        let mut raised = false;
        while out.cases.len() < count {
            let case = out.cases.len();
            match self.solver.solve(case, monitor) {
                Ok(stats) => {
                    out.iterations += stats.iterations;
                    self.add(case, &mut out, &mut top);
                }
                Err(e @ FeError::NotConverged { .. }) if raised => return Err(e.into()),
                Err(FeError::NotConverged { iterations: n, .. }) => {
                    // Loose material that floats in almost nothing defeats the multigrid.
                    raised = true;
                    out.iterations += n;
                    if self.fallbacks == 0 {
                        monitor.warn(STAGE, format!("iteration {}: the solver did not converge in {n} iterations; solved with empty voxels at {RAISED_MIN} of the modulus", self.state.iteration + 1));
                    }
                    self.fallbacks += 1;
                    self.solver.restart();
                    self.set_material(penalty, RAISED_MIN)?;
                    out.cases.clear();
                    top = 0.0;
                }
                Err(e) => return Err(e.into()),
            }
        }
        let weighted = out.cases.iter().zip(&self.problem.cases);
        let weighted: Vec<f64> = weighted.map(|(c, case)| c * case.weight).collect();
        out.compliance = match self.options.objective {
            Objective::Weighted => weighted.iter().sum(),
            Objective::Worst => {
                let norm = norm(&weighted);
                self.scale_sums((top / norm).powf(NORM - 1.0));
                norm
            }
        };
        Ok(out)
    }

    /// Adds the case just solved. For the worst case energies are kept relative to `top`, the largest weighted compliance
    /// so far: the norm is known at the end only, and the displacements of one case at a time are in memory.
    fn add(&mut self, case: usize, out: &mut Response, top: &mut f64) {
        let compliance = self.solver.compliance();
        let mut factor = self.problem.cases[case].weight;
        if self.options.objective == Objective::Worst {
            let weighted = factor * compliance;
            if weighted > *top {
                self.scale_sums((*top / weighted).powf(NORM - 1.0));
                *top = weighted;
            }
            factor *= (weighted / top.max(f64::MIN_POSITIVE)).powf(NORM - 1.0);
        }
        out.cases.push(compliance);
        let solver = &self.solver;
        solver.add_energies(factor, &self.design, &mut self.energy);
        if !self.work.is_empty() {
            solver.add_body_work(factor, &self.design, &mut self.work);
        }
    }

    /// Gives the solver the moduli and masses of the densities whose stiffness counts, and begins the sums over the cases anew.
    fn set_material(&mut self, penalty: f64, e_min: f64) -> Result<(), TopoptError> {
        let eroded = self.chain.eroded(&self.fields);
        let rho = eroded.as_ref().unwrap_or(&self.state.rho);
        let law = Interpolation::new(self.problem, e_min, penalty);
        self.solver.set_moduli(&self.design, &law.moduli(rho))?;
        self.solver.set_shares(&self.design, rho);
        self.energy.fill(0.0);
        self.work.fill(0.0);
        Ok(())
    }

    /// Scales what was summed over the cases so far.
    fn scale_sums(&mut self, factor: f64) {
        scale(&mut self.energy, factor);
        scale(&mut self.work, factor);
    }
}

/// Mean difference of two fields over `count` voxels.
fn mean_change(a: &[f64], b: &[f64], count: f64) -> f64 {
    let differences = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    differences.sum::<f64>() / count
}

/// The p-norm of the compliances; its derivatives are `(c / norm)^(p - 1)`.
fn norm(c: &[f64]) -> f64 {
    let top = c
        .iter()
        .fold(0.0f64, |m, &v| m.max(v))
        .max(f64::MIN_POSITIVE);
    let sum: f64 = c.iter().map(|v| (v / top).powf(NORM)).sum();
    top * sum.powf(1.0 / NORM)
}

fn scale(field: &mut [f64], factor: f64) {
    field.par_iter_mut().for_each(|v| *v *= factor);
}
