//! Readers for tests of the CAD stage: the prototype's B-rep text format, STL, and the corpus folder.
#![allow(dead_code, reason = "every test crate uses some of it")]

use std::path::{Path, PathBuf};

use grassfire::Vec3;
use grassfire::mesh::TriMesh;
use grassfire::spline::{Brep, BrepEdge, BrepFace, BrepUse};

/// Folder of the test corpus, when there is one.
pub fn corpus() -> Option<PathBuf> {
    let beside = || {
        Some(
            Path::new(env!("CARGO_MANIFEST_DIR"))
                .parent()?
                .parent()?
                .join("shared/data"),
        )
    };
    std::env::var_os("GRASSFIRE_CORPUS")
        .map(PathBuf::from)
        .or_else(beside)
        .filter(|p| p.is_dir())
}

/// Text format: counts and volume; vertices; edges (start, end, spans, control points); faces (spans, uses, control
/// points, then per use: edge, reversed, u v at start, u v at end).
pub fn read_brp(path: &Path) -> Option<Brep> {
    let text = std::fs::read_to_string(path).ok()?;
    let mut at = text
        .split_ascii_whitespace()
        .map(|w| w.parse::<f64>().unwrap_or(f64::NAN));
    let [vertices, edges, faces] = [
        at.next()? as usize,
        at.next()? as usize,
        at.next()? as usize,
    ];
    let volume = at.next()?;
    let points = |at: &mut dyn Iterator<Item = f64>, n: usize| -> Option<Vec<Vec3>> {
        (0..n)
            .map(|_| Some(Vec3::new(at.next()?, at.next()?, at.next()?)))
            .collect()
    };
    let vertices = points(&mut at, vertices)?;
    let mut out = Brep {
        vertices,
        volume,
        shells: vec![(0..faces as u32).collect()],
        ..Brep::default()
    };
    for _ in 0..edges {
        let head = [at.next()? as u32, at.next()? as u32, at.next()? as u32];
        let control = points(&mut at, 4 * head[2] as usize + 2)?;
        out.edges.push(BrepEdge {
            vertices: [head[0], head[1]],
            spans: head[2],
            control,
        });
    }
    for _ in 0..faces {
        let [wide, high, uses] = [at.next()? as u32, at.next()? as u32, at.next()? as u32];
        let control = points(&mut at, (4 * wide as usize + 2) * (4 * high as usize + 2))?;
        let mut list = Vec::new();
        for _ in 0..uses {
            let (edge, reversed) = (at.next()? as u32, at.next()? != 0.0);
            list.push(BrepUse {
                edge,
                reversed,
                start: [at.next()?, at.next()?],
                end: [at.next()?, at.next()?],
            });
        }
        out.faces.push(BrepFace {
            spans: [wide, high],
            control,
            uses: list,
        });
    }
    Some(out)
}

/// Binary or text STL as soup.
pub fn read_stl(path: &Path) -> Option<TriMesh> {
    let bytes = std::fs::read(path).ok()?;
    let count = u32::from_le_bytes(bytes.get(80..84)?.try_into().ok()?) as usize;
    let mut points: Vec<Vec3> = Vec::new();
    if bytes.len() == 84 + 50 * count {
        for t in bytes[84..].chunks_exact(50) {
            let f = |k: usize| f64::from(f32::from_le_bytes([t[k], t[k + 1], t[k + 2], t[k + 3]]));
            points
                .extend((0..3).map(|v| Vec3::new(f(12 + 12 * v), f(16 + 12 * v), f(20 + 12 * v))));
        }
    } else {
        for line in String::from_utf8_lossy(&bytes).lines() {
            if let Some(rest) = line.trim().strip_prefix("vertex") {
                let v: Vec<f64> = rest
                    .split_whitespace()
                    .filter_map(|w| w.parse().ok())
                    .collect();
                points.push(Vec3::new(*v.first()?, *v.get(1)?, *v.get(2)?));
            }
        }
    }
    let triangles = (0..points.len() as u32 / 3)
        .map(|t| [3 * t, 3 * t + 1, 3 * t + 2])
        .collect();
    Some(TriMesh {
        points,
        triangles,
        tags: Vec::new(),
    })
}

/// Corners of the six faces of a cuboid (corner k: bit d set = high in direction d), counter-clockwise from outside.
const CUBE: [[usize; 4]; 6] = [
    [0, 2, 3, 1],
    [4, 5, 7, 6],
    [0, 1, 5, 4],
    [2, 6, 7, 3],
    [0, 4, 6, 2],
    [1, 3, 7, 5],
];

/// A cuboid as six bi-5 faces; `inward` makes it a cavity.
pub fn cuboid(low: Vec3, high: Vec3, inward: bool) -> Brep {
    let corner = |k: usize| Vec3::from_fn(|d, _| if k >> d & 1 == 1 { high[d] } else { low[d] });
    let sign = if inward { -1.0 } else { 1.0 };
    let mut out = Brep {
        vertices: (0..8).map(corner).collect(),
        shells: vec![(0..6).collect()],
        volume: sign * (high - low).product(),
        ..Brep::default()
    };
    let mut ids: Vec<[usize; 2]> = Vec::new();
    for mut q in CUBE {
        if inward {
            q.reverse();
        }
        let p = q.map(corner);
        let control = (0..36)
            .map(|k| {
                let (s, t) = (f64::from(k / 6) / 5.0, f64::from(k % 6) / 5.0);
                p[0] * (1.0 - s) * (1.0 - t)
                    + p[1] * s * (1.0 - t)
                    + p[2] * s * t
                    + p[3] * (1.0 - s) * t
            })
            .collect();
        let uv = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let mut uses = Vec::new();
        for k in 0..4 {
            let (a, b) = (q[k], q[(k + 1) % 4]);
            let key = [a.min(b), a.max(b)];
            let edge = ids.iter().position(|e| *e == key).unwrap_or_else(|| {
                ids.push(key);
                let control = (0..6)
                    .map(|i| corner(key[0]).lerp(&corner(key[1]), f64::from(i) / 5.0))
                    .collect();
                out.edges.push(BrepEdge {
                    vertices: key.map(|v| v as u32),
                    spans: 1,
                    control,
                });
                ids.len() - 1
            });
            let reversed = a > b;
            let (start, end) = if reversed {
                (uv[(k + 1) % 4], uv[k])
            } else {
                (uv[k], uv[(k + 1) % 4])
            };
            uses.push(BrepUse {
                edge: edge as u32,
                reversed,
                start,
                end,
            });
        }
        out.faces.push(BrepFace {
            spans: [1, 1],
            control,
            uses,
        });
    }
    out
}

/// Two descriptions in one.
pub fn joined(mut a: Brep, b: &Brep) -> Brep {
    let (v, e, f) = (
        a.vertices.len() as u32,
        a.edges.len() as u32,
        a.faces.len() as u32,
    );
    a.vertices.extend(&b.vertices);
    a.edges.extend(b.edges.iter().map(|x| BrepEdge {
        vertices: x.vertices.map(|i| i + v),
        ..x.clone()
    }));
    a.faces.extend(b.faces.iter().map(|x| {
        let uses = x
            .uses
            .iter()
            .map(|u| BrepUse {
                edge: u.edge + e,
                ..*u
            })
            .collect();
        BrepFace { uses, ..x.clone() }
    }));
    a.shells
        .extend(b.shells.iter().map(|s| s.iter().map(|i| i + f).collect()));
    a.volume += b.volume;
    a
}
