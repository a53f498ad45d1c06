//! Readers and writers of files.
//!
//! [`read_input`] looks at the content first and at the extension second. No reader trusts a count that the file claims: sizes are
//! checked against the bytes that are there before anything is allocated. Lengths are millimetres after [`ReadOptions::scale`].

mod atomic;
mod control;
mod deck;
mod density;
mod detect;
mod error;
mod medial;
mod npy;
mod number;
mod obj;
mod off;
mod ply;
mod ply_table;
mod ply_write;
mod skeleton;
mod source;
mod step;
mod stl;
mod threemf;
mod threemf_write;
mod vti_write;
mod vtk;
mod vtk_array;
mod vtk_grid;
mod vtu_write;

use std::io::Read;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use atomic::atomic_write;
pub use control::{read_control_mesh, read_control_mesh_bytes, write_control_mesh};
pub use deck::read_deck_set;
pub use error::IoError;
pub use medial::{read_medial, read_medial_bytes, write_medial};
pub use ply_write::{write_ply, write_poles};
pub use skeleton::{read_skeleton, read_skeleton_bytes, write_skeleton};
pub use stl::write_stl;
pub use threemf_write::{ThreeMfObject, ThreeMfTexts, write_3mf};
pub use vti_write::write_vti;
pub use vtu_write::{Elements, write_vtu};

use crate::mesh::{Repair, TriMesh};
use crate::monitor::Monitor;
use crate::voxel::VoxelGrid;
use detect::Format;
use source::Source;

/// What a file held.
#[derive(Debug, Clone, PartialEq)]
pub enum Input {
    /// Triangles, as soup.
    Mesh {
        /// The triangles, mm.
        mesh: TriMesh,
        /// What the reader had to skip, guess or mend.
        notes: Vec<Repair>,
    },
    /// Densities of 0..=1.
    Density {
        /// Values at voxel centres.
        grid: VoxelGrid<f32>,
        /// What the reader had to skip, guess or mend.
        notes: Vec<Repair>,
    },
    /// A STEP file that passed the quick checks; the CAD kernel reads it.
    Step(PathBuf),
}

/// Options of [`read_input`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ReadOptions {
    /// Millimetres per unit of the file (25.4 for inches). A 3MF file states its own unit, which this multiplies.
    pub scale: f64,
    /// Density files without a spacing of their own (NPY): edge of a voxel, mm. Default 1.
    pub spacing: Option<f64>,
    /// Density files without an origin of their own (NPY): centre of voxel (0, 0, 0), mm. Default the origin.
    pub origin: Option<[f64; 3]>,
    /// VTI, VTU: name of the array with the densities. Default: the one that is called so, or the only one.
    pub field: Option<String>,
    /// Densities are multiplied by this (0.01 for percent).
    pub density_scale: f64,
    /// Density at which material begins.
    pub threshold: f64,
    /// Share of the densities that may lie outside 0..=1 and is clamped; more is refused.
    pub max_outside_share: f64,
    /// NPY: how many layers a 2-D array is extruded by along z; 0 refuses it.
    pub extrude_layers: usize,
    /// Most bytes in a file.
    pub max_file_bytes: u64,
    /// Most bytes that compressed parts of a file may grow to.
    pub max_unpacked_bytes: u64,
    /// Most triangles.
    pub max_triangles: usize,
    /// Most voxels.
    pub max_voxels: usize,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self {
            scale: 1.0,
            spacing: None,
            origin: None,
            field: None,
            density_scale: 1.0,
            threshold: 0.5,
            max_outside_share: 0.01,
            extrude_layers: 0,
            max_file_bytes: 2 << 30,
            max_unpacked_bytes: 2 << 30,
            max_triangles: 20_000_000,
            max_voxels: 200_000_000,
        }
    }
}

