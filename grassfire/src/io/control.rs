//! Closed quad control meshes as OBJ.

use std::path::Path;

use super::obj::{parse_obj, write_obj};
use super::source::Source;
use super::{IoError, ReadOptions, read_file};
use crate::monitor::Monitor;
use crate::spline::ControlMesh;

/// Reads a quad mesh from OBJ; see [`read_control_mesh_bytes`].
///
/// # Errors
/// As [`read_control_mesh_bytes`], and [`IoError::Open`].
pub fn read_control_mesh(
    path: &Path,
    options: &ReadOptions,
    monitor: &Monitor,
) -> Result<ControlMesh, IoError> {
    let bytes = read_file(path, options.max_file_bytes)?;
    read_control_mesh_bytes(&path.display().to_string(), &bytes, options, monitor)
}

/// Reads a quad mesh from OBJ; whether it is closed is checked by the stage that uses it.
///
/// # Errors
/// [`IoError::Element`] names the first face that is not a quad; [`IoError::Line`] for damaged lines.
pub fn read_control_mesh_bytes(
    name: &str,
    bytes: &[u8],
    options: &ReadOptions,
    monitor: &Monitor,
) -> Result<ControlMesh, IoError> {
    let src = Source {
        name,
        bytes,
        options,
        monitor,
    };
    let data = parse_obj(&src)?;
    let mut mesh = ControlMesh::default();
    for (index, polygon) in data.polygons().enumerate() {
        let wrong = |_| {
            src.element(
                "face",
                index,
                format!(
                    "has {} corners, a control mesh has quads only",
                    polygon.len()
                ),
            )
        };
        mesh.quads.push(polygon.try_into().map_err(wrong)?);
    }
    if mesh.quads.is_empty() {
        return Err(IoError::Empty {
            file: src.file(),
            what: "no quads",
        });
    }
    mesh.points = data.points;
    if let Some(index) = mesh
        .points
        .iter()
        .position(|p| !p.iter().all(|x| x.is_finite()))
    {
        return Err(src.element("point", index, "has a coordinate that is not finite"));
    }
    mesh.points.iter_mut().for_each(|p| *p *= options.scale);
    Ok(mesh)
}

/// Writes a quad mesh as OBJ, atomically; every number reads back exactly.
///
/// # Errors
/// [`IoError::Write`].
pub fn write_control_mesh(path: &Path, mesh: &ControlMesh) -> Result<(), IoError> {
    write_obj(path, &mesh.points, &mesh.quads)
}
