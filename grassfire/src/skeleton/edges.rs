//! Edge table of a face list: sorted edges, each with its faces; look-up by binary search.

use crate::topology::Betti;

/// Unordered edge as an ordered pair.
#[inline]
pub(crate) fn edge(a: u32, b: u32) -> [u32; 2] {
    if a < b { [a, b] } else { [b, a] }
}

/// Every edge of a face list with the faces on it.
#[derive(Debug, Default)]
pub(crate) struct EdgeTable {
    /// Sorted edges.
    pub edges: Vec<[u32; 2]>,
    start: Vec<u32>,
    faces: Vec<u32>,
}

impl EdgeTable {
    /// Builds the table from `(face index, corners)`.
    pub fn new<'a>(faces: impl Iterator<Item = (u32, &'a [u32])>) -> Self {
        let mut list: Vec<([u32; 2], u32)> = Vec::new();
        for (f, corners) in faces {
            for k in 0..corners.len() {
                list.push((edge(corners[k], corners[(k + 1) % corners.len()]), f));
            }
        }
        list.sort_unstable();
        let mut table = Self {
            faces: Vec::with_capacity(list.len()),
            ..Self::default()
        };
        for (e, f) in list {
            if table.edges.last() != Some(&e) {
                table.edges.push(e);
                table.start.push(table.faces.len() as u32);
            }
            table.faces.push(f);
        }
        table.start.push(table.faces.len() as u32);
        table
    }

    /// The table of quads, numbered in their order.
    pub fn of_quads(quads: &[[u32; 4]]) -> Self {
        let faces = quads.iter().enumerate();
        Self::new(faces.map(|(number, quad)| (number as u32, &quad[..])))
    }

    /// Faces of edge number `i`.
    #[inline]
    pub fn faces(&self, i: usize) -> &[u32] {
        &self.faces[self.start[i] as usize..self.start[i + 1] as usize]
    }

    /// Faces on the edge between `a` and `b`; empty when there is none.
    pub fn at(&self, a: u32, b: u32) -> &[u32] {
        match self.edges.binary_search(&edge(a, b)) {
            Ok(i) => self.faces(i),
            Err(_) => &[],
        }
    }

    /// Edges with their faces, in order.
    pub fn iter(&self) -> impl Iterator<Item = ([u32; 2], &[u32])> {
        self.edges
            .iter()
            .enumerate()
            .map(|(i, e)| (*e, self.faces(i)))
    }
}

/// Disjoint sets with path halving.
#[derive(Debug)]
pub(crate) struct UnionFind(Vec<u32>);

impl UnionFind {
    pub fn new(n: usize) -> Self {
        Self((0..n as u32).collect())
    }

    pub fn find(&mut self, mut x: u32) -> u32 {
        while self.0[x as usize] != x {
            let up = self.0[self.0[x as usize] as usize];
            self.0[x as usize] = up;
            x = up;
        }
        x
    }

    /// Unites two sets; the smaller root stays, so the result does not depend on the order.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.find(a), self.find(b));
        let (low, high) = (a.min(b), a.max(b));
        self.0[high as usize] = low;
    }
}

/// Betti numbers of a 2-complex of faces and bare edges; points that nothing uses do not count.
///
/// `b2` is the dimension of the 2-cycles over GF(2): a cycle is constant on a sheet (faces joined over edges with two
/// faces), zero on a sheet with a rim, and sums to zero at every seam.
pub(crate) fn betti<F: AsRef<[u32]>>(points: usize, faces: &[F], beams: &[[u32; 2]]) -> Betti {
    let table = EdgeTable::new(
        faces
            .iter()
            .enumerate()
            .map(|(i, f)| (i as u32, f.as_ref())),
    );
    let mut bare: Vec<[u32; 2]> = beams.iter().map(|b| edge(b[0], b[1])).collect();
    bare.sort_unstable();
    bare.dedup();
    bare.retain(|e| table.at(e[0], e[1]).is_empty());

    let mut sets = UnionFind::new(points);
    let mut used = vec![false; points];
    for e in table.edges.iter().chain(&bare) {
        sets.join(e[0], e[1]);
        used[e[0] as usize] = true;
        used[e[1] as usize] = true;
    }
    let vertices = used.iter().filter(|u| **u).count() as i64;
    let b0 = (0..points as u32)
        .filter(|&v| used[v as usize] && sets.find(v) == v)
        .count() as i64;
    let chi = vertices - (table.edges.len() + bare.len()) as i64 + faces.len() as i64;
    Betti::from_chi(b0, closed_cycles(&table, faces.len()), chi)
}

