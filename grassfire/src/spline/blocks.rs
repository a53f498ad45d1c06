//! Rectangular blocks of quads between cutting lines.

use super::half_edges::QuadTopology;
use super::motorcycle::mark;
use super::{ControlMesh, SplineError};

/// A quad within a block.
#[derive(Clone, Copy, Default)]
pub(super) struct Cell {
    pub quad: u32,
    /// Quarter turns from the quad to the block: side `k` of the quad is side `k + turn` of the cell.
    pub turn: u8,
}

impl Cell {
    /// The half-edge of the quad on side `d` of the cell (0 bottom, 1 right, 2 top, 3 left).
    pub fn side(self, d: u32) -> u32 {
        4 * self.quad + ((d + 4 - u32::from(self.turn)) & 3)
    }
}

/// A rectangle of quads.
pub(super) struct Block {
    /// Cells along u and v.
    pub spans: [u32; 2],
    /// Cells, v fastest.
    pub cells: Vec<Cell>,
}

impl Block {
    /// The cell in column `i` and row `j`.
    pub fn cell(&self, i: u32, j: u32) -> Cell {
        self.cells[(i * self.spans[1] + j) as usize]
    }

    /// Half-edges of side `d`, counter-clockwise.
    pub fn side(&self, d: u32) -> Vec<u32> {
        let [w, h] = self.spans;
        match d {
            0 => (0..w).map(|i| self.cell(i, 0).side(0)).collect(),
            1 => (0..h).map(|j| self.cell(w - 1, j).side(1)).collect(),
            2 => (0..w).rev().map(|i| self.cell(i, h - 1).side(2)).collect(),
            _ => (0..h).rev().map(|j| self.cell(0, j).side(3)).collect(),
        }
    }

    /// Parameters of the lattice point `t` of side `d`, counter-clockwise.
    pub fn parameters(&self, d: u32, t: u32) -> [u32; 2] {
        let [w, h] = self.spans;
        match d {
            0 => [t, 0],
            1 => [w, t],
            2 => [w - t, h],
            _ => [0, h - t],
        }
    }

    /// The blocks left and right of (`axis` 0) or below and above (`axis` 1) lattice line `at`.
    fn split(&self, axis: usize, at: u32) -> [Self; 2] {
        let part = |from: u32, to: u32| {
            let mut low = [0, 0];
            let mut high = self.spans;
            (low[axis], high[axis]) = (from, to);
            let cells = (low[0]..high[0]).flat_map(|i| (low[1]..high[1]).map(move |j| (i, j)));
            Self {
                spans: [high[0] - low[0], high[1] - low[1]],
                cells: cells.map(|(i, j)| self.cell(i, j)).collect(),
            }
        };
        [part(0, at), part(at, self.spans[axis])]
    }

    /// Half-edges along lattice line `at`.
    fn line(&self, axis: usize, at: u32) -> Vec<u32> {
        if axis == 0 {
            (0..self.spans[1])
                .map(|j| self.cell(at, j).side(3))
                .collect()
        } else {
            (0..self.spans[0])
                .map(|i| self.cell(i, at).side(0))
                .collect()
        }
    }
}

/// One block a quad; marks every half-edge.
pub(super) fn single_quads(half_edges: &QuadTopology, cut: &mut [bool]) -> Vec<Block> {
    cut.fill(true);
    (0..half_edges.len() / 4)
        .map(|quad| Block {
            spans: [1, 1],
            cells: vec![Cell { quad, turn: 0 }],
        })
        .collect()
}

