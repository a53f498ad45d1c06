//! Jumps of curvature around extraordinary points for three surfaces of one control mesh: ours, the bicubic
//! approximation of Loop and Schaefer (doi:10.1145/1330511.1330519), and the Catmull-Clark limit surface itself.
//!
//! `cargo run --release --example curvature -- out/body.obj ...` prints a Markdown table. All three are sampled at the same
//! places, a sixteenth of an edge apart, and the shape operator of each side of an edge comes from the normals of three
//! neighbouring samples (Rusinkiewicz 2004, doi:10.1109/TDPV.2004.1335277); the last columns are exact derivatives.

use std::path::Path;

use grassfire::Vec3;
use grassfire::io::{ReadOptions, read_control_mesh};
use grassfire::monitor::Monitor;
use grassfire::spline::catmull_clark::QuadTopology;
use grassfire::spline::{ControlMesh, Patch, PatchOptions, curvature_jump, evaluate, patches};

type Result<T = ()> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Splits of the mesh; 2 to the power of this samples an edge.
const LEVELS: u32 = 4;

fn main() -> Result {
    println!(
        "| part | ours max | p95 | rms | share | kink | bicubic max | p95 | rms | share | kink | Catmull-Clark max | p95 | rms | share | ours max, exact | rms | share |"
    );
    println!("|{}", "---|".repeat(18));
    for path in std::env::args().skip(1) {
        let monitor = Monitor::default();
        let mesh = read_control_mesh(Path::new(&path), &ReadOptions::default(), &monitor)?;
        let ours = patches(&mesh, &PatchOptions::default(), &monitor)?;
        let topology = QuadTopology::new(mesh.points.len(), &mesh.quads)?;
        let name = Path::new(&path).parent().and_then(Path::file_name);
        print!("| {} ", name.unwrap_or_default().to_string_lossy());
        let surfaces = [
            of_patches(&ours),
            of_patches(&bicubic(&mesh, &topology)),
            of_limit(&mesh)?,
        ];
        for (k, surface) in surfaces.iter().enumerate() {
            let [max, p95, rms, share, kink] = jumps(&topology, surface);
            print!("| {max:.3} | {p95:.3} | {rms:.4} | {share:.3} ");
            if k < 2 {
                print!("| {kink:.1e} ");
            }
        }
        let exact = curvature_jump(&mesh, &ours)?;
        println!(
            "| {:.3} | {:.4} | {:.3} |",
            exact.max, exact.rms, exact.relative
        );
    }
    Ok(())
}

/// Position and unit normal.
type Point = (Vec3, Vec3);

/// Samples of a surface: `at(half-edge, along, inward)`, in sixteenths of an edge from the start of the half-edge.
type Surface = Box<dyn Fn(u32, u32, u32) -> Point>;

/// Row and column of a sample of a quad, from its first corner.
fn place(h: u32, along: u32, inward: u32) -> [u32; 2] {
    let n = 1 << LEVELS;
    match h % 4 {
        0 => [along, inward],
        1 => [n - inward, along],
        2 => [n - along, n - inward],
        _ => [inward, n - along],
    }
}

fn of_patches(patches: &[Patch]) -> Surface {
    let patches = patches.to_vec();
    Box::new(move |h, along, inward| {
        let [u, v] = place(h, along, inward).map(|k| f64::from(k) / f64::from(1 << LEVELS));
        let at = evaluate(&patches[h as usize / 4], u, v);
        (at.position, at.normal)
    })
}

/// The limit surface itself, with its exact normals.
fn of_limit(mesh: &ControlMesh) -> Result<Surface> {
    let mut topology = QuadTopology::new(mesh.points.len(), &mesh.quads)?;
    let mut points = mesh.points.clone();
    for _ in 0..LEVELS {
        let (split, refined) = topology.split()?;
        points = split.apply(&points);
        topology = refined;
    }
    let [u, v] = topology.limit_tangents().map(|t| t.apply(&points));
    let place_of = topology.limit_positions().apply(&points);
    Ok(Box::new(move |h, along, inward| {
        let [row, column] = place(h, along, inward);
        let v_index = descend(&topology, h / 4, row, column);
        let normal = u[v_index].cross(&v[v_index]).normalize();
        (place_of[v_index], normal)
    }))
}

/// The point of the refined mesh at (row, column) of a quad: child `k` of a quad has the quad's corner `k` first.
fn descend(refined: &QuadTopology, quad: u32, row: u32, column: u32) -> usize {
    // In the frame of the quad; the child's frame is turned by k quarters.
    let (mut quad, mut at, mut size) = (quad, [row, column], 1 << LEVELS);
    for _ in 0..LEVELS {
        let half = size / 2;
        let k = match (at[0] > half, at[1] > half) {
            (false, false) => 0,
            (true, false) => 1,
            (true, true) => 2,
            (false, true) => 3,
        };
        let [x, y] = at;
        at = match k {
            0 => [x, y],
            1 => [y, size - x],
            2 => [size - x, size - y],
            _ => [size - y, x],
        };
        quad = 4 * quad + k;
        size = half;
    }
    let corner = match at {
        [0, 0] => 0,
        [_, 0] => 1,
        [0, _] => 3,
        _ => 2,
    };
    refined.quads[quad as usize][corner] as usize
}

