//! The solver of one voxel model: set the moduli, solve the load cases.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::energy::add_energies;
use super::frame::Frame;
use super::grid::NodeGrid;
use super::matrix_free::MatrixFree;
use super::multigrid::{Fine, Multigrid, POWER_AGAIN};
use super::pcg::{self, SolveStats};
use super::springs::SpringNode;
use super::weight::{Weight, add_work};
use super::{FeError, SolverOptions, element, galerkin};
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
    /// Springs between nodes and the ground, N/mm; symmetric.
    pub springs: Vec<([usize; 3], Matrix3<f64>)>,
    /// For every load case the forces on nodes, N.
    pub loads: Vec<Vec<([usize; 3], [f64; 3])>>,
    /// For every load case the force on a volume of full material, N/mm3; may be empty when there is none.
    pub body_forces: Vec<[f64; 3]>,
}

impl VoxelModel {
    /// The body force of a case, N/mm3; none where it is zero.
    fn body_force(&self, case: usize) -> Option<[f64; 3]> {
        let force = self.body_forces.get(case).copied();
        force.filter(|f| *f != [0.0; 3])
    }

    fn has_body_force(&self) -> bool {
        (0..self.loads.len()).any(|case| self.body_force(case).is_some())
    }
}

/// Times that a solution is begun: conjugate gradients end early when the cycle is not positive.
const TRIES: usize = 2;
/// Most levels of a hierarchy.
const MAX_LEVELS: usize = 7;
/// Unknowns that are always few enough for a direct solution, and their share of those of the finest grid that is: the
/// factor must not cost more than the iterations that it spares.
const FEW: usize = 5000;
const SHARE: usize = 80;

/// Bytes that a solver takes, about: `voxels` that may have stiffness; `weighs` when a case has body forces.
pub fn memory_estimate(voxels: f64, cases: usize, weighs: bool) -> f64 {
    // A node more than voxels each way, and short rows: a tenth more nodes.
    let nodes = 1.1 * voxels + 1e4;
    // Single: b, x, d, t, p, the diagonal, u of every case but one. Double: r, q, u, moduli.
    let starts = 3.0 * cases.saturating_sub(1) as f64;
    let fine = 4.0 * (5.0 * 3.0 + 1.0 + starts) + 8.0 * (3.0 * 3.0 + 1.0);
    // Shares of elements and of nodes, and a right side with its places.
    let weight = if weighs { 8.0 * 2.0 + 24.0 * 3.0 } else { 0.0 };
    // Coarse levels: 1/7 of stencil and fields, a quarter more nodes at their borders.
    nodes * (fine + weight) + voxels * 1.25 * (243.0 + 18.0) * 4.0 / 7.0
}

/// A multigrid solver for one grid; moduli may change between solutions, supports may not.
pub struct Solver {
    model: VoxelModel,
    frame: Frame,
    /// Field of elements: modulus times edge.
    e: Vec<f64>,
    operator: MatrixFree<f64>,
    multigrid: Multigrid,
    right: Vec<Vec<(usize, f64)>>,
    /// What body forces act on; none when no case has any.
    weight: Option<Weight>,
    /// Displacements of the case solved last.
    u: Vec<f64>,
    /// Displacements of the other cases, which start from them: rounded, which is far below the tolerance.
    starts: Vec<Vec<f32>>,
    /// Where those of every case lie in `starts`; none for the case solved last.
    places: Vec<Option<usize>>,
    last: usize,
    stiffness: [[f64; 24]; 24],
    options: SolverOptions,
}

