//! The solver of one voxel model: set the moduli, solve the load cases.

use std::sync::Arc;

use super::energy::element_energies;
use super::frame::Frame;
use super::grid::NodeGrid;
use super::matrix_free::{MatrixFree, active_blocks};
use super::multigrid::Multigrid;
use super::pcg::{Pcg, SolveStats};
use super::{FeError, SolverOptions, element};
use crate::monitor::Monitor;

/// Geometry, supports and loads of a voxel model.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct VoxelModel {
    /// Voxels along x, y, z.
    pub dims: [usize; 3],
    /// Edge of a voxel, mm.
    pub h: f64,
    /// Poisson's ratio, the same everywhere.
    pub nu: f64,
    /// Fixed degrees of freedom: node and component.
    pub fixed: Vec<([usize; 3], usize)>,
    /// For every load case the forces on nodes, N.
    pub loads: Vec<Vec<([usize; 3], [f64; 3])>>,
}

/// Most levels of a hierarchy.
const MAX_LEVELS: usize = 7;

/// Bytes that a solver takes, about: the fields of the finest grid, the stencils of the coarser ones.
pub fn memory_estimate(dims: [usize; 3], cases: usize) -> f64 {
    let nodes: f64 = dims.iter().map(|&n| n as f64 + 2.0).product();
    // Single: b, x, d, t, modulus, diagonal. Double: r, p, q, modulus, u a case. Coarse levels: 1/7 of stencil and fields.
    let fine = 4.0 * (4.0 * 3.0 + 2.0) + 8.0 * (3.0 * 3.0 + 1.0 + 3.0 * cases as f64);
    nodes * (fine + (243.0 + 18.0) * 4.0 / 7.0)
}

/// A multigrid solver for one grid; moduli may change between solutions, supports may not.
pub struct Solver {
    model: VoxelModel,
    frame: Arc<Frame>,
    multigrid: Multigrid,
    pcg: Pcg,
    right: Vec<Vec<(u32, f64)>>,
    u: Vec<Vec<f64>>,
    stiffness: [[f64; 24]; 24],
    options: SolverOptions,
}

impl Solver {
    /// Allocates a solver. `moduli`: one a voxel, `[z][y][x]`; where it is 0 there is never any stiffness.
    ///
    /// 1. The grid is padded so that it can be halved until the coarsest one has at most `options.coarsest` unknowns.
    /// 2. Galerkin tables of every level are computed; the moduli are set as by [`Solver::set_moduli`].
    ///
    /// # Errors
    /// [`FeError::Memory`] before anything large is allocated; [`FeError::Empty`], [`FeError::Option`].
    pub fn new(
        model: VoxelModel,
        moduli: &[f64],
        options: &SolverOptions,
    ) -> Result<Self, FeError> {
        check(&model, moduli, options)?;
        let count = levels(model.dims, options.coarsest);
        let side = 1usize << (count - 1);
        let grid = NodeGrid::new(model.dims.map(|n| n.next_multiple_of(side)));
        let stiffness = element::stiffness(model.nu);
        let mut operator = MatrixFree::<f64>::new(&grid, &stiffness);
        let mut frame = Frame::new(grid, &model.fixed);
        spread(&frame.grid, &model, moduli, &mut operator.e);
        frame.active = active_blocks(&frame.grid, &operator.e);
        let right = model.loads.iter().map(|l| sparse(&frame, l)).collect();
        let u = model.loads.iter().map(|_| frame.grid.field()).collect();
        let frame = Arc::new(frame);
        let e32: Vec<f32> = operator.e.iter().map(|&v| v as f32).collect();
        let mut multigrid = Multigrid::new(&frame, model.nu, count, &e32, options);
        drop(e32);
        multigrid.set(&operator.e)?;
        Ok(Self {
            pcg: Pcg::new(&frame, operator),
            model,
            frame,
            multigrid,
            right,
            u,
            stiffness,
            options: options.clone(),
        })
    }

    /// Takes new moduli, MPa; the last displacements stay as the start of the next solution.
    ///
    /// # Errors
    /// [`FeError::Factor`].
    pub fn set_moduli(&mut self, moduli: &[f64]) -> Result<(), FeError> {
        spread(
            &self.frame.grid,
            &self.model,
            moduli,
            &mut self.pcg.operator.e,
        );
        self.multigrid.set(&self.pcg.operator.e)
    }

    /// Solves load case `case`.
    ///
    /// # Errors
    /// [`FeError::NotConverged`]; the displacements are what was reached. [`FeError::Cancelled`].
    pub fn solve(&mut self, case: usize, monitor: &Monitor) -> Result<SolveStats, FeError> {
        let limits = (self.options.tolerance, self.options.max_iterations);
        let stats = self.pcg.solve(
            &self.frame,
            &mut self.multigrid,
            &self.right[case],
            &mut self.u[case],
            limits,
            monitor,
        )?;
        if stats.converged {
            return Ok(stats);
        }
        Err(FeError::NotConverged {
            case,
            iterations: stats.iterations,
            residual: stats.residual,
            tolerance: self.options.tolerance,
        })
    }

