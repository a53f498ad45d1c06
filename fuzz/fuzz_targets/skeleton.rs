#![no_main]
use grassfire::io::{read_control_mesh_bytes, read_skeleton_bytes};
use grassfire::monitor::Monitor;
use grassfire_fuzz::{one_line, options};

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let monitor = Monitor::default();
    match read_skeleton_bytes("x.ply", data, &options(), &monitor) {
        Ok(skeleton) => {
            let count = skeleton.points.len();
            assert_eq!(count, skeleton.radii.len());
            assert!(skeleton.quads.iter().flatten().all(|&v| (v as usize) < count));
            assert!(skeleton.beams.iter().flatten().all(|&v| (v as usize) < count));
        }
        Err(error) => one_line(&error.to_string()),
    }
    match read_control_mesh_bytes("x.obj", data, &options(), &monitor) {
        Ok(mesh) => assert!(mesh.quads.iter().flatten().all(|&v| (v as usize) < mesh.points.len())),
        Err(error) => one_line(&error.to_string()),
    }
});
