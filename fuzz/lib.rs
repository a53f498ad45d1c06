//! What all fuzz targets share. A reader must never panic, hang or take much memory; what it lets through, the repair must survive.

use grassfire::io::{Input, ReadOptions, read_bytes};
use grassfire::mesh::{RepairOptions, repair};
use grassfire::monitor::Monitor;

/// Limits that a small input must not get around.
pub fn options() -> ReadOptions {
    ReadOptions {
        max_unpacked_bytes: 1 << 24,
        max_triangles: 200_000,
        max_voxels: 1_000_000,
        extrude_layers: 2,
        ..ReadOptions::default()
    }
}

/// Reads `data` as the file `name`; a mesh is repaired as well, and a mended mesh keeps its promises.
pub fn read(name: &str, data: &[u8]) {
    let monitor = Monitor::default();
    match read_bytes(name, data, &options(), &monitor) {
        Ok(Input::Mesh { mesh, .. }) => {
            let count = mesh.points.len();
            assert!(mesh.triangles.iter().flatten().all(|&v| (v as usize) < count));
            match repair(mesh, &RepairOptions::default(), &monitor) {
                Ok(repaired) => {
                    assert!(repaired.report.volume > 0.0 && repaired.report.volume.is_finite());
                    assert!(repaired.mesh.points.iter().all(|p| p.iter().all(|x| x.is_finite())));
                }
                Err(error) => one_line(&error.to_string()),
            }
        }
        Ok(Input::Density { grid, .. }) => {
            assert_eq!(grid.values.len(), grid.dims.iter().product::<usize>());
            assert!(grid.spacing > 0.0 && grid.values.iter().all(|v| (0.0..=1.0).contains(v)));
        }
        Ok(Input::Step(_)) => {}
        Err(error) => {
            let _ = error.hint();
            one_line(&error.to_string());
        }
    }
}

/// Messages are one line.
pub fn one_line(text: &str) {
    assert!(!text.contains('\n') && !text.is_empty(), "{text:?}");
}
