#![no_main]
use grassfire::io::read_medial_bytes;
use grassfire::monitor::Monitor;
use grassfire_fuzz::{one_line, options};

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    match read_medial_bytes("x.ma", data, &options(), &Monitor::default()) {
        Ok(mesh) => {
            let count = mesh.points.len();
            assert!(mesh.triangles.iter().flatten().all(|&v| (v as usize) < count));
            assert!(mesh.edges.iter().flatten().all(|&v| (v as usize) < count));
        }
        Err(error) => one_line(&error.to_string()),
    }
});
