//! Cuts faces of a B-rep description into single polynomial pieces.
//!
//! The kernel's intersections of a cylinder with a face of many spans sometimes lose a branch, whatever the fuzzy value;
//! with one span a face they do not.

use std::collections::BTreeMap;

use super::patches;
use crate::Vec3;
use crate::spline::{Brep, BrepEdge, BrepFace, BrepUse};

type Grid = [u32; 2];

/// The same body with each `wanted` face replaced by one face a span.
///
/// 1. Edges of wanted faces become one edge a span; faces beside them get longer loops.
/// 2. Each wanted face gets its inner grid vertices and edges.
pub(crate) fn split(brep: &Brep, wanted: &[bool]) -> Brep {
    let mut out = Brep {
        vertices: brep.vertices.clone(),
        volume: brep.volume,
        ..Brep::default()
    };
    let pieces = split_edges(brep, wanted, &mut out);
    let mut new_faces = Vec::with_capacity(brep.faces.len());
    for (f, face) in brep.faces.iter().enumerate() {
        let first = out.faces.len() as u32;
        let uses: Vec<BrepUse> = face
            .uses
            .iter()
            .flat_map(|u| split_use(u, &pieces[u.edge as usize]))
            .collect();
        if wanted[f] && face.spans != [1, 1] {
            split_face(face, &uses, &mut out);
        } else {
            out.faces.push(BrepFace {
                uses,
                ..face.clone()
            });
        }
        new_faces.push(first..out.faces.len() as u32);
    }
    out.shells = brep
        .shells
        .iter()
        .map(|s| {
            s.iter()
                .flat_map(|&f| new_faces[f as usize].clone())
                .collect()
        })
        .collect();
    out
}

/// New edges of each old one, in its own direction.
fn split_edges(brep: &Brep, wanted: &[bool], out: &mut Brep) -> Vec<Vec<u32>> {
    let mut cut = vec![false; brep.edges.len()];
    for (face, _) in brep.faces.iter().zip(wanted).filter(|(_, w)| **w) {
        face.uses.iter().for_each(|u| cut[u.edge as usize] = true);
    }
    let mut pieces = Vec::with_capacity(brep.edges.len());
    for (edge, cut) in brep.edges.iter().zip(cut) {
        let first = out.edges.len() as u32;
        if !cut || edge.spans == 1 {
            out.edges.push(edge.clone());
        } else {
            let mut from = edge.vertices[0];
            for span in 0..edge.spans {
                let control = patches::edge_bezier(edge, span as usize);
                let to = if span + 1 == edge.spans {
                    edge.vertices[1]
                } else {
                    add_vertex(out, control[5])
                };
                out.edges.push(BrepEdge {
                    vertices: [from, to],
                    spans: 1,
                    control: control.to_vec(),
                });
                from = to;
            }
        }
        pieces.push((first..out.edges.len() as u32).collect());
    }
    pieces
}

fn add_vertex(out: &mut Brep, place: Vec3) -> u32 {
    out.vertices.push(place);
    out.vertices.len() as u32 - 1
}

/// The uses that replace one use, in loop order.
fn split_use(old: &BrepUse, pieces: &[u32]) -> Vec<BrepUse> {
    let n = pieces.len();
    let at =
        |k: usize| [0, 1].map(|d| old.start[d] + (old.end[d] - old.start[d]) * k as f64 / n as f64);
    let mut out: Vec<BrepUse> = (0..n)
        .map(|k| BrepUse {
            edge: pieces[k],
            reversed: old.reversed,
            start: at(k),
            end: at(k + 1),
        })
        .collect();
    if old.reversed {
        out.reverse();
    }
    out
}

/// Grid points of one face with their vertices, and grid lines with their edges.
struct Cells {
    vertices: BTreeMap<Grid, u32>,
    /// From the smaller to the larger grid point: edge, and whether it runs against that.
    edges: BTreeMap<[Grid; 2], (u32, bool)>,
}

fn split_face(face: &BrepFace, uses: &[BrepUse], out: &mut Brep) {
    let [wide, high] = face.spans;
    let mut cells = Cells {
        vertices: BTreeMap::new(),
        edges: BTreeMap::new(),
    };
    for u in uses {
        let [a, b] = [u.start, u.end].map(|p| p.map(|x| x.round() as u32));
        let ends = out.edges[u.edge as usize].vertices;
        cells.vertices.insert(a, ends[0]);
        cells.vertices.insert(b, ends[1]);
        cells.edges.insert([a.min(b), a.max(b)], (u.edge, a > b));
    }
    for i in 0..wide {
        for j in 0..high {
            let patch = patches::bezier(face, i as usize, j as usize);
            let mut vertex = |cells: &mut Cells, at: Grid, place: Vec3| {
                *cells
                    .vertices
                    .entry(at)
                    .or_insert_with(|| add_vertex(out, place))
            };
            let here = vertex(&mut cells, [i, j], patch[0][0]);
            let right = vertex(&mut cells, [i + 1, j], patch[5][0]);
            let above = vertex(&mut cells, [i, j + 1], patch[0][5]);
            let rows = [
                ([i + 1, j], right, patch.map(|c| c[0])),
                ([i, j + 1], above, patch[0]),
            ];
            for (to, vertex, control) in rows {
                cells.edges.entry([[i, j], to]).or_insert_with(|| {
                    out.edges.push(BrepEdge {
                        vertices: [here, vertex],
                        spans: 1,
                        control: control.to_vec(),
                    });
                    (out.edges.len() as u32 - 1, false)
                });
            }
        }
    }
    for i in 0..wide {
        for j in 0..high {
            let patch = patches::bezier(face, i as usize, j as usize);
            let corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]];
            let uses = (0..4)
                .filter_map(|k| cell_use(&cells, [i, j], corners[k], corners[(k + 1) % 4]))
                .collect();
            out.faces.push(BrepFace {
                spans: [1, 1],
                control: patch.as_flattened().to_vec(),
                uses,
            });
        }
    }
}

fn cell_use(cells: &Cells, cell: Grid, a: Grid, b: Grid) -> Option<BrepUse> {
    let &(edge, against) = cells.edges.get(&[a.min(b), a.max(b)])?;
    let reversed = (a > b) != against;
    let [pa, pb] = [a, b].map(|p| [0, 1].map(|d| f64::from(p[d] - cell[d])));
    let (start, end) = if reversed { (pb, pa) } else { (pa, pb) };
    Some(BrepUse {
        edge,
        reversed,
        start,
        end,
    })
}
