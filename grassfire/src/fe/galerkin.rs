//! Galerkin coarse operators straight from the moduli of the finest grid.
//!
//! A coarse element is the sum over its fine elements of `E_i M_i` with `M_i = P_i' K0 P_i`, where `P_i` interpolates the
//! corners of the coarse element to those of fine element `i`: `8^level` tables of 300 numbers, no element matrices.
//! Fixed degrees of freedom drop out of `P_i`, so they exist on the finest grid only. Averaged moduli instead need two to
//! four times the iterations on optimized designs.

use std::collections::{BTreeSet, HashMap};
use std::ops::{AddAssign, Mul};

use pulp::Arch;
use rayon::prelude::*;

use super::frame::Frame;
use super::grid::{BLOCK, NodeGrid};
use super::matrix_free::Float;
use super::springs::on_coarse;
use super::stencil::{STRIDE, Stencil};

/// Length of a table: the upper triangle of 24x24, padded.
const TABLE: usize = 304;

/// Place of entry (i, j) in a table.
const fn upper(i: usize, j: usize) -> usize {
    let (i, j) = if i <= j { (i, j) } else { (j, i) };
    i * 24 + j - i * (i + 1) / 2
}

/// The tables of one level.
pub(super) struct Tables<T> {
    level: usize,
    /// Of every child without fixed corners.
    plain: Vec<T>,
    /// Of children with fixed degrees of freedom, by mask and child.
    special: HashMap<(u32, u32), Vec<T>>,
}

impl<T: Float + Mul<Output = T> + AddAssign> Tables<T> {
    pub fn new(stiffness: &[[f64; 24]; 24], level: usize, frame: &Frame) -> Self {
        let children = 1usize << (3 * level);
        let table = |child: usize, mask: u32| -> Vec<T> {
            let m = triple_product(stiffness, level, child, mask);
            m.iter().map(|&v| T::of(v)).collect()
        };
        let plain: Vec<Vec<T>> = (0..children).into_par_iter().map(|i| table(i, 0)).collect();
        let side = (1usize << level) - 1;
        let child = |at: [usize; 3]| {
            ((((at[2] & side) << level) + (at[1] & side)) << level) + (at[0] & side)
        };
        let keys: BTreeSet<(u32, u32)> = frame
            .masks()
            .map(|(at, mask)| (mask, child(at) as u32))
            .collect();
        let special = keys
            .into_par_iter()
            .map(|(mask, child)| ((mask, child), table(child as usize, mask)))
            .collect::<Vec<_>>();
        Self {
            level,
            plain: plain.concat(),
            special: special.into_iter().collect(),
        }
    }

    /// Adds up the matrix of a coarse element from the children's moduli; false when it has no stiffness.
    #[inline(always)]
    fn element(
        &self,
        frame: &Frame,
        children: &Children<T>,
        at: [usize; 3],
        sum: &mut [T; TABLE],
    ) -> bool {
        let side = 1usize << self.level;
        let mut any = false;
        let mut child = 0;
        for z in 0..side {
            for y in 0..side {
                let (fy, fz) = (at[1] * side + y, at[2] * side + z);
                let has_masks = frame.row_has_masks(fy, fz);
                for (x, &modulus) in children.row(y, z, at[0]).iter().enumerate() {
                    if modulus != T::default() {
                        if !any {
                            sum.fill(T::default());
                            any = true;
                        }
                        let mask = if has_masks {
                            frame.mask([at[0] * side + x, fy, fz])
                        } else {
                            0
                        };
                        let table = self.table(mask, child);
                        for (s, &t) in sum.iter_mut().zip(table) {
                            *s += modulus * t;
                        }
                    }
                    child += 1;
                }
            }
        }
        any
    }

    #[inline(always)]
    fn table(&self, mask: u32, child: usize) -> &[T] {
        if mask == 0 {
            return &self.plain[child * TABLE..(child + 1) * TABLE];
        }
        // Every mask of the frame has its table.
        self.special
            .get(&(mask, child as u32))
            .map_or(&self.plain[..TABLE], |t| &t[..])
    }
}

