//! Speed of the medial stage on a generated part (a bumpy gyroid sheet in a box).
//!
//! `cargo bench --bench medial -- [grid]` (grid points a side, default 336: about a million corners).
//! `benches/cgal/run.sh` runs the same with CGAL as a peer and prints ratios. CPU seconds are those of
//! all threads of the process, from /proc; without it (not Linux) wall seconds stand in.

use std::f32::consts::PI;
use std::io::Write;
use std::process::Command;
use std::time::Instant;

use grassfire::Vec3;
use grassfire::medial::{MedialOptions, delaunay, delaunay_lattice, medial_axis};
use grassfire::monitor::Monitor;
use grassfire::voxel::VoxelGrid;

/// Runs of each Delaunay benchmark; the fastest counts.
const RUNS: usize = 3;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let size = std::env::args()
        .skip(1)
        .find_map(|a| a.parse().ok())
        .unwrap_or(336);
    let field = gyroid_part(size);
    let corners = corners(&field);
    println!("grid {size}^3, {} lattice corners", corners.len());
    let monitor = Monitor::default();

    let lattice: Vec<Vec3> = corners
        .iter()
        .map(|c| Vec3::from_fn(|k, _| f64::from(c[k])))
        .collect();
    let surface: Vec<Vec3> = lattice.iter().map(|c| project(&field, c)).collect();
    report("lattice corners, integer", &lattice, Some(250.0), || {
        Ok(delaunay_lattice(&corners, &monitor)?.tets.len())
    })?;
    report("surface points, float", &surface, None, || {
        Ok(delaunay(&surface, &monitor)?.tets.len())
    })?;
    drop((lattice, surface, corners));

    let (wall, cpu) = (Instant::now(), cpu_seconds());
    let axis = medial_axis(&field, &MedialOptions::default(), &monitor)?;
    println!(
        "medial axis: {:.2} s wall, {:.2} s CPU, peak memory of the process {} MB; {:?} -> {} points, {} triangles, {} edges",
        wall.elapsed().as_secs_f64(),
        cpu_seconds().unwrap_or_default() - cpu.unwrap_or_default(),
        peak_megabytes().unwrap_or_default(),
        axis.pruned,
        axis.mesh.points.len(),
        axis.mesh.triangles.len(),
        axis.mesh.edges.len()
    );
    Ok(())
}

type Run<'a> = dyn Fn() -> Result<usize, Box<dyn std::error::Error>> + 'a;

fn report(
    what: &str,
    points: &[Vec3],
    gate: Option<f64>,
    run: impl Fn() -> Result<usize, Box<dyn std::error::Error>>,
) -> Result<(), Box<dyn std::error::Error>> {
    let peer = std::env::var_os("GRASSFIRE_CGAL");
    let file = peer.is_some().then(|| write_points(points)).transpose()?;
    let (mut own, mut other) = (f64::INFINITY, f64::INFINITY);
    let mut cells = 0;
    let run: &Run = &run;
    for _ in 0..RUNS {
        let (wall, cpu) = (Instant::now(), cpu_seconds());
        cells = run()?;
        own = own.min(
            cpu_seconds()
                .zip(cpu)
                .map_or(wall.elapsed().as_secs_f64(), |(b, a)| b - a),
        );
        if let (Some(peer), Some(file)) = (&peer, &file) {
            let output = Command::new(peer).arg(file.path()).output()?;
            let text = String::from_utf8(output.stdout)?;
            other = other.min(
                text.split_whitespace()
                    .nth(2)
                    .ok_or("the peer printed no time")?
                    .parse()?,
            );
        }
    }
    let speed = points.len() as f64 / own / 1e3;
    println!(
        "Delaunay, {what}: {} points, {cells} cells, {own:.2} s CPU, {speed:.0} kpts/s",
        points.len()
    );
    if let Some(gate) = gate {
        println!("  ratio to {gate} kpts/s: {:.2}", speed / gate);
    }
    if other.is_finite() {
        println!(
            "  CGAL {other:.2} s CPU, {:.0} kpts/s; ratio to CGAL: {:.2}",
            points.len() as f64 / other / 1e3,
            other / own
        );
    }
    Ok(())
}

