//! Closed control meshes to test with.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use grassfire::Vec3;
use grassfire::spline::ControlMesh;

/// The surface of a set of unit cubes. Not a manifold when cubes touch along edges or in points only.
pub fn voxels(cells: &[[i32; 3]]) -> ControlMesh {
    let solid: BTreeSet<[i32; 3]> = cells.iter().copied().collect();
    let mut numbers = BTreeMap::new();
    let mut mesh = ControlMesh::default();
    for cell in &solid {
        for axis in 0..3 {
            for positive in [false, true] {
                let mut other = *cell;
                other[axis] += if positive { 1 } else { -1 };
                if solid.contains(&other) {
                    continue;
                }
                let mut quad = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[b, c]| {
                    let mut p = *cell;
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
    mesh
}

pub fn block(n: i32) -> ControlMesh {
    let range = 0..n;
    let cells: Vec<[i32; 3]> = range
        .clone()
        .flat_map(|i| {
            range
                .clone()
                .flat_map(move |j| (0..n).map(move |k| [i, j, k]))
        })
        .collect();
    voxels(&cells)
}

/// Valences 3 and 6, every second edge between extraordinary points.
pub fn plus() -> ControlMesh {
    voxels(&[
        [0, 0, 0],
        [1, 0, 0],
        [-1, 0, 0],
        [0, 1, 0],
        [0, -1, 0],
        [0, 0, 1],
        [0, 0, -1],
    ])
}

/// Valences 3, 4, 5 and 6.
pub fn bracket() -> ControlMesh {
    voxels(&[
        [0, 0, 0],
        [1, 0, 0],
        [2, 0, 0],
        [0, 1, 0],
        [0, 0, 1],
        [2, 1, 0],
        [2, 2, 0],
    ])
}

/// A frame of cubes around a hole.
pub fn frame() -> ControlMesh {
    let cells: Vec<[i32; 3]> = (0..5)
        .flat_map(|i| (0..4).map(move |j| [i, j, 0]))
        .filter(|[i, j, _]| *i == 0 || *i == 4 || *j == 0 || *j == 3)
        .collect();
    voxels(&cells)
}

/// A ring of `m` x `n` quads without extraordinary point.
pub fn torus(m: u32, n: u32) -> ControlMesh {
    let angle = |k: u32, of: u32| std::f64::consts::TAU * f64::from(k) / f64::from(of);
    let point = |i: u32, j: u32| {
        let radius = 5.0 + 2.0 * angle(j, n).cos();
        Vec3::new(
            radius * angle(i, m).cos(),
            radius * angle(i, m).sin(),
            2.0 * angle(j, n).sin(),
        )
    };
    let at = |i: u32, j: u32| (i % m) * n + j % n;
    let grid = || (0..m).flat_map(move |i| (0..n).map(move |j| (i, j)));
    ControlMesh {
        points: grid().map(|(i, j)| point(i, j)).collect(),
        quads: grid()
            .map(|(i, j)| [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)])
            .collect(),
    }
}

/// Two closed components in one mesh.
pub fn two_bodies() -> ControlMesh {
    let (mut mesh, mut other) = (torus(9, 6), block(2));
    let shift = mesh.points.len() as u32;
    other.points.iter_mut().for_each(|p| p.z += 10.0);
    other.quads.iter_mut().flatten().for_each(|v| *v += shift);
    mesh.points.append(&mut other.points);
    mesh.quads.append(&mut other.quads);
    mesh
}

/// Moves every point by up to `size` in each direction.
pub fn jitter(mesh: &mut ControlMesh, size: f64, seed: u64) {
    let mut state = seed
        .wrapping_mul(2862933555777941757)
        .wrapping_add(3037000493);
    for x in mesh.points.iter_mut().flat_map(|p| p.iter_mut()) {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        *x += size * ((state >> 11) as f64 / (1u64 << 52) as f64 - 1.0);
    }
}

pub fn all() -> Vec<(&'static str, ControlMesh)> {
    let mut list = vec![
        ("cube", block(1)),
        ("3 x 3 x 3", block(3)),
        ("plus", plus()),
        ("bracket", bracket()),
        ("frame", frame()),
        ("torus", torus(10, 7)),
        ("smallest torus", torus(3, 3)),
        ("two bodies", two_bodies()),
    ];
    for (k, (name, mut mesh)) in list.clone().into_iter().enumerate() {
        jitter(&mut mesh, 0.15, k as u64);
        list.push((name, mesh));
    }
    list
}

/// Control meshes of real parts: `*/fit.obj` and `*/body.obj` below the folder in `GRASSFIRE_BODIES`.
pub fn bodies() -> Vec<(String, ControlMesh)> {
    let Some(folder) = std::env::var_os("GRASSFIRE_BODIES").map(PathBuf::from) else {
        println!("skipped: no bodies (set GRASSFIRE_BODIES to a folder of <part>/fit.obj)");
        return Vec::new();
    };
    let mut parts: Vec<PathBuf> = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.path())
        .collect();
    parts.sort();
    let files = parts
        .iter()
        .flat_map(|part| ["fit.obj", "body.obj"].map(|name| part.join(name)));
    files
        .filter(|file| file.is_file())
        .map(|file| (file.display().to_string(), read_obj(&file)))
        .collect()
}

fn read_obj(file: &std::path::Path) -> ControlMesh {
    let mut mesh = ControlMesh::default();
    for line in std::fs::read_to_string(file)
        .expect("a readable file")
        .lines()
    {
        let words: Vec<&str> = line.split_whitespace().collect();
        let number = |k: usize| words[k].parse::<f64>().expect("a number");
        let index = |k: usize| {
            words[k]
                .split('/')
                .next()
                .and_then(|w| w.parse::<u32>().ok())
                .expect("an index")
                - 1
        };
        match words.first() {
            Some(&"v") => mesh.points.push(Vec3::new(number(1), number(2), number(3))),
            Some(&"f") => mesh.quads.push([index(1), index(2), index(3), index(4)]),
            _ => {}
        }
    }
    mesh
}

/// V - E + F of the points in use.
pub fn euler(mesh: &ControlMesh) -> i64 {
    let used: BTreeSet<u32> = mesh.quads.iter().flatten().copied().collect();
    used.len() as i64 - mesh.quads.len() as i64
}

/// Length of the diagonal of the box around the mesh.
pub fn diagonal(mesh: &ControlMesh) -> f64 {
    let (low, high) = mesh
        .points
        .iter()
        .fold((mesh.points[0], mesh.points[0]), |(l, h), p| {
            (l.inf(p), h.sup(p))
        });
    (high - low).norm()
}