/// Lays the quads between the cuts out as rectangles.
///
/// 1. Collect the quads that hang together and place them on the integer grid.
/// 2. A ring of quads (no corners) does not fit on the grid: cut it across and lay it out again.
/// 3. A block that meets itself, in an edge or only in a point, is cut along the lattice line that separates most such
///    meetings: kernels accept such faces but meshers do not.
///
/// Cuts are added to `cut`.
pub(super) fn rectangular_blocks(
    mesh: &ControlMesh,
    half_edges: &QuadTopology,
    cut: &mut [bool],
) -> Result<Vec<Block>, SplineError> {
    let quads = mesh.quads.len();
    let mut layout = Layout {
        half_edges,
        position: vec![[0; 2]; quads],
        turn: vec![0; quads],
        placed: vec![false; quads],
    };
    let mut blocks = Vec::new();
    for seed in 0..quads as u32 {
        while !layout.placed[seed as usize] {
            let members = layout.place(cut, seed);
            if let Some(block) = layout.rectangle(cut, &members) {
                blocks.push(block);
                continue;
            }
            let Some(across) = layout.cut_across(cut, &members) else {
                return Err(not_rectangular(mesh, seed));
            };
            across.iter().for_each(|&h| mark(half_edges, cut, h));
            members
                .iter()
                .for_each(|&q| layout.placed[q as usize] = false);
        }
    }
    separate(mesh, half_edges, cut, blocks)
}

fn not_rectangular(mesh: &ControlMesh, quad: u32) -> SplineError {
    let corner = mesh.quads[quad as usize][0];
    SplineError::NotRectangular {
        quad: quad as usize,
        place: mesh.points[corner as usize].into(),
    }
}

struct Layout<'a> {
    half_edges: &'a QuadTopology,
    position: Vec<[i32; 2]>,
    turn: Vec<u8>,
    placed: Vec<bool>,
}

impl Layout<'_> {
    /// Where the neighbour across half-edge `h` belongs.
    fn neighbour(&self, h: u32) -> (u32, [i32; 2], u8) {
        let quad = h as usize / 4;
        let direction = ((h & 3) + u32::from(self.turn[quad])) & 3;
        let [x, y] = self.position[quad];
        let position = match direction {
            0 => [x, y - 1],
            1 => [x + 1, y],
            2 => [x, y + 1],
            _ => [x - 1, y],
        };
        let g = self.half_edges.twin[h as usize];
        let turn = (direction + 2 + 4 - (g & 3)) & 3;
        (g / 4, position, turn as u8)
    }

    /// Places all quads that hang together with `seed`.
    fn place(&mut self, cut: &[bool], seed: u32) -> Vec<u32> {
        self.position[seed as usize] = [0, 0];
        self.turn[seed as usize] = 0;
        self.placed[seed as usize] = true;
        let mut members = vec![seed];
        let mut done = 0;
        while done < members.len() {
            let quad = members[done];
            done += 1;
            for h in 4 * quad..4 * quad + 4 {
                if cut[h as usize] {
                    continue;
                }
                let (other, position, turn) = self.neighbour(h);
                if !std::mem::replace(&mut self.placed[other as usize], true) {
                    self.position[other as usize] = position;
                    self.turn[other as usize] = turn;
                    members.push(other);
                }
            }
        }
        members
    }

    /// The block of `members`, when they fill a rectangle and all neighbours fit.
    fn rectangle(&self, cut: &[bool], members: &[u32]) -> Option<Block> {
        let mut low = [i32::MAX; 2];
        let mut high = [i32::MIN; 2];
        for &q in members {
            for axis in 0..2 {
                low[axis] = low[axis].min(self.position[q as usize][axis]);
                high[axis] = high[axis].max(self.position[q as usize][axis]);
            }
        }
        let spans = [0, 1].map(|axis| high[axis].abs_diff(low[axis]) + 1);
        if u64::from(spans[0]) * u64::from(spans[1]) != members.len() as u64 {
            return None;
        }
        let mut cells = vec![None; members.len()];
        for &quad in members {
            let [x, y] = [0, 1].map(|axis| self.position[quad as usize][axis].abs_diff(low[axis]));
            let cell = Cell {
                quad,
                turn: self.turn[quad as usize],
            };
            if cells[(x * spans[1] + y) as usize].replace(cell).is_some() {
                return None;
            }
            for h in 4 * quad..4 * quad + 4 {
                let (other, position, turn) = self.neighbour(h);
                let fits =
                    self.position[other as usize] == position && self.turn[other as usize] == turn;
                if !cut[h as usize] && !fits {
                    return None;
                }
            }
        }
        Some(Block {
            spans,
            cells: cells.into_iter().collect::<Option<_>>()?,
        })
    }

    /// The best straight line across a ring of quads: from a cut to a cut, through points that are ends already if
    /// possible.
    fn cut_across(&self, cut: &[bool], members: &[u32]) -> Option<Vec<u32>> {
        let mut best: Option<(usize, Vec<u32>)> = None;
        let degree = |v: u32| self.half_edges.ring(v).filter(|&h| cut[h as usize]).count();
        for start in members.iter().flat_map(|&q| 4 * q..4 * q + 4) {
            let from = degree(self.half_edges.origin(start));
            if cut[start as usize] || from == 0 {
                continue;
            }
            let mut line = vec![start];
            let mut h = start;
            while degree(self.half_edges.head(h)) == 0 && line.len() <= members.len() {
                h = self.half_edges.ahead(h);
                line.push(h);
            }
            let to = degree(self.half_edges.head(h));
            let new_points = usize::from(from == 2) + usize::from(to == 2);
            if to > 0 && best.as_ref().is_none_or(|(value, _)| new_points < *value) {
                best = Some((new_points, line));
            }
        }
        best.map(|(_, line)| line)
    }
}

