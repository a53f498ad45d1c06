//! Boundary representation: few B-spline faces with shared edges and exact parameter curves.

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::blocks::{Block, rectangular_blocks, single_quads};
use super::half_edges::{QuadTopology, connect};
use super::motorcycle::cut_lines;
use super::{Brep, BrepEdge, BrepFace, BrepUse, ControlMesh, Patch, STAGE, SplineError, volume};
use crate::Vec3;
use crate::monitor::Monitor;

/// How quads are put together to faces.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FaceMode {
    /// Rectangular blocks of many quads, as few as there are without changing the surface.
    #[default]
    Exact,
    /// The same on a coarser control mesh, which is fitted again: fewer faces, and the surface moves a little.
    /// [`build_brep`] itself treats it as `exact`.
    Fewest,
    /// One face a quad: many faces, sometimes easier for the booleans of a CAD kernel.
    Quads,
}

/// Options of [`build_brep`].
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct BrepOptions {
    /// How quads are put together to faces.
    pub faces: FaceMode,
    /// How far `fewest` may move the surface, mm; half a voxel when not given.
    pub tolerance: Option<f64>,
}

/// Puts the patches together to a boundary representation.
///
/// 1. Cut the control mesh along the motorcycle graph of its extraordinary points into rectangular blocks; cut rings
///    and blocks that meet themselves once more.
/// 2. The patches of a block join C1, so the block is one B-spline surface of degree 5 with inner knots of
///    multiplicity 4: every fifth control row of the joined Bezier nets is dropped.
/// 3. Points where block sides end are vertices; a side is split into edges at every vertex on it, also where only the
///    other side has a corner (T-junction). Edge curves are the joined boundary rows.
/// 4. An edge lies on a straight side of the parameter rectangle and runs at the same speed, so its parameter curve
///    is a straight line, exactly.
/// 5. Shells are the connected components.
///
/// # Errors
/// As for [`super::patches`]; [`SplineError::NotSmooth`] when the patches were not made from this mesh. The result is
/// checked: every edge used twice in opposite senses, closed loops, no face that uses an edge or visits a vertex
/// twice, and the Euler number of the control mesh.
pub fn build_brep(
    mesh: &ControlMesh,
    patches: &[Patch],
    options: &BrepOptions,
    monitor: &Monitor,
) -> Result<Brep, SplineError> {
    let half_edges = connect(mesh)?;
    if patches.len() != mesh.quads.len() {
        return Err(SplineError::PatchCount {
            patches: patches.len(),
            quads: mesh.quads.len(),
        });
    }
    monitor.step(STAGE, "blocks", 0.0)?;
    let (blocks, cut) = layout(mesh, &half_edges, options)?;
    monitor.step(STAGE, "faces", 0.3)?;
    let wires = wires(&half_edges, &cut, &blocks)?;
    let limit = smoothness_limit(mesh);
    let nets: Vec<(Vec<Vec3>, f64)> = blocks
        .par_iter()
        .map(|block| control_net(patches, block))
        .collect();
    if let Some(k) = nets
        .iter()
        .position(|(_, miss)| miss.is_nan() || *miss > limit)
    {
        let quad = blocks[k].cells[0].quad as usize;
        let place = mesh.points[mesh.quads[quad][0] as usize].into();
        return Err(SplineError::NotSmooth {
            quad,
            place,
            value: nets[k].1,
            limit,
        });
    }
    monitor.step(STAGE, "edges", 0.7)?;
    let faces: Vec<BrepFace> = blocks
        .iter()
        .zip(nets)
        .zip(wires.uses)
        .map(|((block, (control, _)), uses)| BrepFace {
            spans: block.spans,
            control,
            uses,
        })
        .collect();
    let edges: Vec<BrepEdge> = wires
        .chains
        .par_iter()
        .map(|chain| edge(&half_edges, patches, &wires.number, chain))
        .collect();
    let vertices = wires
        .vertices
        .iter()
        .map(|&v| corner(patches, half_edges.outgoing[v as usize]))
        .collect();
    let shells = shells(&faces, edges.len());
    let brep = Brep {
        vertices,
        edges,
        faces,
        shells,
        volume: volume(patches),
    };
    check(&brep, half_edges.euler())?;
    monitor.step(STAGE, "boundary representation", 1.0)?;
    Ok(brep)
}

/// The blocks of faces, and which half-edges lie on their borders.
fn layout(
    mesh: &ControlMesh,
    half_edges: &QuadTopology,
    options: &BrepOptions,
) -> Result<(Vec<Block>, Vec<bool>), SplineError> {
    Ok(match options.faces {
        FaceMode::Exact | FaceMode::Fewest => {
            let mut cut = cut_lines(half_edges);
            (rectangular_blocks(mesh, half_edges, &mut cut)?, cut)
        }
        FaceMode::Quads => {
            let mut cut = vec![false; half_edges.twin.len()];
            (single_quads(half_edges, &mut cut), cut)
        }
    })
}

