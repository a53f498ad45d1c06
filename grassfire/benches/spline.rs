//! Cost of the spline stage per quad on gyroid bodies of growing size: everything should stay linear.
//!
//! Run with `cargo bench --bench spline`. Prints seconds for each step and the cost per quad relative to the smallest body.

use std::collections::HashMap;
use std::time::Instant;

use grassfire::Vec3;
use grassfire::monitor::Monitor;
use grassfire::spline::{
    BrepOptions, ControlMesh, PatchOptions, TessellateOptions, build_brep, g1_max, patches,
    tessellate,
};

fn main() {
    println!(
        "{:>8} {:>8} {:>9} {:>9} {:>9} {:>9}   relative cost per quad",
        "quads", "faces", "patches", "brep", "g1", "triangles"
    );
    let mut first = None;
    for cells in [12, 24, 48] {
        let mesh = gyroid(cells);
        let monitor = Monitor::default();
        let mut seconds = Vec::new();
        let mut clock = Instant::now();
        let mut lap = || {
            seconds.push(clock.elapsed().as_secs_f64());
            clock = Instant::now();
        };
        let patches = patches(&mesh, &PatchOptions::default(), &monitor).expect("a closed mesh");
        lap();
        let brep =
            build_brep(&mesh, &patches, &BrepOptions::default(), &monitor).expect("a closed mesh");
        lap();
        g1_max(&mesh, &patches).expect("a closed mesh");
        lap();
        let options = TessellateOptions {
            divisions: Some(4),
            ..TessellateOptions::default()
        };
        tessellate(&mesh, &patches, &options).expect("a closed mesh");
        lap();
        let cost: Vec<f64> = seconds
            .iter()
            .map(|s| s / mesh.quads.len() as f64)
            .collect();
        let base = first.get_or_insert_with(|| cost.clone());
        let ratios: Vec<String> = cost
            .iter()
            .zip(base)
            .map(|(a, b)| format!("{:.2}", a / *b))
            .collect();
        println!(
            "{:>8} {:>8} {:>9.4} {:>9.4} {:>9.4} {:>9.4}   {}",
            mesh.quads.len(),
            brep.faces.len(),
            seconds[0],
            seconds[1],
            seconds[2],
            seconds[3],
            ratios.join(" ")
        );
    }
}

/// Quads between the filled and the empty cells of a gyroid, every cell made of 2 x 2 x 2 voxels so that no two touch
/// along an edge only; points where they would are kept apart by filling the cells around.
fn gyroid(cells: i32) -> ControlMesh {
    let inside = |p: [i32; 3]| {
        let [x, y, z] = p.map(|k| f64::from(k) * 0.7);
        p.iter().all(|k| (0..cells).contains(k))
            && x.sin() * y.cos() + y.sin() * z.cos() + z.sin() * x.cos() < 0.2
    };
    let mut filled: HashMap<[i32; 3], bool> = HashMap::new();
    let range = -1..=cells;
    for i in range.clone() {
        for j in range.clone() {
            for k in range.clone() {
                filled.insert([i, j, k], inside([i, j, k]));
            }
        }
    }
    while separate(&mut filled, cells) {}
    surface(&filled, cells)
}

/// Fills cells around points where the surface would not be a manifold; true when something changed.
fn separate(filled: &mut HashMap<[i32; 3], bool>, cells: i32) -> bool {
    let mut changed = false;
    for i in 0..cells - 1 {
        for j in 0..cells - 1 {
            for k in 0..cells - 1 {
                let corner: Vec<[i32; 3]> = (0..8)
                    .map(|b| [i + (b & 1), j + (b >> 1 & 1), k + (b >> 2)])
                    .collect();
                let bits: Vec<bool> = corner.iter().map(|c| filled[c]).collect();
                if !(connected(&bits, true) && connected(&bits, false)) {
                    corner.iter().for_each(|c| {
                        filled.insert(*c, true);
                    });
                    changed = true;
                }
            }
        }
    }
    changed
}

/// The cells of one kind around a point hang together by faces.
fn connected(bits: &[bool], kind: bool) -> bool {
    let members: Vec<usize> = (0..8).filter(|b| bits[*b] == kind).collect();
    let Some(&start) = members.first() else {
        return true;
    };
    let mut reached = vec![start];
    let mut done = 0;
    while done < reached.len() {
        for axis in [1, 2, 4] {
            let next = reached[done] ^ axis;
            if bits[next] == kind && !reached.contains(&next) {
                reached.push(next);
            }
        }
        done += 1;
    }
    reached.len() == members.len()
}

fn surface(filled: &HashMap<[i32; 3], bool>, cells: i32) -> ControlMesh {
    let mut numbers: HashMap<[i32; 3], u32> = HashMap::new();
    let mut mesh = ControlMesh::default();
    let is_filled = |p: &[i32; 3]| filled.get(p).copied().unwrap_or(false);
    for i in 0..cells {
        for j in 0..cells {
            for k in 0..cells {
                let cell = [i, j, k];
                for side in 0..6 {
                    let (axis, positive) = (side / 2, side % 2 == 1);
                    let mut other = cell;
                    other[axis] += if positive { 1 } else { -1 };
                    if !is_filled(&cell) || is_filled(&other) {
                        continue;
                    }
                    let mut quad = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[b, c]| {
                        let mut p = cell;
                        p[axis] += i32::from(positive);
                        p[(axis + 1) % 3] += b;
                        p[(axis + 2) % 3] += c;
                        *numbers.entry(p).or_insert_with(|| {
                            mesh.points
                                .push(Vec3::new(p[0].into(), p[1].into(), p[2].into()));
                            mesh.points.len() as u32 - 1
                        })
                    });
                    if !positive {
                        quad.reverse();
                    }
                    mesh.quads.push(quad);
                }
            }
        }
    }
    mesh
}