/// Splits blocks until none meets itself.
fn separate(
    mesh: &ControlMesh,
    half_edges: &QuadTopology,
    cut: &mut [bool],
    blocks: Vec<Block>,
) -> Result<Vec<Block>, SplineError> {
    let mut waiting: Vec<Block> = blocks.into_iter().rev().collect();
    let mut separated = Vec::with_capacity(waiting.len());
    while let Some(block) = waiting.pop() {
        let meetings = meetings(half_edges, &block);
        if meetings.is_empty() {
            separated.push(block);
            continue;
        }
        let Some((axis, at)) = best_split(&block, half_edges, cut, &meetings) else {
            return Err(not_rectangular(mesh, block.cells[0].quad));
        };
        block
            .line(axis, at)
            .iter()
            .for_each(|&h| mark(half_edges, cut, h));
        let [first, second] = block.split(axis, at);
        waiting.push(second);
        waiting.push(first);
    }
    Ok(separated)
}

/// Pairs of lattice points on the border of `block` that are the same point of the mesh.
fn meetings(half_edges: &QuadTopology, block: &Block) -> Vec<[[u32; 2]; 2]> {
    let mut border: Vec<(u32, [u32; 2])> = Vec::new();
    for d in 0..4 {
        for (t, h) in block.side(d).into_iter().enumerate() {
            border.push((half_edges.origin(h), block.parameters(d, t as u32)));
        }
    }
    border.sort_unstable();
    let mut pairs = Vec::new();
    for visits in border.chunk_by(|x, y| x.0 == y.0) {
        for (k, first) in visits.iter().enumerate() {
            pairs.extend(visits[k + 1..].iter().map(|second| [first.1, second.1]));
        }
    }
    pairs
}

/// The lattice line that separates most meetings; among equals the one with fewest new end points, then the most central.
fn best_split(
    block: &Block,
    half_edges: &QuadTopology,
    cut: &[bool],
    meetings: &[[[u32; 2]; 2]],
) -> Option<(usize, u32)> {
    let degree = |v: u32| half_edges.ring(v).filter(|&h| cut[h as usize]).count();
    let mut best = None;
    for axis in 0..2 {
        let length = block.spans[axis];
        let mut change = vec![0i64; length as usize + 2];
        for [p, q] in meetings {
            let (from, to) = (p[axis].min(q[axis]), p[axis].max(q[axis]));
            if to > from + 1 {
                change[from as usize + 1] += 1;
                change[to as usize] -= 1;
            }
        }
        let mut separated = 0;
        for at in 1..length {
            separated += change[at as usize];
            let line = block.line(axis, at);
            let (Some(&start), Some(&end)) = (line.first(), line.last()) else {
                continue;
            };
            // Side 3 runs downward and side 0 to the right.
            let ends = if axis == 0 {
                [half_edges.head(start), half_edges.origin(end)]
            } else {
                [half_edges.origin(start), half_edges.head(end)]
            };
            let new_points = ends.iter().filter(|v| degree(**v) == 2).count();
            let key = (-separated, new_points, (2 * at).abs_diff(length), axis, at);
            if separated > 0 && best.is_none_or(|b| key < b) {
                best = Some(key);
            }
        }
    }
    best.map(|(_, _, _, axis, at)| (axis, at))
}