/// The moduli under one row of coarse elements, written out in full.
struct Children<T> {
    side: usize,
    width: usize,
    values: Vec<T>,
}

impl<T: Float> Children<T> {
    fn new(level: usize, coarse: &NodeGrid) -> Self {
        let side = 1usize << level;
        let width = side * coarse.n[0];
        Self {
            side,
            width,
            values: vec![T::default(); side * side * width],
        }
    }

    /// Moves to coarse row (y, z).
    fn load(&mut self, fine: &NodeGrid, e: &[f64], y: usize, z: usize) {
        self.values.fill(T::default());
        for (i, row) in self.values.chunks_exact_mut(self.width).enumerate() {
            let (y, z) = (y * self.side + i % self.side, z * self.side + i / self.side);
            for run in fine.row(y, z) {
                let from = &e[fine.first(z) + run.at..][..run.len];
                // A run of nodes may end one behind the last element.
                for (to, &v) in row[run.x..].iter_mut().zip(from) {
                    *to = T::of(v);
                }
            }
        }
    }

    /// Children of coarse element `x` in their row (y, z).
    #[inline(always)]
    fn row(&self, y: usize, z: usize, x: usize) -> &[T] {
        &self.values[(z * self.side + y) * self.width + x * self.side..][..self.side]
    }
}

/// Upper triangle of `P' K P` for a child of a coarse element; masked degrees of freedom are fixed.
fn triple_product(k: &[[f64; 24]; 24], level: usize, child: usize, mask: u32) -> [f64; TABLE] {
    let side = 1usize << level;
    let at = [child % side, child / side % side, child / (side * side)];
    let mut p = [[0.0; 8]; 8];
    for (j, row) in p.iter_mut().enumerate() {
        for (a, weight) in row.iter_mut().enumerate() {
            *weight = (0..3)
                .map(|d| {
                    let t = (at[d] + (j >> d & 1)) as f64 / side as f64;
                    if a >> d & 1 == 1 { t } else { 1.0 - t }
                })
                .product();
        }
    }
    let free = |dof: usize| mask >> dof & 1 == 0;
    // K P, then P' of it.
    let mut kp = [[0.0; 24]; 24];
    for (i, row) in kp.iter_mut().enumerate() {
        for m in (0..24).filter(|&m| free(m)) {
            for a in 0..8 {
                row[3 * a + m % 3] += k[i][m] * p[m / 3][a];
            }
        }
    }
    let mut out = [0.0; TABLE];
    for m in (0..24).filter(|&m| free(m)) {
        for (a, &weight) in p[m / 3].iter().enumerate() {
            let i = 3 * a + m % 3;
            for j in i..24 {
                out[upper(i, j)] += weight * kp[m][j];
            }
        }
    }
    out
}

/// Which elements of the next coarser grid hold stiffness; `n`: elements of the finer grid, even numbers.
pub(super) fn coarsen(n: [usize; 3], occupied: &[bool]) -> Vec<bool> {
    let half = n.map(|n| n / 2);
    let mut out = vec![false; half.iter().product()];
    for (row, finer) in occupied.chunks_exact(n[0]).enumerate() {
        let (y, z) = (row % n[1] / 2, row / n[1] / 2);
        let to = &mut out[(z * half[1] + y) * half[0]..][..half[0]];
        for (to, pair) in to.iter_mut().zip(finer.chunks_exact(2)) {
            *to |= pair[0] || pair[1];
        }
    }
    out
}

/// Fills the stencil of a coarse grid from the moduli `e` of the finest one.
pub(super) fn fill(
    frame: &Frame,
    grid: &NodeGrid,
    tables: &Tables<f32>,
    e: &[f64],
    stencil: &mut Stencil,
) {
    let planes = grid.n[2] + 1;
    // Each slab computes one layer of elements that its neighbour computes too.
    let slab = planes.div_ceil(4).clamp(2, 16);
    let blocks = &stencil.blocks;
    let mut rest = &mut stencil.values[..];
    let mut slabs = Vec::new();
    for first in (0..planes).step_by(slab) {
        let end = (first + slab).min(planes);
        let (values, others) = rest.split_at_mut((blocks[end] - blocks[first]) * STRIDE);
        slabs.push((first, end, values));
        rest = others;
    }
    slabs.into_par_iter().for_each(|(first, end, values)| {
        values.fill(0.0);
        let slab = Slab {
            grid,
            first,
            end,
            blocks,
        };
        Arch::new().dispatch(|| slab.fill(frame, tables, e, values));
    });
    for (at, matrix) in on_coarse(&frame.springs, tables.level, grid.n) {
        for a in 0..8 {
            for j in 0..8 {
                let block = |r: usize, c: usize| matrix[3 * a + r][3 * j + c] as f32;
                stencil.add(grid, corner(at, a), neighbour(a, j), block);
            }
        }
    }
}

