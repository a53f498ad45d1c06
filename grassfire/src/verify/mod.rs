//! The stiffness of a finished solid: voxels with partial volumes, on two grids.
//!
//! Units: mm, N, MPa; energies N mm (mJ).

mod conditions;
mod equal_volume;
mod fractions;
mod grids;
mod measure;
mod proposal;

#[cfg(test)]
mod tests;

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use fractions::{Fractions, fractions};
pub use measure::{CaseResult, GridResult};
pub use proposal::ProposalResult;

use crate::Vec3;
use crate::case::{Case, CaseError, in_bodies};
use crate::fe::{FeError, SolverOptions};
use crate::mesh::TriMesh;
use crate::monitor::{Cancelled, Monitor};
use crate::remesh::RemeshError;
use crate::tet::TetOptions;
use crate::voxel::VoxelGrid;
use grids::Layout;

/// Name of this stage in progress and warnings.
pub(crate) const STAGE: &str = "verify";

/// Options of [`verify`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct VerifyOptions {
    /// Edge of a voxel of the coarser grid, mm; the finer one has half of it. Default: by `voxels_across`.
    pub h: Option<f64>,
    /// Voxels of the finer grid across the mean wall, twice the volume over the surface.
    pub voxels_across: f64,
    /// Voxels of the finer grid at most, the empty ones included, when `h` is not given.
    pub max_voxels: usize,
    /// A voxel's share of material is measured along this number squared of lines along x, y and z.
    pub lines: usize,
    /// Modulus of a voxel with no more than a trace of material, over the full one.
    pub alpha: f64,
    /// Residual over load at which a solution is accepted.
    pub tolerance: f64,
    /// Volume at which stiffness is compared, mm3. Default: that of the proposal, else the fraction of the optimization.
    pub equal_volume: Option<f64>,
    /// Body-fitted tetrahedra beside the voxels.
    pub tetrahedra: TetOptions,
}

impl Default for VerifyOptions {
    fn default() -> Self {
        Self {
            h: None,
            voxels_across: 8.0,
            max_voxels: 6_000_000,
            lines: 4,
            alpha: 1e-6,
            tolerance: 1e-6,
            equal_volume: None,
            tetrahedra: TetOptions::default(),
        }
    }
}

/// What was found.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Verified {
    /// Volume of the part by its triangles, mm3.
    pub volume: f64,
    /// The coarser grid.
    pub coarse: GridResult,
    /// The finer one: its figures count.
    pub fine: GridResult,
    /// The same loads on the voxels that the optimization left.
    pub proposal: Option<ProposalResult>,
    /// The part at another volume.
    pub equal: Option<EqualVolume>,
}

/// The part with its free surface moved until it has another volume.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct EqualVolume {
    /// The volume, mm3.
    pub volume: f64,
    /// How far the surface moved, mm outward.
    pub offset: f64,
    /// Strain energy, N mm.
    pub strain_energy: f64,
}

impl Verified {
    /// Relative difference of the strain energies of the two grids. Errors of both signs occur (stiff elements, soft cut
    /// cells), so it is not extrapolated.
    pub fn energy_error_estimate(&self) -> f64 {
        difference(&self.coarse, &self.fine)
    }
}

impl ProposalResult {
    /// As [`Verified::energy_error_estimate`].
    pub fn energy_error_estimate(&self) -> f64 {
        difference(&self.coarse, &self.fine)
    }
}

fn difference(coarse: &GridResult, fine: &GridResult) -> f64 {
    (coarse.strain_energy / fine.strain_energy - 1.0).abs()
}

