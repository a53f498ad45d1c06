//! What can go wrong with tetrahedra.

use std::path::PathBuf;

use crate::case::CaseError;
use crate::io::IoError;
use crate::monitor::Cancelled;

/// Why a computation on tetrahedra was refused or failed.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum TetError {
    #[error("verify.tetrahedra.{name} is {value}; {wanted} is wanted")]
    Option {
        name: &'static str,
        value: f64,
        wanted: &'static str,
    },
    #[error("{} is no STEP file: tetrahedra need the exact solid", path.display())]
    NoStep { path: PathBuf },
    #[error("the program {program:?} cannot be started: {reason}")]
    Program { program: String, reason: String },
    #[error("the program {program:?} {how}: {said}")]
    ProgramFailed {
        program: String,
        how: String,
        said: String,
    },
    #[error("the mesh of {program:?}, line {line}: {what}")]
    Mesh {
        program: String,
        line: usize,
        what: String,
    },
    #[error("CalculiX wrote no energy of load case {case} into {}", path.display())]
    NoEnergy { case: usize, path: PathBuf },
    #[error("tetrahedron {cell} near ({:.2}, {:.2}, {:.2}) mm is turned inside out", place[0], place[1], place[2])]
    Inverted { cell: usize, place: [f64; 3] },
    #[error("the {what} on {name:?} meets no face of the boundary of the part")]
    NotOnPart { what: &'static str, name: String },
    #[error("the linear part ({unknowns} unknowns) cannot be factored: {what}")]
    Factor { unknowns: usize, what: String },
    #[error(
        "load case {case}: the residual is {residual:.1e} after {iterations} iterations, {tolerance:.0e} is wanted"
    )]
    NotConverged {
        case: usize,
        iterations: usize,
        residual: f64,
        tolerance: f64,
    },
    #[error(transparent)]
    Case(#[from] CaseError),
    #[error(transparent)]
    Io(#[from] IoError),
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl TetError {
    /// What the user can do about it.
    pub fn hint(&self) -> Option<String> {
        let text = match self {
            Self::Option { .. } => "`grassfire schema case` lists all options",
            Self::NoStep { .. } => "give the part.step of a run; voxels take meshes too",
            Self::Program { .. } => {
                "install it (Debian: apt-get install gmsh calculix-ccx), or name its path in verify.tetrahedra.gmsh or .ccx"
            }
            Self::ProgramFailed { .. } | Self::Inverted { .. } | Self::Mesh { .. } => {
                "another verify.tetrahedra.size may help; the voxels need no mesh"
            }
            Self::NotOnPart { .. } => {
                "is the solid in the place and unit that the project file is about? A tolerance in the selection may be too small"
            }
            Self::NotConverged { .. } => "raise verify.tetrahedra.max_iterations",
            Self::Case(e) => return e.hint(),
            Self::Io(e) => return e.hint(),
            Self::NoEnergy { .. } | Self::Factor { .. } | Self::Cancelled(_) => return None,
        };
        Some(text.to_owned())
    }
}