impl Solver {
    /// Allocates a solver. `moduli`: one a voxel, `[z][y][x]`; where it is 0 there is never any stiffness, nor any memory
    /// taken.
    ///
    /// 1. The grid is padded so that it can be halved until the coarsest one has at most `options.coarsest` unknowns.
    /// 2. Galerkin tables of every level are computed, then the coarse operators as by [`Solver::set_moduli`].
    ///
    /// # Errors
    /// [`FeError::Memory`] before anything large is allocated; [`FeError::Empty`], [`FeError::LoadOnVoid`],
    /// [`FeError::Option`].
    pub fn new(
        model: VoxelModel,
        moduli: &[f64],
        options: &SolverOptions,
    ) -> Result<Self, FeError> {
        check(&model, moduli, options)?;
        let count = levels(model.dims, moduli, options.coarsest);
        let side = 1usize << (count - 1);
        let occupied = padded(model.dims, side, moduli);
        let grid = NodeGrid::new(model.dims.map(|n| n.next_multiple_of(side)), &occupied);
        let stiffness = element::stiffness(model.nu);
        let frame = Frame::new(grid, &model.fixed, &model.springs);
        let right = (0..model.loads.len())
            .map(|case| sparse(&frame, &model, moduli, case))
            .collect::<Result<Vec<_>, _>>()?;
        let cases = right.len();
        let mut out = Self {
            multigrid: Multigrid::new(&frame, model.nu, count, occupied, options),
            operator: MatrixFree::new(&stiffness),
            e: frame.grid.scalar(),
            u: frame.grid.field(),
            starts: vec![frame.grid.field(); cases.saturating_sub(1)],
            places: (0..cases).map(|case| case.checked_sub(1)).collect(),
            last: 0,
            right,
            weight: None,
            model,
            frame,
            stiffness,
            options: options.clone(),
        };
        spread(&out.frame.grid, &out.model, moduli, &mut out.e);
        if out.model.has_body_force() {
            out.weight = Some(Weight::new(&out.frame.grid, &out.e));
        }
        out.set_multigrid()?;
        Ok(out)
    }

    /// Takes new moduli, MPa, of `voxels`: places in `[z][y][x]`, ascending; those without a modulus at first stay without.
    /// The last displacements stay as the start of the next solution.
    ///
    /// # Errors
    /// [`FeError::Factor`].
    pub fn set_moduli(&mut self, voxels: &[u32], moduli: &[f64]) -> Result<(), FeError> {
        let ([nx, ny, _], grid) = (self.model.dims, &self.frame.grid);
        for (&v, &modulus) in voxels.iter().zip(moduli) {
            let v = v as usize;
            let at = [v % nx, v / nx % ny, v / (nx * ny)];
            if let Some(place) = grid.place(at) {
                self.e[grid.first(at[2]) + place] = modulus * self.model.h;
            }
        }
        self.set_multigrid()
    }

    /// Takes the shares of material, 0 to 1, that body forces act on in `voxels`, as [`Solver::set_moduli`] takes moduli. Others
    /// keep theirs; at first every voxel with a modulus is full.
    pub fn set_shares(&mut self, voxels: &[u32], shares: &[f64]) {
        if let Some(weight) = &mut self.weight {
            weight.set(&self.frame.grid, self.model.dims, voxels, shares);
        }
    }

    /// Forces on nodes and body forces of a case as places and values, some places twice.
    fn right_side(&self, case: usize) -> Vec<(usize, f64)> {
        let mut out = self.right[case].clone();
        if let (Some(weight), Some(force)) = (&self.weight, self.model.body_force(case)) {
            out.extend(weight.forces(&self.frame, self.model.h, force));
        }
        out
    }

    fn set_multigrid(&mut self) -> Result<(), FeError> {
        self.multigrid.set(Fine {
            frame: &self.frame,
            e: &self.e,
        })
    }

    /// Solves load case `case`. What is read off afterwards is of this case, until the next one is solved.
    ///
    /// # Errors
    /// [`FeError::NotConverged`]; the displacements are what was reached. [`FeError::Cancelled`].
    pub fn solve(&mut self, case: usize, monitor: &Monitor) -> Result<SolveStats, FeError> {
        if let Some(place) = self.places[case].take() {
            let start = self.starts[place].par_iter_mut();
            start.zip(&mut self.u).for_each(|(start, u)| {
                (*start, *u) = (*u as f32, f64::from(*start));
            });
            self.places[self.last] = Some(place);
            self.last = case;
        }
        let (tolerance, most) = (self.options.tolerance, self.options.max_iterations);
        let right = self.right_side(case);
        let mut stats = SolveStats::default();
        for _ in 0..TRIES {
            let fine = Fine {
                frame: &self.frame,
                e: &self.e,
            };
            let found = pcg::solve(
                fine,
                &self.operator,
                &mut self.multigrid,
                &right,
                &mut self.u,
                (tolerance, most - stats.iterations),
                monitor,
            )?;
            stats = SolveStats {
                iterations: stats.iterations + found.iterations,
                ..found
            };
            if stats.converged {
                return Ok(stats);
            }
            if stats.iterations >= most {
                break;
            }
            // The cycle was not positive: an eigenvalue was estimated too low.
            self.multigrid.set_smoothers(POWER_AGAIN);
        }
        Err(FeError::NotConverged {
            case,
            iterations: stats.iterations,
            residual: stats.residual,
            tolerance,
        })
    }