/// Why a verification was refused or failed.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum VerifyError {
    #[error("verify.{name} is {value}; {wanted} is wanted")]
    Option {
        name: &'static str,
        value: f64,
        wanted: &'static str,
    },
    #[error(
        "the surface is not closed: along lines it holds {found:.3} mm3, by its triangles {wanted:.3} mm3"
    )]
    Open { found: f64, wanted: f64 },
    #[error("the solid is empty")]
    Empty,
    #[error("the {what} on {name:?} meets neither the surface of the part nor a node near it")]
    NotOnPart { what: &'static str, name: String },
    #[error(
        "the load {name:?} acts near {place:?} mm on a piece of the part that no support holds"
    )]
    LooseLoad { name: String, place: [f64; 3] },
    #[error(
        "the proposal has {dims:?} voxels of {h} mm, the project file asks for {wanted:?} of {wanted_h} mm, or they lie elsewhere"
    )]
    Proposal {
        dims: [usize; 3],
        h: f64,
        wanted: [usize; 3],
        wanted_h: f64,
    },
    #[error(transparent)]
    Case(#[from] CaseError),
    #[error(transparent)]
    Fe(#[from] FeError),
    #[error(transparent)]
    Remesh(#[from] RemeshError),
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl VerifyError {
    /// What the user can do about it.
    pub fn hint(&self) -> Option<String> {
        match self {
            Self::Option { .. } => Some("`grassfire schema case` lists all options".into()),
            Self::Open { .. } => Some(
                "close it, as `grassfire reconstruct` does; or take a smaller verify.h where its walls are far thinner than a voxel"
                    .into(),
            ),
            Self::Empty => Some("check its unit and that its normals point outward".into()),
            Self::NotOnPart { .. } => {
                Some("is the solid in the place and unit that the project file is about?".into())
            }
            Self::LooseLoad { .. } => Some("join the pieces of the part".into()),
            Self::Proposal { .. } => {
                Some("give the density.vti of `grassfire optimize` on the same project file".into())
            }
            Self::Case(e) => e.hint(),
            Self::Fe(e) => e.hint(),
            Self::Remesh(e) => e.hint(),
            Self::Cancelled(_) => None,
        }
    }
}

/// Solves the load cases of a project on a finished solid; `folder` is where the paths of the project begin.
///
/// 1. Two grids are laid around the solid; the modulus of a voxel is its share of material, measured along lines.
/// 2. Supports and loads act on the true surface; pieces that no support holds are dropped with a warning. A shift of a
///    load by half a voxel would cost 7 to 29 % of the energy.
/// 3. All cases are solved on both grids; the difference of their energies is the estimate of the error.
/// 4. With a proposal (full above 0.5), the same is done with its full voxels.
/// 5. The free surface of the solid, all but that of the non-design bodies, is moved evenly until the solid has the volume
///    to compare at. The energy there is that of the finer grid times the ratio of moved to unmoved on the coarser one.
///
/// J. Parvizian, A. Duester, E. Rank: Finite cell method, 2007, doi:10.1007/s00466-007-0173-y.
///
/// # Errors
/// [`VerifyError`].
pub fn verify(
    case: &Case,
    folder: &Path,
    mesh: &TriMesh,
    proposal: Option<&VoxelGrid<f32>>,
    monitor: &Monitor,
) -> Result<Verified, VerifyError> {
    let options = &case.verify;
    check_options(options)?;
    let solver = SolverOptions {
        tolerance: options.tolerance,
        ..case.solver.clone()
    };
    let solve = |mesh: &TriMesh, at: &Layout, done: f64| -> Result<GridResult, VerifyError> {
        let what = format!("voxels of {:.4} mm", at.h);
        monitor.step(STAGE, &what, done)?;
        let mut grid = fractions(mesh, at.origin, at.h, at.dims, options.lines)?;
        let conditions = conditions::on_surface(case, folder, mesh, &mut grid, monitor)?;
        measure::solve(case, grid, conditions, options.alpha, &solver, monitor)
    };
    let [coarse, fine] = grids::choose(case, mesh, options, monitor)?;
    let mut out = Verified {
        volume: mesh.volume(),
        coarse: solve(mesh, &coarse, 0.0)?,
        fine: solve(mesh, &fine, 0.2)?,
        ..Verified::default()
    };
    if let Some(full) = proposal {
        out.proposal = Some(proposal::solve(case, folder, full, &solver, monitor)?);
    }
    let Some(volume) = equal_volume(case, folder, &out, monitor)? else {
        return Ok(out);
    };
    let kept = |places: &[Vec3]| -> Result<Vec<bool>, VerifyError> {
        let mut any = vec![false; places.len()];
        for inside in in_bodies(case, folder, places, monitor)? {
            any.iter_mut().zip(inside).for_each(|(a, i)| *a |= i);
        }
        Ok(any)
    };
    // Distances are known some voxels far: those of the coarser grid reach twice as far.
    let moved = match equal_volume::moved(mesh, volume, fine.h, &kept, monitor)? {
        None => equal_volume::moved(mesh, volume, coarse.h, &kept, monitor)?,
        moved => moved,
    };
    let compared = match moved {
        Some(moved) => {
            let before = solve(&moved.before, &coarse, 0.85)?;
            let layout = Layout {
                // Room for the moved surface: the grid has a margin of one voxel only.
                ..grown(&coarse, moved.offset)
            };
            match solve(&moved.after, &layout, 0.95) {
                Ok(after) => Some(EqualVolume {
                    volume,
                    offset: moved.offset,
                    strain_energy: out.fine.strain_energy * after.strain_energy
                        / before.strain_energy,
                }),
                // Thinned so far that members tear: the part itself is proved all the same.
                Err(VerifyError::LooseLoad { .. } | VerifyError::NotOnPart { .. }) => None,
                Err(error) => return Err(error),
            }
        }
        None => None,
    };
    if compared.is_none() {
        monitor.warn(
            STAGE,
            format!(
                "the part of {:.0} mm3 cannot be brought to {volume:.0} mm3 by moving its surface: no comparison at equal volume",
                out.volume
            ),
        );
    }
    out.equal = compared;
    Ok(out)
}

/// A grid with room for a surface that moved outward.
fn grown(layout: &Layout, offset: f64) -> Layout {
    let more = (offset / layout.h).max(0.0).ceil() as usize;
    Layout {
        origin: layout.origin - Vec3::repeat(more as f64 * layout.h),
        h: layout.h,
        dims: layout.dims.map(|n| n + 2 * more),
    }
}

/// The volume at which stiffness is compared, mm3; none when nothing says what it should be.
fn equal_volume(
    case: &Case,
    folder: &Path,
    found: &Verified,
    monitor: &Monitor,
) -> Result<Option<f64>, VerifyError> {
    if let Some(volume) = case.verify.equal_volume {
        return Ok(Some(volume));
    }
    if let Some(proposal) = &found.proposal {
        return Ok(Some(proposal.volume));
    }
    let fraction = case.optimize.volume_fraction;
    if !(fraction > 0.0 && fraction < 1.0) {
        return Ok(None);
    }
    Ok(Some(fraction * space(case, folder, monitor)?))
}

/// Volume of the design space with its non-design bodies, mm3, on the voxels of the project.
///
/// # Errors
/// Those of [`crate::case::build`].
pub fn space(case: &Case, folder: &Path, monitor: &Monitor) -> Result<f64, VerifyError> {
    let problem = crate::case::build(case, folder, monitor)?.problem;
    let active = (0..problem.labels.len()).filter(|&v| problem.is_active(v));
    Ok(active.count() as f64 * problem.h.powi(3))
}

/// Refuses options out of range.
///
/// # Errors
/// [`VerifyError::Option`].
pub fn check_options(options: &VerifyOptions) -> Result<(), VerifyError> {
    let bad = |name, value, wanted| {
        Err(VerifyError::Option {
            name,
            value,
            wanted,
        })
    };
    let positive = |v: f64| v.is_finite() && v > 0.0;
    if let Some(h) = options.h.filter(|&h| !positive(h)) {
        return bad("h", h, "a positive length");
    }
    if let Some(v) = options.equal_volume.filter(|&v| !positive(v)) {
        return bad("equal_volume", v, "a positive volume");
    }
    if !(1.0..=200.0).contains(&options.voxels_across) {
        return bad("voxels_across", options.voxels_across, "1 to 200");
    }
    if options.max_voxels < 1000 {
        return bad("max_voxels", options.max_voxels as f64, "1000 or more");
    }
    if !(1..=64).contains(&options.lines) {
        return bad("lines", options.lines as f64, "1 to 64");
    }
    if !(options.alpha > 0.0 && options.alpha < 0.1) {
        return bad("alpha", options.alpha, "a number above 0 and below 0.1");
    }
    Ok(())
}
