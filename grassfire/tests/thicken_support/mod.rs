//! Skeletons for tests: generated ones, and ASCII PLY files from the corpus of intermediate stages.
#![allow(dead_code, reason = "every test crate uses some of it")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use grassfire::Vec3;
use grassfire::skeleton::Skeleton;
use grassfire::voxel::VoxelGrid;

/// Builds skeletons from positions; equal positions are one point.
#[derive(Default)]
pub struct Builder {
    pub skeleton: Skeleton,
    index: BTreeMap<[i64; 3], u32>,
    pub radius: f64,
}

impl Builder {
    pub fn new(radius: f64) -> Self {
        Self {
            radius,
            ..Self::default()
        }
    }

    pub fn point(&mut self, p: Vec3) -> u32 {
        let key = [0, 1, 2].map(|a| (p[a] * 1e6).round() as i64);
        *self.index.entry(key).or_insert_with(|| {
            self.skeleton.points.push(p);
            self.skeleton.radii.push(self.radius);
            self.skeleton.points.len() as u32 - 1
        })
    }

    /// An n x m grid spanned by `u` and `v` from `origin`; cells for which `hole(i, j)` are left out.
    pub fn sheet_with_holes(
        &mut self,
        origin: Vec3,
        [u, v]: [Vec3; 2],
        [n, m]: [usize; 2],
        hole: impl Fn(usize, usize) -> bool,
    ) {
        for i in 0..n {
            for j in 0..m {
                if !hole(i, j) {
                    let at = |i: usize, j: usize| {
                        origin + u * i as f64 / n as f64 + v * j as f64 / m as f64
                    };
                    let corners = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                    let quad = corners.map(|p| self.point(p));
                    // Cycles are not coherent in real skeletons either.
                    let quad = if (i * 7 + j * 3) % 5 < 2 {
                        [quad[3], quad[2], quad[1], quad[0]]
                    } else {
                        quad
                    };
                    self.skeleton.quads.push(quad);
                }
            }
        }
    }

    pub fn sheet(&mut self, origin: Vec3, axes: [Vec3; 2], count: [usize; 2]) {
        self.sheet_with_holes(origin, axes, count, |_, _| false);
    }

    /// `count` beams from `a` to `b`.
    pub fn beam(&mut self, a: Vec3, b: Vec3, count: usize) {
        for k in 0..count {
            let at = |k: usize| a + (b - a) * (k as f64 / count as f64);
            let ends = [self.point(at(k)), self.point(at(k + 1))];
            self.skeleton.beams.push(ends);
        }
    }
}

pub fn v(x: f64, y: f64, z: f64) -> Vec3 {
    Vec3::new(x, y, z)
}

pub fn x(l: f64) -> Vec3 {
    v(l, 0.0, 0.0)
}

pub fn y(l: f64) -> Vec3 {
    v(0.0, l, 0.0)
}

pub fn z(l: f64) -> Vec3 {
    v(0.0, 0.0, l)
}

/// V - E + F of a skeleton over its used points.
pub fn chi(skeleton: &Skeleton) -> i64 {
    let mut edges = std::collections::BTreeSet::new();
    for q in &skeleton.quads {
        for k in 0..4 {
            let (a, b) = (q[k], q[(k + 1) % 4]);
            edges.insert([a.min(b), a.max(b)]);
        }
    }
    for b in &skeleton.beams {
        edges.insert([b[0].min(b[1]), b[0].max(b[1])]);
    }
    let points: std::collections::BTreeSet<u32> = edges.iter().flatten().copied().collect();
    points.len() as i64 - edges.len() as i64 + skeleton.quads.len() as i64
}

/// Folder of intermediate stages (`<part>/skeleton.ply`, `field.npy`, `field.json`), if there is one.
pub fn stages() -> Option<PathBuf> {
    let folder = std::env::var_os("GRASSFIRE_STAGES").map(PathBuf::from);
    let found = folder.filter(|f| f.is_dir());
    if found.is_none() {
        println!("skipped: no corpus of stages");
    }
    found
}

/// ASCII PLY with vertices (x, y, z, radius), quads and edges.
pub fn read_skeleton(path: &Path) -> Skeleton {
    let text = std::fs::read_to_string(path).expect("skeleton file");
    let (header, data) = text.split_once("end_header\n").expect("PLY header");
    let count = |name: &str| -> usize {
        let line = header
            .lines()
            .find(|l| l.starts_with(&format!("element {name} ")));
        line.and_then(|l| l.rsplit(' ').next())
            .and_then(|n| n.parse().ok())
            .unwrap_or(0)
    };
    let mut lines = data.lines().map(|l| {
        l.split_whitespace()
            .map(|w| w.parse::<f64>().expect("number"))
            .collect::<Vec<_>>()
    });
    let mut skeleton = Skeleton::default();
    for row in lines.by_ref().take(count("vertex")) {
        skeleton.points.push(v(row[0], row[1], row[2]));
        skeleton.radii.push(row[3]);
    }
    for row in lines.by_ref().take(count("face")) {
        skeleton
            .quads
            .push([row[1] as u32, row[2] as u32, row[3] as u32, row[4] as u32]);
    }
    for row in lines.take(count("edge")) {
        skeleton.beams.push([row[0] as u32, row[1] as u32]);
    }
    skeleton
}

/// The signed field of one part: `field.npy` (z, y, x; float32) and `field.json`.
pub fn read_field(folder: &Path) -> VoxelGrid<f32> {
    let json = std::fs::read_to_string(folder.join("field.json")).expect("field.json");
    let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    let number = |value: &serde_json::Value| value.as_f64().expect("number");
    let bytes = std::fs::read(folder.join("field.npy")).expect("field.npy");
    let header = u16::from_le_bytes([bytes[8], bytes[9]]) as usize;
    let values = bytes[10 + header..]
        .chunks_exact(4)
        .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
        .collect();
    VoxelGrid {
        origin: v(
            number(&json["origin"][0]),
            number(&json["origin"][1]),
            number(&json["origin"][2]),
        ),
        spacing: number(&json["spacing"]),
        dims: [0, 1, 2].map(|a| number(&json["dims"][a]) as usize),
        values,
    }
}