fn write_points(points: &[Vec3]) -> Result<tempfile::NamedTempFile, std::io::Error> {
    let mut file = tempfile::NamedTempFile::new()?;
    let mut out = std::io::BufWriter::new(&mut file);
    for x in points.iter().flat_map(|p| p.iter()) {
        out.write_all(&x.to_le_bytes())?;
    }
    out.flush()?;
    drop(out);
    Ok(file)
}

/// A gyroid sheet of varying thickness in a box, with bumps as topology optimization leaves them.
fn gyroid_part(n: usize) -> VoxelGrid<f32> {
    let waves: Vec<[f32; 4]> = (0..12u32)
        .map(|i| {
            let random = |k: u32| {
                f32::from((i * 4 + k + 1).wrapping_mul(0x9E37_79B9).rotate_left(11) as u16)
                    / 65536.0
            };
            [
                (random(0) - 0.5) * 50.0,
                (random(1) - 0.5) * 50.0,
                (random(2) - 0.5) * 50.0,
                random(3) * 2.0 * PI,
            ]
        })
        .collect();
    let spacing = 2.0 / (n - 1) as f64;
    let mut grid = VoxelGrid::filled(Vec3::repeat(-1.0), spacing, [n; 3], 0.0f32);
    let k = PI * 1.15;
    for index in 0..grid.values.len() {
        let [x, y, z] = grid.ijk(index).map(|i| i as f32 * spacing as f32 - 1.0);
        let gyroid = ((k * x + 0.3).sin() * (k * y).cos()
            + (k * y).sin() * (k * z - 0.2).cos()
            + (k * z).sin() * (k * x).cos())
        .abs();
        let thickness = 0.28 + 0.12 * (2.1 * x + 1.0).sin() * (1.7 * y).cos();
        let shell = 2.7 - 3.0 * x.abs().max(y.abs()).max(z.abs());
        let bumps: f32 = waves
            .iter()
            .map(|w| 0.012 * (w[0] * x + w[1] * y + w[2] * z + w[3]).sin())
            .sum();
        grid.values[index] = (thickness - gyroid).min(shell) + bumps;
    }
    grid
}

fn corners(field: &VoxelGrid<f32>) -> Vec<[i32; 3]> {
    let n = field.dims[0] as i32;
    let solid = |x: i32, y: i32, z: i32| {
        [x, y, z].iter().all(|c| (0..n).contains(c))
            && field.values[field.index(x as usize, y as usize, z as usize)] > 0.0
    };
    let mut corners = Vec::new();
    for (z, y, x) in
        (0..=n).flat_map(|z| (0..=n).flat_map(move |y| (0..=n).map(move |x| (z, y, x))))
    {
        let count = (0..8)
            .filter(|c| solid(x - (c & 1), y - (c >> 1 & 1), z - (c >> 2)))
            .count();
        if count % 8 != 0 {
            corners.push([x, y, z]);
        }
    }
    corners
}

/// Moves a lattice corner onto the surface.
fn project(field: &VoxelGrid<f32>, corner: &Vec3) -> Vec3 {
    let mut p = field.origin + field.spacing * (corner - Vec3::repeat(0.5));
    for _ in 0..3 {
        let gradient = field.gradient(&p);
        let step = gradient * (field.sample(&p) / gradient.norm_squared().max(1e-12));
        p -= step * (0.7 * field.spacing / step.norm().max(1e-12)).min(1.0);
    }
    p
}

/// User and system time of this process, seconds.
fn cpu_seconds() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/stat").ok()?;
    let fields: Vec<&str> = text.rsplit(')').next()?.split_whitespace().collect();
    let ticks: f64 = fields.get(11)?.parse::<f64>().ok()? + fields.get(12)?.parse::<f64>().ok()?;
    Some(ticks / 100.0)
}

fn peak_megabytes() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let kilobytes: u64 = text
        .lines()
        .find(|l| l.starts_with("VmHWM"))?
        .split_whitespace()
        .nth(1)?
        .parse()
        .ok()?;
    Some(kilobytes / 1024)
}
