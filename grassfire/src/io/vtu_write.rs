//! Finite elements as VTK unstructured grid (`.vtu`), compressed.

use std::io::Write;
use std::path::Path;

use super::vti_write::array;
use super::{IoError, atomic_write};
use crate::Vec3;

/// Elements of one kind with values.
#[derive(Debug, Clone, PartialEq)]
pub struct Elements<const N: usize> {
    /// Nodes, mm.
    pub points: Vec<Vec3>,
    /// Nodes of every element in the order of VTK: 8 of a hexahedron (the lower four counter-clockwise, then the upper
    /// four), or 10 of a quadratic tetrahedron (corners, then the middles of 01, 12, 20, 03, 13, 23).
    pub cells: Vec<[u32; N]>,
    /// Vectors on the nodes.
    pub vectors: Vec<(String, Vec<[f32; 3]>)>,
    /// Values on the nodes.
    pub node_values: Vec<(String, Vec<f32>)>,
    /// Values in the elements.
    pub values: Vec<(String, Vec<f32>)>,
}

/// VTK's numbers of the hexahedron and of the quadratic tetrahedron, by the number of their nodes.
const fn kind(nodes: usize) -> u8 {
    match nodes {
        8 => 12,
        10 => 24,
        _ => panic!("no element with this number of nodes"),
    }
}

/// Writes elements with values on their nodes and in them: XML with zlib-compressed base64 arrays.
///
/// # Errors
/// [`IoError::Write`].
pub fn write_vtu<const N: usize>(path: &Path, grid: &Elements<N>) -> Result<(), IoError> {
    atomic_write(path, |out| {
        writeln!(out, "<?xml version=\"1.0\"?>")?;
        writeln!(
            out,
            "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\">"
        )?;
        writeln!(
            out,
            "<UnstructuredGrid><Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">",
            grid.points.len(),
            grid.cells.len()
        )?;
        writeln!(out, "<Points>")?;
        let points = grid.points.iter().flat_map(|p| [p.x, p.y, p.z]);
        let bytes = points.flat_map(f64::to_le_bytes).collect();
        data(out, "Float64", "Points", 3, bytes)?;
        writeln!(out, "</Points><Cells>")?;
        let corners = grid.cells.iter().flatten();
        let bytes = corners.flat_map(|c| i64::from(*c).to_le_bytes()).collect();
        data(out, "Int64", "connectivity", 1, bytes)?;
        let ends = (1..=grid.cells.len() as i64).map(|n| N as i64 * n);
        data(
            out,
            "Int64",
            "offsets",
            1,
            ends.flat_map(i64::to_le_bytes).collect(),
        )?;
        data(
            out,
            "UInt8",
            "types",
            1,
            vec![const { kind(N) }; grid.cells.len()],
        )?;
        writeln!(out, "</Cells><PointData>")?;
        for (name, vectors) in &grid.vectors {
            let bytes = vectors.iter().flatten().flat_map(|v| v.to_le_bytes());
            data(out, "Float32", name, 3, bytes.collect())?;
        }
        for (name, values) in &grid.node_values {
            let bytes = values.iter().flat_map(|v| v.to_le_bytes());
            data(out, "Float32", name, 1, bytes.collect())?;
        }
        writeln!(out, "</PointData><CellData>")?;
        for (name, values) in &grid.values {
            let bytes = values.iter().flat_map(|v| v.to_le_bytes());
            data(out, "Float32", name, 1, bytes.collect())?;
        }
        writeln!(out, "</CellData></Piece></UnstructuredGrid></VTKFile>")
    })
}

/// One array. Quotes and brackets of its name would end the XML early.
fn data(
    out: &mut dyn Write,
    kind: &str,
    name: &str,
    components: usize,
    bytes: Vec<u8>,
) -> std::io::Result<()> {
    let name: String = name.chars().filter(|c| !"<>&\"".contains(*c)).collect();
    writeln!(
        out,
        "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"binary\">"
    )?;
    array(out, &bytes)?;
    writeln!(out, "</DataArray>")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::{Input, ReadOptions, read_input};
    use crate::monitor::Monitor;

    #[test]
    fn comes_back_as_it_was() {
        // Three cells in a row.
        let mut points = Vec::new();
        for z in 0..2 {
            for y in 0..2 {
                for x in 0..4 {
                    points.push(Vec3::new(
                        0.5 * f64::from(x),
                        0.5 * f64::from(y),
                        1.0 + 0.5 * f64::from(z),
                    ));
                }
            }
        }
        let grid = Elements {
            points,
            cells: (0..3_u32)
                .map(|x| [0, 1, 5, 4, 8, 9, 13, 12].map(|c| c + x))
                .collect(),
            vectors: vec![("move".into(), vec![[1.0, 2.0, 3.0]; 16])],
            node_values: vec![("stress".into(), vec![5.0; 16])],
            values: vec![("share".into(), vec![1.0, 0.25, 0.5])],
        };
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("grid.vtu");
        write_vtu(&path, &grid).expect("writable");
        let options = ReadOptions {
            field: Some("share".into()),
            ..ReadOptions::default()
        };
        let read = read_input(&path, &options, &Monitor::default());
        let Ok(Input::Density { grid, .. }) = read else {
            panic!("a density");
        };
        assert_eq!(grid.dims, [3, 1, 1]);
        assert_eq!(grid.values, [1.0, 0.25, 0.5]);
        assert!((grid.origin - Vec3::new(0.25, 0.25, 1.25)).norm() < 1e-12);
    }
}
