//! PLY files for viewers: a mesh with one scalar a point, and a medial mesh with radii. Binary, little endian.

use std::io::Write;
use std::path::Path;

use super::{IoError, atomic_write};
use crate::Vec3;
use crate::medial::MedialMesh;
use crate::mesh::TriMesh;

/// Writes `mesh` with one named value a point (`thickness`), atomically; ParaView and MeshLab colour by it.
///
/// # Errors
/// [`IoError::Write`]; [`IoError::Option`] when `values` has another length than the points or `name` is no single word.
pub fn write_ply(
    path: &Path,
    mesh: &TriMesh,
    scalar: Option<(&str, &[f64])>,
) -> Result<(), IoError> {
    if let Some((name, values)) = scalar {
        check_scalar(name, values.len(), mesh.points.len())?;
    }
    atomic_write(path, |w| {
        writeln!(
            w,
            "ply\nformat binary_little_endian 1.0\ncomment grassfire, mm\nelement vertex {}",
            mesh.points.len()
        )?;
        writeln!(w, "property double x\nproperty double y\nproperty double z")?;
        if let Some((name, _)) = scalar {
            writeln!(w, "property double {name}")?;
        }
        writeln!(
            w,
            "element face {}\nproperty list uchar uint vertex_indices\nend_header",
            mesh.triangles.len()
        )?;
        for (i, p) in mesh.points.iter().enumerate() {
            write_point(w, p)?;
            if let Some((_, values)) = scalar {
                w.write_all(&values[i].to_le_bytes())?;
            }
        }
        mesh.triangles.iter().try_for_each(|t| write_triangle(w, t))
    })
}

/// Writes a medial mesh with property `radius`, its triangles and its loose edges, atomically.
///
/// # Errors
/// [`IoError::Write`]; [`IoError::Option`] when there is not one radius a point.
pub fn write_poles(path: &Path, medial: &MedialMesh) -> Result<(), IoError> {
    check_scalar("radius", medial.radii.len(), medial.points.len())?;
    atomic_write(path, |w| {
        writeln!(
            w,
            "ply\nformat binary_little_endian 1.0\ncomment grassfire, mm\nelement vertex {}",
            medial.points.len()
        )?;
        writeln!(
            w,
            "property double x\nproperty double y\nproperty double z\nproperty double radius"
        )?;
        writeln!(
            w,
            "element face {}\nproperty list uchar uint vertex_indices",
            medial.triangles.len()
        )?;
        writeln!(
            w,
            "element edge {}\nproperty uint vertex1\nproperty uint vertex2\nend_header",
            medial.edges.len()
        )?;
        for (p, radius) in medial.points.iter().zip(&medial.radii) {
            write_point(w, p)?;
            w.write_all(&radius.to_le_bytes())?;
        }
        medial
            .triangles
            .iter()
            .try_for_each(|t| write_triangle(w, t))?;
        medial
            .edges
            .iter()
            .flatten()
            .try_for_each(|v| w.write_all(&v.to_le_bytes()))
    })
}

fn check_scalar(name: &str, values: usize, points: usize) -> Result<(), IoError> {
    if name.is_empty() || name.contains(char::is_whitespace) {
        return Err(IoError::Option {
            name: "scalar",
            value: format!("{name:?}"),
            want: "one word",
        });
    }
    if values != points {
        return Err(IoError::Option {
            name: "scalar",
            value: format!("{values} values for {points} points"),
            want: "one value a point",
        });
    }
    Ok(())
}

fn write_point(w: &mut dyn Write, p: &Vec3) -> std::io::Result<()> {
    p.iter().try_for_each(|x| w.write_all(&x.to_le_bytes()))
}

fn write_triangle(w: &mut dyn Write, triangle: &[u32; 3]) -> std::io::Result<()> {
    w.write_all(&[3])?;
    triangle
        .iter()
        .try_for_each(|v| w.write_all(&v.to_le_bytes()))
}