/// Number of corner `j` of an element among the 27 nodes around corner `a`.
fn neighbour(a: usize, j: usize) -> usize {
    let step = |d: usize| (j >> d & 1) + 1 - (a >> d & 1);
    (step(2) * 3 + step(1)) * 3 + step(0)
}

/// Some planes of nodes of a stencil.
struct Slab<'a> {
    grid: &'a NodeGrid,
    first: usize,
    end: usize,
    /// First block of every plane.
    blocks: &'a [usize],
}

impl Slab<'_> {
    #[inline(always)]
    fn fill(&self, frame: &Frame, tables: &Tables<f32>, e: &[f64], values: &mut [f32]) {
        let n = self.grid.n;
        let mut sum = [0f32; TABLE];
        let mut children = Children::new(tables.level, self.grid);
        for z in self.first.saturating_sub(1)..self.end.min(n[2]) {
            for y in 0..n[1] {
                let runs = self.grid.row(y, z);
                if runs.is_empty() {
                    continue;
                }
                children.load(&frame.grid, e, y, z);
                for run in runs {
                    for x in run.x..(run.x + run.len).min(n[0]) {
                        if tables.element(frame, &children, [x, y, z], &mut sum) {
                            self.scatter([x, y, z], &sum, values);
                        }
                    }
                }
            }
        }
    }

    #[inline(always)]
    fn scatter(&self, at: [usize; 3], sum: &[f32; TABLE], values: &mut [f32]) {
        for a in 0..8 {
            let node = corner(at, a);
            let z = node[2];
            if z < self.first || z >= self.end {
                continue;
            }
            // The corners of elements with stiffness are stored.
            let Some(place) = self.grid.place(node) else {
                continue;
            };
            let block = self.blocks[z] - self.blocks[self.first] + place / BLOCK;
            let values = &mut values[block * STRIDE + place % BLOCK..];
            for j in 0..8 {
                let neighbour = neighbour(a, j);
                for r in 0..3 {
                    for c in 0..3 {
                        let to = (neighbour * 9 + r * 3 + c) * BLOCK;
                        values[to] += sum[upper(3 * a + r, 3 * j + c)];
                    }
                }
            }
        }
    }
}

/// Corner `a` of an element.
pub(super) fn corner(at: [usize; 3], a: usize) -> [usize; 3] {
    [at[0] + (a & 1), at[1] + (a >> 1 & 1), at[2] + (a >> 2)]
}

/// The full matrices of all coarse elements with stiffness and of the springs, for a direct solver.
pub(super) fn elements(
    frame: &Frame,
    grid: &NodeGrid,
    tables: &Tables<f64>,
    e: &[f64],
) -> Vec<([usize; 3], [[f64; 24]; 24])> {
    let n = grid.n;
    let row = |i: usize| {
        let (y, z) = (i % n[1], i / n[1]);
        let mut children = Children::new(tables.level, grid);
        children.load(&frame.grid, e, y, z);
        let mut out = Vec::new();
        let mut sum = [0f64; TABLE];
        for x in 0..n[0] {
            if tables.element(frame, &children, [x, y, z], &mut sum) {
                let full = std::array::from_fn(|i| std::array::from_fn(|j| sum[upper(i, j)]));
                out.push(([x, y, z], full));
            }
        }
        out
    };
    let rows: Vec<Vec<_>> = (0..n[1] * n[2]).into_par_iter().map(row).collect();
    let mut out = rows.concat();
    out.extend(on_coarse(&frame.springs, tables.level, n));
    out
}
