//! PLY (Stanford polygon file): points and faces.

use super::IoError;
use super::obj::fan;
use super::ply_table::{Table, read_tables};
use super::source::Source;
use crate::Vec3;
use crate::mesh::{Repair, RepairKind, TriMesh};

/// Reads a mesh of polygons, which are cut into fans.
pub(super) fn read_mesh(src: &Source, notes: &mut Vec<Repair>) -> Result<TriMesh, IoError> {
    let tables = read_tables(src, &|element, property| match element {
        "vertex" => matches!(property, "x" | "y" | "z"),
        "face" => matches!(property, "vertex_indices" | "vertex_index"),
        _ => false,
    })?;
    let points = points(src, &tables)?;
    let Some(faces) = tables.iter().find(|t| t.name == "face") else {
        return Err(IoError::Empty {
            file: src.file(),
            what: "points without faces",
        });
    };
    let corners = faces
        .corners()
        .ok_or_else(|| src.format("the faces have no list `vertex_indices`"))?;
    let mut mesh = TriMesh {
        points,
        ..TriMesh::default()
    };
    let mut flat = 0;
    let mut polygon = Vec::new();
    for (index, list) in corners.lists().enumerate() {
        corner_indices(src, "face", index, list, mesh.points.len(), &mut polygon)?;
        flat += usize::from(polygon.len() < 3);
        fan(&polygon, &mut mesh.triangles);
        src.check_triangles(mesh.triangles.len())?;
    }
    if flat > 0 {
        let text = format!("{flat} faces with fewer than 3 corners ignored");
        notes.push(Repair::new(RepairKind::Skipped, flat, text));
    }
    Ok(mesh)
}

/// The points of element `vertex`.
pub(super) fn points(src: &Source, tables: &[Table]) -> Result<Vec<Vec3>, IoError> {
    let vertices = tables
        .iter()
        .find(|t| t.name == "vertex")
        .ok_or_else(|| src.format("there is no element `vertex`"))?;
    let axis = |name: &str| {
        let column = vertices
            .column(name)
            .filter(|c| c.values.len() == vertices.rows);
        column.ok_or_else(|| src.format(format!("the vertices have no property `{name}`")))
    };
    let (x, y, z) = (axis("x")?, axis("y")?, axis("z")?);
    let zipped = x.values.iter().zip(&y.values).zip(&z.values);
    Ok(zipped.map(|((&x, &y), &z)| Vec3::new(x, y, z)).collect())
}

/// Checks that `list` holds indices of points and puts them into `out`.
pub(super) fn corner_indices(
    src: &Source,
    element: &'static str,
    index: usize,
    list: &[f64],
    points: usize,
    out: &mut Vec<u32>,
) -> Result<(), IoError> {
    out.clear();
    for &value in list {
        if !(value >= 0.0 && value < points as f64 && value.fract() == 0.0) {
            return Err(src.element(
                element,
                index,
                format!("names point {value}, there are {points} (counted from 0)"),
            ));
        }
        out.push(value as u32);
    }
    Ok(())
}
