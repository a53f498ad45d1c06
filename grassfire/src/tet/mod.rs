//! Linear elasticity on body-fitted ten-node tetrahedra: the second, independent proof of stiffness.
//!
//! Units: mm, N, MPa; energies N mm (mJ). Meshes come from gmsh, an external program; the equations are ours.

mod assembly;
mod coarse;
mod conditions;
mod deck;
mod element;
mod error;
mod gmsh;
mod measure;
mod program;
mod solver;

#[cfg(test)]
mod tests;

use std::path::Path;

use nalgebra::Matrix3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use deck::{CalculixResult, run_calculix, write_deck};
pub use error::TetError;
pub use gmsh::mesh_step;
pub use measure::TetCase;

use crate::Vec3;
use crate::case::{Case, CaseError};
use crate::fe::free_modes_of;
use crate::monitor::Monitor;

/// Name of this stage in progress and warnings.
pub(crate) const STAGE: &str = "tetrahedra";

/// Options of [`solve`] and [`mesh_step`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TetOptions {
    /// Verify on tetrahedra too. It needs gmsh.
    pub enabled: bool,
    /// Have CalculiX solve the same mesh, and compare. It needs ccx.
    pub calculix: bool,
    /// Edge of a tetrahedron, mm. Default: half of the mean wall (twice the volume over the surface), larger where that
    /// would make more than `max_elements`.
    pub size: Option<f64>,
    /// Tetrahedra at most when `size` is not given.
    pub max_elements: usize,
    /// The meshing program: a path or a name to look for.
    pub gmsh: String,
    /// CalculiX: a path or a name to look for.
    pub ccx: String,
    /// Seconds that an external program may take.
    pub patience: f64,
    /// Residual over load at which a solution is accepted.
    pub tolerance: f64,
    /// Iterations of conjugate gradients at most.
    pub max_iterations: usize,
    /// Degree of the Chebyshev smoother.
    pub smoother_degree: usize,
    /// The smoother works on the eigenvalues above the largest one over this.
    pub smoother_ratio: f64,
}

impl Default for TetOptions {
    fn default() -> Self {
        Self {
            enabled: false,
            calculix: false,
            size: None,
            max_elements: 120_000,
            gmsh: "gmsh".to_owned(),
            ccx: "ccx".to_owned(),
            patience: 1800.0,
            tolerance: 1e-8,
            max_iterations: 400,
            smoother_degree: 4,
            smoother_ratio: 12.0,
        }
    }
}

/// Refuses options out of range.
///
/// # Errors
/// [`TetError::Option`].
pub fn check_options(options: &TetOptions) -> Result<(), TetError> {
    let limits = [
        (
            "size",
            options.size.unwrap_or(1.0),
            f64::MIN_POSITIVE,
            1e9,
            "a positive length",
        ),
        (
            "max_elements",
            options.max_elements as f64,
            100.0,
            1e7,
            "100 to 10 million",
        ),
        (
            "patience",
            options.patience,
            1.0,
            1e6,
            "1 to a million seconds",
        ),
        ("tolerance", options.tolerance, 1e-13, 1e-2, "1e-13 to 0.01"),
        (
            "max_iterations",
            options.max_iterations as f64,
            1.0,
            1e6,
            "1 to a million",
        ),
        (
            "smoother_degree",
            options.smoother_degree as f64,
            1.0,
            50.0,
            "1 to 50",
        ),
        (
            "smoother_ratio",
            options.smoother_ratio,
            1.5,
            1e4,
            "1.5 to 10,000",
        ),
    ];
    match limits
        .into_iter()
        .find(|(_, v, low, high, _)| !(low..=high).contains(&v))
    {
        Some((name, value, _, _, wanted)) => Err(TetError::Option {
            name,
            value,
            wanted,
        }),
        None => Ok(()),
    }
}

/// Edge of the tetrahedra for a solid with this volume (mm3) and surface (mm2), mm: that of the options, else their default.
pub fn default_size(volume: f64, area: f64, options: &TetOptions) -> f64 {
    // A regular tetrahedron has 0.118 times the cube of its edge; meshes have about a fifth more.
    let least = (1.2 * volume / (0.118 * options.max_elements as f64)).cbrt();
    options.size.unwrap_or_else(|| (volume / area).max(least))
}

/// Ten-node tetrahedra.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TetMesh {
    /// Nodes, mm.
    pub points: Vec<Vec3>,
    /// Nodes of every element: four corners, then the middles of the edges 01, 12, 20, 03, 13, 23 (the order of VTK and of
    /// CalculiX's C3D10).
    pub cells: Vec<[u32; 10]>,
}