/// The bicubic approximation, degree-raised.
fn bicubic(mesh: &ControlMesh, topology: &QuadTopology) -> Vec<Patch> {
    let point = |v: u32| mesh.points[v as usize];
    let face = |h: u32| {
        let quad = &topology.quads[h as usize / 4];
        let corner = |k: u32| point(quad[((h + k) % 4) as usize]);
        let n = f64::from(topology.valence[quad[(h % 4) as usize] as usize]);
        (corner(0) * n + (corner(1) + corner(3)) * 2.0 + corner(2)) / (n + 5.0)
    };
    let after = |h: u32| h - h % 4 + (h + 1) % 4;
    let edge = |h: u32| (face(h) + face(after(topology.twin[h as usize]))) / 2.0;
    let before = |h: u32| h - h % 4 + (h + 3) % 4;
    let vertex = |v: u32| {
        let ring: Vec<Vec3> = topology.ring(v).map(face).collect();
        ring.iter().sum::<Vec3>() / ring.len() as f64
    };
    let patch = |q: u32| {
        let mut net = [[Vec3::zeros(); 4]; 4];
        for k in 0..4 {
            let h = 4 * q + k;
            let mut set = |along: usize, inward: usize, value: Vec3| {
                let [i, j] = match k {
                    0 => [along, inward],
                    1 => [3 - inward, along],
                    2 => [3 - along, 3 - inward],
                    _ => [inward, 3 - along],
                };
                net[i][j] = value;
            };
            set(0, 0, vertex(topology.quads[q as usize][k as usize]));
            set(1, 0, edge(h));
            set(0, 1, edge(topology.twin[before(h) as usize]));
            set(1, 1, face(h));
        }
        let rows: Vec<[Vec3; 6]> = net.iter().map(raise).collect();
        let columns: [[Vec3; 6]; 6] =
            std::array::from_fn(|j| raise(&std::array::from_fn(|i| rows[i][j])));
        Patch {
            control: std::array::from_fn(|i| std::array::from_fn(|j| columns[j][i])),
        }
    };
    (0..mesh.quads.len() as u32).map(patch).collect()
}

/// A cubic as one of degree 5.
fn raise(&[a, b, c, d]: &[Vec3; 4]) -> [Vec3; 6] {
    [
        a,
        (a * 2.0 + b * 3.0) / 5.0,
        (a + b * 6.0 + c * 3.0) / 10.0,
        (b * 3.0 + c * 6.0 + d) / 10.0,
        (c * 3.0 + d * 2.0) / 5.0,
        d,
    ]
}

/// Largest, 95 %, root mean square (1/mm) and relative jump, and the largest kink (degrees), at the edges of quads with
/// an extraordinary corner.
fn jumps(topology: &QuadTopology, surface: &Surface) -> [f64; 5] {
    let near = |h: u32| {
        let quad = &topology.quads[h as usize / 4];
        quad.iter().any(|v| topology.valence[*v as usize] != 4)
    };
    let n = 1 << LEVELS;
    let (mut all, mut square, mut kink) = (Vec::new(), 0.0, 0.0f64);
    for h in 0..topology.twin.len() as u32 {
        let g = topology.twin[h as usize];
        if h > g || !(near(h) || near(g)) {
            continue;
        }
        for k in 0..n {
            let left = side(surface(h, k, 0), surface(h, k + 1, 0), surface(h, k, 1));
            let right = side(
                surface(g, n - k, 0),
                surface(g, n - k - 1, 0),
                surface(g, n - k, 1),
            );
            let (a, b) = (surface(h, k, 0).1, surface(g, n - k, 0).1);
            kink = kink.max(a.cross(&b).norm().atan2(a.dot(&b)).to_degrees());
            all.push((left[0] - right[0]).abs());
            square += (left[1] * left[1] + right[1] * right[1]) / 2.0;
        }
    }
    all.sort_by(f64::total_cmp);
    let count = all.len() as f64;
    let rms = (all.iter().map(|j| j * j).sum::<f64>() / count).sqrt();
    let share = rms / (square / count).sqrt();
    [
        all[all.len() - 1],
        all[all.len() * 95 / 100],
        rms,
        share,
        kink,
    ]
}

/// Normal curvature across the edge from `p` to `next`, and the larger principal curvature, of the triangle with `inner`:
/// the symmetric shape operator that fits the three differences of normals best.
fn side(p: Point, next: Point, inner: Point) -> [f64; 2] {
    let along = (next.0 - p.0).normalize();
    let normal = (next.0 - p.0).cross(&(inner.0 - p.0)).normalize();
    let across = normal.cross(&along);
    let edges = [(p, next), (p, inner), (next, inner)];
    let mut matrix = nalgebra::Matrix3::zeros();
    let mut right = nalgebra::Vector3::zeros();
    for (a, b) in edges {
        let (d, change) = (b.0 - a.0, b.1 - a.1);
        let [x, y] = [d.dot(&along), d.dot(&across)];
        let rows = [
            (nalgebra::Vector3::new(x, y, 0.0), change.dot(&along)),
            (nalgebra::Vector3::new(0.0, x, y), change.dot(&across)),
        ];
        for (row, value) in rows {
            matrix += row * row.transpose();
            right += row * value;
        }
    }
    let solved = matrix.try_inverse().map_or(right * 0.0, |m| m * right);
    let [a, b, c] = [solved.x, solved.y, solved.z];
    let (mean, gauss) = ((a + c) / 2.0, a * c - b * b);
    let largest = mean.abs() + (mean * mean - gauss).max(0.0).sqrt();
    [c, largest]
}
