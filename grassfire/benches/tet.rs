//! The solver on ten-node tetrahedra beside CalculiX (deck with its iterative solver) on the same mesh by gmsh.
//!
//! Run with `cargo bench --bench tet -- CASE.toml PART.step EDGE`; the edge is in mm. Processor seconds of all threads.

use std::path::Path;

use grassfire::case::Case;
use grassfire::monitor::Monitor;
use grassfire::tet::{TetOptions, mesh_step, model, run_calculix, solve, write_deck};

/// Processor seconds of this program, and of the programs that it started, so far.
fn processor() -> [f64; 2] {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields = stat.rsplit(')').next().unwrap_or_default();
    let ticks: Vec<f64> = fields
        .split_whitespace()
        .skip(11)
        .take(4)
        .filter_map(|t| t.parse().ok())
        .collect();
    match ticks[..] {
        [a, b, c, d] => [(a + b) / 100.0, (c + d) / 100.0],
        _ => [0.0; 2],
    }
}

fn main() {
    let args: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| a != "--bench")
        .collect();
    let [case, step, size] = &args[..] else {
        println!("skipped: give a project file, a STEP file and an edge in mm");
        return;
    };
    let (path, step) = (Path::new(case), Path::new(step));
    let case = Case::read(path).expect("a project file");
    let size: f64 = size.parse().expect("an edge in mm");
    let folder = path.parent().unwrap_or(Path::new(""));
    let (options, monitor) = (TetOptions::default(), Monitor::default());
    let mesh = mesh_step(step, size, &options, &monitor).expect("a mesh");
    let model = model(&case, folder, &mesh, &monitor).expect("a model");
    let [start, _] = processor();
    let ours = solve(&mesh, &model, &options, &monitor).expect("a solution");
    let [end, before] = processor();
    let deck = std::env::temp_dir().join(format!("grassfire-tet-{}.inp", std::process::id()));
    write_deck(&deck, &mesh, &model, "bench").expect("a deck");
    let cases = model.cases.len();
    let theirs = run_calculix(&deck, cases, &options, &monitor).expect("CalculiX");
    let [_, after] = processor();
    let _ = std::fs::remove_file(&deck);
    let weighted = model.cases.iter().zip(&theirs.energies);
    let energy: f64 = weighted.map(|(c, e)| c.weight * e).sum();
    let iterations: usize = ours.cases.iter().map(|c| c.iterations).sum();
    let (own, other) = (end - start, after - before);
    println!(
        "{} elements, {} nodes, {cases} load cases",
        ours.elements, ours.nodes
    );
    println!(
        "grassfire: {own:.1} CPU s, {iterations} iterations, {:.3} N mm",
        ours.strain_energy
    );
    println!("CalculiX: {other:.1} CPU s, {energy:.3} N mm");
    println!("ratio {:.3}", own / other);
}
