//! CAD faces that our spline stage makes of control meshes, ours or another program's quads.
//!
//! `cargo run --release --example faces -- quads.obj ...` prints the number of faces for each, or why there are none.

use std::path::Path;

use grassfire::io::{ReadOptions, read_control_mesh};
use grassfire::monitor::Monitor;
use grassfire::spline::{BrepOptions, PatchOptions, build_brep, patches};

fn main() {
    for path in std::env::args().skip(1) {
        match faces(Path::new(&path)) {
            Ok(count) => println!("{count}"),
            Err(error) => println!("none: {error}"),
        }
    }
}

fn faces(path: &Path) -> Result<usize, Box<dyn std::error::Error>> {
    let monitor = Monitor::default();
    let mesh = read_control_mesh(path, &ReadOptions::default(), &monitor)?;
    let surface = patches(&mesh, &PatchOptions::default(), &monitor)?;
    let brep = build_brep(&mesh, &surface, &BrepOptions::default(), &monitor)?;
    Ok(brep.faces.len())
}