/// Which half-edges lie on borders of faces.
pub(super) fn border_lines(
    mesh: &ControlMesh,
    half_edges: &QuadTopology,
    options: &BrepOptions,
) -> Result<Vec<bool>, SplineError> {
    layout(mesh, half_edges, options).map(|(_, cut)| cut)
}

/// Which mesh points are vertices of the B-rep: where border lines end or meet.
pub(super) fn vertices(half_edges: &QuadTopology, cut: &[bool]) -> Vec<u32> {
    let mut degree = vec![0u32; half_edges.valence.len()];
    for (h, _) in cut.iter().enumerate().filter(|(_, c)| **c) {
        degree[half_edges.origin(h as u32) as usize] += 1;
    }
    (0..degree.len() as u32)
        .filter(|&v| degree[v as usize] != 0 && degree[v as usize] != 2)
        .collect()
}

/// Distance that rounding may cause between control points that should be equal.
fn smoothness_limit(mesh: &ControlMesh) -> f64 {
    let largest = mesh.points.iter().fold(0.0f64, |m, p| m.max(p.amax()));
    1e-10 * largest.max(f64::MIN_POSITIVE)
}

/// Edges as chains of half-edges and their uses by the blocks.
struct Wires {
    /// Mesh points that are vertices, ascending.
    vertices: Vec<u32>,
    /// Number of the vertex of each mesh point, `u32::MAX` for all others.
    number: Vec<u32>,
    chains: Vec<Vec<u32>>,
    uses: Vec<Vec<BrepUse>>,
}

fn wires(half_edges: &QuadTopology, cut: &[bool], blocks: &[Block]) -> Result<Wires, SplineError> {
    let vertices = vertices(half_edges, cut);
    let mut number = vec![u32::MAX; half_edges.valence.len()];
    vertices
        .iter()
        .enumerate()
        .for_each(|(k, &v)| number[v as usize] = k as u32);
    // The edge that starts with each half-edge, and whether it runs against the first chain that was found.
    let mut known: Vec<Option<(u32, bool)>> = vec![None; half_edges.twin.len()];
    let mut wires = Wires {
        vertices,
        number,
        chains: Vec::new(),
        uses: Vec::with_capacity(blocks.len()),
    };
    for (index, block) in blocks.iter().enumerate() {
        let mut uses = Vec::new();
        for d in 0..4 {
            let side = block.side(d);
            let mut from = 0;
            while from < side.len() {
                let is_vertex = |h: u32| wires.number[half_edges.origin(h) as usize] != u32::MAX;
                if !is_vertex(side[from]) {
                    return Err(SplineError::Inconsistent {
                        rule: "a block corner is a vertex",
                        index,
                    });
                }
                let to = (from + 1..side.len())
                    .find(|&k| is_vertex(side[k]))
                    .unwrap_or(side.len());
                let (first, last) = (side[from], side[to - 1]);
                let (edge, reversed) = known[first as usize].unwrap_or_else(|| {
                    let edge = wires.chains.len() as u32;
                    wires.chains.push(side[from..to].to_vec());
                    known[first as usize] = Some((edge, false));
                    known[half_edges.twin[last as usize] as usize] = Some((edge, true));
                    (edge, false)
                });
                let [start, end] = [from, to].map(|t| block.parameters(d, t as u32).map(f64::from));
                let (start, end) = if reversed { (end, start) } else { (start, end) };
                uses.push(BrepUse {
                    edge,
                    reversed,
                    start,
                    end,
                });
                from = to;
            }
        }
        wires.uses.push(uses);
    }
    Ok(wires)
}

/// The Bezier points of a cell, turned to the axes of its block.
fn turned(patch: &Patch, turn: u8, i: usize, j: usize) -> Vec3 {
    match turn {
        0 => patch.control[i][j],
        1 => patch.control[j][5 - i],
        2 => patch.control[5 - i][5 - j],
        _ => patch.control[5 - j][i],
    }
}

/// Control net of the B-spline surface of a block and the largest miss of a C1 joint, mm.
fn control_net(patches: &[Patch], block: &Block) -> (Vec<Vec3>, f64) {
    let [w, h] = block.spans.map(|n| n as usize);
    let [rows, columns] = [5 * w + 1, 5 * h + 1];
    let mut net = vec![Vec3::zeros(); rows * columns];
    for x in 0..w {
        for y in 0..h {
            let cell = block.cell(x as u32, y as u32);
            let patch = &patches[cell.quad as usize];
            for i in 0..6 {
                for j in 0..6 {
                    net[(5 * x + i) * columns + 5 * y + j] = turned(patch, cell.turn, i, j);
                }
            }
        }
    }
    let mut miss = 0.0f64;
    for i in 0..rows {
        for j in 0..columns {
            let at = |i: usize, j: usize| net[i * columns + j];
            if is_joint(i, w) {
                miss = miss.max((at(i, j) - (at(i - 1, j) + at(i + 1, j)) / 2.0).norm());
            }
            if is_joint(j, h) {
                miss = miss.max((at(i, j) - (at(i, j - 1) + at(i, j + 1)) / 2.0).norm());
            }
        }
    }
    let kept = (0..rows).filter(|&i| !is_joint(i, w)).flat_map(|i| {
        let net = &net;
        (0..columns)
            .filter(move |&j| !is_joint(j, h))
            .map(move |j| net[i * columns + j])
    });
    (kept.collect(), miss)
}