/// Reads a mesh, a density grid or the name of a STEP file.
///
/// 1. The file is read whole, if it is a regular file of at most [`ReadOptions::max_file_bytes`].
/// 2. Its format is found: STL (ASCII and binary), OBJ, PLY, OFF, 3MF, STEP, VTI, VTU, NPY.
/// 3. The reader of that format makes triangles or densities; coordinates may still be NaN or infinite (`mesh::repair` drops those).
///
/// # Errors
/// [`IoError`] names the file, the line, byte or element, the value and the limit.
pub fn read_input(path: &Path, options: &ReadOptions, monitor: &Monitor) -> Result<Input, IoError> {
    let bytes = read_file(path, options.max_file_bytes)?;
    read_bytes(&path.display().to_string(), &bytes, options, monitor)
}

/// [`read_input`] on bytes in memory; `name` stands in messages and its extension is the second clue to the format.
///
/// # Errors
/// As [`read_input`].
pub fn read_bytes(
    name: &str,
    bytes: &[u8],
    options: &ReadOptions,
    monitor: &Monitor,
) -> Result<Input, IoError> {
    let src = Source {
        name,
        bytes,
        options,
        monitor,
    };
    if !(options.scale.is_finite() && options.scale > 0.0) {
        return Err(IoError::Option {
            name: "scale",
            value: options.scale.to_string(),
            want: "a positive number",
        });
    }
    monitor.step("input", "reading", 0.0)?;
    let mut notes = Vec::new();
    let input = match detect::detect(&src)? {
        Format::StlAscii => mesh_input(&src, stl::read_ascii(&src, &mut notes)?, notes)?,
        Format::StlBinary => mesh_input(&src, stl::read_binary(&src, &mut notes)?, notes)?,
        Format::Obj => mesh_input(&src, obj::read(&src, &mut notes)?, notes)?,
        Format::Ply => mesh_input(&src, ply::read_mesh(&src, &mut notes)?, notes)?,
        Format::Off => mesh_input(&src, off::read(&src, &mut notes)?, notes)?,
        Format::ThreeMf => mesh_input(&src, threemf::read(&src, &mut notes)?, notes)?,
        Format::Vtk => density_input(&src, vtk::read(&src, &mut notes)?, notes)?,
        Format::Npy => density_input(&src, npy::read(&src, &mut notes)?, notes)?,
        Format::Step => {
            step::check(&src)?;
            Input::Step(PathBuf::from(name))
        }
    };
    monitor.step("input", "reading", 1.0)?;
    Ok(input)
}

fn mesh_input(src: &Source, mut mesh: TriMesh, notes: Vec<Repair>) -> Result<Input, IoError> {
    if mesh.triangles.is_empty() {
        return Err(IoError::Empty {
            file: src.file(),
            what: "no triangles",
        });
    }
    if src.options.scale != 1.0 {
        mesh.points.iter_mut().for_each(|p| *p *= src.options.scale);
    }
    // One body needs no tags.
    if mesh
        .tags
        .first()
        .is_some_and(|first| mesh.tags.iter().all(|tag| tag == first))
    {
        mesh.tags.clear();
    }
    Ok(Input::Mesh { mesh, notes })
}

fn density_input(
    src: &Source,
    grid: VoxelGrid<f32>,
    mut notes: Vec<Repair>,
) -> Result<Input, IoError> {
    let grid = density::check(src, grid, &mut notes)?;
    Ok(Input::Density { grid, notes })
}

/// The whole file, if it is a regular one of at most `limit` bytes.
pub(crate) fn read_file(path: &Path, limit: u64) -> Result<Vec<u8>, IoError> {
    let open = |source| IoError::Open {
        file: path.display().to_string(),
        source,
    };
    let file = std::fs::File::open(path).map_err(open)?;
    let data = file.metadata().map_err(open)?;
    if !data.is_file() {
        return Err(open(std::io::Error::new(
            std::io::ErrorKind::InvalidInput,
            "not a regular file",
        )));
    }
    let too_big = |value| IoError::Limit {
        file: path.display().to_string(),
        what: "the size in bytes".into(),
        value,
        limit,
    };
    if data.len() > limit {
        return Err(too_big(data.len()));
    }
    let mut bytes = Vec::with_capacity(data.len() as usize);
    file.take(limit.saturating_add(1))
        .read_to_end(&mut bytes)
        .map_err(open)?;
    if bytes.len() as u64 > limit {
        return Err(too_big(bytes.len() as u64));
    }
    Ok(bytes)
}
