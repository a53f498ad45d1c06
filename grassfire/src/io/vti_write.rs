//! Voxel fields as VTK image data (`.vti`), compressed.

use std::io::Write;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;

use super::{IoError, atomic_write};
use crate::voxel::VoxelGrid;

/// Bytes that are compressed together.
const BLOCK: usize = 1 << 20;

/// Writes fields on the same grid as cell data, each under its name.
///
/// The file is XML with zlib-compressed base64 arrays, as ParaView reads it. Nothing is written when `fields` is empty or
/// their grids differ.
///
/// # Errors
/// [`IoError::Write`].
pub fn write_vti(path: &Path, fields: &[(&str, &VoxelGrid<f32>)]) -> Result<(), IoError> {
    let Some((_, first)) = fields.first() else {
        return Ok(());
    };
    atomic_write(path, |out| {
        let [nx, ny, nz] = first.dims;
        let h = first.spacing;
        // Cell data: the origin is a corner of the first voxel, not its centre.
        let corner = first.origin - crate::Vec3::repeat(h / 2.0);
        let extent = format!("0 {nx} 0 {ny} 0 {nz}");
        writeln!(out, "<?xml version=\"1.0\"?>")?;
        writeln!(
            out,
            "<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\">"
        )?;
        writeln!(
            out,
            "<ImageData WholeExtent=\"{extent}\" Origin=\"{} {} {}\" Spacing=\"{h} {h} {h}\">",
            corner.x, corner.y, corner.z
        )?;
        writeln!(out, "<Piece Extent=\"{extent}\"><CellData>")?;
        for (name, field) in fields {
            writeln!(
                out,
                "<DataArray type=\"Float32\" Name=\"{name}\" format=\"binary\">"
            )?;
            let bytes: Vec<u8> = field.values.iter().flat_map(|v| v.to_le_bytes()).collect();
            array(out, &bytes)?;
            writeln!(out, "</DataArray>")?;
        }
        writeln!(out, "</CellData></Piece></ImageData></VTKFile>")
    })
}

/// The bytes of an array, compressed: header (blocks, their size, size of the last, compressed sizes) and data, each base64
/// of its own.
pub(super) fn array(out: &mut dyn Write, bytes: &[u8]) -> std::io::Result<()> {
    let (mut header, mut data) = (Vec::new(), Vec::new());
    let blocks: Vec<&[u8]> = bytes.chunks(BLOCK).collect();
    let last = blocks.last().map_or(0, |b| b.len() % BLOCK);
    header.extend([blocks.len() as u64, BLOCK as u64, last as u64]);
    for block in blocks {
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
        encoder.write_all(block)?;
        let compressed = encoder.finish()?;
        header.push(compressed.len() as u64);
        data.extend(compressed);
    }
    let header: Vec<u8> = header.iter().flat_map(|n| n.to_le_bytes()).collect();
    writeln!(out, "{}{}", STANDARD.encode(header), STANDARD.encode(data))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;
    use crate::io::{Input, ReadOptions, read_input};
    use crate::monitor::Monitor;

    #[test]
    fn comes_back_as_it_was() {
        let mut field = VoxelGrid::filled(Vec3::new(1.0, -2.0, 0.5), 0.5, [90, 70, 60], 0.0_f32);
        for (i, v) in field.values.iter_mut().enumerate() {
            *v = (i % 977) as f32 / 977.0;
        }
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("field.vti");
        write_vti(&path, &[("density", &field)]).expect("writable");
        let read = read_input(&path, &ReadOptions::default(), &Monitor::default());
        let Ok(Input::Density { grid, .. }) = read else {
            panic!("a density");
        };
        assert_eq!(grid.dims, field.dims);
        assert!((grid.origin - field.origin).norm() < 1e-12);
        assert_eq!(grid.values, field.values);
    }
}