/// Control row `i` lies between two of `spans` Bezier spans and follows from its neighbours.
fn is_joint(i: usize, spans: usize) -> bool {
    i.is_multiple_of(5) && i > 0 && i < 5 * spans
}

/// The Bezier points of half-edge `h`.
fn row(patches: &[Patch], h: u32) -> [Vec3; 6] {
    let control = &patches[h as usize / 4].control;
    std::array::from_fn(|k| match h & 3 {
        0 => control[k][0],
        1 => control[5][k],
        2 => control[5 - k][5],
        _ => control[0][5 - k],
    })
}

fn corner(patches: &[Patch], h: u32) -> Vec3 {
    row(patches, h)[0]
}

fn edge(half_edges: &QuadTopology, patches: &[Patch], number: &[u32], chain: &[u32]) -> BrepEdge {
    let mut control = Vec::with_capacity(4 * chain.len() + 2);
    for (k, &h) in chain.iter().enumerate() {
        let row = row(patches, h);
        let from = usize::from(k > 0);
        let to = if k + 1 < chain.len() { 5 } else { 6 };
        control.extend_from_slice(&row[from..to]);
    }
    let ends = [
        half_edges.origin(chain[0]),
        half_edges.head(chain[chain.len() - 1]),
    ];
    BrepEdge {
        vertices: ends.map(|v| number[v as usize]),
        spans: chain.len() as u32,
        control,
    }
}

/// Faces of each connected component, ascending.
fn shells(faces: &[BrepFace], edges: usize) -> Vec<Vec<u32>> {
    let mut sides = vec![[u32::MAX; 2]; edges];
    for (f, face) in faces.iter().enumerate() {
        for side in &face.uses {
            sides[side.edge as usize][usize::from(side.reversed)] = f as u32;
        }
    }
    let mut seen = vec![false; faces.len()];
    let mut shells = Vec::new();
    for start in 0..faces.len() as u32 {
        if std::mem::replace(&mut seen[start as usize], true) {
            continue;
        }
        let mut shell = vec![start];
        let mut done = 0;
        while done < shell.len() {
            for side in &faces[shell[done] as usize].uses {
                for f in sides[side.edge as usize] {
                    if f != u32::MAX && !std::mem::replace(&mut seen[f as usize], true) {
                        shell.push(f);
                    }
                }
            }
            done += 1;
        }
        shell.sort_unstable();
        shells.push(shell);
    }
    shells
}

/// What a CAD kernel relies on.
fn check(brep: &Brep, euler: i64) -> Result<(), SplineError> {
    let broken = |rule, index| Err(SplineError::Inconsistent { rule, index });
    let mut uses = vec![[0u32; 2]; brep.edges.len()];
    for (f, face) in brep.faces.iter().enumerate() {
        let mut visited = Vec::with_capacity(face.uses.len());
        for (k, side) in face.uses.iter().enumerate() {
            let after = &face.uses[(k + 1) % face.uses.len()];
            uses[side.edge as usize][usize::from(side.reversed)] += 1;
            let (_, end) = directed(brep, side);
            let (start, _) = directed(brep, after);
            if end != start {
                return broken("a loop is closed", f);
            }
            visited.push(end.0);
        }
        visited.sort_unstable();
        if visited.windows(2).any(|pair| pair[0] == pair[1]) {
            return broken("a face visits a vertex once", f);
        }
    }
    if let Some(e) = uses.iter().position(|u| *u != [1, 1]) {
        return broken("an edge is used once in each sense", e);
    }
    let value = brep.vertices.len() as i64 - brep.edges.len() as i64 + brep.faces.len() as i64;
    if value != euler {
        return Err(SplineError::Euler {
            value,
            expected: euler,
        });
    }
    Ok(())
}

/// Vertex and surface parameters at the start and at the end of a use.
fn directed(brep: &Brep, side: &BrepUse) -> ((u32, [f64; 2]), (u32, [f64; 2])) {
    let [a, b] = brep.edges[side.edge as usize].vertices;
    let (start, end) = ((a, side.start), (b, side.end));
    if side.reversed {
        (end, start)
    } else {
        (start, end)
    }
}