    /// Forgets the displacements of all cases.
    pub fn restart(&mut self) {
        self.u.fill(0.0);
        self.starts.iter_mut().for_each(|u| u.fill(0.0));
    }

    /// f'u of the case solved last, N mm: twice the energy in the part and in its springs.
    pub fn compliance(&self) -> f64 {
        let forces = self.right_side(self.last);
        forces.iter().map(|&(at, f)| f * self.u[at]).sum()
    }

    /// Adds `factor` times the work of the body force of the case solved last on a full voxel, N mm, to `out`, which has one
    /// number for each of `voxels`: places in `[z][y][x]`.
    pub fn add_body_work(&self, factor: f64, voxels: &[u32], out: &mut [f64]) {
        let Some(force) = self.model.body_force(self.last) else {
            return;
        };
        let (grid, dims) = (&self.frame.grid, self.model.dims);
        let factor = factor * self.model.h.powi(3);
        add_work(grid, dims, &self.u, force.map(|f| factor * f), voxels, out);
    }

    /// Sum of the body forces on free degrees of freedom in the case solved last, N.
    pub fn weight(&self) -> [f64; 3] {
        match (&self.weight, self.model.body_force(self.last)) {
            (Some(weight), Some(force)) => weight.sum(&self.frame, self.model.h, force),
            _ => [0.0; 3],
        }
    }

    /// Adds `factor u_e' K0 u_e` of the case solved last, for modulus 1 and edge h, mm3, to `out`, which has one number for
    /// each of `voxels`: places in `[z][y][x]`, ascending.
    pub fn add_energies(&self, factor: f64, voxels: &[u32], out: &mut [f64]) {
        let factor = factor * self.model.h;
        let (grid, dims) = (&self.frame.grid, self.model.dims);
        add_energies(grid, dims, &self.stiffness, &self.u, factor, voxels, out);
    }

    /// Displacement of a node in the case solved last, mm; zero where there is no material.
    pub fn displacement(&self, node: [usize; 3]) -> [f64; 3] {
        let u = |c| self.frame.grid.node(node, c).map_or(0.0, |at| self.u[at]);
        [0, 1, 2].map(u)
    }

    /// Energy in the springs in the case solved last, N mm.
    pub fn spring_energy(&self) -> f64 {
        let energy = |spring: &SpringNode| {
            let u = Vector3::from(spring.places.map(|at| self.u[at]));
            u.dot(&(spring.stiffness * u)) / 2.0
        };
        self.frame.springs.iter().map(energy).sum()
    }

    /// Sum of the reactions at the supports, springs among them, in the case solved last, N.
    pub fn reactions(&self) -> [f64; 3] {
        let grid = &self.frame.grid;
        let mut product = grid.field();
        self.operator
            .apply(grid, &self.e, &[], &self.u, &mut product);
        let mut sum = [0.0; 3];
        let mut fixed = self.model.fixed.clone();
        fixed.sort_unstable();
        fixed.dedup();
        for (node, c) in fixed {
            if let Some(at) = grid.node(node, c) {
                sum[c] += product[at];
            }
        }
        for spring in &self.frame.springs {
            let u = Vector3::from(spring.places.map(|at| self.u[at]));
            let force = spring.stiffness * u;
            (0..3).for_each(|c| sum[c] -= force[c]);
        }
        sum
    }

    /// Multiplies by the stiffness `rounds` times, in single precision like the multigrid or in double: for benchmarks.
    #[doc(hidden)]
    pub fn multiply(&self, single: bool, rounds: usize) {
        let grid = &self.frame.grid;
        if single {
            let operator = MatrixFree::<f32>::new(&self.stiffness);
            let (u, mut product) = (vec![1f32; 3 * grid.len()], grid.field());
            for _ in 0..rounds {
                operator.apply(grid, &self.e, &[], &u, &mut product);
            }
        } else {
            let (u, mut product) = (vec![1f64; 3 * grid.len()], grid.field());
            for _ in 0..rounds {
                self.operator.apply(grid, &self.e, &[], &u, &mut product);
            }
        }
    }