fn closed_cycles(table: &EdgeTable, faces: usize) -> i64 {
    let mut sheets = UnionFind::new(faces);
    for (_, f) in table.iter() {
        if let [a, b] = f {
            sheets.join(*a, *b);
        }
    }
    let mut open = vec![false; faces];
    for (_, f) in table.iter() {
        if let [a] = f {
            open[sheets.find(*a) as usize] = true;
        }
    }
    // One equation a seam edge: the sheets that meet it an odd number of times. Equal rows are dropped.
    let mut rows: Vec<Vec<u32>> = Vec::new();
    for (_, f) in table.iter().filter(|(_, f)| f.len() > 2) {
        let mut row: Vec<u32> = f.iter().map(|&x| sheets.find(x)).collect();
        row.sort_unstable();
        let mut odd: Vec<u32> = Vec::with_capacity(row.len());
        for s in row {
            if odd.last() == Some(&s) {
                odd.pop();
            } else {
                odd.push(s);
            }
        }
        rows.push(odd);
    }
    rows.sort_unstable();
    rows.dedup();
    // Sheets forced to zero leave the equations, until nothing changes: almost always nothing is left.
    loop {
        let mut changed = false;
        for row in &mut rows {
            row.retain(|&s| !open[s as usize]);
            if let [s] = row[..] {
                open[s as usize] = true;
                changed = true;
            }
        }
        if !changed {
            break;
        }
    }
    rows.retain(|row| !row.is_empty());
    rows.sort_unstable();
    rows.dedup();
    let free = (0..faces as u32)
        .filter(|&f| sheets.find(f) == f && !open[f as usize])
        .count();
    (free - rank(rows)) as i64
}

/// Rank over GF(2) of sparse rows (sorted column lists).
fn rank(rows: Vec<Vec<u32>>) -> usize {
    let mut pivots: std::collections::BTreeMap<u32, Vec<u32>> = std::collections::BTreeMap::new();
    for mut row in rows {
        while let Some(&lead) = row.first() {
            match pivots.get(&lead) {
                Some(pivot) => row = symmetric_difference(&row, pivot),
                None => {
                    pivots.insert(lead, row);
                    break;
                }
            }
        }
    }
    pivots.len()
}

fn symmetric_difference(a: &[u32], b: &[u32]) -> Vec<u32> {
    let mut out = Vec::with_capacity(a.len() + b.len());
    let (mut i, mut j) = (0, 0);
    while i < a.len() || j < b.len() {
        match (a.get(i), b.get(j)) {
            (Some(x), Some(y)) if x == y => {
                i += 1;
                j += 1;
            }
            (Some(x), Some(y)) if x < y => {
                out.push(*x);
                i += 1;
            }
            (_, Some(y)) => {
                out.push(*y);
                j += 1;
            }
            (Some(x), None) => {
                out.push(*x);
                i += 1;
            }
            (None, None) => break,
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    const TETRAHEDRON: [[u32; 3]; 4] = [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]];

    #[test]
    fn sphere_has_one_cavity() {
        assert_eq!(
            betti(4, &TETRAHEDRON, &[]),
            Betti {
                b0: 1,
                b1: 0,
                b2: 1,
                chi: 2
            }
        );
    }

    #[test]
    fn two_cells_share_a_wall() {
        // Two tetrahedra glued along 0-1-2, the wall kept: two cavities, three sheets at the seams.
        let faces = [
            [0, 1, 2],
            [0, 1, 3],
            [0, 2, 3],
            [1, 2, 3],
            [0, 1, 4],
            [0, 2, 4],
            [1, 2, 4],
        ];
        assert_eq!(
            betti(5, &faces, &[]),
            Betti {
                b0: 1,
                b1: 0,
                b2: 2,
                chi: 3
            }
        );
    }

    #[test]
    fn loop_and_unused_points() {
        let none: [[u32; 3]; 0] = [];
        assert_eq!(
            betti(9, &none, &[[3, 4], [4, 5], [5, 3]]),
            Betti {
                b0: 1,
                b1: 1,
                b2: 0,
                chi: 0
            }
        );
        // A bare edge that a face already has counts once.
        assert_eq!(
            betti(4, &[[0, 1, 2]], &[[0, 1], [2, 3]]),
            Betti {
                b0: 1,
                b1: 0,
                b2: 0,
                chi: 1
            }
        );
    }
}