/// Corners of the edges whose middles are nodes 4 to 9.
pub(crate) const EDGES: [[usize; 2]; 6] = [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]];

/// The model of one mesh: what is held and what acts.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TetModel {
    /// Held degrees of freedom (node, component), ascending.
    pub fixed: Vec<(u32, usize)>,
    /// Nodes that springs hold (node, N/mm), ascending.
    pub springs: Vec<(u32, Matrix3<f64>)>,
    /// For every load case its name, weight and forces on nodes (node, N), ascending.
    pub cases: Vec<TetLoads>,
    /// Young's modulus, MPa.
    pub young: f64,
    /// Poisson's ratio.
    pub nu: f64,
}

/// Forces of one load case.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TetLoads {
    /// Name.
    pub name: String,
    /// Weight in the sum of energies.
    pub weight: f64,
    /// Node and force, N.
    pub forces: Vec<(u32, Vec3)>,
}

/// What was found on one mesh.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TetResult {
    /// Elements.
    pub elements: usize,
    /// Nodes.
    pub nodes: usize,
    /// Volume of the mesh, mm3.
    pub volume: f64,
    /// Weighted sum over the cases, N mm.
    pub strain_energy: f64,
    /// The cases.
    pub cases: Vec<TetCase>,
}

impl TetResult {
    /// Largest displacement of all cases, mm.
    pub fn u_max(&self) -> f64 {
        self.cases.iter().map(|c| c.u_max).fold(0.0, f64::max)
    }
}

/// The model of a project file on a mesh; `folder` is where the paths of the project begin.
///
/// 1. A selection holds the faces of the boundary whose six nodes it holds.
/// 2. A support holds the nodes of its faces and those inside of its selection; springs are spread over the faces.
/// 3. A load acts on its faces by area, gravity on all elements, consistently: by quadrature and shape functions.
///
/// # Errors
/// [`TetError::NotOnPart`], [`CaseError::Mechanism`], and those of selections.
pub fn model(
    case: &Case,
    folder: &Path,
    mesh: &TetMesh,
    monitor: &Monitor,
) -> Result<TetModel, TetError> {
    let model = conditions::on_boundary(case, folder, mesh, monitor)?;
    let place = |node: u32| mesh.points[node as usize].into();
    let fixed = model.fixed.iter().map(|&(node, axis)| (place(node), axis));
    let springs = model.springs.iter().map(|&(node, k)| (place(node), k));
    let modes = free_modes_of(&fixed.collect::<Vec<_>>(), &springs.collect::<Vec<_>>());
    if modes.is_empty() {
        Ok(model)
    } else {
        Err(CaseError::Mechanism { modes }.into())
    }
}

/// Solves all load cases of a model.
///
/// 1. Element matrices by four Gauss points, as CalculiX's C3D10 does, are assembled in blocks of 3 x 3.
/// 2. Conjugate gradients with two levels: Chebyshev smoothing on the quadratic functions, and a direct solution on the
///    linear ones (p-multigrid; Galerkin).
/// 3. Energies, displacements, reactions, stress at the Gauss points.
///
/// Memory: about 4 kB a node. The result does not depend on the number of threads.
///
/// # Errors
/// [`TetError::Option`], [`TetError::Inverted`], [`TetError::Factor`], [`TetError::NotConverged`].
pub fn solve(
    mesh: &TetMesh,
    model: &TetModel,
    options: &TetOptions,
    monitor: &Monitor,
) -> Result<TetResult, TetError> {
    check_options(options)?;
    monitor.step(STAGE, "element matrices", 0.0)?;
    let mut fixed = vec![false; 3 * mesh.points.len()];
    for &(node, axis) in &model.fixed {
        fixed[3 * node as usize + axis] = true;
    }
    let system = assembly::assemble(mesh, model, &fixed)?;
    monitor.step(STAGE, "coarse matrix", 0.2)?;
    let solver = solver::Solver::new(system, fixed, options)?;
    let mut result = TetResult {
        elements: mesh.cells.len(),
        nodes: mesh.points.len(),
        volume: measure::volume(mesh),
        ..TetResult::default()
    };
    for (number, loads) in model.cases.iter().enumerate() {
        let done = 0.4 + 0.6 * number as f64 / model.cases.len() as f64;
        monitor.step(STAGE, &loads.name, done)?;
        let found = solver.solve(number, &loads.forces, monitor)?;
        let case = measure::case(mesh, model, loads, found);
        result.strain_energy += loads.weight * case.strain_energy;
        result.cases.push(case);
    }
    Ok(result)
}