    /// Forgets the displacements of all cases.
    pub fn restart(&mut self) {
        self.u.iter_mut().for_each(|u| u.fill(0.0));
    }

    /// f'u of a load case, N mm: twice the strain energy.
    pub fn compliance(&self, case: usize) -> f64 {
        let u = &self.u[case];
        self.right[case]
            .iter()
            .map(|&(at, f)| f * u[at as usize])
            .sum()
    }

    /// `u_e' K0 u_e` of every voxel for modulus 1 and edge h, `[z][y][x]`, mm3.
    pub fn energies(&self, case: usize) -> Vec<f64> {
        let mut out = element_energies(
            &self.frame.grid,
            self.model.dims,
            &self.stiffness,
            &self.u[case],
        );
        out.iter_mut().for_each(|v| *v *= self.model.h);
        out
    }

    /// Displacement of a node, mm.
    pub fn displacement(&self, case: usize, [x, y, z]: [usize; 3]) -> [f64; 3] {
        let at = self.frame.grid.node(x, y, z);
        [0, 1, 2].map(|c| self.u[case][at + c * self.frame.grid.sx])
    }

    /// Sum of the reactions at the supports, N.
    pub fn reactions(&mut self, case: usize) -> [f64; 3] {
        let grid = &self.frame.grid;
        let product = self.pcg.product(&self.frame, &self.u[case]);
        let mut sum = [0.0; 3];
        for &at in &self.frame.fixed {
            let c = (at as usize - grid.front) % grid.row / grid.sx;
            sum[c] += product[at as usize];
        }
        sum
    }

    /// What the solver was made for.
    pub fn model(&self) -> &VoxelModel {
        &self.model
    }
}

fn check(model: &VoxelModel, moduli: &[f64], options: &SolverOptions) -> Result<(), FeError> {
    let bad = |name, value, wanted| {
        Err(FeError::Option {
            name,
            value,
            wanted,
        })
    };
    if !(options.tolerance > 0.0 && options.tolerance < 1.0) {
        return bad("tolerance", options.tolerance, "a number between 0 and 1");
    }
    if !(1..=8).contains(&options.smoother_degree) {
        return bad("smoother_degree", options.smoother_degree as f64, "1 to 8");
    }
    if !(options.smoother_ratio > 1.0 && options.smoother_ratio <= 100.0) {
        return bad("smoother_ratio", options.smoother_ratio, "1 to 100");
    }
    if options.coarsest < 100 {
        return bad("coarsest", options.coarsest as f64, "100 or more");
    }
    let dims = model.dims;
    let needed = memory_estimate(dims, model.loads.len()) / 1e6;
    // Places are counted in 32 bits.
    if needed > options.max_memory || dims.iter().map(|&n| n as f64 + 40.0).product::<f64>() > 1.2e9
    {
        return Err(FeError::Memory {
            dims,
            needed,
            limit: options.max_memory,
        });
    }
    if moduli.len() != dims.iter().product::<usize>() || !moduli.iter().any(|&e| e > 0.0) {
        return Err(FeError::Empty { dims, h: model.h });
    }
    Ok(())
}

/// Levels until the coarsest grid has at most `coarsest` unknowns.
fn levels(dims: [usize; 3], coarsest: usize) -> usize {
    let unknowns = |level: usize| {
        3 * dims
            .iter()
            .map(|&n| n.div_ceil(1 << level) + 1)
            .product::<usize>()
    };
    (0..MAX_LEVELS)
        .find(|&l| unknowns(l) <= coarsest)
        .unwrap_or(MAX_LEVELS - 1)
        + 1
}

/// Moduli times edge onto the element field.
fn spread(grid: &NodeGrid, model: &VoxelModel, moduli: &[f64], e: &mut [f64]) {
    let [nx, ny, nz] = model.dims;
    for z in 0..nz {
        for y in 0..ny {
            let from = (z * ny + y) * nx;
            let to = grid.element(0, y, z);
            for (to, &modulus) in e[to..to + nx].iter_mut().zip(&moduli[from..from + nx]) {
                *to = modulus * model.h;
            }
        }
    }
}

/// A load as places and values; forces on fixed degrees of freedom do nothing and are left out.
fn sparse(frame: &Frame, forces: &[([usize; 3], [f64; 3])]) -> Vec<(u32, f64)> {
    let mut out: Vec<(u32, f64)> = Vec::new();
    for &([x, y, z], force) in forces {
        for (c, &f) in force.iter().enumerate() {
            let at = (frame.grid.node(x, y, z) + c * frame.grid.sx) as u32;
            if f != 0.0 && frame.fixed.binary_search(&at).is_err() {
                out.push((at, f));
            }
        }
    }
    out.sort_by_key(|&(at, _)| at);
    out.dedup_by(|next, kept| {
        let same = next.0 == kept.0;
        if same {
            kept.1 += next.1;
        }
        same
    });
    out
}
