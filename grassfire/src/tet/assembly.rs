//! The equations of all elements in blocks of 3 x 3.

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::element::stiffness;
use super::{EDGES, TetError, TetMesh, TetModel};
use crate::Vec3;

/// Elements whose matrices are held at a time.
const AT_ONCE: usize = 8192;

/// A symmetric matrix in blocks; rows and columns of held degrees of freedom are those of the identity.
pub(super) struct System {
    /// Where the blocks of a row begin; one more than there are nodes.
    pub starts: Vec<usize>,
    /// Column of every block, ascending in a row.
    pub columns: Vec<u32>,
    pub blocks: Vec<Matrix3<f64>>,
    /// Corner nodes, as numbers of the linear functions; `u32::MAX` for middles.
    pub corners: Vec<u32>,
    /// The corners that a middle lies between.
    pub parents: Vec<[u32; 2]>,
    /// Lower entries of the matrix of the linear functions, unsummed: row, column, value.
    pub coarse: Vec<(u32, u32, f64)>,
}

/// Assembles the matrix and its Galerkin projection onto the linear functions.
pub(super) fn assemble(
    mesh: &TetMesh,
    model: &TetModel,
    fixed: &[bool],
) -> Result<System, TetError> {
    let mut system = pattern(mesh);
    let numbers: Vec<usize> = (0..mesh.cells.len()).collect();
    for some in numbers.chunks(AT_ONCE) {
        let matrices: Vec<_> = some
            .par_iter()
            .map(|&c| element(mesh, model, fixed, c))
            .collect();
        for (&cell, matrix) in some.iter().zip(matrices) {
            let (fine, coarse) = matrix.ok_or_else(|| inverted(mesh, cell))?;
            system.add(&mesh.cells[cell], &fine);
            system.add_coarse(&mesh.cells[cell], &coarse);
        }
    }
    for (node, stiffness) in &model.springs {
        system.add_spring(*node as usize, stiffness, fixed);
    }
    for (dof, _) in fixed.iter().enumerate().filter(|(_, held)| **held) {
        let at = system.find(dof / 3, (dof / 3) as u32);
        system.blocks[at][(dof % 3, dof % 3)] = 1.0;
    }
    Ok(system)
}

fn inverted(mesh: &TetMesh, cell: usize) -> TetError {
    let corners = mesh.cells[cell].map(|n| mesh.points[n as usize]);
    let middle: Vec3 = corners[..4].iter().sum::<Vec3>() / 4.0;
    TetError::Inverted {
        cell,
        place: middle.into(),
    }
}

type Fine = Box<[[Matrix3<f64>; 10]; 10]>;
type Coarse = [[Matrix3<f64>; 4]; 4];

/// Matrix of an element without its held degrees of freedom, and the same on the linear functions.
fn element(
    mesh: &TetMesh,
    model: &TetModel,
    fixed: &[bool],
    cell: usize,
) -> Option<(Fine, Coarse)> {
    let nodes = mesh.cells[cell];
    let corners = nodes.map(|n| mesh.points[n as usize]);
    let mut k = Box::new(stiffness(&corners, model.young, model.nu)?);
    for (i, &node) in nodes.iter().enumerate() {
        for d in (0..3).filter(|d| fixed[3 * node as usize + d]) {
            for j in 0..10 {
                k[i][j].row_mut(d).fill(0.0);
                k[j][i].column_mut(d).fill(0.0);
            }
        }
    }
    // A linear function is one at its corner and one half at the middles of the edges there.
    let parts: [[(usize, f64); 2]; 10] = std::array::from_fn(|i| match i {
        0..4 => [(i, 1.0), (i, 0.0)],
        _ => EDGES[i - 4].map(|c| (c, 0.5)),
    });
    let mut coarse = [[Matrix3::zeros(); 4]; 4];
    for i in 0..10 {
        for j in 0..10 {
            for (a, wa) in parts[i] {
                for (b, wb) in parts[j] {
                    coarse[a][b] += wa * wb * k[i][j];
                }
            }
        }
    }
    Some((k, coarse))
}