#[cfg(test)]
mod tests {
    use super::super::half_edges::connect;
    use super::*;
    use crate::Vec3;
    use crate::spline::motorcycle::cut_lines;

    /// A grid of `m` x `n` quads closed in both directions, the second one with a shift.
    fn torus(m: u32, n: u32, shift: u32) -> ControlMesh {
        let at = |i: u32, j: u32| ((i + shift * (j / n)) % m) * n + j % n;
        let points = (0..m * n)
            .map(|k| Vec3::new(f64::from(k), 0.0, 0.0))
            .collect();
        let quads = (0..m).flat_map(|i| (0..n).map(move |j| (i, j)));
        let quads = quads.map(|(i, j)| [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
        ControlMesh {
            points,
            quads: quads.collect(),
        }
    }

    fn assert_simple(mesh: &ControlMesh, half_edges: &QuadTopology, blocks: &[Block]) {
        let mut quads: Vec<u32> = blocks
            .iter()
            .flat_map(|b| b.cells.iter().map(|c| c.quad))
            .collect();
        quads.sort_unstable();
        assert!(quads.into_iter().eq(0..mesh.quads.len() as u32));
        for block in blocks {
            assert_eq!(block.cells.len() as u32, block.spans[0] * block.spans[1]);
            assert!(meetings(half_edges, block).is_empty());
            for i in 0..block.spans[0] {
                for j in 0..block.spans[1] {
                    let right = half_edges.twin[block.cell(i, j).side(1) as usize];
                    let above = half_edges.twin[block.cell(i, j).side(2) as usize];
                    assert!(i + 1 == block.spans[0] || block.cell(i + 1, j).side(3) == right);
                    assert!(j + 1 == block.spans[1] || block.cell(i, j + 1).side(0) == above);
                }
            }
        }
    }

    #[test]
    fn torus_without_extraordinary_points_gives_four_blocks() {
        for (m, n, shift) in [(8, 6, 0), (3, 3, 0), (9, 7, 2), (12, 3, 5)] {
            let mesh = torus(m, n, shift);
            let half_edges = connect(&mesh).expect("a valid torus");
            let mut cut = cut_lines(&half_edges);
            let blocks = rectangular_blocks(&mesh, &half_edges, &mut cut).expect("rectangles");
            assert_simple(&mesh, &half_edges, &blocks);
            assert!(
                shift != 0 || blocks.len() <= 4,
                "{} blocks on {m} x {n}",
                blocks.len()
            );
        }
    }

    #[test]
    fn rings_are_cut_across() {
        let mesh = torus(8, 6, 0);
        let half_edges = connect(&mesh).expect("a valid torus");
        for loops in [vec![0], vec![0, 2], vec![0, 1, 5]] {
            let mut cut = vec![false; half_edges.twin.len()];
            for &at in &loops {
                let start = (0..half_edges.len())
                    .find(|&h| half_edges.origin(h) == at && half_edges.head(h) == at + 6)
                    .expect("an edge along the loop");
                let mut h = start;
                for _ in 0..8 {
                    mark(&half_edges, &mut cut, h);
                    h = half_edges.ahead(h);
                }
            }
            let blocks = rectangular_blocks(&mesh, &half_edges, &mut cut).expect("rectangles");
            assert_simple(&mesh, &half_edges, &blocks);
            assert_eq!(
                blocks.len(),
                if loops.len() == 1 { 4 } else { 2 * loops.len() }
            );
        }
    }
}
