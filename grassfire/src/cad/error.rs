//! What can go wrong in the CAD stage.

use crate::io::IoError;
use crate::monitor::Cancelled;

/// Error of the CAD stage. Trouble with the finished solid is no error: see `CadSolid::valid`.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CadError {
    /// The file is not STEP or cannot be read.
    #[error("{path}: {text}")]
    Unreadable {
        /// The file.
        path: String,
        /// What the reader said.
        text: String,
    },
    /// The file holds no solid.
    #[error("{path} holds no solid, only {faces} loose faces")]
    NoSolid {
        /// The file.
        path: String,
        /// Faces found.
        faces: u32,
    },
    /// A non-design solid is not valid.
    #[error("{name}: not a valid closed solid: {text}")]
    InvalidSolid {
        /// Name of the body.
        name: String,
        /// What is wrong with it.
        text: String,
    },
    /// A non-design mesh is not closed.
    #[error("{name}: the mesh is not closed: {edges} edges have not exactly two triangles, the first near ({:.3}, {:.3}, {:.3})", .place[0], .place[1], .place[2])]
    OpenMesh {
        /// Name of the body.
        name: String,
        /// Number of such edges.
        edges: usize,
        /// Middle of the first one, mm.
        place: [f64; 3],
    },
    /// A non-design mesh has nothing in it, or a coordinate that is no number.
    #[error("{name}: {text}")]
    BadMesh {
        /// Name of the body.
        name: String,
        /// What is wrong.
        text: String,
    },
    /// The B-rep description contradicts itself.
    #[error("B-rep: {text}")]
    BadBrep {
        /// What is wrong, with the index.
        text: String,
    },
    /// A shell of the body lies where it cannot: a cavity outside all solids or a solid inside another.
    #[error(
        "shell {shell} of the body (volume {volume:.3} mm3) lies {depth} deep in the other shells; {wanted} wanted"
    )]
    MisplacedShell {
        /// Index of the shell.
        shell: usize,
        /// Its signed volume, mm3.
        volume: f64,
        /// Nesting depth found.
        depth: i64,
        /// Nesting depth that fits its orientation.
        wanted: i64,
    },
    /// OpenCASCADE failed where nothing can be tried instead.
    #[cfg(feature = "occt")]
    #[error(transparent)]
    Kernel(#[from] grassfire_occt::OcctError),
    /// A file cannot be written.
    #[error("{path} cannot be written: {text}")]
    Write {
        /// The file.
        path: String,
        /// What the system said.
        text: String,
    },
    /// A file cannot be written.
    #[error(transparent)]
    File(#[from] IoError),
    /// The user asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl CadError {
    /// What the user can do about it.
    pub fn hint(&self) -> Option<String> {
        match self {
            Self::Unreadable { .. } => Some(
                "export the body again as STEP AP214 or AP242, or give it as a closed STL".into(),
            ),
            Self::NoSolid { .. } => Some("export solids, not surfaces or sketches".into()),
            Self::InvalidSolid { .. } => {
                Some("repair the body in the CAD system it comes from, then export it again".into())
            }
            Self::OpenMesh { .. } | Self::BadMesh { .. } => {
                Some("close the mesh, or give the non-design body as STEP".into())
            }
            Self::File(e) => e.hint(),
            Self::Write { .. } => Some("check that the folder exists and has room".into()),
            _ => None,
        }
    }
}
