//! The voxel solver beside the memory bandwidth, on one and two threads, and its iterations on optimized cantilevers.
//!
//! Run with `cargo bench --bench fe`; numbers such as `-- 48 96 192` choose the cantilevers by their voxels along x. Processor
//! seconds are those of all threads; wall seconds mean something on an idle machine only.

use std::path::Path;
use std::time::Instant;

use grassfire::case::{self, Case};
use grassfire::fe::{Solver, SolverOptions, VoxelModel};
use grassfire::monitor::Monitor;
use grassfire::topopt::optimize;
use rayon::prelude::*;

fn main() {
    let sizes: Vec<usize> = std::env::args().filter_map(|a| a.parse().ok()).collect();
    products();
    cold(if sizes.is_empty() { &[48, 96] } else { &sizes });
}

/// Processor seconds of this program so far.
fn processor() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields = stat.rsplit(')').next().unwrap_or_default();
    let ticks = fields.split_whitespace().skip(11).take(2);
    ticks.filter_map(|t| t.parse::<f64>().ok()).sum::<f64>() / 100.0
}

/// Wall and processor seconds of some work on a number of threads.
fn timed(threads: usize, work: impl FnOnce() + Send) -> [f64; 2] {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    let pool = pool.build().expect("threads");
    let (clock, before) = (Instant::now(), processor());
    pool.install(work);
    [clock.elapsed().as_secs_f64(), processor() - before]
}

/// `a = b + 3 c`; gigabytes a run.
fn triad(threads: usize, rounds: usize) -> ([f64; 2], f64) {
    let n = 1 << 24;
    let (mut a, b, c) = (vec![0.0f64; n], vec![1.0f64; n], vec![2.0f64; n]);
    let seconds = timed(threads, || {
        for _ in 0..rounds {
            let parts = a.par_chunks_mut(1 << 16).zip(b.par_chunks(1 << 16));
            parts.zip(c.par_chunks(1 << 16)).for_each(|((a, b), c)| {
                for i in 0..a.len() {
                    a[i] = b[i] + 3.0 * c[i];
                }
            });
        }
    });
    std::hint::black_box(&a);
    (seconds, 24e-9 * (n * rounds) as f64)
}

fn products() {
    let n = 128;
    let model = VoxelModel {
        dims: [n; 3],
        h: 1.0,
        nu: 0.3,
        fixed: (0..3).map(|c| ([0, 0, 0], c)).collect(),
        loads: vec![vec![([n, n, n], [1.0, 0.0, 0.0])]],
        ..VoxelModel::default()
    };
    let voxels = n * n * n;
    let solver =
        Solver::new(model, &vec![1.0; voxels], &SolverOptions::default()).expect("a solver");
    println!(
        "{n}^3 voxels: wall s, CPU s, million voxels (triad: gigabytes) a wall and a CPU second"
    );
    let rounds = 60;
    for threads in [1, 2] {
        let (seconds, bytes) = triad(threads, rounds);
        let row = |name: &str, [wall, cpu]: [f64; 2], amount: f64| {
            println!(
                "{name}, {threads} threads: {wall:.2} {cpu:.2} {:.1} {:.1}",
                amount / wall,
                amount / cpu
            );
        };
        row("triad", seconds, bytes);
        for single in [true, false] {
            let seconds = timed(threads, || solver.multiply(single, rounds));
            let name = if single {
                "product, single"
            } else {
                "product, double"
            };
            row(name, seconds, 1e-6 * (voxels * rounds) as f64);
        }
    }
}

/// Iterations from zero on the cantilever of examples/ after 40 iterations of the optimizer.
fn cold(sizes: &[usize]) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/cantilever/case.toml");
    let monitor = Monitor::default();
    println!(
        "cantilever: voxels along x, empty modulus, iterations, CPU s of the set-up and of the solution"
    );
    for &n in sizes {
        let mut case = Case::read(&path).expect("the example");
        case.grid.h = 48.0 / n as f64;
        case.optimize.filter_radius = Some(3f64.sqrt() * case.grid.h);
        case.optimize.max_iterations = 40;
        let problem = case::build(&case, Path::new(""), &monitor)
            .expect("a problem")
            .problem;
        let none = |_: &_| Ok(());
        let done = optimize(
            &problem,
            &case.optimize,
            &case.solver,
            None,
            &none,
            &monitor,
        );
        let rho = done.expect("a design").rho;
        for e_min in [1e-6, 1e-9] {
            let moduli: Vec<f64> = rho
                .iter()
                .map(|r| e_min + r.powi(3) * (1.0 - e_min))
                .collect();
            let start = processor();
            let mut solver = Solver::new(problem.model(), &moduli, &case.solver).expect("a solver");
            let ready = processor();
            let stats = solver.solve(0, &monitor).expect("a solution");
            let [setup, solve] = [ready - start, processor() - ready];
            println!(
                "{n}, {e_min:.0e}: {} {setup:.2} {solve:.2}",
                stats.iterations
            );
        }
    }
}