/// Rows and columns without values, and the linear functions.
fn pattern(mesh: &TetMesh) -> System {
    let count = mesh.points.len();
    let mut pairs: Vec<(u32, u32)> = Vec::with_capacity(100 * mesh.cells.len());
    let mut is_corner = vec![false; count];
    let mut parents = vec![[u32::MAX; 2]; count];
    for cell in &mesh.cells {
        pairs.extend(cell.iter().flat_map(|&i| cell.iter().map(move |&j| (i, j))));
        cell[..4].iter().for_each(|&c| is_corner[c as usize] = true);
        for (e, [i, j]) in EDGES.into_iter().enumerate() {
            parents[cell[4 + e] as usize] = [cell[i], cell[j]];
        }
    }
    pairs.par_sort_unstable();
    pairs.dedup();
    let mut starts = vec![0; count + 1];
    pairs.iter().for_each(|&(i, _)| starts[i as usize + 1] += 1);
    (0..count).for_each(|i| starts[i + 1] += starts[i]);
    let mut corners = vec![u32::MAX; count];
    for (number, node) in (0..count).filter(|&n| is_corner[n]).enumerate() {
        corners[node] = number as u32;
    }
    System {
        starts,
        blocks: vec![Matrix3::zeros(); pairs.len()],
        columns: pairs.into_iter().map(|(_, j)| j).collect(),
        corners,
        parents,
        coarse: Vec::with_capacity(78 * mesh.cells.len()),
    }
}

impl System {
    /// Nodes.
    pub fn nodes(&self) -> usize {
        self.starts.len() - 1
    }

    /// Place of a block that is in the pattern.
    pub fn find(&self, row: usize, column: u32) -> usize {
        let range = self.starts[row]..self.starts[row + 1];
        let at = self.columns[range.clone()].binary_search(&column);
        range.start + at.unwrap_or_else(|next| next)
    }

    fn add(&mut self, nodes: &[u32; 10], k: &[[Matrix3<f64>; 10]; 10]) {
        for (i, row) in k.iter().enumerate() {
            for (j, block) in row.iter().enumerate() {
                let at = self.find(nodes[i] as usize, nodes[j]);
                self.blocks[at] += block;
            }
        }
    }

    /// Adds a spring between a node and the ground.
    fn add_spring(&mut self, node: usize, stiffness: &Matrix3<f64>, fixed: &[bool]) {
        let mut k = *stiffness;
        for d in (0..3).filter(|d| fixed[3 * node + d]) {
            k.row_mut(d).fill(0.0);
            k.column_mut(d).fill(0.0);
        }
        let at = self.find(node, node as u32);
        self.blocks[at] += k;
        // The linear functions of its corners, as for elements.
        let corners: Vec<(usize, f64)> = match self.corners[node] {
            u32::MAX => self.parents[node].map(|c| (c as usize, 0.5)).into(),
            _ => vec![(node, 1.0)],
        };
        for &(a, wa) in &corners {
            for &(b, wb) in &corners {
                self.add_coarse_block(a, b, &(wa * wb * k));
            }
        }
    }

    /// Adds the lower entries of a block that couples two corners.
    fn add_coarse_block(&mut self, a: usize, b: usize, block: &Matrix3<f64>) {
        let dof = |node: usize, d: usize| 3 * self.corners[node] + d as u32;
        for (d, e) in (0..9).map(|i| (i / 3, i % 3)) {
            let (row, column) = (dof(a, d), dof(b, e));
            if row >= column {
                self.coarse.push((row, column, block[(d, e)]));
            }
        }
    }

    fn add_coarse(&mut self, nodes: &[u32; 10], k: &Coarse) {
        for (i, j) in (0..16).map(|n| (n / 4, n % 4)) {
            self.add_coarse_block(nodes[i] as usize, nodes[j] as usize, &k[i][j]);
        }
    }

    /// `out` = matrix times `x`.
    pub fn times(&self, x: &[Vec3], out: &mut [Vec3]) {
        out.par_iter_mut()
            .enumerate()
            .with_min_len(512)
            .for_each(|(i, out)| {
                let range = self.starts[i]..self.starts[i + 1];
                let mut sum = Vec3::zeros();
                for (block, &j) in self.blocks[range.clone()].iter().zip(&self.columns[range]) {
                    sum += block * x[j as usize];
                }
                *out = sum;
            });
    }
}