    /// Nodes in memory: those of voxels that may have stiffness, and some in short gaps between them.
    pub fn stored_nodes(&self) -> usize {
        self.frame.grid.len()
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
    let voxels = moduli.iter().filter(|&&e| e > 0.0).count();
    // The moduli of the whole grid count too, with a flag each.
    let all: f64 = dims.iter().map(|&n| n as f64).product();
    let cases = model.loads.len();
    let needed = memory_estimate(voxels as f64, cases, model.has_body_force()).max(9.0 * all) / 1e6;
    if needed > options.max_memory {
        return Err(FeError::Memory {
            voxels: if voxels > 0 { voxels as f64 } else { all },
            needed,
            limit: options.max_memory,
        });
    }
    if moduli.len() != dims.iter().product::<usize>() || voxels == 0 {
        return Err(FeError::Empty { dims, h: model.h });
    }
    Ok(())
}

/// Levels until the coarsest grid has at most `coarsest` unknowns and is small beside the finest one.
fn levels(dims: [usize; 3], moduli: &[f64], coarsest: usize) -> usize {
    let (mut n, mut occupied) = (dims, padded(dims, 1, moduli));
    let mut limit = 0;
    for level in 1..MAX_LEVELS {
        let unknowns = 3 * NodeGrid::new(n, &occupied).len();
        if level == 1 {
            limit = coarsest.min(FEW.max(unknowns / SHARE));
        }
        if unknowns <= limit {
            return level;
        }
        let even = n.map(|n| n.next_multiple_of(2));
        occupied = galerkin::coarsen(even, &widened(n, even, &occupied));
        n = even.map(|n| n / 2);
    }
    MAX_LEVELS
}

/// Which elements may have stiffness, on the grid whose sides are multiples of `side`.
fn padded(n: [usize; 3], side: usize, moduli: &[f64]) -> Vec<bool> {
    let occupied: Vec<bool> = moduli.iter().map(|&e| e > 0.0).collect();
    widened(n, n.map(|n| n.next_multiple_of(side)), &occupied)
}

/// The same elements on a larger grid.
fn widened(from: [usize; 3], to: [usize; 3], occupied: &[bool]) -> Vec<bool> {
    let mut out = vec![false; to.iter().product()];
    for (row, occupied) in occupied.chunks_exact(from[0]).enumerate() {
        let at = (row / from[1] * to[1] + row % from[1]) * to[0];
        out[at..at + from[0]].copy_from_slice(occupied);
    }
    out
}

/// Moduli times edge onto the field of elements.
fn spread(grid: &NodeGrid, model: &VoxelModel, moduli: &[f64], e: &mut [f64]) {
    let [nx, ny, nz] = model.dims;
    for z in 0..nz {
        for y in 0..ny {
            let row = &moduli[(z * ny + y) * nx..][..nx];
            for run in grid.row(y, z) {
                let to = &mut e[grid.first(z) + run.at..][..run.len];
                // A run of nodes may end one behind the last voxel.
                for (to, &modulus) in to.iter_mut().zip(&row[run.x..]) {
                    *to = modulus * model.h;
                }
            }
        }
    }
}

/// A load as places and values; forces on fixed degrees of freedom do nothing and are left out.
fn sparse(
    frame: &Frame,
    model: &VoxelModel,
    moduli: &[f64],
    case: usize,
) -> Result<Vec<(usize, f64)>, FeError> {
    let mut out: Vec<(usize, f64)> = Vec::new();
    for &(node, force) in &model.loads[case] {
        if force == [0.0; 3] {
            continue;
        }
        if !touches(model.dims, moduli, node) {
            return Err(FeError::LoadOnVoid { case, node });
        }
        for (c, &f) in force.iter().enumerate() {
            let place = frame.grid.node(node, c);
            if let Some(at) = place.filter(|at| f != 0.0 && frame.fixed.binary_search(at).is_err())
            {
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
    Ok(out)
}

/// Whether a voxel with stiffness touches a node.
fn touches([nx, ny, nz]: [usize; 3], moduli: &[f64], [x, y, z]: [usize; 3]) -> bool {
    let near = |i: usize, n: usize| i.saturating_sub(1)..(i + 1).min(n);
    near(z, nz)
        .any(|z| near(y, ny).any(|y| near(x, nx).any(|x| moduli[(z * ny + y) * nx + x] > 0.0)))
}
